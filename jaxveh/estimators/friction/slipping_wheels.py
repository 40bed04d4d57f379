"""Friction while wheels slip: adaptive observers of the wheels, and a method for left and right wheels separately."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.friction.along import LEAST_SLIP, Slips
from jaxveh.estimators.friction.scalar import Follower, LogFriction
from jaxveh.estimators.friction.wheels import AbstractWheelMethod, WheelMemory
from jaxveh.estimators.method import answer
from jaxveh.tyres import Contact, LuGre


class ObserverMemory(NamedTuple):
    """The observer's wheel speeds (4,), m/s; its friction (-); the averaged excitation of friction (-)."""

    wheels: WheelMemory
    speed: Any
    friction: Any
    excitation: Any


class WheelObserver(AbstractWheelMethod):
    """An adaptive observer of the wheels' dynamics (`law` None: reference [118]; a `tyres.LuGre`: reference [119]).

    Each wheel obeys `J domega/dt = T - R F(slip, mu) + gain J (omega - observed)`. Friction follows the normalised gradient
    `d mu / dt = - rate sum e dF/dmu / F_z - leak (mu - usual)`, where the leak (sigma-modification) holds it near `usual` without
    excitation. Without a law `F = mu F_z phi(slip)`, with phi the file's curve over its peak: this is linear in mu, as in [118],
    and wrong for tyres that keep their slope on slippery roads. With LuGre the bristles are taken as settled (they settle within
    milliseconds), and mu multiplies their friction.

    `known`: among the wheels that slip more than `LEAST_SLIP`, the largest `|F - slip dF/dslip| / F_z`, averaged over time, is
    above `enough`. It gives no standard deviation.
    """

    law: LuGre | None = None
    stiffness_ratio: jax.Array = positive("-", default=1.0)
    gain: jax.Array = positive("1/s", default=20.0)
    rate: jax.Array = positive("1/s", default=3.0)
    leak: jax.Array = positive("1/s", default=0.02)
    usual: jax.Array = positive("-", default=0.8)
    enough: jax.Array = positive("-", default=0.1)

    def begin(self, wheels):
        zero = jnp.zeros_like(wheels.told.t)
        return ObserverMemory(wheels, wheels.wheels.speed, zero + self.usual, zero)

    def follow(self, memory, wheels, seen, dt):
        dt = jnp.minimum(dt, 0.1)
        one = self.slips.wheels
        speed = wheels.wheels.speed
        load = seen.load * self.slips.nominal()
        forces = lambda mu: self._forces(seen, wheels, mu)
        force, slope = jax.jvp(forces, (memory.friction,), (jnp.ones_like(memory.friction),))
        ones = jnp.ones_like(seen.slip)
        torque = wheels.wheels.torque - one.wheel_radius * one.rolling_resistance * load
        error = speed - memory.speed
        push = one.wheel_radius * (torque - one.wheel_radius * force) / one.wheel_inertia
        # Linearly implicit in the gain, so that no step is too long.
        observed = memory.speed + dt * (push + self.gain * error) / (1.0 + dt * self.gain)
        observed = jnp.where(seen.there & memory.wheels.told.moves, observed, speed)
        # The stationary error is that of the force: e = R^2 (F - F_true) / (J gain); over the load it adapts the friction.
        lacks = jnp.where(seen.there, error * one.wheel_inertia * self.gain / one.wheel_radius**2 / load, 0.0)
        tells = jnp.where(seen.there, slope / load, 0.0)
        squares = jnp.sum(tells**2)
        step = -self.rate * jnp.sum(tells * lacks) / (squares + 0.05) - self.leak * (memory.friction - self.usual)
        friction = jnp.clip(memory.friction + dt * step, 0.05, 1.5)
        share = 1.0 - jnp.exp(-dt / 0.3)
        # The part of a force that is not proportional to the slip.
        _, stiff = jax.jvp(
            lambda slip: self._forces(seen._replace(slip=slip), wheels, memory.friction), (seen.slip,), (ones,)
        )
        slips = seen.there & (jnp.abs(seen.slip) > LEAST_SLIP)
        excited = numerics.largest(jnp.where(slips, jnp.abs(force - seen.slip * stiff) / load, 0.0))
        excitation = memory.excitation + share * (excited - memory.excitation)
        return ObserverMemory(wheels, observed, friction, excitation)

    def _forces(self, seen: Slips, wheels: WheelMemory, mu):
        load = seen.load * self.slips.nominal()
        if self.law is None:
            curves = self.slips.curves(self.stiffness_ratio)
            return jnp.stack([mu * c.force(seen.slip[k], 1.0, seen.load[k]) for k, c in enumerate(curves)])
        v_x = wheels.told.v_x
        contact = Contact(slip_ratio=seen.slip, load=load, friction=mu, speed=v_x, slip_speed=v_x)
        return self.law.forces(contact, self.law.start(contact)).F_x

    def say(self, memory):
        known = memory.wheels.told.moves & (memory.excitation > self.enough)
        return answer({"friction": memory.friction}, known=known)


class SidesMemory(NamedTuple):
    """The wheels; the slips of the wheels at zero force, `offset` (4,); and the logarithm of friction on either side."""

    wheels: WheelMemory
    offset: Any
    left: LogFriction
    right: LogFriction


class SidesApart(AbstractWheelMethod):
    """Friction under the left and under the right wheels, each by a filter of ln mu on the forces and slips of its own wheels,
    for a road that is slippery on one side.

    `friction` is the mean of both sides. The force of each wheel is compared with the longitudinal curve of its axle. The slip of
    a wheel at small force is an error of its radius, which is learned within `learning` (s) and subtracted. Rows count from
    `LEAST_SLIP` on. Slips are known to `slip_noise` (-), forces to `force_noise` (-) of themselves and `load_noise` (-) of the
    load. `rolls` (-): force over load below which a wheel rolls freely.
    """

    follower: Follower
    stiffness_ratio: jax.Array = positive("-", default=1.0)
    slip_noise: jax.Array = positive("-", default=0.004)
    force_noise: jax.Array = positive("-", default=0.07)
    load_noise: jax.Array = positive("-", default=0.015)
    learning: jax.Array = positive("s", default=2.0)
    rolls: jax.Array = parameter("-", scale=0.05, default=0.05)

    def begin(self, wheels):
        start = self.follower.start()
        return SidesMemory(wheels, jnp.zeros_like(wheels.wheels.speed), start, start)

    def follow(self, memory, wheels, seen, dt):
        curves, nominal = self.slips.curves(self.stiffness_ratio), self.slips.nominal()
        stiffness = jnp.stack([curve.stiffness for curve in curves])
        free = seen.there & (jnp.abs(seen.force) < self.rolls * seen.load * nominal)
        shown = seen.slip - seen.force / (stiffness * seen.load)
        share = jnp.where(free, 1.0 - jnp.exp(-dt / self.learning), 0.0)
        offset = memory.offset + share * (jnp.where(free, shown, 0.0) - memory.offset)
        sides = [memory.left, memory.right]
        for k, curve in enumerate(curves):
            slip, force, load = seen.slip[k] - offset[k], seen.force[k], seen.load[k]
            state = sides[k % 2]
            _, slope = curve.with_slope(slip, jnp.exp(state.mean), load)
            noise = numerics.sqrt(
                jnp.square(slope * self.slip_noise)
                + jnp.square(self.force_noise * force)
                + jnp.square(self.load_noise * load * nominal[k])
            )
            residual = lambda x, c=curve, s=slip, f=force, n=load: f - c.force(s, jnp.exp(x), n)
            # The filter of a side takes this step twice, once per wheel, so that it also forgets twice.
            tells = seen.there[k] & (jnp.abs(slip) > LEAST_SLIP)
            sides[k % 2] = self.follower.next(state, dt, residual, noise, tells)
        return SidesMemory(wheels, offset, *sides)

    def say(self, memory):
        moves = memory.wheels.told.moves
        left, right = (self.follower.says(side, moves) for side in (memory.left, memory.right))
        mean = {
            "friction": 0.5 * (left.mean.friction + right.mean.friction),
            "friction_left": left.mean.friction,
            "friction_right": right.mean.friction,
        }
        std = {
            "friction": 0.5 * numerics.hypot(left.std.friction, right.std.friction),
            "friction_left": left.std.friction,
            "friction_right": right.std.friction,
        }
        known = {
            "friction": left.known.friction & right.known.friction,
            "friction_left": left.known.friction,
            "friction_right": right.known.friction,
        }
        return answer(mean, std, known)

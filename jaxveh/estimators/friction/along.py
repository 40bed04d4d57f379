"""What torques and wheel speeds tell of friction: the force of each wheel beside its slip."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.friction.laws import LEAST_FRICTION, PlanarCar, SimilarCurve
from jaxveh.estimators.friction.motion import LONGEST, LOWEST

CORNERS = ("fl", "fr", "rl", "rr")

WHEELS = tuple(Need(f"wheel_speed_{at}", "m/s", optional=True) for at in CORNERS) + tuple(
    Need(f"torque_{at}", "N m", optional=True) for at in CORNERS
)
"""Wheel speeds and the torques on the wheels."""

SLOWEST = 0.3
"""Share of the car's speed: a wheel that turns more slowly is about to lock, and its brake's torque is not what it gives."""


LEAST_SLIP = 0.02
"""Of the speed: less slip than this may be an error of a wheel's radius or of the speed, and says nothing of friction's limit."""


class WheelsTold(NamedTuple):
    """Of each wheel (4,): filtered `speed` (m/s) and `torque` (N m), what was measured of them last, and their `age` (s); the
    car's filtered `v_x` (m/s); the time `t` (s)."""

    t: Any
    v_x: Any
    speed: Any
    torque: Any
    last_speed: Any
    last_torque: Any
    age: Any


class Slips(NamedTuple):
    """Of each wheel (4,): longitudinal `slip` (-), `force` (N), static-load `ratio` of its load, and whether they are `there`."""

    slip: Any
    force: Any
    load: Any
    there: Any


class WheelForces(eqx.Module):
    """Slip and longitudinal force of each wheel from its speed and torque (equation 12 of the review; torques that brake are
    negative): `F = (T - J domega/dt) / R` less the rolling resistance, all low-pass filtered alike by `lag` (s)."""

    wheel_radius: jax.Array = positive("m")
    wheel_inertia: jax.Array = positive("kg m^2")
    rolling_resistance: jax.Array = parameter("-", scale=0.01, default=0.01)
    lag: jax.Array = positive("s", default=0.08)

    def start(self, t) -> WheelsTold:
        """Before the first row."""
        zero = jnp.zeros((4,), t.dtype)
        return WheelsTold(t, jnp.zeros_like(t), zero, zero, zero, zero, zero + 1e3)

    def next(self, last: WheelsTold, t, values, told) -> WheelsTold:
        """With the next row; `told` is the motion's `Told` of the same row."""
        dt = jnp.clip(t - last.t, 0.0, 1.0)
        speeds, torques = (jnp.stack([values[f"{kind}_{at}"] for at in CORNERS]) for kind in ("wheel_speed", "torque"))
        here = ~(jnp.isnan(speeds) | jnp.isnan(torques))
        speed = jnp.where(jnp.isnan(speeds), last.last_speed, speeds)
        torque = jnp.where(jnp.isnan(torques), last.last_torque, torques)
        age = jnp.where(here, 0.0, last.age + dt)
        share = 1.0 - jnp.exp(-dt / self.lag)
        anew = last.age > LONGEST
        follow = lambda old, new, anew: jnp.where(anew, new, old + share * (new - old))
        v_x = follow(last.v_x, told.raw_v_x, jnp.all(anew))
        return WheelsTold(
            t, v_x, follow(last.speed, speed, anew), follow(last.torque, torque, anew), speed, torque, age
        )

    def slips(self, car: PlanarCar, memory: WheelsTold, told, yaw_rate, a_y) -> Slips:
        """What they are now; `yaw_rate` (rad/s), `a_y` (m/s^2) as held."""
        left = jnp.asarray([-1.0, 1.0, -1.0, 1.0], memory.speed.dtype)
        along = jnp.maximum(memory.v_x, LOWEST) + left * car.half_track * yaw_rate
        along = jnp.maximum(along, 0.5 * LOWEST)
        slip = (memory.speed - along) / along
        # The derivative of what the low-pass says.
        faster = (memory.last_speed - memory.speed) / self.lag
        ratios, static = car.load_ratios(told.a_x), car.static_loads()
        moved = car.mass * a_y * car.cg_height / (4.0 * car.half_track)
        axle = jnp.stack([static[0] * ratios[0], static[0] * ratios[0], static[1] * ratios[1], static[1] * ratios[1]])
        load = jnp.maximum(0.5 * axle + left * moved, 0.05 * axle)
        force = (memory.torque - self.wheel_inertia * faster / self.wheel_radius) / self.wheel_radius
        turns = memory.last_speed > SLOWEST * along
        there = (memory.age <= LONGEST) & turns & told.moves
        nominal = 0.5 * jnp.stack([static[0], static[0], static[1], static[1]])
        return Slips(slip, force - self.rolling_resistance * load * jnp.sign(memory.v_x), load / nominal, there)


class AlongMemory(NamedTuple):
    """The wheels, what a rolling wheel's slip shows of errors of radius and speed (4,) and the variance of that, and what was
    measured last."""

    wheels: WheelsTold
    offset: Any
    variance: Any
    yaw_rate: Any
    a_y: Any


class AlongEvidence(eqx.Module):
    """Log-likelihoods of frictions from the wheels' slips and forces.

    A radius is not known to better than `radius_noise`: what slip a wheel shows while it hardly pulls is learnt and taken off.
    A force's error is a share `force_noise` of it and `load_noise` of the load; a slip's is `slip_noise` and what is not learnt
    yet, which stays for `slip_time` (s), so that many rows say hardly more than one; a curve is less certain the further the
    slip is beyond its peak. Slips below `knee` (-) hardly count: they tell stiffness, not friction. Rows closer than
    `correlation` (s) say the same.
    """

    car: PlanarCar
    wheels: WheelForces
    stiffness_ratio: jax.Array = positive("-", default=1.0)
    force_noise: jax.Array = positive("-", default=0.05)
    load_noise: jax.Array = positive("-", default=0.015)
    slip_noise: jax.Array = positive("-", default=0.003)
    radius_noise: jax.Array = positive("-", default=0.015)
    knee: jax.Array = positive("-", default=0.025)
    slip_time: jax.Array = positive("s", default=2.0)
    correlation: jax.Array = positive("s", default=0.3)

    @property
    def needs(self):
        return WHEELS

    def start(self, t) -> AlongMemory:
        """Before the first row."""
        wheels = self.wheels.start(t)
        unknown = jnp.square(self.radius_noise) + jnp.zeros_like(wheels.speed)
        return AlongMemory(wheels, jnp.zeros_like(wheels.speed), unknown, jnp.zeros_like(t), jnp.zeros_like(t))

    def _learn(self, memory: AlongMemory, seen: Slips, stiffness, dt):
        """The slips' offsets and variances after a row: of wheels that pull less than a tenth of their load."""
        rolls = seen.there & (jnp.abs(seen.force) < 0.1 * self.stiffness_ratio * stiffness * 0.05)
        shown = jnp.where(rolls, seen.slip - seen.force / (self.stiffness_ratio * stiffness * seen.load), 0.0)
        variance = jnp.minimum(
            memory.variance + dt * jnp.square(self.slip_noise) / 100.0, jnp.square(self.radius_noise)
        )
        # Errors of a slip are alike for half a second.
        rough = jnp.square(0.003 + 0.0 * variance) * 0.5 / jnp.maximum(dt, 1e-3)
        gain = jnp.where(rolls, variance / (variance + rough), 0.0)
        return memory.offset + gain * (shown - memory.offset), (1.0 - gain) * variance

    def next(self, memory: AlongMemory, t, values, told, frictions, weights):
        """The memory, and the log-likelihood of each friction (K,), of probabilities `weights`, for the time since the last
        row."""
        dt = jnp.clip(t - memory.wheels.t, 0.0, 1.0)
        wheels = self.wheels.next(memory.wheels, t, values, told)
        held = lambda name, last: jnp.where(jnp.isnan(values[name]), last, values[name])
        yaw_rate, a_y = held("yaw_rate", memory.yaw_rate), held("a_y", memory.a_y)
        seen = self.wheels.slips(self.car, wheels, told, yaw_rate, a_y)
        stiffness = 0.5 * jnp.stack(
            [c.stiffness for c in (self.car.front, self.car.front, self.car.rear, self.car.rear)]
        )
        offset, variance = self._learn(memory, seen, stiffness, dt)
        seen = seen._replace(slip=seen.slip - offset)
        lateral = self.car.axle_forces(a_y, jnp.zeros_like(a_y))
        total = jnp.zeros_like(frictions)
        for k in range(4):
            curve, across = (self.car.front, lateral[0]) if k < 2 else (self.car.rear, lateral[1])
            one = jax.tree.map(lambda leaf, k=k: leaf[k], seen)
            # Two wheels of an axle share most of their errors.
            of = lambda mu, c=curve, f=across, s=one, p=variance[k]: self._of_wheel(c, f, s, p, mu)
            error, rough = jax.vmap(of)(frictions)
            # One variance for all, as for the motion.
            counts = one.slip**4 / (one.slip**4 + self.knee**4)
            # A wheel that slides across tells little along.
            limit = jnp.sum(weights * frictions) * curve.peak
            counts = counts * jnp.square(jnp.maximum(1.0 - jnp.square(across / limit), 0.0))
            total = total - 0.25 * counts * jnp.square(error) / jnp.sum(weights * rough)
        return AlongMemory(wheels, offset, variance, yaw_rate, a_y), jnp.minimum(dt / self.correlation, 1.0) * total

    def _of_wheel(self, curve: SimilarCurve, across, seen: Slips, variance, friction):
        nominal = 0.5 * curve.peak
        limit = jnp.maximum(friction, LEAST_FRICTION) * nominal * seen.load
        left = numerics.sqrt(jnp.maximum(1.0 - jnp.square(0.5 * across * seen.load / limit), 0.1))
        wheel = SimilarCurve(0.5 * self.stiffness_ratio * curve.stiffness, nominal, curve.shape, curve.bend)
        force, slope = wheel.with_slope(seen.slip, friction * left, seen.load)
        beyond = 0.1 * limit * jnp.square(seen.slip) / (jnp.square(seen.slip) + 0.04)
        rough = jnp.square(self.force_noise * seen.force) + jnp.square(self.load_noise * nominal * seen.load)
        rough = rough + jnp.square(beyond) + jnp.square(0.15 * force)
        rough = rough + self.slip_time / self.correlation * jnp.square(slope) * (variance + jnp.square(self.slip_noise))
        return jnp.where(seen.there, seen.force - force, 0.0), rough

"""Friction from torques and wheel speeds: the force of each wheel and its slip."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.friction.laws import LEAST_FRICTION, PlanarCar, SimilarCurve
from jaxveh.estimators.two_axles import LONGEST, LOWEST, slip_stiffness
from jaxveh.tyres import kit as tyres
from jaxveh.vehicles import kit as vehicles

WHEELS = tuple(Need(f"wheel_speed_{at}", "m/s", optional=True) for at in vehicles.CORNERS) + tuple(
    Need(f"torque_{at}", "N m", optional=True) for at in vehicles.CORNERS
)
"""The wheel speeds, and the torques at the wheels."""

SLOWEST = 0.3
"""Share of the car's speed: a wheel that turns more slowly is about to lock, and its brake torque is no longer the tyre's."""


LEAST_SLIP = 0.02
"""A smaller slip may be an error of a wheel's radius or of the speed, and gives no information on the friction limit."""


class WheelsTold(NamedTuple):
    """For each wheel (4,): filtered `speed` (m/s) and `torque` (N m), their last measurements, and their `age` (s); the car's
    filtered `v_x` (m/s); the time `t` (s)."""

    t: Any
    v_x: Any
    speed: Any
    torque: Any
    last_speed: Any
    last_torque: Any
    age: Any


class Slips(NamedTuple):
    """For each wheel (4,): longitudinal `slip` (-), `force` (N), `load` over the static load (-), and whether they are available,
    `there`."""

    slip: Any
    force: Any
    load: Any
    there: Any


class WheelForces(eqx.Module):
    """Slip and longitudinal force of each wheel from its speed and torque (equation 12 of the review; brake torques are
    negative): `F = (T - J domega/dt) / R` less the rolling resistance, all with the same low-pass filter of `lag` (s)."""

    wheel_radius: jax.Array = positive("m")
    wheel_inertia: jax.Array = positive("kg m^2")
    rolling_resistance: jax.Array = parameter("-", scale=0.01, default=0.01)
    lag: jax.Array = positive("s", default=0.08)

    def start(self, t) -> WheelsTold:
        """The memory before the first row."""
        zero = jnp.zeros((4,), t.dtype)
        return WheelsTold(t, jnp.zeros_like(t), zero, zero, zero, zero, zero + 1e3)

    def next(self, last: WheelsTold, t, values, told) -> WheelsTold:
        """The memory after the next row; `told` is the motion's `Told` of the same row."""
        dt = jnp.clip(t - last.t, 0.0, 1.0)
        speeds, torques = (
            jnp.stack([values[f"{kind}_{at}"] for at in vehicles.CORNERS]) for kind in ("wheel_speed", "torque")
        )
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
        """The present slips and forces, from the held `yaw_rate` (rad/s) and `a_y` (m/s^2)."""
        left = jnp.asarray([-1.0, 1.0, -1.0, 1.0], memory.speed.dtype)
        along = jnp.maximum(memory.v_x, LOWEST) + left * car.half_track * yaw_rate
        along = jnp.maximum(along, 0.5 * LOWEST)
        slip = (memory.speed - along) / along
        # The derivative of the low-passed speed.
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
    """The wheels; the slip `offset` (4,) by errors of radius and speed, seen while a wheel rolls freely, and its `variance` (4,);
    the last yaw rate (rad/s) and a_y (m/s^2)."""

    wheels: WheelsTold
    offset: Any
    variance: Any
    yaw_rate: Any
    a_y: Any


class AlongEvidence(eqx.Module):
    """Log-likelihoods of frictions from the wheels' slips and forces.

    A radius is known to a share of `radius_noise` (-): the slip of a wheel at small force is learned as an offset and subtracted.
    A force's error is a share `force_noise` (-) of it and `load_noise` (-) of the load. A slip's error is `slip_noise` (-) and
    the error of the offset; it lasts for `slip_time` (s), so that many rows give hardly more information than one. The curve has
    the lateral one's peak, `stiffness_ratio` (-) times the usual stiffness (`slip_stiffness`), and the longitudinal `shape` C
    (-), by which it falls beyond the peak; its uncertainty grows with the slip. Slips below `knee` (-) hardly count: they depend
    on stiffness, not on friction. Rows closer than `correlation` (s) count as one.
    """

    car: PlanarCar
    wheels: WheelForces
    stiffness_ratio: jax.Array = positive("-", default=1.0)
    shape: jax.Array = positive("-", default=tyres.TYPICAL_COEFFICIENTS["PCX1"])
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
        """The memory before the first row."""
        wheels = self.wheels.start(t)
        unknown = jnp.square(self.radius_noise) + jnp.zeros_like(wheels.speed)
        return AlongMemory(wheels, jnp.zeros_like(wheels.speed), unknown, jnp.zeros_like(t), jnp.zeros_like(t))

    def _learn(self, memory: AlongMemory, seen: Slips, stiffness, dt):
        """The slips' offsets and variances after a row. They are learned from wheels whose force is less than a tenth of the
        linear force at a slip of 0.05."""
        rolls = seen.there & (jnp.abs(seen.force) < 0.1 * stiffness * 0.05)
        shown = jnp.where(rolls, seen.slip - seen.force / (stiffness * seen.load), 0.0)
        variance = jnp.minimum(
            memory.variance + dt * jnp.square(self.slip_noise) / 100.0, jnp.square(self.radius_noise)
        )
        # Errors of a slip are correlated over half a second.
        rough = 0.003**2 * 0.5 / jnp.maximum(dt, 1e-3)
        gain = jnp.where(rolls, variance / (variance + rough), 0.0)
        return memory.offset + gain * (shown - memory.offset), (1.0 - gain) * variance

    def next(self, memory: AlongMemory, t, values, told, frictions, weights):
        """The memory, and the log-likelihood (K,) of `frictions` with probabilities `weights`, for the time since the last
        row."""
        dt = jnp.clip(t - memory.wheels.t, 0.0, 1.0)
        wheels = self.wheels.next(memory.wheels, t, values, told)
        held = lambda name, last: jnp.where(jnp.isnan(values[name]), last, values[name])
        yaw_rate, a_y = held("yaw_rate", memory.yaw_rate), held("a_y", memory.a_y)
        seen = self.wheels.slips(self.car, wheels, told, yaw_rate, a_y)
        curves = self._curves()
        offset, variance = self._learn(memory, seen, jnp.stack([curve.stiffness for curve in curves]), dt)
        seen = seen._replace(slip=seen.slip - offset)
        lateral = self.car.axle_forces(a_y, jnp.zeros_like(a_y))
        total = jnp.zeros_like(frictions)
        for k in range(4):
            curve, across = curves[k], lateral[k // 2]
            one = jax.tree.map(lambda leaf, k=k: leaf[k], seen)
            # The two wheels of an axle share most of their errors.
            of = lambda mu, c=curve, f=across, s=one, p=variance[k]: self._of_wheel(c, f, s, p, mu)
            error, rough = jax.vmap(of)(frictions)
            # One variance for all frictions, as for the motion.
            counts = one.slip**4 / (one.slip**4 + self.knee**4)
            # A wheel that slides laterally gives little longitudinal information.
            limit = 2.0 * jnp.sum(weights * frictions) * curve.peak
            counts = counts * jnp.square(jnp.maximum(1.0 - jnp.square(across / limit), 0.0))
            total = total - 0.25 * counts * jnp.square(error) / jnp.sum(weights * rough)
        return AlongMemory(wheels, offset, variance, yaw_rate, a_y), jnp.minimum(dt / self.correlation, 1.0) * total

    def _curves(self) -> list[SimilarCurve]:
        """The longitudinal curve of each wheel."""
        axles = (self.car.front, self.car.front, self.car.rear, self.car.rear)
        loads = [0.5 * load for load in self.car.static_loads() for _ in range(2)]
        stiffness = lambda axle, load: self.stiffness_ratio * slip_stiffness(axle.stiffness, load) * load
        return [axle.along(stiffness(axle, load), self.shape) for axle, load in zip(axles, loads, strict=True)]

    def _of_wheel(self, curve: SimilarCurve, across, seen: Slips, variance, friction):
        nominal = curve.peak
        limit = jnp.maximum(friction, LEAST_FRICTION) * nominal * seen.load
        left = numerics.sqrt(jnp.maximum(1.0 - jnp.square(0.5 * across * seen.load / limit), 0.1))
        force, slope = curve.with_slope(seen.slip, friction * left, seen.load)
        beyond = 0.1 * limit * jnp.square(seen.slip) / (jnp.square(seen.slip) + 0.04)
        rough = jnp.square(self.force_noise * seen.force) + jnp.square(self.load_noise * nominal * seen.load)
        rough = rough + jnp.square(beyond) + jnp.square(0.15 * force)
        rough = rough + self.slip_time / self.correlation * jnp.square(slope) * (variance + jnp.square(self.slip_noise))
        return jnp.where(seen.there, seen.force - force, 0.0), rough

"""Friction from the wheels' longitudinal slips and forces: the slip slope and the reconstruction."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.friction.along import LEAST_SLIP, Slips, WheelForces, WheelsTold
from jaxveh.estimators.friction.laws import PlanarCar, SimilarCurve
from jaxveh.estimators.friction.motion import Told, next_told, start_told
from jaxveh.estimators.method import AbstractMethod, Answer, answer
from jaxveh.vehicles import kit as vehicles

SPEED = (Need("v_x", "m/s"),)
WHEEL_CHANNELS = tuple(
    Need(f"{kind}_{at}", unit) for kind, unit in (("wheel_speed", "m/s"), ("torque", "N m")) for at in vehicles.CORNERS
)
MORE = (
    Need("a_x", "m/s^2", optional=True),
    Need("a_y", "m/s^2", optional=True),
    Need("yaw_rate", "rad/s", optional=True),
)


class WheelMemory(NamedTuple):
    """The motion, the wheels, and the last measurements of yaw rate (rad/s) and a_y (m/s^2)."""

    told: Told
    wheels: WheelsTold
    yaw_rate: Any
    a_y: Any


class WheelSlips(eqx.Module):
    """Slips and forces of the wheels from a log, row by row; the steer is not needed."""

    car: PlanarCar
    wheels: WheelForces

    def start(self, t, values) -> WheelMemory:
        """The memory after the first row."""
        return WheelMemory(
            start_told(t, self._straight(t, values), self.car.late),
            self.wheels.start(t),
            jnp.zeros_like(t),
            jnp.zeros_like(t),
        )

    def next(self, last: WheelMemory, t, values) -> tuple[WheelMemory, Slips]:
        """The memory after the next row, and the wheels' slips and forces."""
        told = next_told(last.told, t, self._straight(t, values), self.car.late)
        wheels = self.wheels.next(last.wheels, t, values, told)
        held = lambda name, old: jnp.where(jnp.isnan(values[name]), old, values[name])
        yaw_rate, a_y = held("yaw_rate", last.yaw_rate), held("a_y", last.a_y)
        return WheelMemory(told, wheels, yaw_rate, a_y), self.wheels.slips(self.car, wheels, told, yaw_rate, a_y)

    def nominal(self):
        """Static loads of the four wheels, N."""
        front, rear = self.car.static_loads()
        return 0.5 * jnp.stack([front, front, rear, rear])

    def curves(self, ratio) -> tuple[SimilarCurve, ...]:
        """The longitudinal curve of each wheel: half of its axle's, with `ratio` times the stiffness."""
        axles = (self.car.front, self.car.front, self.car.rear, self.car.rear)
        return tuple(curve.of_a_wheel(ratio) for curve in axles)

    def _straight(self, t, values):
        """The values with zero for the lateral sensors, which count as measured because nothing here depends on them."""
        still = jnp.zeros_like(t)
        return {"v_x": values["v_x"], "a_x": values["a_x"], "steer": still, "yaw_rate": still, "a_y": still}


class AbstractWheelMethod(AbstractMethod):
    """A method that uses the wheels' slips and forces; `slips` computes them. Its memory has theirs in a field `wheels`."""

    slips: WheelSlips

    @property
    def needs(self):
        return (*SPEED, *WHEEL_CHANNELS, *MORE)

    @abc.abstractmethod
    def begin(self, wheels: WheelMemory) -> Any:
        """The memory after the first row."""

    @abc.abstractmethod
    def follow(self, memory: Any, wheels: WheelMemory, seen: Slips, dt: Any) -> Any:
        """The memory after the next row, at most a second (`dt`, s) later."""

    @abc.abstractmethod
    def say(self, memory: Any) -> Answer:
        """The answer to the row of this memory."""

    def first(self, t, values):
        memory = self.begin(self.slips.start(t, values))
        return memory, self.say(memory)

    def next(self, memory, t, values):
        dt = jnp.clip(t - memory.wheels.told.t, 0.0, 1.0)
        wheels, seen = self.slips.next(memory.wheels, t, values)
        memory = self.follow(memory, wheels, seen, dt)
        return memory, self.say(memory)


class SlopeMemory(NamedTuple):
    """Mean (3,) and covariance (3, 3) of the compliance (slip over normalised force) and both axles' slip offsets."""

    wheels: WheelMemory
    mean: Any
    covariance: Any


class SlipSlope(AbstractWheelMethod):
    """Friction from the slope of the normalised force over the slip at small slip (references [112-116]).

    For each axle `slip = (F_x / F_z) / K + offset` (F. Gustafsson, Automatica 33, 1997). A Kalman filter with forgetting
    estimates the compliance 1/K, common to both axles, and one offset per axle, which is an error of the radii; it uses rows with
    a used friction up to `used` only.

    **The slope is not the friction.** Brush model and Magic Formula have the same slope on every road. That measured slopes fall
    with friction is an observation on real tyres, and the effect depends on tyre, wear, temperature and pressure. `friction =
    (K / K_0)^exponent`, with K_0 from the car's file, is the calibration of that effect: identify `exponent` and
    `calibration_spread` (of ln mu) on the car at hand. The standard deviation includes the slope's and the calibration's. `known`
    only refers to the slope: it is known within a tenth.
    """

    stiffness_ratio: jax.Array = positive("-", default=1.0)
    exponent: jax.Array = positive("-", default=1.0)
    calibration_spread: jax.Array = positive("-", default=0.3)
    slip_noise: jax.Array = positive("-", default=0.004)
    used: jax.Array = positive("-", default=0.3)
    memory: jax.Array = positive("s", default=60.0)

    def begin(self, wheels):
        usual, zero = self._usual(), jnp.zeros_like(wheels.told.t)
        return SlopeMemory(wheels, jnp.stack([usual, zero, zero]), self._spread())

    def follow(self, memory, wheels, seen, dt):
        mean, stays = memory.mean, jnp.exp(-dt / self.memory)
        # Forgetting leads back to the covariance before the drive.
        P = stays**2 * memory.covariance + (1.0 - stays**2) * self._spread()
        rough = jnp.square(self.slip_noise) * jnp.maximum(0.2 / jnp.maximum(dt, 1e-3), 1.0)
        normal = seen.force / (seen.load * self.slips.nominal())
        for k, axle in ((0, 1), (2, 2)):
            force, slip = 0.5 * (normal[k] + normal[k + 1]), 0.5 * (seen.slip[k] + seen.slip[k + 1])
            here = seen.there[k] & seen.there[k + 1] & (jnp.abs(force) < self.used)
            phi = jnp.zeros_like(mean).at[0].set(force).at[axle].set(1.0)
            across = P @ phi
            gain = jnp.where(here, across / (phi @ across + rough), 0.0)
            mean = mean + gain * (slip - phi @ mean)
            P = P - jnp.outer(gain, across)
        return SlopeMemory(wheels, mean, 0.5 * (P + P.T))

    def _usual(self):
        car = self.slips.car
        return sum(car.static_loads()) / (self.stiffness_ratio * (car.front.stiffness + car.rear.stiffness))

    def _spread(self):
        usual = self._usual()
        return jnp.diag(jnp.square(jnp.stack([0.5 * usual, 0.02, 0.02])))

    def say(self, memory):
        usual = self._usual()
        compliance = jnp.clip(memory.mean[0], usual / 1.5, 10.0 * usual)
        friction = jnp.exp(self.exponent * jnp.log(usual / compliance))
        slope = numerics.sqrt(memory.covariance[0, 0]) / compliance
        spread = numerics.hypot(self.exponent * slope, self.calibration_spread)
        return answer({"friction": friction}, {"friction": friction * spread}, memory.wheels.told.moves & (slope < 0.1))


class CurveMemory(NamedTuple):
    """The filtered slip and used friction of the wheel that uses most, the curve's slope, the friction extrapolated from it, and
    the slope's age (s)."""

    wheels: WheelMemory
    slip: Any
    used: Any
    slope: Any
    friction: Any
    age: Any


class Reconstruction(AbstractWheelMethod):
    """The curve of used friction over slip, reconstructed (equations 18, 19, figure 6 of the review; references [3, 136-138]).

    `mu = F_x / F_z` (18) and its slope `d mu / d lambda = (d mu / dt) / (d lambda / dt)` (19), for the wheel that uses most.
    Where `|d lambda / dt|` is below `least_rate` (1/s), (19) divides noise by noise, and the last slope is kept. Figure 6 reads
    the peak where the slope is zero. Before that, the brush curve extrapolates: with `k` the slope over the initial slope of the
    car's file, `1 - g = sqrt(k)`, and the peak is `mu / (1 - (1 - g)^3)`. A low-pass filter of `lag` (s) on both limits the noise
    of the derivatives.

    `known`: the slope is recent and below `bent` of the initial one, at a slip above `LEAST_SLIP`, so that the curve has left its
    linear part. It gives no standard deviation. **With the wheel speeds of a series car this rule fails**: an error of half a per
    cent of a radius and the sensor's noise bend the curve at slips of a per cent, and frictions marked as known are far too
    small.
    """

    stiffness_ratio: jax.Array = positive("-", default=1.0)
    least_rate: jax.Array = positive("1/s", default=0.05)
    lag: jax.Array = positive("s", default=0.1)
    bent: jax.Array = positive("-", default=0.4)
    memory: jax.Array = positive("s", default=0.5)

    def begin(self, wheels):
        zero = jnp.zeros_like(wheels.told.t)
        return CurveMemory(wheels, zero, zero, zero + self._steepest(), zero + 1.0, zero + 10.0)

    def follow(self, memory, wheels, seen, dt):
        normal = jnp.where(seen.there, seen.force / (seen.load * self.slips.nominal()), 0.0)
        most = jnp.argmax(jnp.abs(normal))
        sign = jnp.sign(normal[most])
        used_now, slip_now, here = jnp.abs(normal[most]), sign * seen.slip[most], seen.there[most]
        share = jnp.where(here, 1.0 - jnp.exp(-dt / self.lag), 0.0)
        slip, used = memory.slip + share * (slip_now - memory.slip), memory.used + share * (used_now - memory.used)
        faster, harder = (slip_now - slip) / self.lag, (used_now - used) / self.lag
        moves = here & (jnp.abs(faster) > self.least_rate)
        raw = harder / numerics.or_one(faster, moves)
        steepest = self._steepest()
        slope = jnp.where(moves, memory.slope + share * (jnp.clip(raw, 0.0, steepest) - memory.slope), memory.slope)
        age = jnp.where(moves, 0.0, memory.age + dt)
        rest = numerics.sqrt(jnp.maximum(slope / steepest, 0.0))
        peak = used / jnp.maximum(1.0 - rest**3, 0.05)
        bends = here & (slope < self.bent * steepest) & (age < self.memory)
        friction = jnp.where(bends, peak, jnp.maximum(memory.friction, used))
        return CurveMemory(wheels, slip, used, slope, friction, age)

    def _steepest(self):
        car = self.slips.car
        return self.stiffness_ratio * (car.front.stiffness + car.rear.stiffness) / sum(car.static_loads())

    def say(self, memory):
        bends = (memory.slope < self.bent * self._steepest()) & (memory.age < self.memory)
        known = memory.wheels.told.moves & bends & (memory.slip > LEAST_SLIP)
        return answer({"friction": memory.friction}, known=known)

"""The state of the recommended speed filter, its memory and its standard deviations."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.estimators.body_motion import steer_heard
from jaxveh.estimators.contract import Need
from jaxveh.estimators.misfit import OUTLIER, Misfit, white_part
from jaxveh.estimators.rear_steer import rear_angle
from jaxveh.estimators.sequential import Belief, Innovation, update
from jaxveh.estimators.speed.accelerometer import AbstractOffsetAndSlope
from jaxveh.estimators.speed.car_numbers import SpeedCar
from jaxveh.vehicles import kit as vehicles

LEFT = np.array([1, -1, 1, -1])
"""1 for wheels on the left, -1 for those on the right; front left first."""

FRONT = np.array([True, True, False, False])
"""Which wheels are in front."""

RADII = slice(6, 10)
"""Indices of the wheels' own radii in the state."""

STATES = 13
"""Length of the state."""

HELD = (
    "a_x", "a_y", "yaw_rate", "steer", "steer_rear", "drive_torque", *(f"brake_torque_{at}" for at in vehicles.CORNERS)
)  # fmt: skip
"""Channels that are held between two samples."""

MAY_HELP = tuple(
    Need(name, unit, optional=True)
    for name, unit in (
        ("a_x", "m/s^2"), ("a_y", "m/s^2"), ("yaw_rate", "rad/s"), ("steer", "rad"), ("steering_wheel", "rad"), ("speed", "m/s"),
        ("drive_torque", "N m"), *[(f"{kind}_{at}", "N m") for kind in ("brake_torque", "torque") for at in vehicles.CORNERS],
    )
)  # fmt: skip
"""Channels that are used if a log has them."""

PATIENCE = 0.3
"""s: time for which a sample is held; then the channel counts as missing."""


class SpeedState(NamedTuple):
    """`rolled`: mean speed of wheels without slip, `(1 + radius) v_x` (m/s); `force`: force of tyres and air over the mass
    (m/s^2); `slope`: gravity along the road (m/s^2, uphill positive); `offset` (m/s^2) and `gain` (-) of the accelerometer;
    `radius` (-): common relative error of all wheels' speeds by their radii, `radius_fl` to `radius_rr` (-): that of each wheel
    beyond it; `softness_front`, `softness_rear` (-): logarithm of the slip of an axle's tyres over that of the file; `sinking`
    (-): the relative decrease of a wheel's rolling radius if its load doubles.

    The wheels' speed is a state instead of the car's, so that no wheel makes the common radius error observable. (A filter of
    v_x, linearised about a changing speed, would soon consider it known.)"""

    rolled: Any
    force: Any
    slope: Any
    offset: Any
    gain: Any
    radius: Any
    radius_fl: Any
    radius_fr: Any
    radius_rl: Any
    radius_rr: Any
    softness_front: Any
    softness_rear: Any
    sinking: Any

    @property
    def v_x(self) -> Any:
        """The car's speed, m/s."""
        return self.rolled / (1.0 + self.radius)


class Spreads(AbstractOffsetAndSlope):
    """Standard deviations of the prior, of the random walks, and of the measurements.

    Walks are per root second. A softness decays to the file's with `softness_time` (s), with a random walk that keeps its
    standard deviation. `radius` (-) is that of each wheel's own radius error; `common_radius` (-) that of the file's radius,
    often that of a tyre without load, 1 to 3 % larger than the one on which it rolls; `sinking` (-) that of the state of this
    name. `wheel` (m/s) is the quantisation of the sensor's teeth, `wheel_share` (-) is proportional to the speed.

    The following errors are correlated in time, so that `repeats` (-) samples count as one: `slip_share` (-), a share of the
    expected slip; `peak_slip` (-), unknown slip at a force equal to the load, which falls with the fourth power of the force;
    `limit_slip` (-), additional slip, expected and uncertain, of a wheel that was recently at its limit (it decays with
    `suspicion_time`, s); `other_slip` (-), slip of all wheels while one is at its limit, because the forces are then distributed
    otherwise; `turn` (m/s per rad/s), error of the wheels' positions; `still` (m/s), speed of a wheel whose sensor says zero,
    since slow teeth are not seen.

    `slides` (rad sqrt(s)), times the fourth power of a_y over g, is the white noise of the sideslip angle by which a car that
    turns loses speed without feeling it.
    """

    gain: jax.Array = positive("-", default=0.012)
    radius: jax.Array = positive("-", default=0.004)
    common_radius: jax.Array = positive("-", default=0.015)
    radius_walk: jax.Array = positive("1/sqrt(s)", default=1e-4)
    softness: jax.Array = positive("-", default=0.35)
    softness_time: jax.Array = positive("s", default=300.0)
    sinking: jax.Array = positive("-", default=0.01)
    force_walk: jax.Array = positive("m/s^2/sqrt(s)", default=6.0)
    speed_walk: jax.Array = positive("m/s/sqrt(s)", default=0.02)
    a_x: jax.Array = positive("m/s^2", default=0.1)
    wheel: jax.Array = positive("m/s", default=0.04)
    wheel_share: jax.Array = positive("-", default=1e-3)
    slip_share: jax.Array = positive("-", default=0.25)
    peak_slip: jax.Array = positive("-", default=0.3)
    limit_slip: jax.Array = positive("-", default=0.03)
    suspicion_time: jax.Array = positive("s", default=0.4)
    other_slip: jax.Array = positive("-", default=0.015)
    repeats: jax.Array = positive("-", default=25.0)
    turn: jax.Array = positive("m/s per rad/s", default=0.05)
    still: jax.Array = positive("m/s", default=0.1)
    slides: jax.Array = positive("rad sqrt(s)", default=0.05)
    satellite: jax.Array = positive("m/s", default=0.06)


class Memory(NamedTuple):
    """The belief and its time `t` (s); the last measurements by channel, `heard`, and their times `at` (s); for each wheel the
    low-passed speed `smooth` (m/s), its time `smooth_at` (s), its `trust` (-), and the `suspicion` (-) that it is at its limit;
    the car's low-passed acceleration `rate` (m/s^2); the time `lost` (s) since which no wheel was trusted; the `misfit` of
    accelerometer, satellites and wheels, and the last two speeds of each wheel, `lately` (m/s); how many fixes in turn were
    beyond the gate, `missed`."""

    belief: Belief
    t: Any
    heard: dict[str, Any]
    at: dict[str, Any]
    smooth: Any
    smooth_at: Any
    trust: Any
    suspicion: Any
    rate: Any
    lost: Any
    misfit: Misfit
    lately: tuple[Any, Any]
    missed: Any


class Said(NamedTuple):
    """The wheels' predicted `speed` (m/s), and that without slip, `rolling` (m/s); their `slip` (-) and force over load, `share`
    (-), (4,) each."""

    speed: Any
    rolling: Any
    slip: Any
    share: Any


def heard_in(car: SpeedCar, memory: Memory, t: Any, values: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The last measurements by channel after a row, and their times (s)."""
    now = dict(values) | {"steer": steer_heard(values, car.steering_ratio, car.steer_offset)}
    now["steer_rear"] = rear_angle(values, jnp.zeros_like(t))
    torques = [values[f"torque_{place}"] for place in vehicles.CORNERS]
    now["drive_torque"] = jnp.where(jnp.isnan(now["drive_torque"]), sum(torques), now["drive_torque"])
    heard = {n: jnp.where(jnp.isnan(now[n]), memory.heard[n], now[n]) for n in HELD}
    return heard, {n: jnp.where(jnp.isnan(now[n]), memory.at[n], t) for n in HELD}


def front_rear(front: Any, rear: Any) -> Any:
    """The front value for the front wheels and the rear value for the rear wheels, (4,)."""
    return jnp.where(FRONT, front, rear)


def beyond(far: Any) -> Any:
    """1 where |far| <= 1, otherwise |far| to the power of -8; safe for very large values."""
    size = jnp.clip(jnp.abs(far), 1.0, 1e3)
    return 1.0 / jnp.square(jnp.square(jnp.square(size)))


def trust_of_wheels(found: Innovation, said: Said, variance: Any, there: Any, gate: Any, calm: Any) -> Any:
    """The trust of each wheel by its innovation, (4,): `gate` and `calm` of the method.

    Where forces are small and the wheels agree, the belief is more likely wrong than all wheels, and the gate is wide.
    """
    apart = found.residual[:, None] - found.residual[None, :]
    alike = jnp.exp(-jnp.square(apart) / (9.0 * (variance[:, None] + variance[None, :])))
    others = jnp.sum(jnp.where(there[None, :], alike, 0.0), axis=1) - 1.0
    agree = jnp.clip(others - 0.5, 0.0, 1.0)
    little = jnp.exp(-jnp.square(said.share / calm))
    far = numerics.sqrt(jnp.square(found.residual) / found.variance)
    return beyond(far / (gate * (1.0 + 4.0 * little * agree)))


def own_radii(std: Any) -> Any:
    """The covariance (`STATES`, `STATES`) of a state in which only the four wheels' own radii are uncertain, with equal standard
    deviations `std` less that of their mean."""
    free = jnp.eye(4, dtype=std.dtype) - 0.25
    return jnp.zeros((STATES, STATES), std.dtype).at[RADII, RADII].set(free * jnp.square(std))


def roughness_of_wheels(wheels: Any, lately: tuple[Any, Any], white: Any) -> tuple[Any, tuple[Any, Any]]:
    """The mean square of the wheels' white noise over the variance `white`, NaN without a wheel, each at most `OUTLIER`; and
    their last two speeds after this row."""
    there = ~jnp.isnan(wheels)
    last, before = lately
    parts = jnp.minimum(jnp.square(white_part(jnp.where(there, wheels, last), last, before)) / white, OUTLIER)
    count = jnp.sum(there.astype(parts.dtype))
    mean = jnp.sum(jnp.where(there, parts, 0.0)) / jnp.maximum(count, 1.0)
    return jnp.where(count > 0, mean, jnp.nan), (jnp.where(there, wheels, last), jnp.where(there, last, before))


WRONG, MOST_MISSED = 3.0, 10.0
"""Fixes in turn after which the belief counts as wrong, and after which their gate grows no further."""


def missed_in_turn(missed: Any, fix: Any, weight: Any) -> Any:
    """How many fixes in turn were beyond the gate, after a row with this `fix` (NaN: none), whose `weight` by the gate this is.

    One wrong fix is a reflection; several in turn are right, and the belief is wrong: it integrates an accelerometer without
    knowing that the car slides across its own nose.
    """
    after = jnp.where(weight < 0.5, jnp.minimum(missed + 1.0, MOST_MISSED), 0.0)
    return jnp.where(jnp.isnan(fix), missed, after)


def bound_by_two(belief: Belief, rolling: Innovation, there: Any, white: Any, sure: Any) -> Belief:
    """The belief after two wheels that bound the speed: no braked wheel is faster than the car, no driven one slower. `rolling`
    (4,): the innovations without slip; `sure`: the weight.

    A single wheel may be driven in a car that brakes, by the engine or a lifted wheel's differential.
    """
    over = jnp.where(there, jnp.where(SpeedState(*belief.mean).force < 0.0, 1.0, -1.0) * rolling.residual, -jnp.inf)
    second = jnp.argsort(over)[-2]
    slope = rolling.slope[second]
    one = Innovation(rolling.residual[second], slope @ belief.covariance @ slope + white, slope)
    return update(belief, one, jnp.where(over[second] > 0.0, sure, 0.0))

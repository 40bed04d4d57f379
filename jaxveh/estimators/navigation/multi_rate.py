"""A single track that is corrected by the yaw rate in every row, and by the course at each satellite fix (Nguyen, Wang, Oh,
Fujimoto, Hori 2012, [51] of the review's section 1.3.2)."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.estimators.contract import Need
from jaxveh.estimators.delays import satellite_lag
from jaxveh.estimators.live import AbstractCleaning
from jaxveh.estimators.method import AbstractMethod, Answer, Filtered
from jaxveh.filters import Delayed, Extended
from jaxveh.io import CarSpecification
from jaxveh.statespace import Continuous, Gaussian, Prior, StateSpace
from jaxveh.vehicles import LinearSingleTrack

SLOWEST = 3.0
"""m/s: a slower single track is computed at this speed, where the steer has little influence; sideslip is then not known."""

DEPTH = 24
"""Number of rows that are kept for a delayed fix."""


SLIP_ERROR, SLIP_TIME = 0.004, 2.0
"""rad and s: standard deviation and time constant of a linear single track's sideslip error."""


class Track(NamedTuple):
    """`sideslip` (rad), `yaw_rate` (rad/s) and `yaw` (rad) of the single track; `bias_yaw_rate` (rad/s) of the gyroscope,
    `steer_offset` (rad) of the road wheels, and `slip_error` (rad): true sideslip less that of the single track, first-order
    Gauss-Markov."""

    sideslip: Any
    yaw_rate: Any
    yaw: Any
    bias_yaw_rate: Any
    steer_offset: Any
    slip_error: Any


class TrackReport(NamedTuple):
    """The outputs of the filter: velocity (m/s), yaw and sideslip (rad), yaw rate and its bias (rad/s), `steer_offset` (rad)."""

    v_x: Any
    v_y: Any
    yaw: Any
    sideslip: Any
    yaw_rate: Any
    bias_yaw_rate: Any
    steer_offset: Any


def transition(system: LinearSingleTrack, t0, t1, x: Track, u) -> Track:
    """The state after a step by the trapezoidal rule, which is stable at any speed and for any step."""
    half = 0.5 * (t1 - t0)
    v = jnp.maximum(jnp.abs(u.v_x), SLOWEST)
    a_11, a_12, a_21, a_22, b_1, b_2, _ = system.system(v)
    steer = u.steer - x.steer_offset
    right_1 = x.sideslip + half * (a_11 * x.sideslip + a_12 * x.yaw_rate + 2.0 * b_1 * steer)
    right_2 = x.yaw_rate + half * (a_21 * x.sideslip + a_22 * x.yaw_rate + 2.0 * b_2 * steer)
    m_11, m_12, m_21, m_22 = 1.0 - half * a_11, -half * a_12, -half * a_21, 1.0 - half * a_22
    determinant = m_11 * m_22 - m_12 * m_21
    sideslip = (m_22 * right_1 - m_12 * right_2) / determinant
    yaw_rate = (m_11 * right_2 - m_21 * right_1) / determinant
    return x._replace(
        sideslip=sideslip,
        yaw_rate=yaw_rate,
        yaw=x.yaw + half * (x.yaw_rate + yaw_rate),
        slip_error=jnp.exp(-2.0 * half / SLIP_TIME) * x.slip_error,
    )


class Seen(NamedTuple):
    """The measurements: `yaw_rate` (rad/s) and `course` (rad)."""

    yaw_rate: Any
    course: Any


def observation(system: LinearSingleTrack, t, x: Track, u) -> Seen:
    """The yaw rate plus its bias, and the course, which is yaw plus sideslip."""
    del system, t, u
    return Seen(x.yaw_rate + x.bias_yaw_rate, x.yaw + x.sideslip + x.slip_error)


def report(system: LinearSingleTrack, t, x: Track, u) -> TrackReport:
    """The outputs of the filter."""
    del system, t
    v_x, sideslip = numerics.as_wide_as(u.v_x, x.sideslip), x.sideslip + x.slip_error
    return TrackReport(v_x, v_x * sideslip, x.yaw, sideslip, x.yaw_rate, x.bias_yaw_rate, x.steer_offset)


class Held(AbstractCleaning):
    """The last measured steer and speed. The speed is that of the rear wheels, or that of the satellites in rows without it."""

    @property
    def channels(self):
        return ("steer", "yaw_rate", "course", "speed", "wheel_speed_rl", "wheel_speed_rr")

    def first(self, t, values):
        nothing = jnp.zeros_like(t)
        return self.next((nothing, nothing), t, values)

    def next(self, memory, t, values):
        del t
        steer, speed = memory
        rolled = 0.5 * (values["wheel_speed_rl"] + values["wheel_speed_rr"])
        steer = jnp.where(jnp.isnan(values["steer"]), steer, values["steer"])
        told = jnp.where(jnp.isnan(rolled), values["speed"], rolled)
        speed = jnp.where(jnp.isnan(told), speed, told)
        cleaned = {"steer": steer, "v_x": speed, "yaw_rate": values["yaw_rate"], "course": values["course"]}
        return (steer, speed), cleaned


class MultiRate(AbstractMethod):
    """The filter `tracked` with the measured speed as an input; it gives no standard deviation for the speed."""

    tracked: Filtered

    @property
    def needs(self):
        return self.tracked.needs

    def first(self, t, values):
        memory, said = self.tracked.first(t, values)
        return memory, _without_speed(said)

    def next(self, memory, t, values):
        memory, said = self.tracked.next(memory, t, values)
        return memory, _without_speed(said)


def _without_speed(said: Answer) -> Answer:
    return said._replace(std=said.std._replace(v_x=jnp.full_like(said.std.v_x, jnp.nan)))


PROCESS_NOISE = {
    "sideslip": 0.01,
    "yaw_rate": 0.05,
    "yaw": 1e-4,
    "bias_yaw_rate": 1e-4,
    "steer_offset": 1e-4,
    "slip_error": SLIP_ERROR * (2.0 / SLIP_TIME) ** 0.5,
}
"""Standard deviations of the process noise, rad and rad/s per root second."""

SPREAD = {
    "sideslip": 0.05,
    "yaw_rate": 0.5,
    "yaw": 2.0,
    "bias_yaw_rate": 0.005,
    "steer_offset": 0.01,
    "slip_error": SLIP_ERROR,
}
"""Standard deviations at the start, rad and rad/s; the yaw is practically unknown."""


def multi_rate_of(car: CarSpecification) -> MultiRate:
    """Makes the filter from a car's file. A fix is inserted among the rows at its own time, and the later rows are filtered again
    (`Delayed`).

    Between two fixes the paper predicts the residual of the course, and corrects by it. A filter does not need this, since its
    belief already contains all measurements so far.
    """
    numbers = ("mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg")
    stiffness = {f"{axle}_stiffness": getattr(car, f"{axle}_cornering_stiffness") for axle in ("front", "rear")}
    model = StateSpace(
        system=LinearSingleTrack(**{name: getattr(car, name) for name in numbers}, **stiffness),
        transition=transition,
        observation=observation,
        report=report,
        process_noise=Continuous(Gaussian(PROCESS_NOISE)),
        measurement_noise=Gaussian({"yaw_rate": 0.003, "course": 0.004}),
        prior=Prior(
            Track(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)._replace(steer_offset=car.steer_offset or 0.0), Gaussian(SPREAD)
        ),
        inputs=("steer", "v_x"),
        angles=("course",),
    )
    reads = (
        Need("steer", "rad"),
        Need("yaw_rate", "rad/s"),
        Need("course", "rad"),
        Need("speed", "m/s"),
        Need("wheel_speed_rl", "m/s", optional=True),
        Need("wheel_speed_rr", "m/s", optional=True),
    )
    lag = satellite_lag(car)
    filter = Delayed(Extended(), {"course": lag}, DEPTH) if lag > 0 else Extended()
    return MultiRate(Filtered(model, filter, reads, Held(), what_is_told))


def what_is_told(model: StateSpace, belief: Any, row: Any) -> dict[str, Any]:
    """Which outputs are known: speed and yaw rate above `SLOWEST`; lateral velocity and sideslip there if the standard deviation
    of sideslip is below 0.02 rad; the yaw if its standard deviation is below 0.05 rad, which needs a fix."""
    std = belief.moments(model)[1]
    moving = row.u.v_x > SLOWEST
    sure = moving & (std.sideslip < 0.02)
    return {"v_x": moving, "v_y": sure, "sideslip": sure, "yaw": std.yaw < 0.05, "yaw_rate": moving}

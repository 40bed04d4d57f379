"""A single track that is corrected by the yaw rate in every row, and by the course whenever satellites speak (Nguyen, Wang, Oh,
Fujimoto, Hori 2012, [51] of the review's section 1.3.2)."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.parameter import check_parameters, positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.live import AbstractCleaning
from jaxveh.estimators.method import AbstractMethod, Answer, Filtered
from jaxveh.estimators.navigation.of_car import satellite_lag
from jaxveh.filters import Delayed, Extended
from jaxveh.io import CarSpecification
from jaxveh.statespace import Continuous, Gaussian, Prior, StateSpace

SLOWEST = 3.0
"""m/s: at less the single track is taken to go at this speed, where its steer no longer says much; sideslip is not known."""

DEPTH = 24
"""How many rows are kept for a fix that is late."""


SLIP_ERROR, SLIP_TIME = 0.004, 2.0
"""rad and s: size and memory of what a linear single track does not know of sideslip."""


class Track(NamedTuple):
    """`sideslip` (rad), `yaw_rate` (rad/s) and `yaw` (rad) of the centre of gravity as the single track has them;
    `bias_yaw_rate` (rad/s) of the gyroscope, `steer_offset` (rad) of the road wheels, and `slip_error` (rad): by how much the
    true sideslip is more, first-order Gauss-Markov."""

    sideslip: Any
    yaw_rate: Any
    yaw: Any
    bias_yaw_rate: Any
    steer_offset: Any
    slip_error: Any


class TrackReport(NamedTuple):
    """What is shown: speeds (m/s), yaw and sideslip (rad), yaw rate and its bias (rad/s), `steer_offset` (rad)."""

    v_x: Any
    v_y: Any
    yaw: Any
    sideslip: Any
    yaw_rate: Any
    bias_yaw_rate: Any
    steer_offset: Any


class LinearTrack(eqx.Module):
    """The linear single track: `mass`, `yaw_inertia`, `front_axle_to_cg`, `rear_axle_to_cg` (kg, kg m^2, m) and the axles'
    cornering stiffnesses (N/rad)."""

    mass: jax.Array = positive("kg")
    yaw_inertia: jax.Array = positive("kg m^2")
    front_axle_to_cg: jax.Array = positive("m")
    rear_axle_to_cg: jax.Array = positive("m")
    front_stiffness: jax.Array = positive("N/rad")
    rear_stiffness: jax.Array = positive("N/rad")

    def __check_init__(self):
        check_parameters(self)

    def matrices(self, v) -> tuple[Any, ...]:
        """a_11, a_12, a_21, a_22, b_1, b_2 of sideslip and yaw rate at a speed (m/s)."""
        m, J, a, b = self.mass, self.yaw_inertia, self.front_axle_to_cg, self.rear_axle_to_cg
        C_f, C_r = self.front_stiffness, self.rear_stiffness
        lever = b * C_r - a * C_f
        return (
            -(C_f + C_r) / (m * v),
            lever / (m * v * v) - 1.0,
            lever / J,
            -(a * a * C_f + b * b * C_r) / (J * v),
            C_f / (m * v),
            a * C_f / J,
        )


def transition(system: LinearTrack, t0, t1, x: Track, u) -> Track:
    """The trapezoidal rule: stable however slow the car or long the step."""
    half = 0.5 * (t1 - t0)
    v = jnp.maximum(jnp.abs(u.v_x), SLOWEST)
    a_11, a_12, a_21, a_22, b_1, b_2 = system.matrices(v)
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
    """What is measured: `yaw_rate` (rad/s) and `course` (rad)."""

    yaw_rate: Any
    course: Any


def observation(system: LinearTrack, t, x: Track, u) -> Seen:
    """Yaw rate with its bias, and the course, yaw and sideslip together."""
    del system, t, u
    return Seen(x.yaw_rate + x.bias_yaw_rate, x.yaw + x.sideslip + x.slip_error)


def report(system: LinearTrack, t, x: Track, u) -> TrackReport:
    """What is shown."""
    del system, t
    v_x, sideslip = u.v_x + 0.0 * x.sideslip, x.sideslip + x.slip_error
    return TrackReport(v_x, v_x * sideslip, x.yaw, sideslip, x.yaw_rate, x.bias_yaw_rate, x.steer_offset)


class Held(AbstractCleaning):
    """Steer and speed as they were said last: the speed of the rear wheels, or of the satellites where these are silent."""

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
    """The filter `tracked`, whose speed is told: of that it claims no spread."""

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
"""rad and rad/s, per root second."""

SPREAD = {
    "sideslip": 0.05,
    "yaw_rate": 0.5,
    "yaw": 2.0,
    "bias_yaw_rate": 0.005,
    "steer_offset": 0.01,
    "slip_error": SLIP_ERROR,
}
"""rad, rad/s: at the start, the yaw as good as unknown."""


def multi_rate_of(car: CarSpecification) -> MultiRate:
    """The filter of a car's file. The fix is put among the rows at its own time, and these are filtered anew (`Delayed`).

    Between two fixes the paper predicts the residual of the course, and corrects by it; a filter needs none there, since its
    belief already is what all measurements so far say.
    """
    numbers = ("mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg")
    stiffness = {f"{axle}_stiffness": getattr(car, f"{axle}_cornering_stiffness") for axle in ("front", "rear")}
    model = StateSpace(
        system=LinearTrack(**{name: getattr(car, name) for name in numbers}, **stiffness),
        transition=transition,
        observation=observation,
        report=report,
        process_noise=Continuous(Gaussian(PROCESS_NOISE)),
        measurement_noise=Gaussian({"yaw_rate": 0.003, "course": 0.004}),
        prior=Prior(Track(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), Gaussian(SPREAD)),
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
    """What is known: all but the yaw while the car is not slow and sideslip is certain enough; the yaw after a fix."""
    std = belief.moments(model)[1]
    moving = row.u.v_x > SLOWEST
    sure = moving & (std.sideslip < 0.02)
    return {"v_x": moving, "v_y": sure, "sideslip": sure, "yaw": std.yaw < 0.05, "yaw_rate": moving}

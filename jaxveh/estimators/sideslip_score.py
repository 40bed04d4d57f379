"""The error of a sideslip estimate against a reference, and the position at which it is measured."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_has, check_kind
from jaxveh._core.recording import Recording, check_recording
from jaxveh.diagnostics import Score, score_band
from jaxveh.estimators.linear_baseline import open_loop_of_file
from jaxveh.estimators.rear_axle import RearAxle
from jaxveh.filters import Estimate, SmoothedEstimate
from jaxveh.io import CarSpecification
from jaxveh.io import kit as io

TOGETHER = 0.1
"""Share of the rarer channel's rows; below it, two channels do not share a clock."""


def is_measured(recording: Recording, name: str) -> bool:
    """Whether the channel exists and is not NaN in every row."""
    return name in recording and bool(np.isfinite(np.asarray(recording[name])).any())


def speak_apart(recording: Recording) -> bool:
    """Whether yaw rate and lateral acceleration are measured, but hardly ever in the same row: two clocks."""
    check_recording("speak_apart", recording)
    if not (is_measured(recording, "yaw_rate") and is_measured(recording, "a_y")):
        return False
    there = [np.isfinite(np.asarray(recording[name])) for name in ("yaw_rate", "a_y")]
    return bool((there[0] & there[1]).sum() < TOGETHER * min(one.sum() for one in there))


def at_centre(car: CarSpecification | RearAxle, recording: Recording) -> Recording:
    """The recording with the `v_y` of a reference, m/s, moved to the centre of gravity from the position where the car's file
    says that it is measured (`reference_position`): less the distance of that position ahead times the yaw rate."""
    check_kind("at_centre: car", car, CarSpecification | RearAxle, "io.read_car reads a car's file.")
    check_recording("at_centre", recording)
    ahead = _reference_ahead(car)
    if not ahead:
        return recording
    return recording.replace(v_y=np.asarray(recording["v_y"]) - ahead * np.asarray(recording["yaw_rate"]))


def _reference_ahead(car: CarSpecification | RearAxle) -> float:
    place = car.reference_position if isinstance(car, CarSpecification) else None
    return 0.0 if place is None else place[0]


def reference_sideslip(recording: Recording) -> jax.Array:
    """atan2(v_y, v_x) of a recording that has v_y, rad, (T,)."""
    check_recording("reference_sideslip", recording)
    return jnp.arctan2(recording["v_y"], recording["v_x"])


def least_speed_of(car: CarSpecification) -> float:
    """Speed (m/s) below which sideslip is not scored by default: 3, and 0.5 for cars with a wheelbase of less than a metre.
    At lower speeds sideslip is the quotient of two small numbers."""
    io.check_car_file("least_speed_of", car)
    return 3.0 if car.wheelbase >= 1.0 else 0.5


def score(
    car: CarSpecification, found: Estimate | SmoothedEstimate, recording: Recording, *, least_speed: float | None = None
) -> dict[str, float]:
    """Errors of an estimate against a reference recording with `v_y`, next to those of the open-loop linear model: the car's
    file with linear tyres, steered from rest, which is the do-nothing baseline. Both are compared at the position where the
    file says that the reference is measured (`reference_position`).

    Uses the rows in which the reference is finite and `v_x` at least `least_speed` (m/s, default `least_speed_of`).
    **Returns** by name the numbers of `diagnostics.Score`, for sideslip in degrees (`sideslip_rmse_deg`) and for v_y in m/s:
    the error as measured, its constant part and the rest (an INS that is turned by half a degree against the car shows this
    angle in every row), the largest error, coverage of the bands, CRPS; the errors of the baseline as
    `open_loop_sideslip_...`, if the angles of the road wheels were measured; `rows` and `least_speed`.

    **Raises** `InputError` if no row is left.
    """
    io.check_car_file("score", car)
    check_has("score: found", found, ("mean", "std"), "estimators.sideslip.estimate returns one.")
    check_recording("score", recording)
    v_y, v_x = np.asarray(recording["v_y"]), np.asarray(recording["v_x"])
    floor = least_speed_of(car) if least_speed is None else least_speed
    ahead = _reference_ahead(car)
    there = lambda v_y, turning: np.asarray(v_y) + (ahead * np.asarray(turning["yaw_rate"]) if ahead else 0.0)
    mean = there(found["v_y"], recording)
    fast = (v_x >= floor) & np.isfinite(mean)
    if not (fast & np.isfinite(v_y)).any():
        raise InputError(
            f"score: no row has both a reference v_y and a speed of at least {floor:g} m/s; there is nothing to score against."
        )
    degrees = lambda v_y: np.degrees(np.arctan2(v_y, v_x))
    stds = np.degrees(np.asarray(found.std.sideslip)), np.asarray(found.std.v_y)
    sideslip = score_band(degrees(v_y), degrees(mean), stds[0], fast)
    named = _named("sideslip", "_deg", sideslip) | _named("v_y", "", score_band(v_y, mean, stds[1], fast))
    baseline = open_loop_of_file(car, recording)
    if baseline is not None:
        plain = score_band(degrees(v_y), degrees(there(baseline["v_y"], baseline)), which=fast)
        told = _named("open_loop_sideslip", "_deg", plain)
        named |= {name: value for name, value in told.items() if not np.isnan(value)}
    return named | {"rows": sideslip.rows, "least_speed": floor}


def _named(quantity: str, unit: str, found: Score) -> dict[str, float]:
    """A score's numbers by their names in the JSON file; shares have no unit."""
    numbers = found._asdict()
    del numbers["rows"]
    return {f"{quantity}_{name}{'' if name.startswith('coverage') else unit}": value for name, value in numbers.items()}

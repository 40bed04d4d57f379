"""Corrects late sensors: an accelerometer, timed against the yaw rate, and all channels behind a low-pass."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jaxveh._core.errors import warn
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import kit as diagnostics
from jaxveh.estimators.cleaning import without_wild_values
from jaxveh.estimators.coarse_log import coarse_logs
from jaxveh.estimators.rear_axle import RearAxle
from jaxveh.estimators.variety import QUIET, variety
from jaxveh.io import CarSpecification

USUAL, SOFTER = 0.12, 0.7
"""A delay of up to `USUAL` s is left uncorrected: in a fleet of cars without any delay, whose rear axles were fitted, up to
0.09 s were found (tyres near their limit). For a car that was not fitted, `SOFTER` times its own lag is added: a softer axle
looks alike."""

ALIKE = 0.85
"""Correlation below which no delay is estimated."""

SURE, WINDOW = 3.0, 0.2
"""A delay must change a_y, in means over `WINDOW` s, by more than `SURE` times what roads and offsets do (`variety.QUIET`) over
the root of the log's `variety`: on slow ramps of steer and circles, slow errors of a_y look like delays of 0.1 to 0.5 s."""


def a_y_delay(fitted: CarSpecification, told: CarSpecification, recordings: Sequence[Recording]) -> float:
    """The delay of a_y (s) in the logs of a car, all taken together; 0 where it is within the usual range.

    The `fitted` car is tried first. A fit may mistake a delay for a soft axle, so the car as `told` (as given) is tried next;
    its delay counts only if it exceeds the error that a wrong stiffness could cause. A `JaxvehWarning` reports a delay that was
    found.
    """
    recordings = [without_wild_values(one, told.wheelbase) for one in recordings]
    for car, softer in ((fitted, 0.0), (told, SOFTER)):
        usual = USUAL + softer * max(_lag(car, one) for one in recordings)
        seconds, error = _found(car, recordings)
        if abs(seconds) > usual + 3 * error and _is_felt(recordings, seconds, told.wheelbase):
            _warn(seconds, error)
            return seconds
    return 0.0


def _found(car: CarSpecification, recordings: Sequence[Recording]) -> tuple[float, float]:
    """The delay of a_y against the yaw rate by the car's model, and its standard error (s); (0, 0) where it cannot be timed."""
    found = [diagnostics.a_y_delay(one, car) for one in recordings]
    sure = [one for one in found if one is not None and one.correlation > ALIKE and np.isfinite(one.error)]
    if not sure:
        return 0.0, 0.0
    weights = np.array([1 / max(one.error, 1e-3) ** 2 for one in sure])
    return float(np.average([one.seconds for one in sure], weights=weights)), float(weights.sum() ** -0.5)


def _is_felt(recordings: Sequence[Recording], seconds: float, wheelbase: float) -> bool:
    """Whether these logs tell a delay from slow errors of a_y."""
    change = np.concatenate([_change(one, seconds) for one in recordings])
    size = np.sqrt(np.mean(change**2)) if change.size else 0.0
    return bool(size * variety(coarse_logs(recordings, wheelbase)) ** 0.5 > SURE * QUIET)


def _change(recording: Recording, seconds: float) -> np.ndarray:
    """By how much v_x yaw_rate changes within these seconds, m/s^2, in means over `WINDOW`."""
    turning = np.asarray(recording["v_x"], float) * np.asarray(recording["yaw_rate"], float)
    known = np.isfinite(turning)
    time, turning = np.asarray(recording.time, float)[known], turning[known]
    integral = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time) * (turning[1:] + turning[:-1]))])
    mean = lambda at: np.diff(np.interp([at - WINDOW / 2, at + WINDOW / 2], time, integral), axis=0)[0] / WINDOW
    inner = time[(time > time[0] + WINDOW + abs(seconds)) & (time < time[-1] - WINDOW - abs(seconds))]
    return mean(inner) - mean(inner - seconds)


def _lag(car: CarSpecification, recording: Recording) -> float:
    """The lag of a linear car's a_y behind v_x yaw_rate (s): `v_x a m / (L C_r)` at its usual speed."""
    speed = max(float(np.nanquantile(np.asarray(recording["v_x"]), 0.75)), 0.0)
    return speed * car.front_axle_to_cg * car.mass / (car.wheelbase * float(car.rear_cornering_stiffness or np.inf))


def _warn(seconds: float, error: float) -> None:
    words = f"{abs(seconds) * 1e3:.0f} ms (+-{2e3 * error:.0f}) too {'late' if seconds > 0 else 'early'}"
    warn(
        f"sideslip: a_y comes {words}, judged by the car's model and yaw_rate; it is shifted by as much, and the car fitted "
        "again. A remaining delay, up to 0.05 s, makes the estimate worse: correct the channel at its source."
    )


FELT = ("a_x", "a_y", "yaw_rate", "steer_rear")
"""Channels that may be behind the low-pass of a car's file (`low_pass`); `RearSteer` has given its angle the same delay."""


def on_time(recording: Recording, system: RearAxle) -> Recording:
    """The recording with delayed channels moved to the right time: all of `FELT` by the delay of their low-pass, a_y by its own
    delay as well."""
    low_pass, a_y = float(system.sensor_delay), float(system.a_y_delay)
    late = {name: low_pass + (a_y if name == "a_y" else 0.0) for name in FELT if name in recording}
    moved = {name: _earlier(recording, name, by) for name, by in late.items() if by}
    if "steer_rear" in moved:
        # An input, which every row must have.
        time, angle = np.asarray(recording.time, float), np.asarray(recording["steer_rear"])
        moved["steer_rear"] = np.interp(time + late["steer_rear"], time, angle).astype(angle.dtype)
    return recording.replace(**moved)


def _earlier(recording: Recording, name: str, seconds: float) -> np.ndarray:
    """A channel moved earlier by `seconds`, sample by sample, so that stuck or missing samples stay so."""
    time, values = np.asarray(recording.time, float), np.asarray(recording[name])
    wanted = time + seconds
    after = np.clip(np.searchsorted(time, wanted), 1, len(time) - 1)
    nearest = np.where(wanted - time[after - 1] < time[after] - wanted, after - 1, after)
    far = np.abs(time[nearest] - wanted) > np.median(np.diff(time))
    return np.where(far, np.nan, values[nearest]).astype(values.dtype)

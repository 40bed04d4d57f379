"""Sensors that speak late, and are put right: an accelerometer, found against the yaw rate, and all behind a low-pass."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from jaxveh._core.errors import JaxvehWarning
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import kit as diagnostics
from jaxveh.estimators.cleaning import without_wild_values
from jaxveh.estimators.rear_axle import RearAxle
from jaxveh.io import CarSpecification

USUAL, SOFTER = 0.12, 0.7
"""A delay of up to `USUAL` s is left as it is: in a fleet of cars without any, whose rear axles were fitted, up to 0.09 s were
found (tyres near their limit). Of a car that was not fitted so is this share of its own lag: a softer one looks alike."""

ALIKE = 0.85
"""Correlation below which nothing is timed."""


def a_y_delay(fitted: CarSpecification, told: CarSpecification, recordings: Sequence[Recording]) -> float:
    """By how many seconds a_y comes late in the logs of a car, all taken together; 0 where it is as usual.

    It is told by the `fitted` car, and else, since a fit may take a delay for a soft axle, by the car as it was `told`, if it is
    more than that could be wrong. A `JaxvehWarning` says so where there is one.
    """
    recordings = [without_wild_values(one, told.wheelbase) for one in recordings]
    for car, softer in ((fitted, 0.0), (told, SOFTER)):
        usual = USUAL + softer * max(_lag(car, one) for one in recordings)
        seconds, error = _found(car, recordings)
        if abs(seconds) > usual + 3 * error:
            _warn(seconds, error)
            return seconds
    return 0.0


def _found(car: CarSpecification, recordings: Sequence[Recording]) -> tuple[float, float]:
    """The delay by what a car makes of the yaw rate, and its standard error, s; nothing where it cannot be timed."""
    found = [diagnostics.a_y_delay(one, car) for one in recordings]
    sure = [one for one in found if one is not None and one.correlation > ALIKE and np.isfinite(one.error)]
    if not sure:
        return 0.0, 0.0
    weights = np.array([1 / max(one.error, 1e-3) ** 2 for one in sure])
    return float(np.average([one.seconds for one in sure], weights=weights)), float(weights.sum() ** -0.5)


def _lag(car: CarSpecification, recording: Recording) -> float:
    """By how much a linear car's a_y comes after v_x yaw_rate, s: `v_x a m / (L C_r)` at its usual speed."""
    speed = max(float(np.nanquantile(np.asarray(recording["v_x"]), 0.75)), 0.0)
    return speed * car.front_axle_to_cg * car.mass / (car.wheelbase * float(car.rear_cornering_stiffness or np.inf))


def _warn(seconds: float, error: float) -> None:
    words = f"{abs(seconds) * 1e3:.0f} ms (+-{2e3 * error:.0f}) too {'late' if seconds > 0 else 'early'}"
    warnings.warn(
        f"sideslip: a_y comes {words} by what the car makes of yaw_rate; it is shifted by as much, and the car fitted again. "
        "What is left of it, up to 0.05 s, makes the estimate worse: put the channel right where it is made.",
        JaxvehWarning,
        stacklevel=4,
    )


FELT = ("a_x", "a_y", "yaw_rate")
"""Channels behind the low-pass that a car's file may have (`low_pass`)."""


def on_time(recording: Recording, system: RearAxle) -> Recording:
    """The recording with what the sensors said late where it belongs: all of `FELT` by the delay of their low-pass, a_y by its
    own beside."""
    low_pass, a_y = float(system.sensor_delay), float(system.a_y_delay)
    late = {name: low_pass + (a_y if name == "a_y" else 0.0) for name in FELT if name in recording}
    return recording.replace(**{name: _earlier(recording, name, by) for name, by in late.items() if by})


def _earlier(recording: Recording, name: str, seconds: float) -> np.ndarray:
    """A channel as it was said `seconds` later, sample by sample, so that what is stuck or missing stays so."""
    time, values = np.asarray(recording.time, float), np.asarray(recording[name])
    wanted = time + seconds
    after = np.clip(np.searchsorted(time, wanted), 1, len(time) - 1)
    nearest = np.where(wanted - time[after - 1] < time[after] - wanted, after - 1, after)
    far = np.abs(time[nearest] - wanted) > np.median(np.diff(time))
    return np.where(far, np.nan, values[nearest]).astype(values.dtype)

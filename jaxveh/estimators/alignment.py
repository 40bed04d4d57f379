"""Accelerometers that speak late: found against the yaw rate, and taken out."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from jaxveh._core.errors import JaxvehWarning
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import kit as diagnostics
from jaxveh.estimators.cleaning import without_wild_values
from jaxveh.io import CarSpecification

USUAL = 0.12
"""s: a delay up to this is left as it is: in a fleet of cars without any, up to 0.09 s were found (tyres near their limit)."""

ALIKE = 0.85
"""Correlation below which nothing is timed."""


def a_y_delay(fitted: CarSpecification, recordings: Sequence[Recording]) -> float:
    """By how many seconds a_y comes late in the logs of a car whose rear axle was fitted to them, all taken together; 0 where
    that is no more than `USUAL`.

    A `JaxvehWarning` says so where it is not. The file of a car that was not fitted will not do: a wrong stiffness looks alike.
    """
    found = [
        diagnostics.a_y_delay(without_wild_values(one, fitted.wheelbase), fitted) for one in recordings if "a_y" in one
    ]
    sure = [one for one in found if one is not None and one.correlation > ALIKE and np.isfinite(one.error)]
    if not sure:
        return 0.0
    weights = np.array([1 / max(one.error, 1e-3) ** 2 for one in sure])
    seconds = float(np.average([one.seconds for one in sure], weights=weights))
    error = float(weights.sum() ** -0.5)
    if abs(seconds) <= USUAL + 3 * error:
        return 0.0
    words = f"{abs(seconds) * 1e3:.0f} ms (+-{2e3 * error:.0f}) too {'late' if seconds > 0 else 'early'}"
    warnings.warn(
        f"sideslip: a_y comes {words} by what the fitted car makes of yaw_rate; it is shifted by as much, and the car fitted "
        "again. What is left of it, up to 0.05 s, makes the estimate worse: put the channel right where it is made.",
        JaxvehWarning,
        stacklevel=3,
    )
    return seconds


def shift_a_y(recording: Recording, seconds: float) -> Recording:
    """The recording with its a_y as it was said `seconds` later, sample by sample, so that what is stuck or missing stays so."""
    if seconds == 0 or "a_y" not in recording:
        return recording
    time, a_y = np.asarray(recording.time, float), np.asarray(recording["a_y"])
    wanted = time + seconds
    after = np.clip(np.searchsorted(time, wanted), 1, len(time) - 1)
    nearest = np.where(wanted - time[after - 1] < time[after] - wanted, after - 1, after)
    far = np.abs(time[nearest] - wanted) > np.median(np.diff(time))
    return recording.replace(a_y=np.where(far, np.nan, a_y[nearest]).astype(a_y.dtype))

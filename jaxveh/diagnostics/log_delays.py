"""Delays between channels, from the peak of their cross-correlation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh._core.recording import Recording
from jaxveh.diagnostics.log_findings import LogFinding, LogView
from jaxveh.diagnostics.log_single_track import (
    a_y_from_yaw_rate,
    steady_v_y,
    understeer_gradient,
    yaw_rate_from_steer,
)
from jaxveh.io import CarSpecification

REACH = 0.5
"""Longest delay that is searched for, s."""

ALIKE = 0.6
"""Correlation below which two channels are too different for a delay between them."""

AROUND = 0.04
"""Half the width of the parabola through the peak, s."""

ALIKE_ROWS = 0.2
"""Time whose rows count as one independent sample, s."""

EXACT = 0.02
"""Largest delay without a warning between two channels that are related exactly, s."""

SMOOTH = 0.2
"""Length of the moving average of both channels, s."""

MODELLED = 0.06
"""Largest delay without a warning between two channels that are related by a linear model of the car, s."""


STIFFNESSES, SLOPES = "Wrong stiffnesses in the car's file", "Slopes and bends"
"""What looks like a delay to a model of the car, and to the rate of speed without v_y."""

DOUBTFUL = 0.15
"""Delay up to which one that a linear model of the car shows may be due to the car's file, s."""


class Delay(NamedTuple):
    """The delay of a signal after its reference in `seconds`, its standard `error`, and the `correlation` at that delay."""

    seconds: float
    error: float
    correlation: float


def delay(reference: np.ndarray, signal: np.ndarray, step: float, reach: float = REACH) -> Delay:
    """Return the delay of `signal` after `reference`.

    Both are (N,) on an even grid of `step` seconds, NaN where missing. The peak of the normalised cross-correlation within
    +-`reach` is refined by a parabola through its neighbours within `AROUND`. The error is the larger of that from the curvature
    and that from the farthest lag whose likelihood is lower by a factor of exp(-2) at most (two standard deviations), where
    `ALIKE_ROWS` seconds count as one sample. The delay is NaN if there is no inner peak.
    """
    most = min(round(reach / step), reference.size // 4)
    found = _correlations(reference, signal, most)
    if not np.isfinite(found).all():
        return Delay(np.nan, np.inf, 0.0)
    peak = int(np.argmax(found))
    width = min(max(round(AROUND / step), 1), peak, found.size - 1 - peak)
    if width == 0:
        return Delay(np.nan, np.inf, float(found[peak]))
    near = np.arange(-width, width + 1)
    bend, slope, top = np.polyfit(near, found[peak - width : peak + width + 1], 2)
    if bend >= 0 or not 0 < top <= 1 + 1e-6:
        return Delay(np.nan, np.inf, float(found[peak]))
    samples = max(np.isfinite(reference * signal).sum() * step / ALIKE_ROWS, 1.0)
    error = step * np.sqrt(max(1 - top**2, 0.0) / (2 * top * -bend * samples))
    # The peak may be due to noise: other lags that explain the signal nearly as well count too.
    worse = 0.5 * samples * np.log((1 - found**2 + 1e-12) / (1 - found[peak] ** 2 + 1e-12))
    rivals = np.flatnonzero((worse < 2.0) & (found > 0))
    error = max(error, 0.5 * step * np.abs(rivals - peak).max())
    seconds = step * (peak - most + np.clip(-slope / (2 * bend), -width, width))
    return Delay(float(seconds), float(error), float(found[peak]))


def check_delays(log: LogView) -> list[LogFinding]:
    """Check the delays of a_y and a_x after the speeds and the gyroscope, and of yaw rate after steer."""
    findings = []
    if log.has("v_x", "yaw_rate", "a_y"):
        findings.append(_lateral(log))
    if log.has("v_x", "a_x"):
        findings.append(_longitudinal(log))
    if log.has("steer", "yaw_rate", "v_x"):
        findings.append(_steering(log))
    return findings


def _longitudinal(log: LogView) -> LogFinding:
    """Compare a_x with the rate of speed; in bends it also contains v_y yaw_rate, which without v_y is that of a steady turn."""
    speed, change = log.even("v_x"), log.slope(log.even("v_x"))
    if not log.has("yaw_rate"):
        return _judge(log, "a_x", "dv_x/dt", change, "", MODELLED, SLOPES)
    if log.has("v_y"):
        return _judge(log, "a_x", "dv_x/dt", change - log.even("v_y") * log.even("yaw_rate"), "", EXACT)
    if log.car is not None:
        yaw_rate = log.even("yaw_rate")
        change = change - steady_v_y(log.car, yaw_rate, log.rear_steer(), speed) * yaw_rate
    return _judge(log, "a_x", "dv_x/dt", change, "", MODELLED, SLOPES)


def _lateral(log: LogView) -> LogFinding:
    speed, yaw_rate = log.even("v_x"), log.even("yaw_rate")
    if log.has("v_y"):
        reference = speed * yaw_rate + log.slope(log.even("v_y"))
        return _judge(log, "a_y", "v_x yaw_rate + dv_y/dt", reference, "", EXACT)
    if log.car is not None:
        reference = _a_y_expected(log, log.car)
        return _judge(
            log, "a_y", "the prediction of the car's linear model from yaw_rate", reference, "", MODELLED, STIFFNESSES
        )
    caveat = " Without v_y or a car, this includes the sideslip's own lag of up to 0.2 s at speed."
    return _judge(log, "a_y", "v_x yaw_rate", speed * yaw_rate, caveat, np.inf)


def _a_y_expected(log: LogView, car: CarSpecification) -> np.ndarray:
    """Return the a_y that the car's linear model predicts from yaw_rate, on the grid."""
    seen = log.even("yaw_rate"), log.rear_steer(), log.even("v_x")
    known = np.isfinite(sum(seen))
    if not known.any():
        return np.full(known.shape, np.nan)
    # Bridged: the angle of the rear wheels is differentiated.
    yaw_rate, rear, v_x = (np.interp(log.grid, log.grid[known], values[known]) for values in seen)
    return np.where(known, a_y_from_yaw_rate(car, yaw_rate, rear, v_x, log.step), np.nan)


def a_y_delay(recording: Recording, car: CarSpecification) -> Delay | None:
    """Return the delay of a_y after the prediction of a car's linear model from yaw_rate; None if a channel is missing.

    A stiffness that is wrong by a factor of two causes an error of some 0.05 s, and so do tyres near their limit.
    """
    log = LogView.of(recording, car)
    if not log.has("v_x", "yaw_rate", "a_y"):
        return None
    a_y = log.while_moving(log.even("a_y"))
    return delay(log.smooth(_a_y_expected(log, car), SMOOTH), log.smooth(a_y, SMOOTH), log.step)


def _steering(log: LogView) -> LogFinding:
    steer = log.even("steer")
    if log.car is None:
        caveat = " Without a car, this includes its own response of some 0.1 s."
        return _judge(log, "yaw_rate", "steer", log.while_moving(steer), caveat, np.inf)
    expected = yaw_rate_from_steer(log.car, steer, log.rear_steer(), log.even("v_x"), log.step)
    if understeer_gradient(log.car) < 0.0:
        caveat = " The car's file oversteers: such a car answers late at speed."
        return _judge(log, "yaw_rate", "the prediction of the car's linear model from steer", expected, caveat, np.inf)
    return _judge(
        log, "yaw_rate", "the prediction of the car's linear model from steer", expected, "", MODELLED, STIFFNESSES
    )


def _judge(
    log: LogView, name: str, other: str, reference: np.ndarray, caveat: str, tolerance: float, alike: str = ""
) -> LogFinding:
    # The same symmetric average on both sides removes noise and delays neither.
    found = delay(log.smooth(reference, SMOOTH), log.smooth(log.even(name), SMOOTH), log.step)
    values = {name: value for name, value in found._asdict().items() if np.isfinite(value)}
    if not (found.correlation > ALIKE and np.isfinite(found.seconds)):
        message = f"has no clear delay after {other}: they are too different (correlation {found.correlation:.2f})."
        return LogFinding("note", name, message, values)
    size, sure = abs(found.seconds), 2 * found.error
    words = (
        f"comes {size * 1e3:.0f} ms (+-{sure * 1e3:.0f}) {'after' if found.seconds >= 0 else 'before'} {other}.{caveat}"
    )
    if size <= max(tolerance if np.isfinite(tolerance) else 0.0, 0.75 * log.step, 3 * found.error):
        return LogFinding("ok", name, words, values)
    if np.isinf(tolerance):
        return LogFinding("note", name, words, values)
    advice = "Shift the channel by this delay before estimating."
    if alike and size < DOUBTFUL:
        advice = f"{alike} look alike: shift the channel only if you know that it is late."
    return LogFinding("warning", name, f"{words} {advice}", values)


def _correlations(reference: np.ndarray, signal: np.ndarray, most: int) -> np.ndarray:
    """Return Pearson's correlation (2 most + 1,) of reference[k] with signal[k + lag] over the rows known on both sides."""
    known = np.isfinite(reference), np.isfinite(signal)
    if min(known[0].sum(), known[1].sum()) < 20:
        return np.full(2 * most + 1, np.nan)
    size = int(2 ** np.ceil(np.log2(reference.size + most + 1)))
    first, second = (
        np.fft.rfft([mask, filled, filled**2], n=size)
        for mask, values in zip(known, (reference, signal), strict=True)
        for filled in [np.where(mask, values - values[mask].mean(), 0.0)]
    )

    def summed(i: int, j: int) -> np.ndarray:
        products = np.fft.irfft(np.conj(first[i]) * second[j], n=size)
        return np.concatenate([products[-most:], products[: most + 1]]) if most else products[:1]

    count = np.where(summed(0, 0) > 19.5, summed(0, 0), np.nan)
    shared = summed(1, 1) - summed(1, 0) * summed(0, 1) / count
    spread = summed(2, 0) - summed(1, 0) ** 2 / count, summed(0, 2) - summed(0, 1) ** 2 / count
    # A constant leaves only rounding errors after the transforms.
    tiny = [1e-12 * abs(terms[2, 0]) for terms in (first, second)]
    moves = (spread[0] > tiny[0]) & (spread[1] > tiny[1])
    return np.where(moves, shared / np.sqrt(np.where(moves, spread[0] * spread[1], 1.0)), np.nan)

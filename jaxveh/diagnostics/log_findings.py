"""The findings of the checks of a log, and the view of a log that the checks share."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from jaxveh._core.recording import Recording, check_recording
from jaxveh.io import CarSpecification

SEVERITIES = ("ok", "note", "warning", "error")
"""Severities: nothing to do; worth knowing; estimates will be worse; estimates will be wrong."""

GRAVITY = 9.81
"""Gravity, m/s^2."""


MOVING, WHEELBASE = 5.0, 2.7
"""Speed above which directions are compared (m/s), for a car of this wheelbase (m); it scales with the root of the wheelbase."""


LAGGING = 2.0
"""Time that the sideslip angle of a slow car, or a late compass, takes at most, s."""


class LogFinding(NamedTuple):
    """One finding: its `severity` (of `SEVERITIES`), the `channel` concerned, a `message` in words, `values` by name; `instead`:
    other channels, one of which may be the wrong one."""

    severity: str
    channel: str
    message: str
    values: dict[str, float]
    instead: tuple[str, ...] = ()

    @property
    def suspects(self) -> set[str]:
        """The channels of which one or all may be wrong."""
        return {*self.channel.split(", "), *self.instead}


def shown_time(seconds: float, end: float | None = None) -> str:
    """Return a time of a log for a message, to a tenth of a millisecond: also one that counts from 1970. With `end`: from, to."""
    shown = f"{round(float(seconds), 4):.15g}"
    return shown if end is None else f"{shown} to {shown_time(end)}"


@dataclass(frozen=True)
class LogView:
    """A recording as NumPy arrays in float64: `time` (T,), `channels` name to (T,), and the `car`, None if unknown."""

    time: np.ndarray
    channels: dict[str, np.ndarray]
    car: CarSpecification | None

    @classmethod
    def of(cls, recording: Recording, car: CarSpecification | None) -> LogView:
        """Make a view of the measured channels of a recording, without a simulation's truth."""
        check_recording("check_log", recording)
        names = [name for name in recording.names if not name.startswith("true.")]
        channels = {name: np.asarray(recording[name], dtype=np.float64) for name in names}
        return cls(np.asarray(recording.time, dtype=np.float64), channels, car)

    def has(self, *names: str) -> bool:
        """Whether all of these channels are present with at least ten finite samples."""
        return all(name in self.channels and np.isfinite(self.channels[name]).sum() >= 10 for name in names)

    @cached_property
    def grid(self) -> np.ndarray:
        """Even time stamps (N,) with the usual step of the fastest channel, for correlations and derivatives."""
        masks = [np.isfinite(values) for values in self.channels.values()]
        steps = [np.median(np.diff(self.time[mask])) for mask in masks if mask.sum() > 1]
        if not steps:
            return self.time[:1]
        step = min(steps)
        return self.time[0] + step * np.arange(int(np.floor((self.time[-1] - self.time[0]) / step + 1e-6)) + 1)

    @property
    def step(self) -> float:
        """Spacing of `grid` in seconds."""
        return float(self.grid[1] - self.grid[0]) if self.grid.size > 1 else np.nan

    def even(self, name: str) -> np.ndarray:
        """Return a channel on `grid`, linear between its samples; NaN outside them, and in gaps over 0.5 s and 2.5 steps."""
        values = self.channels[name]
        known = np.isfinite(values)
        time = self.time[known]
        on_grid = np.interp(self.grid, time, values[known])
        after = np.clip(np.searchsorted(time, self.grid), 1, time.size - 1)
        longest = max(0.5, 2.5 * float(np.median(np.diff(time))))
        hair = 1e-6 * self.step  # the grid meets time stamps up to rounding
        inside_gap = (self.grid > time[after - 1] + hair) & (self.grid < time[after] - hair)
        on_grid[inside_gap & (time[after] - time[after - 1] > longest)] = np.nan
        on_grid[(self.grid < time[0] - hair) | (self.grid > time[-1] + hair)] = np.nan
        return on_grid

    def rear_steer(self) -> np.ndarray:
        """Return the angle of the rear wheels (N,) on `grid`, rad; zeros for a car that does not steer them and a log without."""
        steered = self.car is not None and not self.car.steers_front_alone and self.has("steer_rear")
        return self.even("steer_rear") if steered else np.zeros_like(self.grid)

    @property
    def least_speed(self) -> float:
        """Speed (m/s) above which directions are compared: `MOVING`, but less for small cars."""
        return MOVING * min(1.0, ((self.car.wheelbase if self.car else WHEELBASE) / WHEELBASE) ** 0.5)

    def while_moving(self, values: np.ndarray) -> np.ndarray:
        """Return values (N,) on `grid`, NaN where the car is slower than `least_speed` or its speed is unknown."""
        with np.errstate(invalid="ignore"):
            return np.where(self.even("v_x") > self.least_speed, values, np.nan)

    def slope(self, values: np.ndarray) -> np.ndarray:
        """Return the time derivative (N,) on `grid`."""
        return np.gradient(values, self.step)

    def smooth(self, values: np.ndarray, seconds: float = 0.1) -> np.ndarray:
        """Return the symmetric moving average (N,) on `grid`, which adds no delay; the ends and rows beside NaN are NaN."""
        count = 2 * round(seconds / self.step / 2) + 1
        if count >= values.size:
            return np.full_like(values, np.nan)
        return np.convolve(values, np.full(count, 1 / count), "same") * _inside(values.size, count // 2)

    def is_slow(self, values: np.ndarray) -> bool:
        """Whether averages of values (N,) over `LAGGING` seconds keep half of their deviation. In quicker motions the rate of the
        sideslip angle and delays change slopes and signs of what agrees in slow ones."""
        slow = self.smooth(values, LAGGING)
        both = np.isfinite(values) & np.isfinite(slow)
        return bool(both.any() and np.std(slow[both]) > 0.5 * np.std(values[both]))


def _inside(size: int, edge: int) -> np.ndarray:
    inside = np.ones(size)
    inside[:edge] = inside[size - edge :] = np.nan
    return inside


def without_jumps(angles: np.ndarray) -> np.ndarray:
    """Return angles (n,), in radians or degrees, without the jumps of a full turn if they are wrapped."""
    # A wrapped angle stays within a turn: of radians if it fits into one.
    turn = 2.0 * np.pi if np.ptp(angles) < 6.3 else 360.0
    jumps = np.max(np.abs(np.diff(angles)), initial=0.0) > 0.5 * turn
    return np.unwrap(angles, period=turn) if jumps and np.ptp(angles) <= 1.01 * turn else angles


AGREE = 0.5
"""Correlation above which two channels count as related."""

SCALED = 0.8
"""Correlation above which a slope other than 1 is attributed to a unit; below it a channel may be damaged or late."""

SAME = 1.35
"""Ratio up to which two channels that must agree do: scales and offsets of sensors, and motions that a relation leaves out."""


def is_one(slope: float) -> bool:
    """Whether a slope of one channel over another, which should be 1, is, within `SAME`."""
    return slope > 0 and bool(abs(np.log(slope)) < np.log(SAME))


_ALIKE = 10


def fit(target: np.ndarray, *regressors: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Fit by least squares with an intercept over the finite rows, and again without rows 4 robust deviations off.

    Returns coefficients (1 + regressors,), the intercept first, their standard errors (ten neighbouring rows count as
    one, because they are correlated), and the correlation of the fit with the target. With fewer than ten rows the result is
    zeros, infinite errors and no correlation.
    """
    rows = np.stack([np.ones_like(target), *regressors], axis=1)
    finite = np.isfinite(target) & np.isfinite(rows).all(axis=1)
    rows, target = rows[finite], target[finite]
    if target.size < 10:
        return np.zeros(rows.shape[1]), np.full(rows.shape[1], np.inf), 0.0
    keep = np.ones(target.size, bool)
    for _ in range(2):
        solution = np.linalg.lstsq(rows[keep], target[keep], rcond=None)[0]
        residual = target - rows @ solution
        keep = np.abs(residual) <= 4 * 1.4826 * np.median(np.abs(residual)) + 1e-12
    variance = np.var(residual[keep]) * _ALIKE * np.linalg.pinv(rows[keep].T @ rows[keep])
    fitted = (rows @ solution)[keep]
    flat = np.std(fitted) < 1e-12 or np.std(target[keep]) < 1e-12
    correlation = 0.0 if flat else float(np.corrcoef(fitted, target[keep])[0, 1])
    return solution, np.sqrt(np.abs(np.diag(variance))), correlation

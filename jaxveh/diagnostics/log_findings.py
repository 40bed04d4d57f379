"""What a check of a log says, and the view of a log that the checks share."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from jaxveh._core.recording import Recording
from jaxveh.io import CarSpecification

SEVERITIES = ("ok", "note", "warning", "error")
"""From nothing to do, over worth knowing, to: estimates will suffer, estimates will be wrong."""

GRAVITY = 9.81
"""m/s^2"""


MOVING, WHEELBASE = 5.0, 2.7
"""m/s above which directions are compared, of a car of this wheelbase (m); of others by its square root."""


class LogFinding(NamedTuple):
    """One finding: `severity` (of `SEVERITIES`), the `channel` it is about, `message` in words, `values` by name."""

    severity: str
    channel: str
    message: str
    values: dict[str, float]


@dataclass(frozen=True)
class LogView:
    """A recording as NumPy arrays in float64: `time` (T,), `channels` name to (T,), and the car, if it is known."""

    time: np.ndarray
    channels: dict[str, np.ndarray]
    car: CarSpecification | None

    @classmethod
    def of(cls, recording: Recording, car: CarSpecification | None) -> LogView:
        """The measured channels of a recording; a simulation's truth is no log."""
        names = [name for name in recording.names if not name.startswith("true.")]
        channels = {name: np.asarray(recording[name], dtype=np.float64) for name in names}
        return cls(np.asarray(recording.time, dtype=np.float64), channels, car)

    def has(self, *names: str) -> bool:
        """Whether every one of these channels is there with at least ten finite samples."""
        return all(name in self.channels and np.isfinite(self.channels[name]).sum() >= 10 for name in names)

    @cached_property
    def grid(self) -> np.ndarray:
        """Even stamps (N,) with the fastest channel's usual step, for everything that correlates or differentiates."""
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
        """A channel on `grid`, linear between its samples; NaN outside them and in gaps over 0.5 s or 2.5 steps."""
        values = self.channels[name]
        known = np.isfinite(values)
        time = self.time[known]
        on_grid = np.interp(self.grid, time, values[known])
        after = np.clip(np.searchsorted(time, self.grid), 1, time.size - 1)
        longest = max(0.5, 2.5 * float(np.median(np.diff(time))))
        hair = 1e-6 * self.step  # the grid meets stamps but for rounding
        inside_gap = (self.grid > time[after - 1] + hair) & (self.grid < time[after] - hair)
        on_grid[inside_gap & (time[after] - time[after - 1] > longest)] = np.nan
        on_grid[(self.grid < time[0] - hair) | (self.grid > time[-1] + hair)] = np.nan
        return on_grid

    @property
    def least_speed(self) -> float:
        """Speed (m/s) above which directions are compared: `MOVING`, and less for small cars."""
        return MOVING * min(1.0, ((self.car.wheelbase if self.car else WHEELBASE) / WHEELBASE) ** 0.5)

    def while_moving(self, values: np.ndarray) -> np.ndarray:
        """Values (N,) on `grid`, NaN where the car is slower than `least_speed` or its speed is not known."""
        with np.errstate(invalid="ignore"):
            return np.where(self.even("v_x") > self.least_speed, values, np.nan)

    def slope(self, values: np.ndarray) -> np.ndarray:
        """Time derivative (N,) on `grid`."""
        return np.gradient(values, self.step)

    def smooth(self, values: np.ndarray, seconds: float = 0.1) -> np.ndarray:
        """Moving average (N,) on `grid`, symmetric, so that it delays nothing; the ends and rows beside NaN are NaN."""
        count = 2 * round(seconds / self.step / 2) + 1
        if count >= values.size:
            return np.full_like(values, np.nan)
        return np.convolve(values, np.full(count, 1 / count), "same") * _inside(values.size, count // 2)


def _inside(size: int, edge: int) -> np.ndarray:
    inside = np.ones(size)
    inside[:edge] = inside[size - edge :] = np.nan
    return inside


_ALIKE = 10


def fit(target: np.ndarray, *regressors: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Least squares with an intercept over the finite rows, once more without what is 4 robust deviations off.

    Returns coefficients (1 + regressors,), the intercept first, their standard errors (ten neighbouring rows count as
    one, for they are alike), and the correlation of the fit with the target. Fewer than ten rows tell nothing: zeros,
    infinite errors, no correlation.
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

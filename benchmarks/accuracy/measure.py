"""One line of the table: the score of a log's setting, beside simpler estimates."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass

import numpy as np

from jaxveh import FilterError, InputError, estimators

from .logs import REFERENCE, Log, Setting

AS_TOLD = Setting("as told", None, (-np.inf, np.inf))


@dataclass(frozen=True)
class Line:
    """The result of a setting. Angles in degrees; `failed`: why there is no estimate.

    `over_open_loop`, `over_as_told`: the error over that of the open-loop linear model, and over that of the estimate with the
    values of the car file, on the same rows; `..._without_constant`: of errors without their constant part.
    """

    log: str
    setting: str
    seconds: float
    failed: str = ""
    rmse: float = np.nan
    rmse_without_constant: float = np.nan
    open_loop: float = np.nan
    open_loop_without_constant: float = np.nan
    as_told: float = np.nan
    worst: float = np.nan
    coverage_50: float = np.nan
    coverage_95: float = np.nan
    crps: float = np.nan
    crps_constant: float = np.nan
    rows: int = 0

    @property
    def over_open_loop(self) -> float:
        """The error over that of the open loop."""
        return self.rmse / self.open_loop

    @property
    def over_open_loop_without_constant(self) -> float:
        """The same of errors without their constant part."""
        return self.rmse_without_constant / self.open_loop_without_constant

    @property
    def over_as_told(self) -> float:
        """The error over that with the values of the car file."""
        return self.rmse / self.as_told

    def numbers(self) -> dict:
        """Return all numbers by name, for JSON."""
        ratios = ("over_open_loop", "over_open_loop_without_constant", "over_as_told")
        return asdict(self) | {name: getattr(self, name) for name in ratios}


def measure(log: Log, setting: Setting) -> Line:
    """Calibrate and estimate in a setting, and score."""
    begun = time.perf_counter()
    part = log.recording.between(*_open_ended(setting.estimate))
    blind = part.without(REFERENCE)
    try:
        told = _score(log, part, estimators.sideslip.estimate(log.car, blind))
        found = told
        if setting.calibrate is not None:
            span = log.recording.between(*_open_ended(setting.calibrate))
            seen = span if REFERENCE in setting.uses else span.without(REFERENCE)
            calibration = estimators.sideslip.calibrate(log.car, seen, uses=setting.uses)
            found = _score(log, part, estimators.sideslip.estimate(calibration, blind))
    except (InputError, FilterError) as error:
        return Line(log.name, setting.name, time.perf_counter() - begun, failed=str(error))
    take = lambda name: found[f"sideslip_{name}"]
    return Line(
        log.name,
        setting.name,
        time.perf_counter() - begun,
        rmse=take("rmse_deg"),
        rmse_without_constant=take("rmse_without_constant_deg"),
        open_loop=found["open_loop_sideslip_rmse_deg"],
        open_loop_without_constant=found["open_loop_sideslip_rmse_without_constant_deg"],
        as_told=told["sideslip_rmse_deg"],
        worst=take("worst_deg"),
        coverage_50=take("coverage_50"),
        coverage_95=take("coverage_95"),
        crps=take("crps_deg"),
        crps_constant=take("crps_constant_deg"),
        rows=found["rows"],
    )


def _score(log: Log, part, estimate) -> dict:
    return estimators.sideslip.score(log.car, estimate, part)


def _open_ended(span: tuple[float, float]) -> tuple[float, float]:
    """Return the span with its last row included."""
    return span[0], float(np.nextafter(span[1], np.inf))

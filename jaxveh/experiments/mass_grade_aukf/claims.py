"""The paper's claims besides its numbers: how gentle its drives are, which estimator is better, and which needs
acceleration."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh.experiments.mass_grade_aukf.settings import GATE
from jaxveh.experiments.mass_grade_aukf.study import Raced
from jaxveh.experiments.report import BETTER, FAILED, MET, OPEN, interval, judge_ratio, spread
from jaxveh.sweeps import Table, compare

NOTHING = "first guess"
"""The estimator that does nothing."""


class Claim(NamedTuple):
    """A sentence of the paper: the `metric` of estimator `a` is smaller than that of `b`, by `BETTER` at least."""

    text: str
    metric: str
    a: str
    b: str


CLAIMS = (
    Claim("the final mass of the AUKF is nearer to the truth than that of the UKF", "mass_error", "AUKF", "UKF"),
    Claim("the mass of the AUKF is nearer over the whole drive: it converges faster", "mass_rmse", "AUKF", "UKF"),
    Claim("the AUKF finds the grade better than the UKF", "grade_rmse", "AUKF", "UKF"),
    Claim(
        "the same against a UKF with a wrong first guess and a small standard deviation",
        "mass_error",
        "AUKF",
        "UKF, timid",
    ),
    Claim("an estimator that stops below 0.6 m/s^2 [8] is worse here", "mass_error", "AUKF", "gated"),
    Claim("high-pass filtered least squares [11] are worse here", "mass_error", "AUKF", "high-pass"),
    Claim("an accelerometer that removes the grade [12, 13] is better", "mass_error", "kinematic grade", "AUKF"),
    Claim("the grade from accelerometer and speed alone [12] is better", "grade_rmse", "kinematic grade", "AUKF"),
)
"""The claims that compare two estimators."""

WITHIN = {
    "settled": (10.0, 1.0, "within 3 % from then on, s, from each first guess"),
    "mass_error": (3.0, 100.0, "final error of the mass, %, from each first guess"),
}
"""The claims about the AUKF alone: its bound, the scale of the metric, and a description."""


def claims_table(*raced: Raced) -> Table:
    """Every claim in each of the races: ratios with 95 % intervals, paired over seeds, of means over first guesses; for the
    claims about the AUKF alone the numbers of its worst first guess. Beside them the same numbers of doing nothing."""
    rows = []
    for one in raced:
        at = lambda metric, name, one=one: one.found.at(metric, estimator=name, pedals=one.pedals[-1])
        for metric, (bound, scale, what) in WITHIN.items():
            worst, nothing = (scale * at(metric, name).max(axis=0) for name in ("AUKF", NOTHING))
            rows.append(
                (one.study.name, f"AUKF: {what}", spread(worst, lost="never"), f"{bound:g}",
                 spread(nothing, lost="never"), _judge_quartiles(worst, bound))
            )  # fmt: skip
        for claim in CLAIMS:
            a, b, nothing = (at(claim.metric, name).mean(axis=0) for name in (claim.a, claim.b, NOTHING))
            found = compare(a, b)
            cells = (interval(found.ratio), f"{BETTER:g}", interval(compare(a, nothing).ratio))
            rows.append((one.study.name, claim.text, *cells, judge_ratio(found.ratio)))
    return Table(
        "The paper's claims as numbers: ratio of errors [95 % interval] paired over seeds, or median [quartiles]",
        ("drives", "claim", "found", "at most", "over (or of) the first guess", "status"),
        rows,
        2,
    )


def _judge_quartiles(values: np.ndarray, bound: float) -> str:
    low, high = np.quantile(np.where(np.isnan(values), np.inf, values), [0.25, 0.75], method="nearest")
    if high <= bound:
        return MET
    return FAILED if low > bound else OPEN


PRINTED = {
    "truck": {"lowest speed, km/h": "40", "highest speed, km/h": "85", "largest |dv/dt|, m/s^2": "< 0.4",
              "mean |dv/dt|, m/s^2": "< 0.1", "grade peak to peak, degrees": "5.5", "distance, m": "10000"},
    "car": {"highest speed, km/h": "20", "largest |dv/dt|, m/s^2": "< 0.75", "mean |dv/dt|, m/s^2": "< 0.1"},
}  # fmt: skip
"""The numbers that the paper prints of its drives."""


def drives_table(*raced: Raced) -> Table:
    """How gentle the drives are, beside the paper's: median and quartiles over seeds."""
    found = [(one.study.name, _numbers_of(one)) for one in raced]
    rows = []
    for name in found[0][1]:
        cells = [cell for study, numbers in found for cell in (spread(numbers[name]), PRINTED[study].get(name, ""))]
        rows.append((name, *cells))
    heads = [head for study, _ in found for head in (study, "paper's")]
    return Table("The drives: median [quartiles] over seeds", ("", *heads), rows)


def _numbers_of(raced: Raced) -> dict[str, np.ndarray]:
    """(seeds,) each. The slope's part of the acceleration counts for a gate on the accelerometer, but not for one on the
    speed's rate."""
    drives, dt = raced.drives, raced.study.dt
    v, grade, felt = (np.asarray(x)[-1] for x in (drives.true_v_x, drives.true_grade, drives.true_a_x))
    rate = np.gradient(v, dt, axis=-1)
    return {
        "lowest speed, km/h": 3.6 * v.min(axis=-1),
        "highest speed, km/h": 3.6 * v.max(axis=-1),
        "largest |dv/dt|, m/s^2": np.abs(rate).max(axis=-1),
        "mean |dv/dt|, m/s^2": np.abs(rate).mean(axis=-1),
        "grade peak to peak, degrees": np.rad2deg(np.ptp(grade, axis=-1)),
        "distance, m": v.sum(axis=-1) * dt,
        f"time above {GATE:g} m/s^2 of dv/dt, %": 100.0 * (np.abs(rate) > GATE).mean(axis=-1),
        f"time above {GATE:g} m/s^2 as felt, %": 100.0 * (np.abs(felt) > GATE).mean(axis=-1),
    }

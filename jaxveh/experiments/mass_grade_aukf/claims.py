"""What the paper says beside its numbers: how gentle its drives are, who is better than whom, and who needs acceleration."""

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
    Claim("the AUKF ends nearer to the mass than the UKF", "mass_error", "AUKF", "UKF"),
    Claim("the AUKF is nearer over the whole drive: it converges faster", "mass_rmse", "AUKF", "UKF"),
    Claim("the AUKF finds the grade better than the UKF", "grade_rmse", "AUKF", "UKF"),
    Claim("the same of a UKF that is sure of a wrong first guess", "mass_error", "AUKF", "UKF, timid"),
    Claim("who stops below 0.6 m/s^2 [8] is worse off here", "mass_error", "AUKF", "gated"),
    Claim("high-pass filtered least squares [11] are worse off here", "mass_error", "AUKF", "high-pass"),
    Claim("an accelerometer that takes the grade away [12, 13] is better", "mass_error", "kinematic grade", "AUKF"),
    Claim("the grade of accelerometer and speed alone [12] is better", "grade_rmse", "kinematic grade", "AUKF"),
)
"""Those that compare two."""

WITHIN = {
    "settled": (10.0, 1.0, "within 3 % from then on, s, from each first guess"),
    "mass_error": (3.0, 100.0, "final error of the mass, %, from each first guess"),
}
"""Those of the AUKF alone: its bound, the scale of the metric, and what it is."""


def claims_table(*raced: Raced) -> Table:
    """Every claim in each of the races: ratios with 95 % intervals, paired over seeds, means over first guesses; what the AUKF
    alone should reach, of its worst first guess. Beside it: the same of doing nothing."""
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
        "What the paper says, as numbers: ratio of errors [95 % interval] paired over seeds, or median [quartiles]",
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
"""What the paper prints of its drives."""


def drives_table(*raced: Raced) -> Table:
    """How gentle the drives are beside the paper's: median and quartiles over seeds."""
    found = [(one.study.name, _numbers_of(one)) for one in raced]
    rows = []
    for name in found[0][1]:
        cells = [cell for study, numbers in found for cell in (spread(numbers[name]), PRINTED[study].get(name, ""))]
        rows.append((name, *cells))
    heads = [head for study, _ in found for head in (study, "paper's")]
    return Table("The drives: median [quartiles] over seeds", ("", *heads), rows)


def _numbers_of(raced: Raced) -> dict[str, np.ndarray]:
    """(seeds,) each. The slope's pull counts for who is gated by an accelerometer, not for who is by the speed's rate."""
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

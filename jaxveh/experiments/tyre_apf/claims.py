"""The paper's claims besides its tables, as ratios of errors on the same seeds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh.experiments.report import BETTER, interval, judge_ratio
from jaxveh.experiments.tyre_apf.reproduction import Reproduction
from jaxveh.experiments.tyre_apf.settings import STEP_OUTPUTS, STEPS
from jaxveh.experiments.tyre_apf.tracks import course_of
from jaxveh.experiments.tyre_apf.variants import at_variant
from jaxveh.sweeps import Table, compare


class Claim(NamedTuple):
    """A sentence of the paper: errors `a` over errors `b` (seeds,) should be from `low` to `high`."""

    text: str
    a: np.ndarray
    b: np.ndarray
    low: float = 0.0
    high: float = BETTER


SAME = (BETTER, 1.0 / BETTER)
"""Bounds of ratios that should show no difference."""

WORSE = (1.0 / BETTER, float("inf"))
"""Bounds of ratios that should be worse."""


def claims(result: Reproduction) -> list[Claim]:
    """All claims."""
    prior, pf, apf = (course_of(result.tracks, name, result.study) for name in ("prior", "PF", "APF"))
    step = lambda name, what: np.asarray(result.steps[STEPS[0]][name])[:, list(STEP_OUTPUTS).index(what)]
    lane = lambda variant, metric="curve_error": _both(at_variant(result.variants, metric, variant, "UKF"))
    return [
        Claim("table 3: the APF's parameters are nearer than the PF's, over the drive", apf.rmse, pf.rmse),
        Claim("figures 9, 13: in the second half both E of the APF vary less than the PF's", apf.restless_E, pf.restless_E),
        Claim("figures 6 to 13: at the end the APF drifts away a little, its particles degenerate", apf.end, apf.middle, *WORSE),
        Claim("the PF's final parameters are nearer than the first guess", pf.end, prior.end),
        Claim("the APF's final parameters are nearer than the first guess", apf.end, prior.end),
        *_of_order(result),
        *[
            Claim(f"figures 19 to 23: the APF's tyres predict {what} in a step of 5 degrees better than the guess's",
                  step("APF", what), step("prior", what))
            for what in STEP_OUTPUTS
        ],
        Claim("a sensor low-pass of 20 Hz makes no difference (UKF)", lane("low-pass, not told"), lane("as the study"), *SAME),
        Claim("nor does it if the filter has it in its model (UKF)", lane("low-pass, told"), lane("as the study"), *SAME),
        Claim("eqs 12, 14: longitudinal forces in the model reduce the error (UKF)", lane("drive torque, told"),
              lane("drive torque, not told")),
        Claim("a_x is enough as input, v_x need not be measured (UKF)", lane("a_x as input"),
              lane("drive torque, not told"), *SAME),
    ]  # fmt: skip


def _of_order(result: Reproduction) -> list[Claim]:
    """Conclusion 1, which has two parts: the effect of Runge-Kutta on a particle filter of eleven states, and that of the
    order."""
    few, many, short = result.order.design.axis("case").labels
    at = lambda metric, case, solver="Runge-Kutta 4": result.order.at(metric, case=case, solver=solver)
    text = "conclusion 1: Runge-Kutta makes the PF possible at high order"
    return [
        Claim(f"{text}: v_y, against Euler's rule, {many}", at("v_y", many), at("v_y", many, "Euler")),
        Claim(f"{text}: v_y, against Euler's rule, {short}", at("v_y", short), at("v_y", short, "Euler")),
        Claim(f"{text}: parameters, against Euler's rule, {many}", at("error", many), at("error", many, "Euler")),
        Claim(f"{text}: v_y, against three states", at("v_y", many), at("v_y", few)),
        Claim(f"{text}: parameters, against the first guess, {many}", at("error", many), at("prior_error", many)),
        Claim(f"{text}: parameters, against the first guess, {short}", at("error", short), at("prior_error", short)),
    ]


def _both(values: np.ndarray) -> np.ndarray:
    """Root mean square of the last axis."""
    return np.sqrt(np.mean(np.square(values), axis=-1))


def claims_table(result: Reproduction) -> Table:
    """Every claim with its ratio, paired over seeds, and its verdict."""
    rows = []
    for claim in claims(result):
        ratio = compare(claim.a, claim.b).ratio
        bounds = f"{claim.low:.3g} to {claim.high:.3g}"
        rows.append((claim.text, interval(ratio), bounds, judge_ratio(ratio, claim.low, claim.high)))
    return Table(
        f"The paper's claims: ratios of errors [95 % interval] paired over {result.seeds} seeds; the first guess does nothing",
        ("claim", "ratio", "should be", "status"),
        rows,
    )

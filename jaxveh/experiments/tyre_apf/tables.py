"""The tables of the tyre-apf experiment: first the honest study, each with the prior, which does nothing, then as printed."""

from __future__ import annotations

import numpy as np

from jaxveh.experiments.report import interval, spread
from jaxveh.experiments.tyre_apf.claims import claims_table
from jaxveh.experiments.tyre_apf.order import order_table
from jaxveh.experiments.tyre_apf.printed import Printed, PrintedOutcome
from jaxveh.experiments.tyre_apf.reproduction import Reproduction
from jaxveh.experiments.tyre_apf.saturated import over_bound
from jaxveh.experiments.tyre_apf.settings import LEVELS, STEP_OUTPUTS, STEP_STEER, STEPS, TABLE_2, TABLE_3
from jaxveh.experiments.tyre_apf.sharpness import Sharpness, likelihood_ratio, pairs
from jaxveh.experiments.tyre_apf.study import ESTIMATORS, FIELDS
from jaxveh.experiments.tyre_apf.tracks import tracks_table
from jaxveh.experiments.tyre_apf.variants import variants_table
from jaxveh.sweeps import ConfidenceInterval, Swept, Table

ERROR_TITLE = "Eight parameters by the sensors' noise: RMSE in prior standard deviations, median [quartiles]"
AHEAD_TITLE = ERROR_TITLE + "; the APF looks ahead with the process noise"


def tables(result: Reproduction) -> list[Table]:
    """All tables."""
    return [
        _curve_table(result),
        _parameter_table(result),
        _step_table(result),
        tracks_table(result.tracks, result.study),
        variants_table(result.variants),
        order_table(result.order),
        claims_table(result),
        _saturated_table(result),
        _error_table(result.sharpness),
        _likelihood_table(result.sharpness),
        _error_table(result.ahead, AHEAD_TITLE),
        _likelihood_table(result.ahead),
        _truth_table(result),
        *tables_as_printed(result.printed, result.printed_settings),
    ]


def tables_as_printed(found: PrintedOutcome, settings: Printed) -> list[Table]:
    """Tables 2 and 3 with the printed settings."""
    return [_printed_2(found), _printed_3(found, settings)]


def _curve_table(result: Reproduction) -> Table:
    rows = []
    for name in ESTIMATORS:
        curve, states = np.asarray(result.outcome.curve_error[name]), np.asarray(result.outcome.states[name])
        rows.append((name, *[spread(100 * curve[:, i]) for i in (0, 1)], *[spread(states[:, i]) for i in (0, 1)]))
    return Table(
        f"Force curves over the visited slips and states: RMSE, median [quartiles] over {result.seeds} seeds",
        ("estimator", "front F_y, % of D", "rear F_y, % of D", "v_y, m/s", "yaw rate, rad/s"),
        rows,
    )


def _parameter_table(result: Reproduction) -> Table:
    truth = np.asarray(result.printed.truth)[0]
    rows = []
    for i, field in enumerate(FIELDS):
        unit = 1.0 if field.endswith("E") else truth[i]
        errors = [np.abs(np.asarray(result.outcome.parameters[n])[:, i] - truth[i]) / abs(unit) for n in ESTIMATORS]
        rows.append((field.replace("_", "."), f"{truth[i]:g}", *[spread(100 * e) for e in errors]))
    return Table(
        f"Absolute error of each parameter in % of the truth (E: in hundredths), median [quartiles] over {result.seeds} seeds",
        ("parameter", "truth", *ESTIMATORS),
        rows,
    )


def _step_table(result: Reproduction) -> Table:
    rows = []
    for degrees in STEPS:
        printed = dict(zip(("yaw", "yaw_rate"), STEP_STEER.get(degrees, ()), strict=False))
        for i, (what, unit) in enumerate(STEP_OUTPUTS.items()):
            cells = [spread(np.asarray(result.steps[degrees][n])[:, i]) for n in ESTIMATORS]
            paper = f"{printed[what]:g}" if what in printed else ""
            rows.append((f"{degrees} degrees, {what.replace('yaw_rate', 'yaw rate')}, {unit}", paper, *cells))
    return Table(
        "Step steer with the estimated tyres: RMSE, median [quartiles]", ("step steer", "paper", *ESTIMATORS), rows
    )


def _saturated_table(result: Reproduction) -> Table:
    rows, shown = [], [f"{axle}.{name}" for axle in ("front", "rear") for name in "BD"]
    for unknown, found in result.saturated.found.items():
        for i, case in enumerate(result.saturated.cases):
            seen = result.saturated.bounds[unknown][case]
            for name in found.design.axis("estimator").labels:
                error = 100 * np.sqrt(np.mean(found.at("error", estimator=name)[i] ** 2, axis=0))
                by_name = dict(zip(seen.names, zip(error, 100 * seen.bounds.array(), strict=True), strict=True))
                ratio = over_bound(result.saturated, unknown, name, case).max()
                lost = int((found.at("result", estimator=name)[i] != 0).sum())
                cells = [f"{by_name[one][0]:.2g} ({by_name[one][1]:.2g})" for one in shown]
                rows.append((unknown, case, name, *cells, f"{ratio:.3g}", lost))
    return Table(
        f"Both axles beyond their peak: RMSE in % over {result.seeds} seeds (in brackets the Cramer-Rao bound)",
        ("unknown", "drive", "estimator", *shown, "worst RMSE over bound", "lost"),
        rows,
    )


HEADS = tuple(f"{level.yaw_rate:g} rad/s, {level.a_y:g} m/s^2" for level in LEVELS)


def _error_table(found: Sharpness, title: str = ERROR_TITLE) -> Table:
    rows = []
    for count, runs in found.found.items():
        rows += [(count, name, *[spread(v) for v in runs.at("error", filter=name)]) for name in _names(runs)]
        for auxiliary, plain in pairs(runs):
            compared = runs.compare("error", "filter", auxiliary, plain)
            ratios = [ConfidenceInterval(*numbers) for numbers in zip(*compared.ratio, strict=True)]
            cells = [f"{interval(ratio)}, {wins:.0%}" for ratio, wins in zip(ratios, compared.wins, strict=True)]
            rows.append((count, f"{auxiliary} over plain (95 %), wins", *cells))
    return Table(title, ("particles", "filter", *HEADS), rows)


def _likelihood_table(found: Sharpness) -> Table:
    rows = []
    for count, runs in found.found.items():
        own = [name for name in _names(runs) if name != "prior"]
        rows += [(count, name, *[spread(v) for v in runs.at("likelihood_spread", filter=name)]) for name in own]
        for auxiliary, plain in pairs(runs):
            ratios = [likelihood_ratio(found, count, i, auxiliary, plain) for i in range(len(LEVELS))]
            rows.append((count, f"{auxiliary} over plain", *[f"{ratio:.3g}" for ratio in ratios]))
    title = (
        "The same: interquartile range of the log-likelihood over passes of one drive, median [quartiles] over drives"
    )
    return Table(title, ("particles", "filter", *HEADS), rows)


def _names(runs: Swept) -> tuple[str, ...]:
    return runs.design.axis("filter").labels


def _truth_table(result: Reproduction) -> Table:
    """The two uses of the truth, separately and together."""
    truth = np.asarray(result.printed.truth)[0]
    honest = {name: result.outcome.parameters[name] for name in ("prior", "PF", "APF")}
    looks = [
        ("none: an honest prior, the last estimate", honest),
        ("at the end: an honest prior, the mean of the 20 % closest to the truth", result.peeked),
        ("at the start: from the truth, the last estimate", result.printed.last),
        ("both, as in the paper", result.printed.by_rule),
    ]
    unit = np.where([field.endswith("E") for field in FIELDS], 1.0, truth)
    rows = []
    for look, values in looks:
        for name in [one for one in ("prior", "PF", "APF", "walk") if one in values]:
            error = np.abs(np.asarray(values[name]) - truth) / unit
            rows.append((look, name, *[spread(100 * error[:, i], 2) for i in range(len(FIELDS))]))
    return Table(
        "Two ways to use the truth: absolute error in % (E: in hundredths), median [quartiles]; 'walk' filters nothing; from "
        "the truth on with the printed geometry and P0 = Q = I",
        ("look", "estimator", *[field.replace("_", ".") for field in FIELDS]),
        rows,
    )


def _printed_2(printed: PrintedOutcome) -> Table:
    truth = np.asarray(printed.truth)[0]
    rows = []
    for i, field in enumerate(FIELDS):
        cells = [
            f"{np.median(where[n], axis=0)[i]:.5g}"
            for n in ("PF", "APF", "walk")
            for where in (printed.last, printed.by_rule)
        ]
        rows.append((field.replace("_", "."), f"{truth[i]:g}", f"{TABLE_2[field][1]:g}", *cells))
    heads = [f"{n}, {how}" for n in ("PF", "APF", "walk") for how in ("last", "closest 20 %")]
    return Table(
        "Table 2 as printed: every filter starts at the truth; 'closest 20 %' uses the truth again; 'walk' filters nothing",
        ("parameter", "truth = start", "paper", *heads),
        rows,
    )


def _printed_3(printed: PrintedOutcome, settings: Printed) -> Table:
    truth = np.asarray(printed.truth)[0]
    rows = []
    for i, field in enumerate(FIELDS):
        rms = [
            np.sqrt(np.mean((np.asarray(printed.series[n])[:, i] - truth[i]) ** 2, axis=-1))
            for n in ("PF", "APF", "walk")
        ]
        rows.append((field.replace("_", "."), *[f"{v:g}" for v in TABLE_3[field]], *[spread(r) for r in rms]))
    ess = {name: float(np.median(value)) for name, value in printed.ess.items()}
    return Table(
        f"Table 3 as printed (P0 = Q = I): RMSE over time; effective sample size {ess['PF']:.1f} (PF), {ess['APF']:.1f} (APF) "
        f"of {settings.particles}",
        ("parameter", "paper PF", "paper APF", "PF", "APF", "walk"),
        rows,
    )

"""The report of the tyre-apf experiment: tables, checks against the printed numbers and against honest criteria."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxveh import estimators, manoeuvres, sensors, vehicles
from jaxveh._core.errors import check_at_least
from jaxveh._core.progress import Progress, silent
from jaxveh.diagnostics.observability import UNOBSERVABLE, Observability
from jaxveh.experiments.report import Check, Table, above, at_most
from jaxveh.experiments.tyre_apf.printed import Printed, PrintedOutcome, run_printed_seeds
from jaxveh.experiments.tyre_apf.settings import STEP_STEER, TABLE_2, TABLE_3, Study, tyres
from jaxveh.experiments.tyre_apf.staged import run_staged
from jaxveh.experiments.tyre_apf.study import ESTIMATORS, FIELDS, Outcome
from jaxveh.simulation import simulate


class Reproduction(NamedTuple):
    """Everything the experiment found; leaves over seeds."""

    study: Study
    seeds: int
    outcome: Outcome
    steps: dict
    lane_change: Observability
    sweep: Observability
    printed: PrintedOutcome
    printed_settings: Printed


def run(
    study: Study | None = None,
    printed: Printed | None = None,
    *,
    seeds: int = 50,
    seed: int = 0,
    progress: Progress = silent,
) -> Reproduction:
    """Run the honest study, the observability reports and the printed settings over `seeds` seeds, each in one batch."""
    check_at_least("seeds", seeds, 1)
    study, printed = study or Study(), printed or Printed()
    honest_key, printed_key = jax.random.split(jax.random.key(seed))
    keys = jax.random.split(honest_key, seeds)
    staged = run_staged(study, keys, lambda done, total, stage: progress(0.7 * done / total, 1.0, stage))
    progress(0.7, 1.0, "observability in the lane change")
    lane_change = lane_change_observability(study)
    progress(0.75, 1.0, "observability in the sweep of 15 degrees")
    sweep = sweep_observability(study)
    progress(0.8, 1.0, "printed settings")
    as_printed = jax.block_until_ready(run_printed_seeds(printed, jax.random.split(printed_key, seeds)))
    progress(1.0, 1.0, "done")
    return Reproduction(study, seeds, staged.outcome, staged.steps, lane_change, sweep, as_printed, printed)


def as_printed(*, seeds: int = 50, seed: int = 0, progress: Progress = silent) -> list[Table]:
    """The printed settings alone, errata included."""
    progress(0.0, 1.0, "printed settings")
    printed = Printed()
    _, key = jax.random.split(jax.random.key(seed))
    found = jax.block_until_ready(run_printed_seeds(printed, jax.random.split(key, seeds)))
    progress(1.0, 1.0, "done")
    return [_printed_2(found), _printed_3(found, printed)]


def settings(result: Reproduction) -> dict:
    """The study and the printed settings, for the manifest."""
    return {"study": dataclasses.asdict(result.study), "printed": dataclasses.asdict(result.printed_settings)}


def _observed(study: Study, manoeuvre, where=tyres) -> Observability:
    car = vehicles.passenger_car()
    devices = sensors.esc(yaw_rate=study.yaw_rate_std, a_y=study.a_y_std)
    drive = simulate(car, manoeuvre, devices, key=jax.random.key(0), dt=1 / study.rate)
    return estimators.observe(estimators.state_space(car, devices, estimate=where, prior=study.prior), drive)


def lane_change_observability(study: Study) -> Observability:
    """What the study's lane change can tell about the eight parameters."""
    manoeuvre = manoeuvres.double_lane_change(speed=study.speed, steer=study.steer, duration=study.duration)
    return _observed(study, manoeuvre)


def sweep_observability(study: Study) -> Observability:
    """What a sine sweep of 15 degrees at the road wheels can tell about D and B of both axles, C and E known."""
    manoeuvre = manoeuvres.swept_sine(
        speed=study.speed, steer=float(np.radians(15.0)), from_frequency=0.2, to_frequency=1.0, duration=study.duration
    )
    return _observed(study, manoeuvre, lambda car: (car.front.B, car.front.D, car.rear.B, car.rear.D))


def _median(values) -> Any:
    return np.median(np.asarray(values), axis=0)


def check(result: Reproduction) -> list[Check]:
    """The criteria, medians over seeds; no estimator of the honest study knew the truth."""
    checks = []
    add = lambda name, value, bound: checks.append(at_most(name, value, bound))
    prior = _median(result.outcome.curve_error["prior"])
    for name in ("UKF", "MAP"):
        curve = _median(result.outcome.curve_error[name])
        for i, axle in enumerate(("front", "rear")):
            add(f"{name} {axle} force-curve RMSE, % of D", 100 * curve[i], 0.8)
            add(f"{name} {axle} force-curve RMSE over the prior's", curve[i] / prior[i], 0.2)
        for degrees, printed in STEP_STEER.items():
            found, before = _median(result.steps[degrees][name]), _median(result.steps[degrees]["prior"])
            for i, what in enumerate(("yaw", "yaw-rate")):
                add(f"{name} step steer {degrees} degrees, {what} RMSE against the paper's", found[i], printed[i])
                add(
                    f"{name} step steer {degrees} degrees, {what} RMSE over the prior mean's",
                    found[i] / before[i],
                    0.35,
                )
    condition = result.lane_change.condition_number
    checks.append(above("lane change: condition number of eight parameters, above", condition, UNOBSERVABLE))
    observable = result.sweep.observable()
    add("sweep of 15 degrees: D and B not observable, number", sum(n not in observable for n in result.sweep.names), 0)
    truth = np.asarray(result.printed.truth)[0]
    walk = np.abs(_median(result.printed.by_rule["walk"]) / truth - 1)
    worst = {"D": 0.0005, "B": 0.003, "C": 0.003}
    for name, bound in worst.items():
        rows = [i for i, field in enumerate(FIELDS) if field.endswith(name)]
        add(
            f"as printed: a walk that filters nothing, by the paper's final rule, relative error of {name}",
            walk[rows].max(),
            bound,
        )
    return checks


def tables(result: Reproduction) -> list[Table]:
    """The tables of the report: honest first, the do-nothing prior in each, then as printed."""
    return [
        _curve_table(result),
        _parameter_table(result),
        _step_table(result),
        _printed_2(result.printed),
        _printed_3(result.printed, result.printed_settings),
    ]


def _spread(values, digits=3) -> str:
    low, mid, high = np.percentile(np.asarray(values), [25, 50, 75])
    return f"{mid:.{digits}g} [{low:.{digits}g}, {high:.{digits}g}]"


def _curve_table(result: Reproduction) -> Table:
    rows = []
    for name in ESTIMATORS:
        curve, states = np.asarray(result.outcome.curve_error[name]), np.asarray(result.outcome.states[name])
        rows.append((name, *[_spread(100 * curve[:, i]) for i in (0, 1)], *[_spread(states[:, i]) for i in (0, 1)]))
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
        rows.append((field.replace("_", "."), f"{truth[i]:g}", *[_spread(100 * e) for e in errors]))
    return Table(
        f"Absolute error of each parameter in % of the truth (E: in hundredths), median [quartiles] over {result.seeds} seeds",
        ("parameter", "truth", *ESTIMATORS),
        rows,
    )


def _step_table(result: Reproduction) -> Table:
    rows = []
    for degrees, printed in STEP_STEER.items():
        for i, what in enumerate(("yaw, rad", "yaw rate, rad/s")):
            cells = [_spread(np.asarray(result.steps[degrees][n])[:, i]) for n in ESTIMATORS]
            rows.append((f"{degrees} degrees, {what}", f"{printed[i]:g}", *cells))
    return Table(
        "Step steer with the estimated tyres: RMSE, median [quartiles]", ("step steer", "paper", *ESTIMATORS), rows
    )


def _printed_2(printed: PrintedOutcome) -> Table:
    truth = np.asarray(printed.truth)[0]
    rows = []
    for i, field in enumerate(FIELDS):
        cells = [
            f"{_median(where[n])[i]:.5g}" for n in ("PF", "APF", "walk") for where in (printed.last, printed.by_rule)
        ]
        rows.append((field.replace("_", "."), f"{truth[i]:g}", f"{TABLE_2[field][1]:g}", *cells))
    heads = [f"{n}, {how}" for n in ("PF", "APF", "walk") for how in ("last", "closest 20 %")]
    return Table(
        "Table 2 as printed: every filter starts at the truth; 'closest 20 %' looks at the truth again; 'walk' filters nothing",
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
        rows.append((field.replace("_", "."), *[f"{v:g}" for v in TABLE_3[field]], *[_spread(r) for r in rms]))
    ess = {name: float(_median(value)) for name, value in printed.ess.items()}
    return Table(
        f"Table 3 as printed (P0 = Q = I): RMSE over time; effective sample size {ess['PF']:.1f} (PF), {ess['APF']:.1f} (APF) "
        f"of {settings.particles}",
        ("parameter", "paper PF", "paper APF", "PF", "APF", "walk"),
        rows,
    )

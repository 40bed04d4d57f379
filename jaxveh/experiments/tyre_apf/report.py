"""The results of the tyre-apf experiment: the runs, and checks against the printed numbers and against honest criteria."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import estimators, manoeuvres, sensors, vehicles
from jaxveh._core.errors import check_at_least
from jaxveh._core.parameter import pick, resolve
from jaxveh._core.progress import Progress, part, silent
from jaxveh.diagnostics import Observability, kit
from jaxveh.experiments.report import Check, above, at_least, at_most, with_terms
from jaxveh.experiments.tyre_apf.criteria import AHEAD, CRITERIA, WHERE
from jaxveh.experiments.tyre_apf.order import run_order
from jaxveh.experiments.tyre_apf.printed import Printed, closest_share, run_printed
from jaxveh.experiments.tyre_apf.reproduction import Reproduction
from jaxveh.experiments.tyre_apf.saturated import SWEEP, over_bound, run_saturated
from jaxveh.experiments.tyre_apf.settings import LOOKING_AHEAD, STEP_STEER, Study, tyres
from jaxveh.experiments.tyre_apf.sharpness import (
    PAPERS_PARTICLES,
    PREDICTIVE,
    Sharpness,
    likelihood_ratio,
    run_sharpness,
)
from jaxveh.experiments.tyre_apf.staged import Staged, run_staged
from jaxveh.experiments.tyre_apf.study import FIELDS
from jaxveh.experiments.tyre_apf.tables import tables_as_printed
from jaxveh.experiments.tyre_apf.tracks import Tracks, tracks_of
from jaxveh.experiments.tyre_apf.variants import run_variants
from jaxveh.simulation import simulate
from jaxveh.sweeps import IN_MEMORY, Stores, Table

FEW = 10
"""Most seeds of the other drives and of the effects of order and integrator, for which there is no criterion."""


def run(
    study: Study | None = None,
    printed: Printed | None = None,
    *,
    seeds: int = 20,
    seed: int = 0,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Reproduction:
    """Run the honest study, the saturated drives, the sharpness of sensors and the printed settings over `seeds` seeds."""
    check_at_least("seeds", seeds, 2)
    study, printed = study or Study(), printed or Printed()
    honest_key, printed_key = jax.random.split(jax.random.key(seed))
    told = part(progress, 0.0, 0.4, "lane change")
    staged = run_staged(study, seeds, honest_key, progress=told, stores=stores.under("lane-change"))
    progress(0.4, 1.0, "observability in the lane change")
    lane_change = lane_change_observability(study)
    # Drives of their own, besides the study's.
    saturated_key, sharp_key = jax.random.split(jax.random.fold_in(jax.random.key(seed), 2))
    told = part(progress, 0.42, 0.65, "saturated")
    saturated = run_saturated(study, seeds, saturated_key, progress=told, stores=stores.under("saturated"))
    told = part(progress, 0.65, 0.84, "sharpness")
    sharpness = run_sharpness(study, seeds, sharp_key, progress=told, stores=stores.under("sharpness"))
    ahead = run_sharpness(
        study, seeds, sharp_key, counts=(PAPERS_PARTICLES,), kinds=PREDICTIVE, levels=LOOKING_AHEAD,
        progress=part(progress, 0.84, 0.92, "looking ahead with the noise"), stores=stores.under("ahead"),
    )  # fmt: skip
    other_key, order_key = jax.random.split(jax.random.fold_in(jax.random.key(seed), 3))
    told = part(progress, 0.92, 0.96, "other drives")
    others = run_variants(study, min(seeds, FEW), other_key, progress=told, stores=stores.under("variants"))
    told = part(progress, 0.96, 0.98, "order")
    order = run_order(study, printed, min(seeds, FEW), order_key, progress=told, stores=stores.under("order"))
    progress(0.98, 1.0, "printed settings")
    found = jax.block_until_ready(run_printed(printed, seeds, printed_key, stores=stores))
    progress(1.0, 1.0, "done")
    return Reproduction(
        study, seeds, staged.outcome, staged.steps, lane_change, saturated, sharpness, ahead, found, printed,
        looked_at_the_truth(staged, printed), staged.first_step, staged.open_loop, tracks_of_study(staged, study), others,
        order,
    )  # fmt: skip


def tracks_of_study(staged: Staged, study: Study) -> Tracks:
    """The honest filters' parameters over time, and the prior's."""
    outcome = staged.outcome
    return tracks_of(
        outcome.drive.time, staged.estimates, outcome.parameters["prior"], outcome.spread["prior"], study.particles
    )


def looked_at_the_truth(staged: Staged, printed: Printed) -> dict[str, np.ndarray]:
    """The honest filters' final parameters by the paper's rule, (seeds, 8): the mean of the estimates closest to the truth."""
    truth = jnp.stack(pick(vehicles.passenger_car(), resolve(vehicles.passenger_car(), tyres)))
    found = {}
    for name in ("PF", "APF"):
        series = jnp.stack(list(staged.estimates[name].parameters.values()), axis=1)
        found[name] = np.asarray(jax.vmap(lambda one: closest_share(one, truth, printed.share))(series))
    return found


def as_printed(
    *, seeds: int = 20, seed: int = 0, progress: Progress = silent, stores: Stores = IN_MEMORY
) -> list[Table]:
    """Only the printed settings, errata included."""
    progress(0.0, 1.0, "printed settings")
    printed = Printed()
    _, key = jax.random.split(jax.random.key(seed))
    found = jax.block_until_ready(run_printed(printed, seeds, key, stores=stores.under("as-printed")))
    progress(1.0, 1.0, "done")
    return tables_as_printed(found, printed)


def settings(result: Reproduction) -> dict:
    """The study and the printed settings, for the manifest."""
    return {"study": dataclasses.asdict(result.study), "printed": dataclasses.asdict(result.printed_settings)}


def lane_change_observability(study: Study) -> Observability:
    """The information about the eight parameters in the study's lane change."""
    car = vehicles.passenger_car()
    manoeuvre = manoeuvres.double_lane_change(speed=study.speed, steer=study.steer, duration=study.duration)
    devices = sensors.esc(yaw_rate=study.yaw_rate_std, a_y=study.a_y_std)
    drive = simulate(car, manoeuvre, devices, key=jax.random.key(0), dt=1 / study.rate)
    return estimators.observe(estimators.state_space(car, devices, estimate=tyres, prior=study.prior), drive)


def _median(values) -> Any:
    return np.median(np.asarray(values), axis=0)


def check(result: Reproduction) -> list[Check]:
    """The criteria, each with its condition (`criteria`): medians over seeds."""
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
    checks.append(above("lane change: condition number of eight parameters, above", condition, kit.UNOBSERVABLE))
    seen = result.saturated.bounds["D and B"][SWEEP]
    add(f"{SWEEP}: D and B not observable, number", len(seen.names) - len(seen.observable()), 0)
    for name in ("UKF", "MAP"):
        worst = over_bound(result.saturated, "D and B", name, SWEEP).max()
        add(f"{SWEEP}, D and B: {name}'s largest RMSE over its Cramer-Rao bound", worst, 2.0)
    checks += _sharpness_checks(result.sharpness) + _sharpness_checks(result.ahead, AHEAD)
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
    return with_terms(checks, CRITERIA)


def _sharpness_checks(found: Sharpness, which: str = "APF") -> list[Check]:
    """At the paper's number of particles and with its resampling: the APF over the PF, paired; `which` is its name.

    Three of the paper's do not hold with the noise of `noise.choose_level`: with sharp sensors the APF has 0.98 times the
    error of the PF and wins 55 % of drives (over 40 others, 16 passes each: 0.99 [0.94, 1.03], 53 %; with twice that noise
    in the yaw rate, less likely, 0.92 [0.88, 0.95], 75 %); and with coarse ones its log-likelihood varies 0.85 times as much
    (over 40 others, 48 passes each: 0.87, 90 % interval 0.77 to 0.99), a fully adapted filter's 0.81: one row ahead contains
    little information about eight parameters.
    """
    compared, checks = found.found[PAPERS_PARTICLES].compare("error", "filter", "APF", "PF"), []
    for i, bound in enumerate((0.95, 1.1, 1.1)):
        name = f"{WHERE[i]}: {which} over PF, parameter RMSE, paired"
        checks.append(at_most(name, compared.ratio.value[i], bound))
        if i == 0:
            checks.append(at_least(f"{WHERE[i]}: share of seeds that the {which} wins", compared.wins[i], 0.6))
    ratio = likelihood_ratio(found, PAPERS_PARTICLES, len(WHERE) - 1)
    checks.append(at_most(f"{WHERE[-1]}: {which} over PF, spread of the log-likelihood", ratio, 0.8))
    return checks

"""The paper's first conclusion: Runge-Kutta makes a particle filter possible for a system of high order.

A filter without unknown tyre parameters (three states) and one with eight (eleven states), integrated by Runge-Kutta of
order four and by Euler's rule. An integrator can spoil the prediction; the order requires the particles to cover eleven
unknowns. The two effects are examined separately.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import diffrax
import jax
import jax.numpy as jnp

from jaxveh import estimators, filters, numerics, sensors, sweeps
from jaxveh._core.parameter import pick, resolve
from jaxveh._core.progress import Progress, silent
from jaxveh.experiments.report import interval, spread
from jaxveh.experiments.tyre_apf.printed import Printed
from jaxveh.experiments.tyre_apf.settings import Study, tyres
from jaxveh.experiments.tyre_apf.sharpness import errors_of
from jaxveh.experiments.tyre_apf.study import drive_once, guess_once, state_errors
from jaxveh.statespace import RK4
from jaxveh.sweeps import IN_MEMORY, Stores, Table, compare

SOLVERS = {"Runge-Kutta 4": RK4, "Euler": diffrax.Euler}
"""Integrators of the filter's model, one step per row; the drive itself is simulated with finer steps."""

CASES = {
    "3 states, rows of {long:g} s": (None, "long"),
    "11 states, rows of {long:g} s": (tyres, "long"),
    "11 states, rows of {short:g} s": (tyres, "short"),
}
"""The unknowns (none, with the prior's mean taken as the tyres, or all eight parameters), and the length of a row: the
paper's, or the study's."""


def run_order(
    study: Study,
    printed: Printed,
    seeds: int,
    key,
    *,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> sweeps.Swept:
    """The particle filter with the paper's number of particles, by case and solver: `error` of the eight parameters in prior
    standard deviations (with three states that of the prior) and `prior_error`, `v_y` (m/s) and `yaw_rate` (rad/s) RMSE, the
    effective `share` of the particles, `result`."""
    steps = {"long": printed.step, "short": 1.0 / study.rate}
    cases = {name.format(**steps): (order, steps[step]) for name, (order, step) in CASES.items()}

    def run(point, key):
        order, step = point.case
        own = dataclasses.replace(study, rate=1.0 / step)
        keys = jax.random.split(key, 3)
        drive, guess = drive_once(own, keys[0]), guess_once(own, keys[1])
        model = _model(own, guess, order, point.solver())
        found = filters.scan(
            filters.ParticleFilter(printed.particles, numerics.multinomial), model, model.rows(drive), keys[2]
        )
        last = values_of(guess) if order is None else jnp.stack([one[-1] for one in found.parameters.values()])
        v_y, yaw_rate = state_errors(found.mean, drive)
        rms = lambda values: jnp.sqrt(jnp.mean(errors_of(own, values) ** 2))
        return {
            "error": rms(last), "prior_error": rms(values_of(guess)), "v_y": v_y, "yaw_rate": yaw_rate,
            "share": jnp.median(found.info.ess) / printed.particles, "result": found.result.astype(jnp.int32),
        }  # fmt: skip

    return stores.sweep("order", run, sweeps.Design(case=cases, solver=SOLVERS), seeds, key, progress=progress)


def values_of(car) -> jax.Array:
    """The eight parameters of a car, (8,)."""
    return jnp.stack(pick(car, resolve(car, tyres)))


def _model(study: Study, car, order, solver) -> Any:
    """The model of `study.model_of`, with tyres that are unknown or taken as certain, and another solver."""
    devices, noise = sensors.esc(yaw_rate=study.yaw_rate_std, a_y=study.a_y_std), study.particle
    process = {"v_y": noise.v_y, "yaw_rate": noise.yaw_rate}
    unknown: dict[str, Any] = {} if order is None else {"estimate": order, "prior": study.prior, "walk": noise.walk}
    return estimators.state_space(car, devices, process_noise=process, solver=solver, **unknown)


def order_table(found: sweeps.Swept) -> Table:
    """Errors by row length, order and solver, and their ratios to Runge-Kutta's."""
    rows = []
    axis = lambda name: found.design.axis(name).labels
    for case in axis("case"):
        for solver in axis("solver"):
            at = lambda metric, solver=solver, case=case: found.at(metric, case=case, solver=solver)
            over = compare(at("v_y"), at("v_y", axis("solver")[0])).ratio
            lost = int((at("result") != 0).sum())
            rows.append(
                (case, solver, spread(at("prior_error")), spread(at("error")), spread(at("v_y")), spread(at("yaw_rate")),
                 interval(over), spread(100 * at("share"), 2), lost)
            )  # fmt: skip
    return Table(
        f"Effect of order and integrator on the particle filter: median [quartiles] over {found.seeds} seeds, or ratio [95 %]",
        ("case", "integrator", "prior's error, its sd", "parameters' error, prior sd", "v_y, m/s", "yaw rate, rad/s",
         "v_y over Runge-Kutta's", "effective particles, %", "lost"),
        rows,
        2,
    )  # fmt: skip

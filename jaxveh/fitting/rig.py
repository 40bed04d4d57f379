"""Tyres fitted to rig data: staged least squares, standard errors, cross-validation."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import (
    FilterError,
    InputError,
    check_at_least,
    check_flags,
    check_kind,
    check_one_of,
    check_positive,
    check_whole,
)
from jaxveh._core.host import check_on_host
from jaxveh._core.names import as_names, as_pairs, check_names
from jaxveh._core.parameter import Parameter, Where, pick, prior_spread, resolve
from jaxveh._core.parameters import Parameters
from jaxveh._core.progress import Progress, check_progress, silent
from jaxveh._core.shown import above
from jaxveh.fitting.problem import SearchEnd, by_name, on_line, scalar_parameters
from jaxveh.fitting.result import AbstractFit
from jaxveh.fitting.rig_data import RigData, Settings, StageReport, fold_of, rms
from jaxveh.fitting.rig_identify import settle, without
from jaxveh.fitting.rig_in_turn import fit_in_turn
from jaxveh.fitting.rig_problem import PULL, RigProblem, contact_of, of_common_length, offered_forces, spread_of
from jaxveh.fitting.rig_robust import inflation
from jaxveh.fitting.rig_stages import HELD_COEFFICIENTS, Stage, stages_of
from jaxveh.fitting.solve import fit_at
from jaxveh.io import RigTable, kit
from jaxveh.tyres import AbstractTyre, MFTyre

JOINT = "joint"

KNOWN = ("nominal_load", "reference_load")
"""Parameters that state where others hold: known, and not fitted unless `where` picks them."""


class RigFit(AbstractFit):
    """A tyre fitted to rig data: a fit (see `AbstractFit`), and the results of the rig's channels.

    `model`, also as `tyre`: the law with its coefficients, in the canonical one of its twins (`rig_canonical`). Standard
    errors come from the Gauss-Newton matrix of the joint stage, with the noise estimated from residuals. They are nan for
    coefficients held at their start, because data do not identify them or by default (`rig_stages.HELD_COEFFICIENTS`); in the
    others' errors these count with a standard deviation of their own size, or of their variation among ordinary tyres.
    `identified`: how many directions the data identify. By channel (`F_x`, ...): `rmse` of residuals, `peak` (the 99.5th
    percentile of the measurements), `start_rmse` before the fit, `noise` (standard deviation), and `cross_validation`, the
    RMSE at rows left out of a fold's fit (nan without folds). `residuals` (n,): fitted less measured, nan without a
    measurement. `stages`: one report per stage. `problem`: the joint stage at the fit, for `solve` and `bootstrap`, in which
    held coefficients stay; None in a loaded fit.
    """

    kept_fields = ("rmse", "start_rmse", "cross_validation", "peak", "noise", "residuals")

    parameters: Parameters
    parameters_std: Parameters
    unconstrained: np.ndarray
    covariance: np.ndarray
    cost: Any
    steps: Any
    result: Any
    model: AbstractTyre
    chosen: tuple[Parameter, ...] = eqx.field(static=True)
    identified: int = eqx.field(static=True)
    rmse: dict[str, float]
    start_rmse: dict[str, float]
    cross_validation: dict[str, float]
    peak: dict[str, float]
    noise: dict[str, float]
    residuals: dict[str, np.ndarray]
    stages: tuple[StageReport, ...] = eqx.field(static=True)
    problem: RigProblem

    @property
    def tyre(self) -> AbstractTyre:
        """The fitted law."""
        return self.model

    def plot(self, rig: RigTable | None = None, *arguments: Any, **options: Any) -> Any:
        """Plot the law against the `rig` data that it was fitted to (`plots.rig_fit`); without them the parameters
        (`plots.fit`). **Returns** the figure."""
        if rig is None:
            return super().plot(*arguments, **options)
        return above("plots", "rig_fit")(self, rig, *arguments, **options)

    def _facts(self) -> dict[str, Any]:
        return {"identified": self.identified, "stages": [stage._asdict() for stage in self.stages]}

    @classmethod
    def _of_facts(cls, facts: dict[str, Any]) -> dict[str, Any]:
        return {"identified": facts["identified"], "stages": tuple(StageReport(**one) for one in facts["stages"])}


def fit_rig(
    law: AbstractTyre,
    rig: RigTable,
    where: Where | None = None,
    *,
    free: Sequence[str] = (),
    prior: float | Mapping[str, float] | None = None,
    measured: Sequence[str] | None = None,
    weights: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    robust: bool = False,
    folds: int = 0,
    staged: bool = True,
    max_steps: int = 500,
    tolerance: float = 1e-6,
    progress: Progress = silent,
    throw: bool = True,
) -> RigFit:
    """Fit a tyre to rig data, starting from its present coefficients.

    MF-Tyre is fitted in stages (pure slip, combined slip, moments) over the coefficients that the data show (those of load
    where the load varies, and so on), then all together; other laws at once. `where` picks coefficients of the law instead.
    A table with more than 10,000 rows is fitted in some of them first, 3,000 in each stage, drawn at random, and then in all.

    `free`: names of coefficients to fit that are held by default (`lateral.PKY4`, the form of the cornering stiffness over
    load, stays at the law's value, 2 in a typical one). Coefficients that the data do not identify stay at their start.
    `prior`: relative spreads around the law's own coefficients, one number or by name, as in all fits. `measured`: the forces
    and moments to compare; by default those that both data and law have. `weights`: factors by channel on one over the noise
    squared, which is estimated. `bounds`: by name, an interval for a coefficient. `robust`: residuals are assumed to follow
    Student's t with 4 degrees of freedom, on the scale of their median size, so that outliers count little. `folds`: number
    of parts for cross-validation, whole runs if the data number them, otherwise blocks of rows; 0 for none. `staged=False`
    skips to the joint fit, for a law that is near the data already.

    This program inspects the data (which coefficients they show, how noisy they are) and runs `LevenbergMarquardt` in rounds:
    for `jit`, `vmap` and `grad` see `pose_rig` and `solve`.

    **Raises** `InputError` for a channel, weight or bound that has no match, a start outside its bounds or without finite
    forces, too few rows, rows in which no slip varies, bad `folds` or `max_steps`, traced numbers;
    `FilterError` if the joint fit does not converge, unless `throw=False`.
    """
    check_on_host("fit_rig", law, prior, weights, bounds)
    _check_settings(max_steps, tolerance, folds, progress, robust=robust, staged=staged, throw=throw)
    data, plan, aside = _prepare(law, rig, where, free, prior, measured, weights, bounds, robust, max_steps, tolerance)
    parts = fold_of(rig, folds) if folds else np.full(rig.load.shape, -1)
    joint = _joint(data)
    plan = [*(plan if staged else ()), without(joint, _held_mask(data, aside), data.names)]
    total = len(plan) + folds
    tyre, reports = fit_in_turn(data, law, plan, lambda k, name: progress(k, total, name))
    settled = settle(data, law, tyre, joint, aside, reports[-1])
    tyre, reports[-1] = settled.tyre, settled.report
    plan = [without(stage, settled.held, data.names) for stage in plan]
    missed = _missed_residuals(data, law, plan, parts, lambda k: progress(len(plan) + k, total, "cross-validation"))
    progress(total, total, JOINT)
    validation = rms(data.channels, missed) if folds else dict.fromkeys(data.channels, np.nan)
    if throw and not reports[-1].converged:
        steps = reports[-1].steps
        raise FilterError(f"fit to {rig.source} stopped after {steps} steps; throw=False returns the unfinished fit.")
    return _result(data, tyre, joint, settled.held, tuple(reports), data.rmse(law), validation)


def _check_settings(max_steps: int, tolerance: float, folds: int, progress: Progress, **flags: Any) -> None:
    check_flags(**flags)
    check_at_least("max_steps", max_steps, 1)
    check_at_least("tolerance", tolerance, 0)
    check_whole("folds", folds, 0)
    check_progress(progress)


def _check_free(free: Sequence[str], plan: list[Stage]) -> None:
    there = tuple(dict.fromkeys(name for stage in plan for name in stage.coefficients))
    check_names("free", dict.fromkeys(free), there)


def _held_mask(data: RigData, aside: Sequence[str]) -> np.ndarray:
    return np.array([name in aside for name in data.names])


def pose_rig(
    law: AbstractTyre,
    rig: RigTable,
    where: Where | None = None,
    *,
    noise: Mapping[str, float] | None = None,
    free: Sequence[str] = (),
    prior: float | Mapping[str, float] | None = None,
    measured: Sequence[str] | None = None,
    weights: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    robust: bool = False,
) -> RigProblem:
    """The joint stage of `fit_rig` at the law's coefficients, for `solve`: all coefficients but those held by default, one
    noise level per channel.

    `noise`: standard deviations by channel; by default those of the law's own residuals, so that a problem at a fitted law has
    the noise of the fit. Other arguments and errors as in `fit_rig`.
    """
    check_on_host("pose_rig", law, noise, prior, weights, bounds)
    check_flags(robust=robust)
    data, _, aside = _prepare(law, rig, where, free, prior, measured, weights, bounds, robust)
    levels = data.noise(law) if noise is None else dict(as_pairs(noise, "noise"))
    check_names("noise", levels, data.channels)
    missing = [name for name in data.channels if name not in levels]
    if missing:
        raise InputError(f"noise: no standard deviation for {', '.join(missing)}.")
    for name, level in levels.items():
        check_positive(f"noise[{name!r}]", level)
    return data.problem(law, without(_joint(data), _held_mask(data, aside), data.names), levels)


def _prepare(
    law, rig, where, free, prior, measured, weights, bounds, robust, max_steps: int = 500, tolerance: float = 1e-6
) -> tuple[RigData, list[Stage], tuple[str, ...]]:
    """The data for all stages, after every check, the stages before the joint one, and the coefficients held by default."""
    check_kind("law", law, AbstractTyre, "fitting.starting_tyre(name, rig) makes one.")
    check_kind("rig", rig, RigTable, "io.read_rig_table reads one.")
    free, measured = as_names(free, "free") or (), as_names(measured, "measured")
    extra, limits = (dict(as_pairs({} if v is None else v, n)) for n, v in (("weights", weights), ("bounds", bounds)))
    contact = contact_of(rig)
    channels = _channels(law, rig, contact, measured)
    check_names("weights", extra, channels)
    for name, weight in extra.items():
        check_positive(f"weights[{name!r}]", weight)
    chosen = None if where is None else tuple(p.name for p in scalar_parameters(law, where))
    plan = stages_of(law, rig, channels, chosen, free)
    _check_free(free, plan)
    aside = tuple(name for stage in plan for name in stage.aside)
    settings = Settings(extra, limits, robust, max_steps, tolerance)
    data = RigData(rig, contact, channels, (*_names(law, plan, chosen), *aside), settings)
    data.check(law)
    if prior is not None:
        fitted = data.parameters(law)
        values = pick(law, fitted)
        spread = jnp.stack(prior_spread(fitted, values, prior))
        data.chosen = settings._replace(prior=(on_line(fitted, values), spread))
    return data, plan, aside


def _joint(data: RigData) -> Stage:
    return Stage(JOINT, data.channels, data.names, np.ones(data.rig.load.shape, bool))


def _missed_residuals(data, law, plan, parts, told):
    """Residuals at rows left out of a fold's fit; `parts`: the fold of each row (-1: none); nan for rows without a fold."""
    missed = np.full(data.measured.shape, np.nan)
    for k in range(int(parts.max()) + 1):
        told(k)
        missed[:, parts == k] = _unseen_residuals(data, law, plan, parts == k)[:, parts == k]
    return missed


def _unseen_residuals(data: RigData, law: AbstractTyre, plan: list[Stage], rows: np.ndarray) -> np.ndarray:
    """Residuals (m, n) of a fit from the same start that leaves out some rows."""
    law, _ = fit_in_turn(data.without(rows), law, plan, lambda k, name: None)
    return data.residuals(law)


def _channels(law: AbstractTyre, rig: RigTable, contact: Any, measured: Sequence[str] | None) -> tuple[str, ...]:
    has = offered_forces(law, contact)
    there = tuple(name for name in kit.RIG_CHANNELS if getattr(rig, name) is not None)
    if measured is None:
        found = tuple(name for name in there if name in has)
        if not found:
            raise InputError(
                f"{rig.source} has {', '.join(there)}, {type(law).__name__} {', '.join(has)}: nothing in common."
            )
        return found
    for name in measured:
        check_one_of("measured", name, kit.RIG_CHANNELS)
        if name not in there:
            raise InputError(f"measured: {name} is not in {rig.source}; there are: {', '.join(there)}.")
        if name not in has:
            raise InputError(f"measured: {type(law).__name__} has no {name}; it has: {', '.join(has)}.")
    return tuple(measured)


def _names(law: AbstractTyre, plan: list[Stage], chosen: tuple[str, ...] | None) -> tuple[str, ...]:
    if chosen is not None:
        return chosen
    if isinstance(law, MFTyre):
        if not plan:
            raise InputError(
                "neither slip angle nor slip ratio varies enough to show a coefficient of MF-Tyre: "
                "fit sweeps of slip, or pick coefficients with `where`."
            )
        return tuple(dict.fromkeys(name for stage in plan for name in stage.coefficients))
    every = resolve(law, lambda law: jax.tree.leaves(law))
    found = tuple(p.name for p in every if p.name.rpartition(".")[2] not in KNOWN)
    if not found:
        raise InputError(f"{type(law).__name__} has no coefficient to fit.")
    return found


def _result(data: RigData, law, joint: Stage, held: np.ndarray, reports, start_rmse, validation) -> RigFit:
    noise, last = data.noise(law), reports[-1]
    problem = _as_uncertain(data.problem(law, joint, noise), held, joint.coefficients)
    fit, known = _summary(of_common_length(problem), jnp.asarray(last.steps), jnp.asarray(last.converged))
    # The noise is that of the fit, corrected for the degrees of freedom of the coefficients.
    count = int(data.present.sum())
    factor = count / (count - int((~held).sum()))
    if data.chosen.robust:
        factor *= inflation(data.residuals(law) / np.array([[noise[name]] for name in data.channels]))
    covariance = np.asarray(fit.covariance) * factor
    values = pick(law, fit.chosen)
    slopes = np.array([float(p.domain.slope(value)) for p, value in zip(fit.chosen, values, strict=True)])
    std = np.where(held, np.nan, np.abs(slopes) * np.sqrt(np.diag(covariance)))
    return RigFit(
        parameters=jax.tree.map(np.asarray, fit.parameters),
        parameters_std=by_name(fit.chosen, std),
        unconstrained=np.asarray(fit.unconstrained),
        covariance=covariance,
        cost=fit.cost,
        steps=fit.steps,
        result=fit.result,
        model=law,
        chosen=fit.chosen,
        identified=int(known),
        rmse=data.rmse(law),
        start_rmse=start_rmse,
        cross_validation=validation,
        peak=data.peak,
        noise=noise,
        residuals=dict(zip(data.channels, data.residuals(law), strict=True)),
        stages=reports,
        problem=data.problem(law, without(joint, held, data.names), noise),
    )


def _as_uncertain(problem: RigProblem, held: np.ndarray, names: Sequence[str]) -> RigProblem:
    """The problem in which the held coefficients are uncertain.

    The standard deviation of a coefficient held for lack of data is its own size, and that of one held by default is its
    value in `HELD_COEFFICIENTS`; coefficients confounded with them become as uncertain.
    """
    spreads = jnp.asarray([HELD_COEFFICIENTS.get(name, np.nan) for name in names])
    size = jnp.where(jnp.isnan(spreads), 1.0, spreads / problem.scale)
    pull = jnp.where(jnp.asarray(held), 1 / size, PULL).astype(problem.origin.dtype)
    return dataclasses.replace(problem, pull=pull)


@eqx.filter_jit
def _summary(problem: RigProblem, steps, converged):
    """The fit that ended at the start of the problem, and how many directions of the coefficients the data identify."""
    found = SearchEnd(problem.start(), steps, converged)
    return fit_at(problem, found, problem.cost(found.z), problem.covariance(found.z)), spread_of(found.z, problem)[1]

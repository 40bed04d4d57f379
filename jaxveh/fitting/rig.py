"""Tyres fitted to rig data: staged least squares, standard errors, cross-validation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import FilterError, InputError, check_at_least, check_one_of, check_positive
from jaxveh._core.names import check_names
from jaxveh._core.parameter import Where, pick, resolve
from jaxveh._core.progress import Progress, silent
from jaxveh.fitting.rig_data import RigData, Settings, StageReport, fold_of, rms
from jaxveh.fitting.rig_identify import settle, without
from jaxveh.fitting.rig_problem import PULL, RigProblem, contact_of, offered
from jaxveh.fitting.rig_robust import inflation
from jaxveh.fitting.rig_solve import covariance, information
from jaxveh.fitting.rig_stages import HELD, Stage, stages_of
from jaxveh.io.rig_table import MEASURED, RigTable
from jaxveh.tyres import AbstractTyre, MFTyre

JOINT = "joint"

KNOWN = ("nominal_load", "reference_load")
"""Parameters that say where others hold: known, not fitted unless `where` picks them."""


class RigFit(eqx.Module):
    """A tyre fitted to rig data.

    `tyre`: the law with its coefficients. `names` (p,), `values`, `std` (p,): the coefficients that were fitted, in the law's
    units and in the canonical one of the tyre's twins (`rig_canonical`); standard errors by the Gauss-Newton matrix of the joint
    stage with the noise estimated from residuals. nan for what stands at its start, because data do not identify it or because it
    is held unless asked (`rig_stages.HELD`): in the others' errors it counts with a spread of its own size, or of what it is
    among ordinary tyres. `identified`: how many directions the data do.
    `unconstrained`, `covariance` (p, p): on the line of each one's bijector. By channel (`F_x`, ...): `rmse` of residuals,
    `peak` (the 99.5th percentile of what was measured), `start_rmse` before the fit, `noise` (standard deviation), and
    `cross_validation`, the RMSE at rows that a fold's fit did not see (nan without). `residuals` (n,): fitted less measured, nan
    without a measurement. `stages`: a report each.
    """

    tyre: AbstractTyre
    names: tuple[str, ...] = eqx.field(static=True)
    values: np.ndarray
    std: np.ndarray
    unconstrained: np.ndarray
    covariance: np.ndarray
    identified: int = eqx.field(static=True)
    rmse: dict[str, float]
    start_rmse: dict[str, float]
    cross_validation: dict[str, float]
    peak: dict[str, float]
    noise: dict[str, float]
    residuals: dict[str, np.ndarray]
    stages: tuple[StageReport, ...] = eqx.field(static=True)


def fit_rig(
    law: AbstractTyre,
    rig: RigTable,
    *,
    where: Where | None = None,
    free: Sequence[str] = (),
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
    """Fit a tyre to rig data, from the coefficients that it has.

    MF-Tyre goes in stages (pure slip, combined slip, moments) over the coefficients that the data show (those of load where
    the load varies, and so on), then all of them together; other laws at once. `where` picks coefficients instead. `free`:
    names of those that are held unless asked (`lateral.PKY4`, the form of the cornering stiffness over load, which stays at what
    the law has, 2 in a typical one). What the data do not identify stays at its start.
    `measured`: the forces and moments to be compared; by default those that both data and law have. `weights`: by channel, on
    top of one over the noise squared, which is estimated. `bounds`: by name, an interval that a coefficient stays in. `robust`:
    residuals are taken for Student's t with 4 degrees of freedom, on the scale of their median size, so that outliers count
    little. `folds`: parts for cross-validation, whole runs
    where the data number them, blocks of rows where not; 0 for none. `staged=False` goes straight to the joint fit, for a law
    that is near the data already.

    **Raises** `InputError` for a channel, weight or bound that has no match, a start outside its bounds or without finite
    forces, too few rows, rows in which no slip varies, bad `folds` or `max_steps`;
    `FilterError` where the joint fit does not converge, unless `throw=False`.
    """
    contact = contact_of(rig)
    channels = _channels(law, rig, contact, measured)
    extra = {} if weights is None else dict(weights)
    check_names("weights", extra, channels)
    for name, weight in extra.items():
        check_positive(f"weights[{name!r}]", weight)
    check_at_least("max_steps", max_steps, 1)
    chosen = None if where is None else tuple(p.name for p in resolve(law, where))
    plan = stages_of(law, rig, channels, chosen, free)
    _check_free(free, plan)
    fitted, aside = _names(law, plan, chosen), tuple(name for stage in plan for name in stage.aside)
    names = (*fitted, *aside)
    settings = Settings(extra, dict(bounds or {}), robust, max_steps, tolerance)
    data = RigData(rig, contact, channels, names, settings)
    data.check(law)
    parts = fold_of(rig, folds) if folds else np.zeros(rig.load.shape)
    joint = Stage(JOINT, channels, names, np.ones(rig.load.shape, bool))
    plan = [*(plan if staged else ()), joint._replace(coefficients=fitted)]
    total = len(plan) + folds
    tyre, reports = law, []
    for k, stage in enumerate(plan):
        progress(k, total, stage.name)
        tyre, report = data.fit(tyre, stage)
        reports.append(report)
    settled = settle(data, law, tyre, joint, aside, reports[-1])
    tyre, reports[-1] = settled.tyre, settled.report
    plan = [without(stage, settled.held, names) for stage in plan]
    missed = np.full(data.measured.shape, np.nan)
    for k in range(folds):
        progress(len(plan) + k, total, "cross-validation")
        missed[:, parts == k] = _unseen(data, law, plan, parts == k)[:, parts == k]
    progress(total, total, JOINT)
    validation = rms(channels, missed) if folds else dict.fromkeys(channels, float("nan"))
    fit = _result(data, tyre, joint, settled.held, tuple(reports), data.rmse(law), validation)
    if throw and not reports[-1].converged:
        steps = reports[-1].steps
        raise FilterError(f"fit to {rig.source} stopped after {steps} steps; throw=False returns it as it is.")
    return fit


def _check_free(free: Sequence[str], plan: list[Stage]) -> None:
    there = tuple(dict.fromkeys(name for stage in plan for name in stage.coefficients))
    check_names("free", dict.fromkeys(free), there)


def _unseen(data: RigData, law: AbstractTyre, plan: list[Stage], rows: np.ndarray) -> np.ndarray:
    """Residuals (m, n) of a fit from the same start that did not see some rows."""
    rest = data.without(rows)
    for stage in plan:
        if (rest.present[[data.channels.index(name) for name in stage.channels]] & stage.rows).any():
            law, _ = rest.fit(law, stage)
    return data.residuals(law)


def _channels(law: AbstractTyre, rig: RigTable, contact: Any, measured: Sequence[str] | None) -> tuple[str, ...]:
    has = offered(law, contact)
    there = tuple(name for name in MEASURED if getattr(rig, name) is not None)
    if measured is None:
        found = tuple(name for name in there if name in has)
        if not found:
            raise InputError(
                f"{rig.source} has {', '.join(there)}, {type(law).__name__} {', '.join(has)}: nothing in common."
            )
        return found
    for name in measured:
        check_one_of("measured", name, MEASURED)
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
        raise InputError(f"{type(law).__name__} has no coefficient to be fitted.")
    return found


def _result(data: RigData, law, joint: Stage, held: np.ndarray, reports, start_rmse, validation) -> RigFit:
    parameters = data.parameters(law)
    values = np.array([float(value) for value in pick(law, parameters)])
    problem = data.problem(law, joint, data.noise(law))
    # The noise is that of the fit, with the degrees of freedom that coefficients take.
    count = int(data.present.sum())
    free = count / (count - int((~held).sum()))
    noise = data.noise(law)
    if data.chosen.robust:
        free *= inflation(data.residuals(law) / np.array([[noise[name]] for name in data.channels]))
    spread, known = _spread(data, law, joint, problem, held)
    line = np.asarray(spread * problem.scale * problem.scale[:, None]) * free
    slopes = np.array([float(p.domain.slope(value)) for p, value in zip(parameters, values, strict=True)])
    residual = data.residuals(law)
    return RigFit(
        tyre=law,
        names=joint.coefficients,
        values=values,
        std=np.where(held, np.nan, np.sqrt(np.diag(line)) * np.abs(slopes)),
        unconstrained=np.asarray(problem.origin),
        covariance=line,
        identified=int(known),
        rmse=data.rmse(law),
        start_rmse=start_rmse,
        cross_validation=validation,
        peak=data.peak,
        noise=data.noise(law),
        residuals=dict(zip(data.channels, residual, strict=True)),
        stages=reports,
    )


def _spread(data: RigData, law: AbstractTyre, joint: Stage, problem: RigProblem, held) -> tuple[Any, Any]:
    """The covariance (p, p) in the problem's coordinates, and how many directions the data identify.

    What is held at its start for lack of data may be off by its own size, what is held unless asked by what `HELD` says, and what
    is confounded with it by as much.
    """
    zero = jnp.zeros(problem.origin.shape)
    found = information(problem, zero)
    spreads = jnp.asarray([HELD.get(name, np.nan) for name in joint.coefficients])
    size = jnp.where(jnp.isnan(spreads), 1.0, spreads / problem.scale)
    prior = jnp.where(jnp.asarray(held), 1 / size**2, PULL**2)
    spread, known = covariance(found, prior)
    if not data.chosen.weights:
        return spread, known
    # Weights of the user's change what is minimised, not what is known: the sandwich, and what the data know without them. The
    # pull counts in its middle as in its ends: what data do not show stays unknown.
    middle, plain = (information(data.problem(law, joint, data.noise(law), power), zero) for power in (1.0, 0.0))
    middle = middle + jnp.diag(prior.astype(middle.dtype))
    return spread @ middle @ spread, covariance(plain)[1]

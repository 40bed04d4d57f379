"""Tyres fitted to rig data: staged least squares, standard errors, cross-validation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.bijectors import Interval
from jaxveh._core.errors import FilterError, InputError, check_at_least, check_one_of, check_positive
from jaxveh._core.names import check_names
from jaxveh._core.parameter import Parameter, Where, pick, resolve
from jaxveh._core.progress import Progress, silent
from jaxveh.fitting.rig_problem import RigProblem, contact_of, offered, start_of
from jaxveh.fitting.rig_solve import Solved, covariance, information, predicted, solve
from jaxveh.fitting.rig_stages import Stage, stages_of
from jaxveh.io.rig_table import MEASURED, RigTable
from jaxveh.tyres import AbstractTyre

JOINT = "joint"

CURVATURES = (-1.0, 0.5)
"""Where else a stage starts its curvature."""

LEAST_NOISE = 1e-4
"""The least noise over peak that weighs a channel: one that fits perfectly would outweigh all others."""


class StageReport(NamedTuple):
    """What one stage did: its `name`, `rows` and `coefficients` that counted, the RMS of its channels' residuals over their
    peak `before` and `after`, `steps` taken, and whether the solver `converged`."""

    name: str
    rows: int
    coefficients: int
    before: float
    after: float
    steps: int
    converged: bool


class RigFit(eqx.Module):
    """A tyre fitted to rig data.

    `tyre`: the law with its coefficients. `names` (p,), `values`, `std` (p,): the coefficients that were fitted, in the law's
    units; standard errors by the Gauss-Newton matrix of the joint stage with the noise estimated from residuals, nan where
    one is larger than the coefficient's own size: data do not identify it; `identified`: how many directions they do.
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
    measured: Sequence[str] | None = None,
    weights: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    robust: bool = False,
    folds: int = 0,
    max_steps: int = 200,
    tolerance: float = 1e-7,
    progress: Progress = silent,
    throw: bool = True,
) -> RigFit:
    """Fit a tyre to rig data, from the coefficients that it has.

    MF-Tyre goes in stages (pure slip, combined slip, moments) over the coefficients that the data show (those of load where
    the load varies, and so on), then all of them together; other laws at once. `where` picks coefficients instead.
    `measured`: the forces and moments to be compared; by default those that both data and law have. `weights`: by channel, on
    top of one over the noise, which is estimated. `bounds`: by name, an interval that a coefficient stays in. `robust`:
    residuals beyond two standard deviations count by their size. `folds`: parts for cross-validation, whole runs
    where the data number them, blocks of rows where not; 0 for none.

    **Raises** `InputError` for a channel, weight or bound that has no match, a start outside its bounds, too few rows;
    `FilterError` where the joint fit does not converge, unless `throw=False`.
    """
    contact = contact_of(rig)
    channels = _channels(law, rig, contact, measured)
    extra = {} if weights is None else dict(weights)
    check_names("weights", extra, channels)
    for name, weight in extra.items():
        check_positive(f"weights[{name!r}]", weight)
    chosen = None if where is None else tuple(p.name for p in resolve(law, where))
    plan = stages_of(law, rig, channels, chosen)
    names = _names(law, plan, chosen)
    data = _Data(rig, contact, channels, extra, dict(bounds or {}), robust, max_steps, tolerance)
    data.check(names)
    joint = Stage(JOINT, channels, names, np.ones(rig.load.shape, bool))
    total = len(plan) + 1 + folds
    start_rmse, reports = data.rmse(law), []
    for k, stage in enumerate(plan):
        progress(k, total, stage.name)
        law, report, _ = data.fit(law, stage)
        reports.append(report)
    progress(len(plan), total, JOINT)
    law, report, solved = data.fit(law, joint)
    reports.append(report)
    validation = data.cross_validate(
        law, joint, folds, lambda k: progress(len(plan) + 1 + k, total, "cross-validation")
    )
    progress(total, total, JOINT)
    fit = _result(data, law, joint, solved, tuple(reports), start_rmse, validation)
    if throw and not report.converged:
        raise FilterError(f"fit to {rig.source} stopped after {report.steps} steps; throw=False returns it as it is.")
    return fit


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
    if plan:
        return tuple(dict.fromkeys(name for stage in plan for name in stage.coefficients))
    return tuple(p.name for p in resolve(law, lambda law: jax.tree.leaves(law)))


class _Data:
    """Rig data and settings that all stages share."""

    def __init__(self, rig, contact, channels, weights, bounds, robust, max_steps, tolerance):
        self.rig, self.contact, self.channels, self.bounds = rig, contact, channels, bounds
        self.robust, self.max_steps, self.tolerance, self.weights = robust, max_steps, tolerance, weights
        measured = np.stack([getattr(rig, name) for name in channels])
        self.present = np.isfinite(measured)
        self.measured = np.where(self.present, measured, 0.0)
        sizes = [
            np.percentile(np.abs(row[here]), 99.5) if here.any() else np.nan
            for row, here in zip(measured, self.present, strict=True)
        ]
        self.peak = dict(zip(channels, (float(size) for size in sizes), strict=True))
        for name, size in self.peak.items():
            check_positive(f"{rig.source}: largest {name}", size, advice="Leave this channel out: measured=...")

    def check(self, names: tuple[str, ...]) -> None:
        """Raise for bounds without a coefficient, and for fewer measurements than coefficients."""
        check_names("bounds", self.bounds, names)
        count = int(self.present.sum())
        check_at_least(f"{self.rig.source}: measurements for {len(names)} coefficients", count, len(names) + 1)

    def parameters(self, law, names) -> tuple[Parameter, ...]:
        found = resolve(law, lambda law: [_leaf(law, name) for name in names])
        return tuple(self._bounded(law, p) for p in found)

    def _bounded(self, law, p: Parameter) -> Parameter:
        if p.name not in self.bounds:
            return p
        low, high = self.bounds[p.name]
        value = float(_leaf(law, p.name))
        if not low < value < high:
            raise InputError(f"bounds[{p.name!r}] = ({low:g}, {high:g}): the start {value:g} must lie inside.")
        return p._replace(domain=Interval(float(low), float(high)))

    def problem(self, law, stage: Stage, noise: Mapping[str, float], rows: np.ndarray | None = None) -> RigProblem:
        """The stage's problem, weighted by one over the noise of each channel."""
        parameters = self.parameters(law, stage.coefficients)
        origin, scale = start_of(law, parameters)
        index = [self.channels.index(name) for name in stage.channels]
        counts = self.present[index] & (stage.rows if rows is None else rows)
        size = np.array([np.sqrt(self.weights.get(name, 1.0)) / noise[name] for name in stage.channels])
        return RigProblem(
            law, self.contact, jnp.asarray(self.measured[index]), jnp.asarray(counts * size[:, None]), origin, scale,
            parameters, stage.channels, self.robust,
        )  # fmt: skip

    def residuals(self, law) -> np.ndarray:
        """Fitted less measured (m, n), nan without a measurement."""
        found = np.asarray(_forces(law, self.contact, self.channels, jnp.asarray(self.measured)))
        return np.where(self.present, found - self.measured, np.nan)

    def rmse(self, law) -> dict[str, float]:
        return dict(zip(self.channels, np.sqrt(np.nanmean(self.residuals(law) ** 2, axis=1)).tolist(), strict=True))

    def noise(self, law) -> dict[str, float]:
        """The spread of residuals: their RMS, or where the fit is robust 1.48 times their median size."""
        size = self.residuals(law)
        spread = 1.4826 * np.nanmedian(np.abs(size), axis=1) if self.robust else np.sqrt(np.nanmean(size**2, axis=1))
        return {
            name: max(float(one), LEAST_NOISE * self.peak[name])
            for name, one in zip(self.channels, spread, strict=True)
        }

    def share(self, law, stage: Stage) -> float:
        """RMS of the stage's residuals over their channels' peaks."""
        index = [self.channels.index(name) for name in stage.channels]
        peaks = np.array([self.peak[name] for name in stage.channels])
        rows = np.where(stage.rows, self.residuals(law)[index], np.nan) / peaks[:, None]
        return float(np.sqrt(np.nanmean(rows**2)))

    def fit(self, law, stage: Stage) -> tuple[AbstractTyre, StageReport, Solved]:
        """One stage, from each of its starts; the best end counts."""
        before = self.share(law, stage)
        ends = [self._descend(one, stage) for one in starts_of(law, stage)]
        law, steps, solved = min(ends, key=lambda end: self.share(end[0], stage))
        counts = int(
            np.sum(stage.rows & self.present[[self.channels.index(name) for name in stage.channels]].any(axis=0))
        )
        after = self.share(law, stage)
        names = len(stage.coefficients)
        return law, StageReport(stage.name, counts, names, before, after, steps, bool(solved.converged)), solved

    def _descend(self, law, stage: Stage) -> tuple[AbstractTyre, int, Solved]:
        """From one start: twice where the noise, which weighs channels and says what is an outlier, has to be found first."""
        steps, again = 0, self.robust or len(stage.channels) > 1
        for _ in range(1 + again):
            problem = self.problem(law, stage, self.noise(law))
            solved = solve(problem, jnp.zeros(problem.origin.shape), self.max_steps, self.tolerance)
            law, steps = problem.filled(solved.z), steps + int(solved.steps)
        return law, steps, solved

    def cross_validate(self, law, joint: Stage, folds: int, tell: Callable[[int], None]) -> dict[str, float]:
        """RMSE of each channel at rows that the fold's fit, from the fit to all, did not see."""
        if folds == 0:
            return {name: float("nan") for name in self.channels}
        part, noise = fold_of(self.rig, folds), self.noise(law)
        missed = np.full(self.measured.shape, np.nan)
        for k in range(folds):
            tell(k)
            problem = self.problem(law, joint, noise, rows=part != k)
            solved = solve(problem, jnp.zeros(problem.origin.shape), self.max_steps, self.tolerance)
            found = np.asarray(predicted(problem, solved.z))
            missed[:, part == k] = (found - self.measured)[:, part == k]
        missed = np.where(self.present, missed, np.nan)
        return dict(zip(self.channels, np.sqrt(np.nanmean(missed**2, axis=1)).tolist(), strict=True))


def starts_of(law: AbstractTyre, stage: Stage) -> list[AbstractTyre]:
    """The law as it is, and with other values of the stage's curvature."""
    if stage.curvature is None:
        return [law]
    leaf = lambda law: _leaf(law, stage.curvature)
    like = jnp.asarray(leaf(law))
    return [law] + [eqx.tree_at(leaf, law, jnp.asarray(value, like.dtype)) for value in CURVATURES]


def fold_of(rig: RigTable, folds: int) -> np.ndarray:
    """The fold (n,) of each row: whole runs where the data number them, else blocks of neighbours, which are no copies of
    each other, dealt in turn."""
    check_at_least("folds", folds, 2)
    if rig.run is not None and len(np.unique(rig.run)) >= folds:
        _, run = np.unique(rig.run, return_inverse=True)
        return run % folds
    rows = rig.load.size
    check_at_least(f"{rig.source}: rows for {folds} folds", rows, 4 * folds)
    return (np.arange(rows) * 4 * folds // rows) % folds


def _result(data: _Data, law, joint: Stage, solved: Solved, reports, start_rmse, validation) -> RigFit:
    parameters = data.parameters(law, joint.coefficients)
    values = np.array([float(value) for value in pick(law, parameters)])
    problem = data.problem(law, joint, data.noise(law))
    # The noise is that of the fit, with the degrees of freedom that coefficients take.
    count = int(data.present.sum())
    free = count / (count - len(parameters))
    spread, known = covariance(information(problem, jnp.zeros(problem.origin.shape)))
    line = np.asarray(spread * problem.scale * problem.scale[:, None]) * free
    unseen = np.asarray(jnp.diagonal(spread)) > 1.0
    slopes = np.array([float(p.domain.slope(value)) for p, value in zip(parameters, values, strict=True)])
    residual = data.residuals(law)
    return RigFit(
        tyre=law,
        names=joint.coefficients,
        values=values,
        std=np.where(unseen, np.nan, np.sqrt(np.diag(line)) * np.abs(slopes)),
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


@eqx.filter_jit
def _forces(law, contact, channels, measured):
    found = law.forces(contact)
    return jnp.stack([jnp.asarray(getattr(found, name), measured.dtype) + 0 * measured[0] for name in channels])


def _leaf(law, name: str) -> Any:
    for part in name.split("."):
        law = getattr(law, part)
    return law

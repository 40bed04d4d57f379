"""Rig data for the stages of a fit: rows that count, weights, starts, and the end of the fit."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.bijectors import Interval
from jaxveh._core.errors import InputError, check_at_least, check_positive
from jaxveh._core.names import check_names
from jaxveh._core.parameter import Parameter, resolve
from jaxveh.fitting.rig_problem import (
    PULL,
    Descent,
    RigProblem,
    contact_of,
    descend,
    fill_up,
    forces_of,
    of_common_length,
    rows_of_common_length,
    start_of,
)
from jaxveh.fitting.rig_robust import TO_DEVIATION
from jaxveh.fitting.rig_stages import Stage
from jaxveh.io import RigTable
from jaxveh.tyres import AbstractTyre, Contact

LEAST_NOISE = 1e-4
"""Lower limit of the noise over peak in a channel's weight: a channel that fits perfectly would outweigh all others."""

ROUND = 100
"""Steps after which the noise is estimated again and the pull restarts: along valleys that data hardly show, several such
rounds get further than one long one."""

SETTLED = 0.5
"""A fit has converged where a round lowers the sum of squares, in units of the noise's variance, by less than this: no
combination of coefficients would move by more than a standard error. Coefficients that the data do not distinguish may drift on
without end."""


class StageReport(NamedTuple):
    """The report of one stage: its `name`, the `rows` and `coefficients` that counted, the RMS of its channels' residuals over
    their peak `before` and `after`, the `steps` from the best start, and whether it `converged`: according to the solver, or
    because a round of steps gained less than the noise."""

    name: str
    rows: int
    coefficients: int
    before: float
    after: float
    steps: int
    converged: bool


class Settings(NamedTuple):
    """The user's settings: `weights` and `bounds` by name, `robust`, `max_steps` per stage, the solver's `tolerance`; the
    centre and the standard deviation (p,) of a `prior` on the coefficients' real line."""

    weights: Mapping[str, float]
    bounds: Mapping[str, tuple[float, float]]
    robust: bool
    max_steps: int
    tolerance: float
    prior: tuple[Any, Any] | None = None


class RigData:
    """Rig data, the `channels` that are compared and the `names` of the fitted coefficients, shared by all stages.

    `measured` (m, n): values, zero where there is none; `present` (m, n): where there is one; `peak` by channel: the 99.5th
    percentile of the absolute values.
    """

    def __init__(
        self, rig: RigTable, contact: Contact, channels: tuple[str, ...], names: tuple[str, ...], chosen: Settings
    ):
        self.rig, self.contact, self.channels, self.names, self.chosen = rig, contact, channels, names, chosen
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

    def check(self, law: AbstractTyre) -> None:
        """Raise for bounds without a coefficient or without its start inside, for a start without finite forces, and for fewer
        measurements than coefficients."""
        check_names("bounds", self.chosen.bounds, self.names)
        self.parameters(law)
        count, coefficients = int(self.present.sum()), len(self.names)
        check_at_least(f"{self.rig.source}: measurements for {coefficients} coefficients", count, coefficients + 1)
        wrong = self.present & ~np.isfinite(self.residuals(law))
        if wrong.any():
            channel, row = np.argwhere(wrong)[0]
            raise InputError(
                f"{type(law).__name__}: {self.channels[channel]} is not finite in row {row} of {self.rig.source}: "
                "start from another tyre."
            )

    def without(self, rows: np.ndarray) -> RigData:
        """The same data without the measurements of some rows, a mask (n,)."""
        rest = copy.copy(self)
        rest.present = self.present & ~rows
        return rest

    def take(self, rows: np.ndarray) -> RigData:
        """Some `rows` (indices) of the same data, with the peaks of all."""
        some = copy.copy(self)
        some.rig = self.rig.take(rows)
        some.contact = contact_of(some.rig)
        some.measured, some.present = self.measured[:, rows], self.present[:, rows]
        return some

    def parameters(self, law: AbstractTyre) -> tuple[Parameter, ...]:
        """The fitted parameters, with their bounds."""
        found = resolve(law, lambda law: [leaf_of(law, name) for name in self.names])
        return tuple(self._with_bounds(law, p) for p in found)

    def _with_bounds(self, law: AbstractTyre, p: Parameter) -> Parameter:
        if p.name not in self.chosen.bounds:
            return p
        low, high = self.chosen.bounds[p.name]
        value = float(leaf_of(law, p.name))
        if not low < value < high:
            raise InputError(f"bounds[{p.name!r}] = ({low:g}, {high:g}): the start {value:g} must lie inside.")
        return p._replace(domain=Interval(float(low), float(high)))

    def problem(self, law: AbstractTyre, stage: Stage, noise: Mapping[str, float]) -> RigProblem:
        """The stage's problem, weighted by one over the noise of each channel.

        All stages have the same shapes: channels that a stage does not compare have zero weight, and coefficients that it
        does not fit are held. So one compilation serves them all; it takes longer than all steps.
        """
        parameters = self.parameters(law)
        origin, scale = start_of(law, parameters)
        moves = np.array([name in stage.coefficients for name in self.names])
        size = [1 / noise[name] if name in stage.channels else 0.0 for name in self.channels]
        counts = self.present & stage.rows
        emphasis = np.array([self.chosen.weights.get(name, 1.0) for name in self.channels])
        centre, spread = self.chosen.prior or (origin, jnp.full_like(origin, jnp.inf))
        return RigProblem(
            law=law,
            contact=self.contact,
            measured=jax.device_put(self.measured),
            weight=jax.device_put(counts * np.array(size)[:, None]),
            emphasis=jnp.asarray(emphasis),
            origin=origin,
            scale=jnp.where(moves, scale, 0.0),
            centre=centre,
            spread=spread,
            pull=jnp.asarray(PULL, origin.dtype),
            chosen=parameters,
            channels=self.channels,
            robust=self.chosen.robust,
        )

    def residuals(self, law: AbstractTyre) -> np.ndarray:
        """Fitted less measured (m, n), nan without a measurement."""
        contact, measured = rows_of_common_length(self.contact, self.measured)
        found = np.asarray(_forces(law, contact, self.channels, measured))[:, : self.measured.shape[1]]
        return np.where(self.present, found - self.measured, np.nan)

    def rmse(self, law: AbstractTyre) -> dict[str, float]:
        """The RMS of each channel's residuals."""
        return rms(self.channels, self.residuals(law))

    def noise(self, law: AbstractTyre) -> dict[str, float]:
        """The standard deviation of residuals: their RMS, or for a robust fit 1.48 times their median size."""
        size = self.residuals(law)
        robust = self.chosen.robust
        spread = TO_DEVIATION * np.nanmedian(np.abs(size), axis=1) if robust else np.sqrt(np.nanmean(size**2, axis=1))
        return {
            name: max(float(one), LEAST_NOISE * self.peak[name])
            for name, one in zip(self.channels, spread, strict=True)
        }

    def share(self, law: AbstractTyre, stage: Stage) -> float:
        """RMS of the stage's residuals over their channels' peaks."""
        peaks = np.array([[self.peak[name]] for name in self.channels])
        rows = np.where(self.counts(stage), self.residuals(law), np.nan) / peaks
        return float(np.sqrt(np.nanmean(rows**2)))

    def loss(self, law: AbstractTyre, stage: Stage, noise: Mapping[str, float]) -> float:
        """The minimised loss of the stage, comparable between laws for the same noise; infinite where a force is not finite."""
        problem = of_common_length(self.problem(law, stage, noise))
        rows = fill_up(np.where(self.counts(stage), self.residuals(law), 0.0), problem.weight.shape[1], "constant")
        bent = problem.bend(problem.weight * rows)[0]
        return float(np.nan_to_num(jnp.sum(problem.emphasis[:, None] * bent**2), nan=np.inf))

    def counts(self, stage: Stage) -> np.ndarray:
        """Which measurements (m, n) count in a stage."""
        return self.present & stage.rows & np.array([[name in stage.channels] for name in self.channels])

    def fit(self, law: AbstractTyre, stage: Stage) -> tuple[AbstractTyre, StageReport]:
        """Run one stage: from the law, then from its other starts; the best end is returned."""
        before = self.share(law, stage)
        law, steps, converged = self.descend(law, stage)
        # The other starts change this end in a few coefficients: near the data in all others, they do not run back to it.
        ends = [self.descend(one, stage, ROUND)[0] for one in starts_of(law, stage, self.chosen.bounds)]
        noise = self.noise(law)
        best = min([law, *ends], key=lambda end: self.loss(end, stage, noise))
        if best is not law:
            law, steps, converged = self.descend(best, stage)
        rows = int(np.sum(self.counts(stage).any(axis=0)))
        report = StageReport(
            stage.name, rows, len(stage.coefficients), before, self.share(law, stage), steps, converged
        )
        return law, report

    def descend(self, law: AbstractTyre, stage: Stage, most: int | None = None) -> tuple[AbstractTyre, int, bool]:
        """Descend from one start, in rounds: the noise, which weights channels and defines outliers, has to be found first.

        Returns the law, the number of steps (limited by `most`, by default the user's limit), and whether it converged.
        """
        most = self.chosen.max_steps if most is None else most
        steps, alone = 0, not self.chosen.robust and len(stage.channels) == 1
        while steps < most:
            problem, limit = self.problem(law, stage, self.noise(law)), min(ROUND, most - steps)
            found, lowered = _descend(of_common_length(problem), jnp.asarray(limit), self.chosen.tolerance)
            law, steps = problem.model_at(found.z), steps + int(found.steps)
            if 2 * float(lowered) < SETTLED or (alone and bool(found.converged)):
                return law, steps, True
        return law, steps, False


def rms(channels: tuple[str, ...], residuals: np.ndarray) -> dict[str, float]:
    """The RMS of residuals (m, n), by channel; nan does not count."""
    return dict(zip(channels, np.sqrt(np.nanmean(residuals**2, axis=1)).tolist(), strict=True))


def starts_of(law: AbstractTyre, stage: Stage, bounds: Mapping[str, tuple[float, float]]) -> list[AbstractTyre]:
    """The law with every combination of the stage's other starts, within their bounds."""
    choices = []
    for name, values in stage.starts:
        low, high = bounds.get(name, (-np.inf, np.inf))
        choices.append([(name, value) for value in (None, *values) if value is None or low < value < high])
    return [_start_from(law, one) for one in itertools.product(*choices)][1:]


def _start_from(law: AbstractTyre, start: Sequence[tuple[str, float | None]]) -> AbstractTyre:
    for name, value in start:
        law = law if value is None else with_leaf(law, name, value)
    return law


def fold_of(rig: RigTable, folds: int) -> np.ndarray:
    """The fold (n,) of each row: whole runs if the data number them, otherwise blocks of neighbouring rows (single rows would
    be nearly copies of their neighbours), dealt in turn."""
    check_at_least("folds", folds, 2)
    if rig.run is not None and len(np.unique(rig.run)) >= folds:
        _, run = np.unique(rig.run, return_inverse=True)
        return run % folds
    rows = rig.load.size
    check_at_least(f"{rig.source}: rows for {folds} folds", rows, 4 * folds)
    return (np.arange(rows) * 4 * folds // rows) % folds


_forces = eqx.filter_jit(forces_of)


@eqx.filter_jit
def _descend(problem: RigProblem, limit, tolerance: float) -> Descent:
    """Steps from the law's coefficients: a block between two estimates of the noise by the host."""
    return descend(problem, problem.start(), None, tolerance, limit)


def leaf_of(law: AbstractTyre, name: str) -> Any:
    """The coefficient of a dotted name."""
    for part in name.split("."):
        law = getattr(law, part)
    return law


def with_leaf(law: AbstractTyre, name: str, value: Any) -> AbstractTyre:
    """The law with another value of the coefficient of a dotted name."""
    like = jnp.asarray(leaf_of(law, name))
    return eqx.tree_at(lambda law: leaf_of(law, name), law, jnp.asarray(value, like.dtype))

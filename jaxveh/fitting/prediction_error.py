"""Prediction-error fits: a Gaussian filter's likelihood maximised by Fisher scoring, from forward derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from jaxveh._core.errors import InputError, check_flags, check_kind, check_positive, check_whole, is_concrete
from jaxveh._core.parameter import Parameter, Where, pick, strong
from jaxveh._core.progress import Progress, check_progress, silent
from jaxveh._core.recording import Recording
from jaxveh.filters import AbstractFilter, scan
from jaxveh.fitting.filter_problem import AbstractFilterProblem
from jaxveh.fitting.levenberg_marquardt import Quadratic
from jaxveh.fitting.problem import SearchEnd, on_line, scalar_parameters
from jaxveh.fitting.recorded import as_list, spread_on_line
from jaxveh.fitting.result import Fit, raise_unfinished
from jaxveh.fitting.scoring import FisherScoring
from jaxveh.fitting.solve import fit_at, solve
from jaxveh.statespace import Gradient, StateSpace, kit

LOG_2PI = float(np.log(2 * np.pi))

BLOCK = 1
"""Steps between two reports of progress: each is a pass over all the data."""


class Target(NamedTuple):
    """A reference for a reported quantity: `values` of the model's `name`, one (T,) array per recording, NaN for none.

    Each row adds `rho(reported - values) / weight^2` to the cost, with the pseudo-Huber function rho that bends at `bend`; both
    are in the quantity's unit. The filter itself does not use the values.
    """

    name: str
    values: Any
    weight: float
    bend: float


class _Name(eqx.Module):
    """A string that is part of the structure, not an argument, of a compiled function."""

    name: str = eqx.field(static=True)


class PredictionErrorProblem(AbstractFilterProblem):
    """A Gaussian filter's negative log-likelihood of recordings of one length, as squares of its whitened innovations, as a
    function of the chosen parameters of its model.

    `rows` has (K, T) leaves; `counts` (K,): how many times each recording counts. `centre`, `spread` (p,): mean and standard
    deviation of the prior on the real line of the bijectors; infinite for no prior. The first `warm_up` rows of each recording
    do not count.
    """

    target: Any
    warm_up: int = eqx.field(static=True)
    chosen: tuple[Parameter, ...] = eqx.field(static=True)

    def cost(self, z):
        return _cost(self, self.parts(z)) + self.prior_cost(z)

    def unit(self):
        """The unit of a step (p,): the prior's standard deviation, or one on the real line without a prior."""
        return jnp.where(jnp.isfinite(self.spread), self.spread, 1.0)

    def search(self, z, max_steps, tolerance):
        found, state = score(self, z, None, tolerance, jnp.asarray(max_steps))
        return SearchEnd(found, state.steps, state.done, state.at.cost, uncertainty(state.at))

    def covariance(self, z):
        return uncertainty(quadratic(z, self))

    def is_failure(self, cost):
        return ~jnp.isfinite(cost)

    def units(self):
        return self.rows.t.shape[0]

    def parts(self, z) -> Parts:
        """The parts of the cost at z."""
        model = self.model_at(z)
        if self.target is None:
            return jax.vmap(lambda rows: self._one(model, rows, None))(self.rows)
        return jax.vmap(lambda rows, values: self._one(model, rows, values))(self.rows, self.target.values)

    def _one(self, model, rows, values):
        estimate = scan(self.filter, model, rows)
        counts = jnp.arange(rows.t.shape[0]) >= self.warm_up
        present = jnp.stack([jnp.isfinite(getattr(rows.y, n)) & counts for n in model.channels], axis=1)
        white = jnp.where(present, jnp.stack(estimate.info.whitened, axis=1), 0)
        # The normal law's constant is added per measurement, so that the cost equals the negative log-likelihood.
        levels = jnp.where(present, jnp.stack(estimate.info.log_scale, axis=1), 0)
        constant = 0.5 * LOG_2PI * jnp.sum(present, dtype=white.dtype)
        return Parts(white, levels, self._target_residuals(estimate, values, counts, white.dtype), constant)

    def _target_residuals(self, estimate, values, counts, dtype):
        if values is None:
            return jnp.zeros((0,), dtype)
        known = jnp.isfinite(values) & counts
        error = getattr(estimate.mean, self.target.name.name) - jnp.where(known, values, 0)
        # The square root of twice the pseudo-Huber cost, with its sign: smooth at zero.
        share = jnp.sqrt(2 / (jnp.sqrt(1 + (error / self.target.bend) ** 2) + 1))
        return jnp.where(known, error * share / self.target.weight, 0)


class Parts(NamedTuple):
    """Whitened innovations and log standard deviations (K, T, m), zero where not counted, the target's residuals (K, T), and
    the constants (K,) of the normal laws."""

    white: Any
    levels: Any
    supervised: Any
    constant: Any


def _cost(problem: PredictionErrorProblem, parts: Parts):
    """The negative log-likelihood with the target's cost, without the prior's."""
    by_recording = lambda leaf: jnp.sum(leaf, axis=tuple(range(1, leaf.ndim)))
    squares = by_recording(parts.white**2) + by_recording(parts.supervised**2)
    return jnp.sum(problem.counts * (0.5 * squares + by_recording(parts.levels) + parts.constant))


def _scalar(z, problem: PredictionErrorProblem):
    """In the place of the cost, of which the solver needs the shape alone: it has its values from `quadratic`. To trace the
    filter once more would take a second or two."""
    return jnp.zeros((), z.dtype)


def quadratic(z, problem: PredictionErrorProblem) -> Quadratic:
    """Cost, gradient (p,) and expected information (p, p) of the negative log-posterior at z, from one forward pass."""
    push = lambda direction: jax.jvp(problem.parts, (z,), (direction,))
    parts, slopes = jax.vmap(push, out_axes=(None, 0))(jnp.eye(z.size, dtype=z.dtype))
    deviation = (z - problem.centre) / problem.spread
    cost = _cost(problem, parts) + 0.5 * jnp.sum(deviation**2)
    # Each recording is weighted by its count: the square root on either side of a product.
    weigh = lambda leaf: jnp.sqrt(problem.counts).reshape(-1, *(1,) * (leaf.ndim - 1)) * leaf
    flat = lambda leaf: jax.vmap(weigh)(leaf).reshape(z.size, -1)
    white, levels, supervised = (flat(leaf) for leaf in (slopes.white, slopes.levels, slopes.supervised))
    gradient = white @ weigh(parts.white).reshape(-1) + supervised @ weigh(parts.supervised).reshape(-1)
    gradient = gradient + levels @ weigh(jnp.ones_like(parts.levels)).reshape(-1) + deviation / problem.spread
    # With w = e / exp(s), dw = de / exp(s) - w ds, whose square contains one of the two ds^2 in (dlog S)^2 / 2.
    information = white @ white.T + levels @ levels.T + supervised @ supervised.T
    return Quadratic(cost, gradient, information + jnp.diag(1 / problem.spread**2))


def uncertainty(at: Quadratic) -> tuple[jax.Array, jax.Array]:
    """The covariance (p, p) from the information at the optimum, and a mask (p,) that marks every parameter as known."""
    return jnp.linalg.pinv(at.matrix, hermitian=True), jnp.ones(at.gradient.shape, bool)


def score(problem: PredictionErrorProblem, z, state, tolerance: float, limit):
    """Fisher scoring from z, or continued from a `state`, up to `limit` steps in all: the end point and the state."""
    solver = FisherScoring(atol=tolerance, quadratic=quadratic)
    options = {"unit": problem.unit(), "limit": limit} | ({} if state is None else {"state": state})
    found = optx.minimise(_scalar, solver, z, problem, options=options, max_steps=None, throw=False)
    return found.value, found.state


def pose_prediction_error(
    filter: AbstractFilter,
    model: StateSpace,
    recordings: Recording | Sequence[Recording],
    where: Where,
    *,
    prior: float | Mapping[str, float] | None = None,
    centre: StateSpace | None = None,
    target: Target | None = None,
    warm_up: int = 0,
) -> PredictionErrorProblem:
    """The problem of `prediction_error`, for `solve`; arguments and errors as there."""
    kit.check_told(filter, model)
    if target is not None:
        check_kind("target", target, Target, "fitting.Target(name, values, weight, bend) makes one.")
    if centre is not None:
        kit.check_model("centre", centre)
    check_whole("warm_up", warm_up, 0)
    recordings = as_list(recordings)
    if len({len(recording) for recording in recordings}) != 1:
        raise InputError("recordings: must have the same number of rows; cut them to one length.")
    if (mixture := kit.who_lacks(filter, "whitens")) is not None:
        raise InputError(f"prediction_error: {mixture} has no whitened innovations; use maximum_likelihood with it.")
    kit.check_gradients("prediction_error", filter, Gradient.exact)
    model, centre = strong(model), strong(centre)
    filter.check(model)
    chosen = scalar_parameters(model, where)
    rows = jax.tree.map(lambda *leaves: jnp.stack(leaves), *[model.rows(recording) for recording in recordings])
    means = pick(model if centre is None else centre, chosen)
    line = on_line(chosen, means)
    return PredictionErrorProblem(
        filter=filter, model=model, rows=rows, counts=jnp.ones(len(recordings), line.dtype), centre=line,
        spread=spread_on_line(chosen, means, prior), target=_target(target, recordings), warm_up=warm_up,
        chosen=chosen,
    )  # fmt: skip


def prediction_error(
    filter: AbstractFilter,
    model: StateSpace,
    recordings: Recording | Sequence[Recording],
    where: Where,
    *,
    prior: float | Mapping[str, float] | None = None,
    centre: StateSpace | None = None,
    target: Target | None = None,
    warm_up: int = 0,
    max_steps: int = 40,
    tolerance: float = 0.05,
    progress: Progress = silent,
    throw: bool = True,
) -> Fit:
    """Maximise a Gaussian filter's likelihood (with `prior`: its posterior) over the leaves that `where` picks.

    It finds the optimum of `maximum_likelihood` in a dozen steps, each from one forward-mode pass for all parameters (Fisher
    scoring on innovations e with variance S: information `de de' / S + dlog S dlog S' / 2`; see `FisherScoring`). `progress`
    is called after each step. Works under `jit`, `vmap` and `grad`, then without `progress`; see `solve`.

    `where` is called with the StateSpace; `prior`: relative standard deviations, one number or by name, around the values of
    `centre` (default: the model's own). `target`: a reference for the fit. Recordings of equal length run as one batch: a
    long log cut into pieces is many times faster than in one piece. The pieces overlap by `warm_up` rows, in which each
    filter finds its state and which do not count. The fit ends when two steps in a row gain less than `tolerance` of
    log-posterior; for exact derivatives, make it small.

    **Returns** a `Fit`; standard errors from the expected information. **Raises** `InputError` for a filter without
    whitened innovations, recordings of different length, or `max_steps` below one; `FilterError` if it does not converge
    (`throw`).
    """
    check_flags(throw=throw)
    check_positive("tolerance", tolerance)
    check_whole("max_steps", max_steps)
    check_progress(progress)
    problem = pose_prediction_error(
        filter, model, recordings, where, prior=prior, centre=centre, target=target, warm_up=warm_up
    )
    if is_concrete(problem):
        fit = _stepwise(problem, max_steps, tolerance, progress)
    else:
        fit = solve(problem, max_steps=max_steps, tolerance=tolerance)
    if throw:
        raise_unfinished(fit)
    return fit


def _stepwise(problem: PredictionErrorProblem, max_steps: int, tolerance: float, progress: Progress) -> Fit:
    """The fit of `solve`, one block of steps at a time."""
    progress(0, max_steps, "fit (compiling first)")
    z = problem.start()
    state = FisherScoring(atol=tolerance, quadratic=quadratic).begin(z)
    while not bool(state.done) and int(state.steps) < max_steps:
        limit = min(int(state.steps) + BLOCK, max_steps)
        z, state = _block(problem, z, state, tolerance, jnp.asarray(limit))
        best = -float(state.at.cost)
        progress(int(state.steps), max_steps, f"fit: step {int(state.steps)}, log-posterior {best:.1f}")
    return _conclude(problem, SearchEnd(z, state.steps, state.done), state.at)


@eqx.filter_jit
def _block(problem: PredictionErrorProblem, z, state, tolerance: float, limit):
    return score(problem, z, state, tolerance, limit)


@eqx.filter_jit
def _conclude(problem: PredictionErrorProblem, found: SearchEnd, at: Quadratic) -> Fit:
    return fit_at(problem, found, at.cost, uncertainty(at))


def _target(target: Target | None, recordings) -> Target | None:
    if target is None:
        return None
    if len(target.values) != len(recordings):
        raise InputError(f"target has {len(target.values)} value arrays for {len(recordings)} recordings; must agree.")
    check_positive("target weight", target.weight)
    values = jnp.stack([jnp.asarray(v) for v in target.values])
    return target._replace(
        values=values,
        weight=jnp.asarray(target.weight, values.dtype),
        bend=jnp.asarray(target.bend, values.dtype),
        name=_Name(target.name),
    )

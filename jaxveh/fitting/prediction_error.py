"""Prediction-error fits: a Gaussian filter's likelihood maximised by Fisher scoring, from forward derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.parameter import Where, pick, prior_spread, put, resolve
from jaxveh._core.progress import Progress, silent
from jaxveh._core.recording import Recording
from jaxveh.filters import AbstractFilter, scan
from jaxveh.fitting.result import Fit, make_fit, raise_unfinished
from jaxveh.statespace import StateSpace

LOG_2PI = float(np.log(2 * np.pi))

FIRST_DAMPING, RAISED, LOWERED = 1e-2, 5.0, 0.2
"""Levenberg's damping at the start, and its factors after a step that raised and one that lowered the cost."""

SECANTS = 10
"""How many of the last steps correct the curvature."""

LONGEST_STEP = 2.0
"""In the prior's standard deviations (without a prior: on the real line): how far one step may move a parameter."""


class Target(NamedTuple):
    """A reference for a reported quantity: `values` by the model's `name`, one (T,) array a recording, NaN for none.

    Each row costs `rho(reported - values) / weight^2` beside the likelihood, rho the pseudo-Huber law with its bend at
    `bend`; both in the quantity's unit. The filter itself never sees the values.
    """

    name: str
    values: Any
    weight: float
    bend: float


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

    The optimum of `maximum_likelihood` in a dozen steps, each from one forward-mode pass for all parameters (Fisher scoring
    on innovations e with variance S: information `de de' / S + dlog S dlog S' / 2`; Ljung 1999, ch. 10; Gupta & Mehra
    1974), damped after Levenberg. The steps are taken on the host, one compiled function serves them all.

    `where` sees the StateSpace; `prior`: relative spreads as in `with_parameters`, around the values of `centre` (default:
    the model's own). `target`: a reference that supervises the fit. Recordings of equal length run as one batch: a long log
    cut into pieces that overlap by `warm_up` rows, in which each filter finds its state and which do not count, is many
    times faster than the log in one. Ends when two steps in a row gain less than `tolerance` of log-posterior.

    **Returns** a `Fit`; standard errors from the expected information. **Raises** `InputError` for a filter without
    whitened innovations, or recordings of different length; `FilterError` where it does not converge (`throw`).
    """
    recordings = [recordings] if isinstance(recordings, Recording) else list(recordings)
    if len({len(recording) for recording in recordings}) != 1:
        raise InputError("recordings: must be one or several of the same number of rows; cut them to one length.")
    check_positive("tolerance", tolerance)
    if (mixture := _without_whitened(filter)) is not None:
        raise InputError(f"prediction_error: {mixture} has no whitened innovations; use maximum_likelihood with it.")
    filter.check(model)
    parameters = resolve(model, where)
    rows = _stack([model.rows(recording) for recording in recordings])
    values, means = pick(model, parameters), pick(model if centre is None else centre, parameters)
    line = lambda physical: jnp.stack([p.domain.inverse(v) for p, v in zip(parameters, physical, strict=True)])
    spread = (
        jnp.full((len(parameters),), jnp.inf) if prior is None else jnp.stack(prior_spread(parameters, means, prior))
    )
    problem = _Problem(filter, model, rows, line(means), spread, _target(target, recordings), warm_up, parameters)
    z, cost, information, steps, converged = _score(problem, line(values), max_steps, tolerance, progress)
    counted = sum(int(np.isfinite(np.asarray(y)[:, warm_up:]).sum()) for y in rows.y)
    cost += 0.5 * LOG_2PI * counted
    covariance = jnp.asarray(np.linalg.pinv(information))
    fit = make_fit(
        parameters, z, covariance, jnp.asarray(cost), jnp.asarray(steps), jnp.asarray(converged), problem.filled(z)
    )
    if throw:
        raise_unfinished(fit)
    return fit


def _without_whitened(filter: Any) -> str | None:
    """The name of the filter, or of one that it goes around, whose innovations are not whitened."""
    while filter is not None:
        if not filter.whitens:
            return type(filter).__name__
        filter = getattr(filter, "filter", None)
    return None


def _stack(parts):
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *parts)


def _target(target: Target | None, recordings) -> Target | None:
    if target is None:
        return None
    if len(target.values) != len(recordings):
        raise InputError(f"target has {len(target.values)} value arrays for {len(recordings)} recordings; must agree.")
    check_positive("target weight", target.weight)
    values = jnp.stack([jnp.asarray(v) for v in target.values])
    return target._replace(values=values, weight=jnp.asarray(target.weight, values.dtype), name=_Name(target.name))


class _Name(eqx.Module):
    """A string that is part of the structure, not an argument, of a compiled function."""

    name: str = eqx.field(static=True)


class _Problem(eqx.Module):
    """What is to be minimised, over rows with (K, T) leaves."""

    filter: AbstractFilter
    model: StateSpace
    rows: Any
    centre: jax.Array
    spread: jax.Array
    target: Any
    warm_up: int = eqx.field(static=True)
    parameters: tuple = eqx.field(static=True)

    def filled(self, z) -> StateSpace:
        values = [p.domain.forward(value) for p, value in zip(self.parameters, z, strict=True)]
        return put(self.model, self.parameters, values)

    def parts(self, z):
        """Whitened innovations and log-spreads (K, T, m), zero where nothing counts, and the target's residuals (K, T)."""
        model = self.filled(z)
        if self.target is None:
            return jax.vmap(lambda rows: self._one(model, rows, None))(self.rows)
        return jax.vmap(lambda rows, values: self._one(model, rows, values))(self.rows, self.target.values)

    def _one(self, model, rows, values):
        estimate = scan(self.filter, model, rows)
        counts = jnp.arange(rows.t.shape[0]) >= self.warm_up
        present = jnp.stack([jnp.isfinite(getattr(rows.y, n)) & counts for n in model.channels], axis=1)
        white = jnp.where(present, jnp.stack(estimate.info.whitened, axis=1), 0)
        levels = jnp.where(present, jnp.stack(estimate.info.log_scale, axis=1), 0)
        return white, levels, self._supervised(estimate, values, counts, white.dtype)

    def _supervised(self, estimate, values, counts, dtype):
        if values is None:
            return jnp.zeros((0,), dtype)
        known = jnp.isfinite(values) & counts
        error = getattr(estimate.mean, self.target.name.name) - jnp.where(known, values, 0)
        # The square root of twice the pseudo-Huber cost, with its sign: smooth at zero.
        share = jnp.sqrt(2 / (jnp.sqrt(1 + (error / self.target.bend) ** 2) + 1))
        return jnp.where(known, error * share / self.target.weight, 0)


@eqx.filter_jit
def _linearised(problem: _Problem, z):
    """Cost, gradient (p,) and expected information (p, p) of the negative log-posterior at z."""
    push = lambda direction: jax.jvp(problem.parts, (z,), (direction,))
    primal, tangents = jax.vmap(push, out_axes=(None, 0))(jnp.eye(z.size, dtype=z.dtype))
    flat = lambda leaf: leaf.reshape(z.size, -1)
    (white, levels, supervised), (d_white, d_levels, d_supervised) = primal, map(flat, tangents)
    deviation = (z - problem.centre) / problem.spread
    cost = 0.5 * (jnp.sum(white**2) + jnp.sum(supervised**2) + jnp.sum(deviation**2)) + jnp.sum(levels)
    gradient = d_white @ white.reshape(-1) + d_supervised @ supervised.reshape(-1)
    gradient = gradient + jnp.sum(d_levels, axis=1) + deviation / problem.spread
    # With w = e / exp(s), dw = de / exp(s) - w ds, whose square holds one of the two ds^2 that (dlog S)^2 / 2 is made of.
    information = d_white @ d_white.T + d_levels @ d_levels.T + d_supervised @ d_supervised.T
    return cost, gradient, information + jnp.diag(1 / problem.spread**2)


def _with_secants(information, pairs):
    """The information corrected to the changes of the gradient (step, change) that were seen, oldest first (BFGS).

    The expected information is the curvature only on average; where they differ, plain scoring creeps.
    """
    curvature = information
    for step, change in pairs:
        along = curvature @ step
        if change @ step > 1e-2 * step @ along:
            curvature = curvature + np.outer(change, change) / (change @ step) - np.outer(along, along) / (step @ along)
    return curvature


def _score(problem: _Problem, z, max_steps: int, tolerance: float, progress: Progress):
    """Damped Fisher scoring with secant corrections: optimum, cost and information there, steps, whether it converged."""
    unit = np.asarray(jnp.where(jnp.isfinite(problem.spread), problem.spread, 1.0))
    damping, small = FIRST_DAMPING, 0
    pairs: list[tuple[np.ndarray, np.ndarray]] = []
    progress(0, max_steps, "fit (compiling first)")
    cost, gradient, information = map(np.asarray, _linearised(problem, z))
    for step in range(1, max_steps + 1):
        curvature = _with_secants(information, pairs[-SECANTS:])
        damped = curvature + damping * np.diag(np.diag(curvature))
        move = -np.linalg.lstsq(damped, gradient, rcond=None)[0]
        move *= min(1.0, LONGEST_STEP / max(np.max(np.abs(move / unit)), 1e-12))
        trial = z + jnp.asarray(move, z.dtype)
        found = tuple(map(np.asarray, _linearised(problem, trial)))
        progress(step, max_steps, f"fit: step {step}, log-posterior {-float(min(cost, found[0])):.1f}")
        if np.isfinite(found[1]).all():
            pairs.append((np.asarray(trial - z), found[1] - gradient))
        if all(np.isfinite(part).all() for part in found) and found[0] < cost:
            small = small + 1 if cost - found[0] < tolerance else 0
            z, (cost, gradient, information), damping = trial, found, damping * LOWERED
        else:
            # No step is small enough to gain: that is the optimum, to the last digit of the cost.
            small = small + 1 if np.max(np.abs(move / unit)) < 1e-3 else 0
            damping = max(damping * RAISED, 1e-3)
        if small == 2:
            return z, float(cost), information, step, True
    return z, float(cost), information, max_steps, False

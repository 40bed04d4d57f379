"""MAP and least-squares fits by multiple shooting: short simulations tied together, so that a spin-out cannot explode."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.recording import Recording
from jaxveh.fitting.result import Fit, make_fit, raise_unfinished
from jaxveh.fitting.segments import Segments, cut
from jaxveh.statespace import StateSpace, start_from
from jaxveh.statespace.contract import wrap_angle
from jaxveh.statespace.noise import whiten

LARGEST_RESIDUAL = 1e6
"""What a residual of a diverged segment is taken as: finite, so that the solver can step back."""


class Unknowns(NamedTuple):
    """Parameters on the real line (p,), and the state at the start of each segment: a tuple of (K,) arrays."""

    parameters: jax.Array
    starts: tuple


def multiple_shooting(
    model: StateSpace,
    recordings: Recording | Sequence[Recording],
    *,
    window: float = 0.5,
    prior: bool = True,
    tie: float = 0.01,
    max_steps: int = 100,
    tolerance: float = 1e-8,
    throw: bool = True,
) -> Fit:
    """Fit the parameters of a model (see `statespace.with_parameters`) to recordings by Levenberg-Marquardt.

    The recordings are cut into segments of `window` seconds (Bock 1981); unknown are the parameters and the state at the
    start of each. Residuals: measurements over their noise's standard deviation; the ends' mismatch with the next start,
    over the process noise gathered in a window, or over `tie` times the prior's spread for states without process
    noise; the first states and, with `prior`, the parameters against the prior (MAP; without: least squares).

    **Returns** a `Fit`; standard errors from the Jacobian at the optimum, the starts marginalised. **Raises** `InputError`
    for a model without parameters, or logs too short; `FilterError` where the solver does not converge (`throw`).
    """
    if model.chosen is None:
        raise InputError("multiple_shooting: the model estimates no parameter; give `estimate=` or `with_parameters`.")
    check_positive("tie", tie)
    segments = cut(model, recordings, window)
    fit = shoot(model, segments, jnp.asarray(tie, model.prior.mean[0].dtype), prior, max_steps, tolerance)
    if throw:
        raise_unfinished(fit)
    return fit


@eqx.filter_jit
def shoot(model: StateSpace, segments: Segments, tie, prior: bool, max_steps: int, tolerance: float) -> Fit:
    """The compiled part of `multiple_shooting`."""
    n = len(model.chosen.states)
    count = segments.first.shape[0]
    mean = model.prior.mean
    start = Unknowns(jnp.stack(mean[n:]), tuple(jnp.broadcast_to(m, (count,)) for m in mean[:n]))
    solver = optx.LevenbergMarquardt(rtol=tolerance, atol=tolerance)
    residuals = lambda unknowns, args: _residuals(model, segments, tie, prior, unknowns)
    solution = optx.least_squares(residuals, solver, start, max_steps=max_steps, throw=False)
    found = solution.value
    covariance, cost = _laplace(residuals, found)
    physical = model.chosen.physical(list(found.parameters))
    parameters = model.chosen.parameters
    fitted = start_from(model, **{p.field: value for p, value in zip(parameters, physical, strict=True)})
    # Residuals at their limit do not move with the unknowns: the solver takes a diverged start for an optimum.
    bounded = cost < 0.5 * LARGEST_RESIDUAL**2
    converged = (solution.result == optx.RESULTS.successful) & bounded
    steps = solution.stats["num_steps"]
    return make_fit(parameters, found.parameters, covariance, cost, steps, converged, fitted)


def _residuals(model: StateSpace, segments: Segments, tie, prior: bool, unknowns: Unknowns):
    ends, misfit = _simulate(model, segments, unknowns)
    residuals = {
        "misfit": misfit,
        "ties": _ties(model, segments, tie, unknowns, ends),
        "prior": _prior(model, segments, prior, unknowns),
    }
    finite = lambda r: jnp.clip(jnp.nan_to_num(r, nan=LARGEST_RESIDUAL), -LARGEST_RESIDUAL, LARGEST_RESIDUAL)
    return jax.tree.map(finite, residuals)


def _simulate(model, segments, unknowns):
    """Ends of the segments (tuple of (K,)), and measurement residuals (W, m, K), zero where nothing was measured."""
    noise = model.measurement_noise
    count = segments.first.shape[0]
    wide = lambda value: jnp.broadcast_to(value, (count,))
    parameters = [wide(value) for value in unknowns.parameters]
    state = model.chosen.joint_type(*unknowns.starts, *parameters)

    def body(state, rows):
        now, then = rows
        observed = model.observation(now.t, state, now.u)
        residual, present = {}, {}
        for name in noise.names:
            measured = getattr(now.y, name)
            present[name] = jnp.isfinite(measured)
            difference = jnp.where(present[name], measured, 0) - getattr(observed, name)
            residual[name] = wrap_angle(difference) if name in model.angles else difference
        white = whiten(noise, residual, present)
        u = model.step_inputs(now.t, then.t, now.u, then.u)
        moved = model.transition(now.t, then.t, state, u)
        return jax.tree.map(wide, moved), jnp.stack([white[name] for name in noise.names])

    rows = segments.rows
    pairs = jax.tree.map(lambda leaf: leaf[:-1], rows), jax.tree.map(lambda leaf: leaf[1:], rows)
    end, misfit = jax.lax.scan(body, state, pairs)
    return tuple(end)[: len(unknowns.starts)], misfit


def _ties(model, segments, tie, unknowns, ends):
    """Mismatch of each end with the next start, in standard deviations; zero where nothing follows."""
    spread = _tie_spread(model, tie, jnp.diff(segments.rows.t, axis=0))
    out = []
    for i, (start, end) in enumerate(zip(unknowns.starts, ends, strict=True)):
        gap = jnp.roll(start, -1) - end
        out.append(jnp.where(segments.linked, gap / spread[i], 0))
    return jnp.stack(out)


def _tie_spread(model, tie, steps):
    """What a state may jump between segments whose rows lie `steps` (W, K) seconds apart, one (K,) array a state."""
    states = model.chosen.states
    own = dict(zip(model.states, numerics.sqrt(jnp.diagonal(model.prior.covariance())), strict=True))
    spread = {name: tie * own[name] * jnp.ones_like(steps[0]) for name in states}
    if model.process_noise is not None:
        # Over the whole window, as if the noise added up without dynamics: the scale of a jump, not its exact law.
        variances = jax.vmap(jax.vmap(lambda dt: jnp.diagonal(model.process_noise.over(dt).covariance())))(steps)
        gathered = jnp.sqrt(jnp.sum(variances, axis=0))
        for i, name in enumerate(model.process_noise.law.names):
            if name in states:
                spread[name] = jnp.maximum(gathered[:, i], spread[name] * 1e-3)
    return [spread[name] for name in states]


def _prior(model, segments, prior: bool, unknowns):
    """Deviations of the first states, and of the parameters, from the prior, whitened."""
    n = len(model.chosen.states)
    mean, covariance = jnp.stack(model.prior.mean), model.prior.covariance()
    # States and parameters are independent in the prior that `with_parameters` makes, each among themselves may not be.
    own, theirs = numerics.cholesky(covariance[:n, :n]), numerics.cholesky(covariance[n:, n:])
    first = numerics.solve_lower(own, jnp.stack(unknowns.starts) - mean[:n, None])
    deviation = numerics.solve_lower(theirs, unknowns.parameters - mean[n:])
    # Least squares alone: the parameters are free, but for a hair that keeps the solver's matrix regular.
    return {
        "states": jnp.where(segments.first, first, 0),
        "parameters": deviation if prior else 1e-6 * deviation,
    }


def _laplace(residuals, found: Unknowns):
    """Covariance (p, p) of the parameters, the starts marginalised, from the Jacobian; and half the sum of squares."""
    flat, unravel = jax.flatten_util.ravel_pytree(found)
    stacked = lambda z: jax.flatten_util.ravel_pytree(residuals(unravel(z), None))[0]
    jacobian = jax.jacfwd(stacked)(flat)
    p = found.parameters.shape[0]
    # R of the QR factorisation with the parameters last: its lower right block is the square root of their information.
    reordered = jnp.concatenate([jacobian[:, p:], jacobian[:, :p]], axis=1)
    root = jnp.linalg.qr(reordered, mode="r")[-p:, -p:]
    inverse = jax.scipy.linalg.solve_triangular(root, jnp.eye(p, dtype=root.dtype))
    return inverse @ inverse.T, 0.5 * jnp.sum(stacked(flat) ** 2)

"""MAP and least-squares fits by multiple shooting: short simulations tied together, so that a spin-out cannot explode."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_positive, is_concrete
from jaxveh._core.parameter import Parameter, Where, pick, put
from jaxveh._core.recording import Recording
from jaxveh.fitting.problem import AbstractProblem, SearchEnd, in_units, on_line, scalar_parameters
from jaxveh.fitting.recorded import spread_on_line
from jaxveh.fitting.result import Fit, raise_unfinished
from jaxveh.fitting.segments import Segments, cut
from jaxveh.fitting.solve import solve
from jaxveh.statespace import StateSpace, kit, start_from

LARGEST_RESIDUAL = 1e6
"""What a residual of a diverged segment is taken as: finite, so that the solver can step back."""

HAIR = 1e-6
"""What holds a parameter without a prior, in deviations a unit of its line: it keeps the solver's matrix regular."""


class ShootingProblem(AbstractProblem):
    """Residuals of simulations from the start of each of K segments, and what of the model is to be fitted.

    Coordinates: the parameters (p,) on their bijectors' line, then each state at the K starts. `tie`: what a state without
    process noise may jump between segments, over its prior's spread. `counts` (recordings,): how many times each counts.
    `centre` (p,) and `prior` (p, p): mean and covariance of the parameters on their line; None where nothing was known of them.
    """

    model: StateSpace
    segments: Segments
    tie: jax.Array
    counts: jax.Array
    centre: jax.Array
    prior: jax.Array | None
    chosen: tuple[Parameter, ...] = eqx.field(static=True)

    @property
    def states(self) -> tuple[str, ...]:
        """The model's own states: those that are no parameters."""
        return self.model.states if self.model.chosen is None else self.model.chosen.states

    def start(self):
        count = self.segments.first.shape[0]
        mean = self.model.prior.mean[: len(self.states)]
        return jnp.concatenate([self.centre, *(jnp.broadcast_to(m, (count,)) for m in mean)])

    def line(self, z):
        return z[: len(self.chosen)]

    def starts(self, z):
        """The states at the start of each segment: an array (K,) each."""
        return list(z[len(self.chosen) :].reshape(len(self.states), -1))

    def model_at(self, z):
        values = in_units(self.chosen, self.line(z))
        if self.model.chosen is None:
            return put(self.model, self.chosen, values)
        return start_from(self.model, **{p.field: v for p, v in zip(self.chosen, values, strict=True)})

    def cost(self, z):
        return 0.5 * jnp.sum(residuals(z, self) ** 2)

    def search(self, z, max_steps, tolerance):
        solver = optx.LevenbergMarquardt(rtol=tolerance, atol=tolerance)
        found = optx.least_squares(residuals, solver, z, self, max_steps=max_steps, throw=False)
        return SearchEnd(found.value, found.stats["num_steps"], found.result == optx.RESULTS.successful)

    def covariance(self, z):
        jacobian, p = jax.jacfwd(residuals)(z, self), len(self.chosen)
        # R of the QR factorisation with the parameters last: its lower right block is the square root of their information.
        reordered = jnp.concatenate([jacobian[:, p:], jacobian[:, :p]], axis=1)
        root = jnp.linalg.qr(reordered, mode="r")[-p:, -p:]
        inverse = jax.scipy.linalg.solve_triangular(root, jnp.eye(p, dtype=root.dtype))
        return inverse @ inverse.T, jnp.ones((p,), bool)

    def is_failure(self, cost):
        # Residuals at their limit do not move with the unknowns: the solver takes a diverged start for an optimum.
        return cost >= 0.5 * LARGEST_RESIDUAL**2

    def units(self):
        return self.counts.shape[0]

    def with_counts(self, counts):
        return dataclasses.replace(self, counts=counts)


def pose_shooting(
    model: StateSpace,
    segments: Segments,
    where: Where | None = None,
    *,
    prior: float | Mapping[str, float] | None = None,
    tie=0.01,
) -> ShootingProblem:
    """What `multiple_shooting` solves over segments (see `cut`, `cut_rows`), for `solve`; arguments and errors as there."""
    check_positive("tie", tie)
    if model.chosen is None and where is None:
        raise InputError("multiple_shooting: the model estimates no parameter; give `where=`, or `with_parameters`.")
    if model.chosen is not None and where is not None:
        raise InputError("multiple_shooting: the model's parameters are states already; leave `where` out.")
    known = None
    if model.chosen is None:
        chosen = scalar_parameters(model, where)
        _check_inside(chosen)
        values = pick(model, chosen)
        centre = on_line(chosen, values)
    else:
        chosen = model.chosen.parameters
        n = len(model.chosen.states)
        # States and parameters are independent in the prior that `with_parameters` makes, each among themselves may not be.
        centre, known = jnp.stack(model.prior.mean[n:]), model.prior.covariance()[n:, n:]
        values = in_units(chosen, centre)
    if prior is not None:
        known = jnp.diag(spread_on_line(chosen, values, prior) ** 2)
    # A batch of segments does not tell how many recordings it is made of: then they are one.
    count = int(np.sum(segments.first)) if is_concrete(segments.first) else 1
    counts, tie = jnp.ones(count, centre.dtype), jnp.asarray(tie, centre.dtype)
    return ShootingProblem(
        model=model, segments=segments, tie=tie, counts=counts, centre=centre, prior=known, chosen=chosen
    )


def _check_inside(chosen: tuple[Parameter, ...]) -> None:
    """Raise for what squares of residuals cannot tell, or what is unknown anyway."""
    for p in chosen:
        if p.path.partition(".")[0] != "system":
            raise InputError(
                f"multiple_shooting: where picked {p.name}; it fits what moves the system (`m.system...`): noise levels are for "
                "maximum_likelihood, and first states are always found."
            )


def multiple_shooting(
    model: StateSpace,
    recordings: Recording | Sequence[Recording],
    where: Where | None = None,
    *,
    prior: float | Mapping[str, float] | None = None,
    window: float = 0.5,
    tie: float = 0.01,
    max_steps: int = 100,
    tolerance: float = 1e-8,
    standard_errors: bool = True,
    throw: bool = True,
) -> Fit:
    """Fit the leaves of a model that `where` picks to recordings, by Levenberg-Marquardt on short simulations.

    `where` sees the StateSpace. Of a model whose parameters are states (see `statespace.with_parameters`) those are fitted, with
    the prior that it has of them. `prior`: relative spreads around the present values, one number or by name; a model's own prior
    gives way to it. Without any: least squares.

    The recordings are cut into segments of `window` seconds (Bock 1981); unknown are the parameters and the state at the start
    of each. Residuals: measurements over their noise's standard deviation; the ends' mismatch with the next start, over the
    process noise gathered in a window, or over `tie` times the prior's spread for states without process noise; the first states
    and the parameters against the prior. Under `jit`, `vmap` and `grad` as it is, the first recording's time being concrete; see
    `solve`.

    **Returns** a `Fit`; standard errors from the Jacobian at the optimum, the starts marginalised. **Raises** `InputError`
    for a model without parameters, or logs too short; `FilterError` where the solver does not converge (`throw`).
    """
    problem = pose_shooting(model, cut(model, recordings, window), where, prior=prior, tie=tie)
    fit = solve(problem, max_steps=max_steps, tolerance=tolerance, standard_errors=standard_errors)
    if throw:
        raise_unfinished(fit)
    return fit


def residuals(z, problem: ShootingProblem):
    """What is to be least in squares, at the coordinates z: misfits, ties and deviations from the prior, in one array."""
    starts = problem.starts(z)
    ends, misfit = _simulate(problem, z, starts)
    # Each recording as often as it counts: its segments follow one another from where it starts.
    share = jnp.sqrt(problem.counts)[jnp.cumsum(problem.segments.first) - 1]
    parts = share * misfit, share * _ties(problem, starts, ends), share * _first(problem, starts), _prior(problem, z)
    stacked = jnp.concatenate([part.reshape(-1) for part in parts])
    return jnp.clip(jnp.nan_to_num(stacked, nan=LARGEST_RESIDUAL), -LARGEST_RESIDUAL, LARGEST_RESIDUAL)


def _simulate(problem: ShootingProblem, z, starts):
    """Ends of the segments (a list of (K,)), and measurement residuals (W, m, K), zero where nothing was measured."""
    model, segments = problem.model, problem.segments
    count = segments.first.shape[0]
    wide = lambda value: jnp.broadcast_to(value, (count,))
    if model.chosen is None:
        model, state = problem.model_at(z), type(model.prior.mean)(*starts)
    else:
        state = model.chosen.joint_type(*starts, *map(wide, problem.line(z)))
    noise = model.measurement_noise

    def body(state, rows):
        now, then = rows
        observed = model.observation(now.t, state, now.u)
        residual, present = {}, {}
        for name in noise.names:
            measured = getattr(now.y, name)
            present[name] = jnp.isfinite(measured)
            difference = jnp.where(present[name], measured, 0) - getattr(observed, name)
            residual[name] = numerics.wrap_angle(difference) if name in model.angles else difference
        white = kit.whiten(noise, residual, present)
        u = model.step_inputs(now.t, then.t, now.u, then.u)
        moved = model.transition(now.t, then.t, state, u)
        return jax.tree.map(wide, moved), jnp.stack([white[name] for name in noise.names])

    rows = segments.rows
    pairs = jax.tree.map(lambda leaf: leaf[:-1], rows), jax.tree.map(lambda leaf: leaf[1:], rows)
    end, misfit = jax.lax.scan(body, state, pairs)
    return list(end)[: len(starts)], misfit


def _ties(problem: ShootingProblem, starts, ends):
    """Mismatch (n, K) of each end with the next start, in standard deviations; zero where nothing follows."""
    spread = tie_spread(problem, jnp.diff(problem.segments.rows.t, axis=0))
    out = []
    for i, (start, end) in enumerate(zip(starts, ends, strict=True)):
        gap = jnp.roll(start, -1) - end
        out.append(jnp.where(problem.segments.linked, gap / spread[i], 0))
    return jnp.stack(out)


def tie_spread(problem: ShootingProblem, steps):
    """What a state may jump between segments whose rows lie `steps` (W, K) seconds apart, one (K,) array a state."""
    model, tie, states = problem.model, problem.tie, problem.states
    own = dict(zip(model.states, numerics.sqrt(jnp.diagonal(model.prior.covariance())), strict=True))
    spread = {name: tie * own[name] * jnp.ones_like(steps[0]) for name in states}
    noise = model.process_noise
    if noise is not None:
        # Over the whole window, as if the noise added up without dynamics: the scale of a jump, not its exact law.
        variances = jax.vmap(jax.vmap(lambda dt: jnp.diagonal(noise.over(dt).covariance())))(steps)
        gathered = jnp.sqrt(jnp.sum(variances, axis=0))
        for i, name in enumerate(noise.law.names):
            if name in states:
                spread[name] = jnp.maximum(gathered[:, i], spread[name] * 1e-3)
    return [spread[name] for name in states]


def _first(problem: ShootingProblem, starts):
    """Deviations (n, K) of the first states of recordings from the prior, whitened."""
    n, prior = len(starts), problem.model.prior
    deviation = jnp.stack(starts) - jnp.stack(prior.mean[:n])[:, None]
    whitened = numerics.solve_lower(numerics.cholesky(prior.covariance()[:n, :n]), deviation)
    return jnp.where(problem.segments.first, whitened, 0)


def _prior(problem: ShootingProblem, z):
    """Deviations (p,) of the parameters from the prior, whitened."""
    deviation = problem.line(z) - problem.centre
    if problem.prior is None:
        return HAIR * deviation
    return numerics.solve_lower(numerics.cholesky(problem.prior), deviation)

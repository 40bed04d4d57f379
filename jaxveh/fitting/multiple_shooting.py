"""MAP and least-squares fits by multiple shooting: short simulations tied together, so that a spin-out cannot diverge."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_flags, check_kind, check_positive, is_concrete
from jaxveh._core.parameter import Parameter, Where, pick, put, strong
from jaxveh._core.recording import Recording
from jaxveh.fitting.problem import AbstractProblem, SearchEnd, in_units, on_line, scalar_parameters
from jaxveh.fitting.recorded import spread_on_line
from jaxveh.fitting.result import Fit, raise_unfinished
from jaxveh.fitting.segments import Segments, cut
from jaxveh.fitting.solve import solve
from jaxveh.statespace import StateSpace, kit, start_from

LARGEST_RESIDUAL = 1e6
"""The limit of a residual of a diverged segment: finite, so that the solver can step back."""

HAIR = 1e-6
"""Weight that holds a parameter without a prior, in standard deviations per unit of its real line: keeps the solver's matrix
regular."""


class ShootingProblem(AbstractProblem):
    """Residuals of simulations from the start of each of K segments, as a function of the chosen parameters of the model.

    Coordinates: the parameters (p,) on the real line of their bijectors, then each state at the K starts. `tie`: the standard
    deviation of a jump between segments for a state without process noise, as a share of its prior's. `counts` (recordings,):
    how many times each counts. `centre` (p,) and `prior` (p, p): mean and covariance of the parameters on their line; `prior`
    is None if there is none.
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
        """The model's own states, without the parameters."""
        return self.model.states if self.model.chosen is None else self.model.chosen.states

    def start(self):
        count = self.segments.first.shape[0]
        mean = self.model.prior.mean[: len(self.states)]
        return jnp.concatenate([self.centre, *(jnp.broadcast_to(m, (count,)) for m in mean)])

    def line(self, z):
        return z[: len(self.chosen)]

    def starts(self, z):
        """The states at the start of each segment: a list of arrays (K,)."""
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
        end = SearchEnd(found.value, found.stats["num_steps"], found.result == optx.RESULTS.successful)
        # The solver has the residuals and their Jacobian at its end: computed again, they take 40 % of the compilation.
        at = found.state.f_info
        return end._replace(cost=0.5 * jnp.sum(at.residual**2), uncertainty=self._spread(at.jac.as_matrix()))

    def covariance(self, z):
        return self._spread(jax.jacfwd(residuals)(z, self))

    def _spread(self, jacobian):
        """The covariance (p, p) from the Jacobian of the residuals, and that all parameters are determined."""
        p = len(self.chosen)
        # R of the QR factorisation with the parameters last: its lower right block is the square root of their information.
        reordered = jnp.concatenate([jacobian[:, p:], jacobian[:, :p]], axis=1)
        root = jnp.linalg.qr(reordered, mode="r")[-p:, -p:]
        inverse = jax.scipy.linalg.solve_triangular(root, jnp.eye(p, dtype=root.dtype))
        return inverse @ inverse.T, jnp.ones((p,), bool)

    def is_failure(self, cost):
        # Residuals at their limit do not change with the unknowns: the solver takes a diverged start for an optimum.
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
    """The problem of `multiple_shooting` over segments (see `cut`, `cut_rows`), for `solve`; arguments and errors as there."""
    check_positive("tie", tie)
    model = strong(model)
    kit.check_model("multiple_shooting", model)
    check_kind("segments", segments, Segments, "fitting.cut makes them.")
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
        # In the prior of `with_parameters`, states and parameters are independent of each other, but not among themselves.
        centre, known = jnp.stack(model.prior.mean[n:]), model.prior.covariance()[n:, n:]
        values = in_units(chosen, centre)
    if prior is not None:
        known = jnp.diag(spread_on_line(chosen, values, prior) ** 2)
    # A batch of segments does not show the number of its recordings: then they count as one.
    count = int(np.sum(segments.first)) if is_concrete(segments.first) else 1
    counts, tie = jnp.ones(count, centre.dtype), jnp.asarray(tie, centre.dtype)
    return ShootingProblem(
        model=model, segments=segments, tie=tie, counts=counts, centre=centre, prior=known, chosen=chosen
    )


def _check_inside(chosen: tuple[Parameter, ...]) -> None:
    """Raise for parameters that squared residuals cannot determine, or that are unknowns anyway."""
    for p in chosen:
        if p.path.partition(".")[0] != "system":
            raise InputError(
                f"multiple_shooting: where picked {p.name}; it fits parameters of the system (`m.system...`): fit noise levels "
                "with maximum_likelihood; first states are always found."
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

    `where` is called with the StateSpace. If the model's parameters are states (see `statespace.with_parameters`), those are
    fitted, with their prior in the model. `prior`: relative standard deviations around the present values, one number or by
    name; it replaces the model's own prior. Without any prior: least squares.

    The recordings are cut into segments of `window` seconds (Bock 1981); unknown are the parameters and the state at the
    start of each segment. Residuals: measurements over their noise's standard deviation; the gap between each end and the
    next start, over the window's process noise, or `tie` times the prior's standard deviation for states without any; the
    first states and the parameters against the prior. Works under `jit`, `vmap` and `grad` if the first recording's time is
    concrete; see `solve`.

    **Returns** a `Fit`; standard errors from the Jacobian at the optimum, with the starts marginalised. **Raises** `InputError`
    for a model without parameters, logs too short, or `max_steps` below one; `FilterError` if the solver does not converge
    (`throw`).
    """
    check_flags(standard_errors=standard_errors, throw=throw)
    problem = pose_shooting(model, cut(model, recordings, window), where, prior=prior, tie=tie)
    fit = solve(problem, max_steps=max_steps, tolerance=tolerance, standard_errors=standard_errors)
    if throw:
        raise_unfinished(fit)
    return fit


def residuals(z, problem: ShootingProblem):
    """All residuals at the coordinates z in one array: misfits, ties and deviations from the prior."""
    starts = problem.starts(z)
    ends, misfit = _simulate(problem, z, starts)
    # Each recording is weighted by its count: its segments follow one another from its start.
    share = jnp.sqrt(problem.counts)[jnp.cumsum(problem.segments.first) - 1]
    parts = share * misfit, share * _ties(problem, starts, ends), share * _first(problem, starts), _prior(problem, z)
    stacked = jnp.concatenate([part.reshape(-1) for part in parts])
    return jnp.clip(jnp.nan_to_num(stacked, nan=LARGEST_RESIDUAL), -LARGEST_RESIDUAL, LARGEST_RESIDUAL)


def _simulate(problem: ShootingProblem, z, starts):
    """Ends of the segments (a list of (K,)), and measurement residuals (W, m, K), zero where not measured."""
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
    """Mismatch (n, K) of each end with the next start, in standard deviations; zero where no segment follows."""
    spread = tie_spread(problem, jnp.diff(problem.segments.rows.t, axis=0))
    out = []
    for i, (start, end) in enumerate(zip(starts, ends, strict=True)):
        gap = jnp.roll(start, -1) - end
        out.append(jnp.where(problem.segments.linked, gap / spread[i], 0))
    return jnp.stack(out)


def tie_spread(problem: ShootingProblem, steps):
    """Standard deviation of a jump between segments whose rows lie `steps` (W, K) seconds apart, one (K,) array per state."""
    model, tie, states = problem.model, problem.tie, problem.states
    own = dict(zip(model.states, numerics.sqrt(jnp.diagonal(model.prior.covariance())), strict=True))
    spread = {name: numerics.as_wide_as(tie * own[name], steps[0]) for name in states}
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

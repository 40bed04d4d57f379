"""The posterior Cramer-Rao bound: the least error that any filter can have on a model."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import FilterError, InputError, check_key, check_whole
from jaxveh._core.parameter import strong
from jaxveh._core.recording import Recording
from jaxveh.statespace.draw import draw_rows, propagate, schedule_rows
from jaxveh.statespace.location import location_covariance
from jaxveh.statespace.model import StateSpace, check_model


class PosteriorBound(NamedTuple):
    """Bounds of the root mean square error of any estimate from the rows up to each one.

    `time` (T,); `std`: the state's NamedTuple with (T,) in each field, of the model's states (parameters on the real line);
    `covariance` (T, n, n): a lower bound of any estimate's mean square error matrix; `runs`: the number of draws for the
    expectations. NaN for states without a bound (see `posterior_cramer_rao`).
    """

    time: np.ndarray
    std: Any
    covariance: np.ndarray
    runs: int


def posterior_cramer_rao(model: StateSpace, schedule: Recording, key, runs: int = 200) -> PosteriorBound:
    """The posterior Cramer-Rao bound of the states, by the recursion of P. Tichavsky, C. Muravchik & A. Nehorai (1998,
    proposition 1, additive noises).

        J' = D22 - D12^T (J + D11)^-1 D12 + E[H^T R^-1 H]
        D11 = E[F^T Q^-1 F],   D12 = -E[F^T] Q^-1,   D22 = Q^-1

    with Jacobians F and H of transition and observation, and expectations over `runs` draws of the model, whose scatter the
    bound has (none on linear models, where it is the Kalman filter's covariance). For Student-t noise, Q^-1 and R^-1 are the
    Fisher informations of its location.

    The bound is also exact if some states have no process noise and **move linearly** (constant parameters, integrals of
    states): their new values are then linear in the old state, whose joint information with the noisy states' new values
    follows from the recursion. Noise-free states that move nonlinearly have no such recursion: `InputError`.

    **Arguments**: `schedule`: as in `draw`: times, inputs, and which measurements are missing. float64 is advised.

    The bound holds for the mean over draws of the model, prior included, not for a single trajectory. It may be far below the
    errors that can be reached where posteriors have several peaks.

    **Raises** `InputError` for laws whose information is unknown, noise-free states as above, or fewer than one run;
    `FilterError` if a draw diverges.
    """
    check_whole("runs", runs)
    check_key("posterior_cramer_rao", key)
    check_model("posterior_cramer_rao", model)
    model = strong(model)
    rows = schedule_rows(model, schedule)
    noisy = () if model.process_noise is None else model.process_noise.law.names
    start, terms = jax.tree.map(
        lambda leaf: np.asarray(leaf, np.float64), _terms(model, rows, jax.random.split(key, runs))
    )
    for what, values in (("transition", terms.F), ("observation", terms.seen)):
        if not np.isfinite(values).all():
            k = int(np.argmax(~np.isfinite(values).all(axis=(1, 2))))
            raise FilterError(
                f"posterior_cramer_rao: a Jacobian of the {what} is not finite in row {k}; a draw diverges."
            )
    kept = _with_recursion(model, noisy, terms)
    covariance = np.full(terms.seen.shape, np.nan)
    covariance[:, kept[:, None], kept] = _recursion([model.states[i] for i in kept], noisy, *_only(kept, start, terms))
    variances = np.einsum("tii->ti", covariance)
    std = type(model.prior.mean)(*np.sqrt(variances).T)
    return PosteriorBound(np.asarray(schedule.time), std, covariance, runs)


class _Terms(NamedTuple):
    """Expectations for each row: `seen` (T, n, n) E[H^T R^-1 H]; for each step, (T - 1, ...): `F` E[F], `spread` of F over the
    draws (largest deviation), `largest` |F|, `pull` E[F^T Q^-1 F] over noisy rows, `Q` (q, q)."""

    seen: Any
    F: Any
    spread: Any
    largest: Any
    pull: Any
    Q: Any


@eqx.filter_jit
def _terms(model: StateSpace, rows: Any, keys: Any) -> tuple[Any, _Terms]:
    """The prior's `location_covariance` (n, n) in the order of the states, and the expectations."""
    states, _ = jax.vmap(lambda key: draw_rows(model, rows, key))(keys)
    states = jax.tree.map(lambda leaf: leaf.T, states)
    head, tail = (
        (lambda tree: jax.tree.map(lambda leaf: leaf[:-1], tree)),
        (lambda tree: jax.tree.map(lambda v: v[1:], tree)),
    )
    seen = jax.lax.map(lambda given: _measured_information(model, *given), (rows, states))
    steps = jax.lax.map(lambda given: _step(model, *given), (head(rows), tail(rows), head(states)))
    law = model.prior.law
    order = np.asarray([law.names.index(name) for name in model.states])
    return location_covariance(law)[order][:, order], _Terms(seen, *steps)


def _measured_information(model: StateSpace, row, states):
    """E[H^T R^-1 H] over states (R,), for the channels present."""
    kind = type(model.prior.mean)
    here = jnp.stack([jnp.isfinite(getattr(row.y, name)) for name in model.channels])

    def see(vector):
        observed = model.observation(row.t, kind(*vector), row.u)
        return jnp.stack([jnp.asarray(getattr(observed, name), vector.dtype) for name in model.channels])

    H = jax.vmap(jax.jacfwd(see))(jnp.stack(states, axis=1))
    H = jnp.where(here[:, None], H, 0)
    # The marginal of the channels present: absent ones become independent, and add no information.
    R = location_covariance(model.measurement_noise)
    R = jnp.where(here[:, None] & here[None, :], R, jnp.eye(len(here), dtype=R.dtype))
    return jnp.mean(jnp.swapaxes(H, 1, 2) @ jnp.linalg.solve(R, H), axis=0)


def _step(model: StateSpace, row, after, states):
    """E[F], the largest deviation from it, the largest |F|, E[F^T Q^-1 F] over noisy states, and Q, for states (R,)."""
    kind = type(model.prior.mean)
    u = model.step_inputs(row.t, after.t, row.u, after.u)
    move = lambda vector: jnp.stack(propagate(model, row.t, after.t, kind(*vector), u))
    F = jax.vmap(jax.jacfwd(move))(jnp.stack(states, axis=1))
    mean = jnp.mean(F, axis=0)
    spread, largest = jnp.max(jnp.abs(F - mean), axis=0), jnp.max(jnp.abs(F), axis=0)
    if model.process_noise is None:
        return mean, spread, largest, jnp.zeros_like(mean), jnp.zeros((0, 0), mean.dtype)
    Q = location_covariance(model.process_noise.over(after.t - row.t))
    noisy = F[:, np.asarray([model.states.index(name) for name in model.process_noise.law.names])]
    return mean, spread, largest, jnp.mean(jnp.swapaxes(noisy, 1, 2) @ jnp.linalg.solve(Q, noisy), axis=0), Q


def _with_recursion(model: StateSpace, noisy: tuple[str, ...], terms: _Terms) -> np.ndarray:
    """Indices of the states that have a recursion: all but those without process noise whose Jacobian differs between draws.

    **Raises** `InputError` if a state without a recursion affects the others, or if no state has one.
    """
    rounding = 1e3 * np.finfo(model.dtype).eps
    bent = (terms.spread > rounding * (1 + np.abs(terms.F))).any(axis=(0, 2))
    without = np.array([bent[i] and name not in noisy for i, name in enumerate(model.states)])
    kept = np.flatnonzero(~without)
    for i in np.flatnonzero(without):
        name = model.states[i]
        if kept.size == 0 or terms.largest[:, kept, i].any() or terms.seen[:, i, i].any():
            raise InputError(
                f"posterior_cramer_rao: {name} carries no process noise and its transition is not linear, for which there is no "
                "recursion, and the other states or the measurements depend on it. Give it a little noise."
            )
    return kept


def _only(kept: np.ndarray, start: np.ndarray, terms: _Terms) -> tuple[np.ndarray, _Terms]:
    """The prior's covariance and the expectations of some states."""
    block = lambda matrices: matrices[..., kept[:, None], kept]
    seen, F, spread, largest, pull = (block(matrices) for matrices in terms[:-1])
    return block(start), _Terms(seen, F, spread, largest, pull, terms.Q)


def _recursion(states: list[str], noisy: tuple[str, ...], start: np.ndarray, terms: _Terms) -> np.ndarray:
    """Covariance bounds (T, n, n), from the prior's (n, n)."""
    n, q = len(states), len(noisy)
    moving = [states.index(name) for name in noisy]
    still = [i for i in range(n) if i not in moving]
    J = np.linalg.inv(start) + terms.seen[0]
    found = [np.linalg.inv(J)]
    for k in range(len(terms.F)):
        F, Q_inverse = terms.F[k], np.linalg.inv(terms.Q[k])
        # For the old state and the noisy states' new values together.
        cross = -F[moving].T @ Q_inverse
        joint = np.block([[J + terms.pull[k], cross], [cross.T, Q_inverse]])
        # The new state is linear in both.
        new = np.zeros((n, n + q))
        new[moving, n + np.arange(q)] = 1
        new[still, :n] = F[still]
        J = np.linalg.inv(new @ np.linalg.inv(joint) @ new.T) + terms.seen[k + 1]
        J = 0.5 * (J + J.T)
        found.append(np.linalg.inv(J))
    return np.stack(found)

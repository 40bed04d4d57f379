"""Paths drawn backwards through the particles of a filter."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check_whole
from jaxveh.filters.choosing import log_of
from jaxveh.filters.particle import SHORTEST, AbstractParticleFilter
from jaxveh.filters.smoothing.genealogy import path_moments
from jaxveh.filters.smoothing.path_smoother import AbstractPathSmoother
from jaxveh.filters.smoothing.smoothed import SmoothedEstimate, smoothed_estimate, with_last
from jaxveh.statespace import Row, StateSpace, kit


class BackwardSampling(AbstractPathSmoother):
    """Draws `trajectories` paths backwards from the smoothing distribution, for particle filters whose states all have
    process noise."""

    trajectories: int = eqx.field(static=True, default=200)

    def __check_init__(self):
        check_whole("trajectories", self.trajectories, 2)

    def check(self, filter, model):
        check_density(model)

    def smooth(self, filter, model, rows, key):
        return sample_backwards(filter, model, rows, key, self.trajectories)


def check_density(model: StateSpace) -> None:
    """Raise `InputError` if the transition has no density; it names the states without process noise."""
    names = () if model.process_noise is None else model.process_noise.law.names
    still = [name for name in model.states if name not in names]
    if still:
        raise InputError(
            f"BackwardSampling needs process noise on every state; without it: {', '.join(still)}. Use Genealogy()."
        )


@eqx.filter_jit
def sample_backwards(filter: AbstractParticleFilter, model: StateSpace, rows: Row, key, count: int) -> SmoothedEstimate:
    """`count` paths over rows with (T,) leaves, from the smoothing distribution (S. Godsill, A. Doucet & M. West 2004).

    The states of the last row are drawn by their weights, then those of each earlier row by weight times the
    transition's density to the drawn state after it.
    """
    noise = model.process_noise
    assert noise is not None  # `check_density` ensures it
    forward_key, last_key, back_key = jax.random.split(key, 3)
    filtered, kept = kit.scan_and_keep(filter, model, rows, forward_key, lambda b: (b.particles, b.weights))
    particles, weights = kept
    chosen = jax.random.categorical(last_key, log_of(weights[-1]), shape=(count,))
    last = jax.tree.map(lambda field: field[-1][chosen], particles)
    before = jax.tree.map(lambda leaf: leaf[:-1], (particles, weights, rows))
    after = jax.tree.map(lambda leaf: leaf[1:], rows)
    keys = jax.random.split(back_key, rows.t.shape[0] - 1)

    def back(later, given):
        ((particles, weights, row), following), key = given
        u = model.step_inputs(row.t, following.t, row.u, following.u)
        moved = model.transition(row.t, following.t, particles, u)
        law = noise.over(jnp.maximum(following.t - row.t, SHORTEST))
        names = noise.law.names
        residual = {name: getattr(later, name)[:, None] - getattr(moved, name) for name in names}
        density = law.log_prob(residual, dict.fromkeys(names, jnp.asarray(True)))
        chosen = jax.random.categorical(key, density + log_of(weights), axis=1)
        found = jax.tree.map(lambda field: field[chosen], particles)
        return found, found

    _, earlier = jax.lax.scan(back, last, ((before, after), keys), reverse=True)
    paths = with_last(earlier, last)
    uniform = jnp.full((count,), 1 / count, weights.dtype)
    return smoothed_estimate(model, filtered, path_moments(model, rows, paths, uniform), paths, uniform)

"""The ancestors of the last particles: a smoother without additional computation."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh.filters.choosing import check_ancestors
from jaxveh.filters.particle import AbstractParticleFilter, ParticleBelief
from jaxveh.filters.smoothing.path_smoother import AbstractPathSmoother
from jaxveh.filters.smoothing.smoothed import SmoothedEstimate, smoothed_estimate
from jaxveh.statespace import Row, StateSpace, kit


class Genealogy(AbstractPathSmoother):
    """Follows the ancestors of the last particles, for any particle filter whose scheme keeps them; good for about ten
    rows before the end."""

    def check(self, filter, model):
        check_ancestors("Genealogy", kit.innermost(filter).resampling, "Use BackwardSampling().")

    def smooth(self, filter, model, rows, key):
        return trace_genealogy(filter, model, rows, key)


@eqx.filter_jit
def trace_genealogy(filter: AbstractParticleFilter, model: StateSpace, rows: Row, key) -> SmoothedEstimate:
    """The paths of the particles alive in the last row, over rows with (T,) leaves (G. Kitagawa 1996; Sarkka 2013, sec. 11.1).

    Every path has the weight of its last particle. Going back, the paths merge: some hundred rows before the end few
    distinct ancestors are left, and standard deviations are too small.
    """
    filtered, (particles, ancestors) = kit.scan_and_keep(filter, model, rows, key, lambda b: (b.particles, b.ancestors))
    weights = filtered.belief.weights
    last = jnp.arange(weights.shape[0], dtype=ancestors.dtype)

    def back(index, parents):
        return parents[index], index

    first, others = jax.lax.scan(back, last, ancestors[1:], reverse=True)
    lines = jnp.concatenate([first[None], others])
    paths = jax.tree.map(lambda field: jnp.take_along_axis(field, lines, axis=1), particles)
    return smoothed_estimate(model, filtered, path_moments(model, rows, paths, weights), paths, weights)


def path_moments(model: StateSpace, rows: Row, paths, weights):
    """Mean and standard deviation of the report in each row, of weighted paths with (T, M) leaves."""

    def of(path, row):
        belief = ParticleBelief(path, weights, None, None, row.t, row.u, None)
        return belief.moments(model)

    return jax.lax.map(lambda given: of(*given), (paths, rows))

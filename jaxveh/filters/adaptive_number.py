"""A particle filter whose number of particles follows the spread of the belief."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import InputError, check, check_positive, check_whole
from jaxveh._core.names import as_pairs, as_several, check_names
from jaxveh.filters.choosing import check_ancestors, gather
from jaxveh.filters.particle import AbstractParticleFilter, ParticleBelief, check_all_particles
from jaxveh.statespace import AbstractWrapper

BINS = 0x62696E73
"""Folded into the step's key for the draw by which the filled bins are counted."""

# An odd 32-bit number, of which each state takes another power: a multiplicative hash.
HASH = np.uint32(2654435761)


class AdaptiveNumber(AbstractWrapper):
    """`inner` with one of `sizes` particles in each step, chosen by how many `bins` the belief fills (D. Fox 2003,
    KLD-sampling).

    The number of particles n is such that, with probability `confidence` (-), the Kullback-Leibler distance between the
    drawn and the true distribution over the k filled bins is below `error`. With z the normal quantile:

        n = (k - 1) / (2 error) (1 - 2 / (9 (k - 1)) + z sqrt(2 / (9 (k - 1))))^3

    `bins`: the width of the bins by state, in the state's unit (parameters on the real line). The largest size is the
    number of particles of `inner`. The filter starts with it and resamples in every step. Shapes are fixed when
    compiling: there is one branch per size, of which one runs, and every belief has the largest size, filled up with
    particles of zero weight. Under `vmap` all branches run, and no time is saved.
    """

    has_covariance: ClassVar[bool] = True
    noise_by_row: ClassVar[bool] = True
    rows_between: ClassVar[bool] = True
    inner: AbstractParticleFilter
    bins: tuple[tuple[str, float], ...] = eqx.field(static=True)
    sizes: tuple[int, ...] = eqx.field(static=True)
    error: float = eqx.field(static=True)
    confidence: float = eqx.field(static=True)

    def __init__(
        self,
        inner: AbstractParticleFilter,
        bins: Mapping[str, float],
        sizes: tuple[int, ...] | None = None,
        error: float = 0.05,
        confidence: float = 0.99,
    ):
        check_all_particles("AdaptiveNumber", inner)
        n = inner.particles
        self.inner, self.error, self.confidence = inner, error, confidence
        self.bins = tuple(sorted(as_pairs(bins, "AdaptiveNumber.bins")))
        usual = tuple(max(2, n // part) for part in (8, 4, 2, 1))
        self.sizes = usual if sizes is None else as_several(sizes, "AdaptiveNumber.sizes")

    def __check_init__(self):
        for name, width in self.bins:
            check_positive(f"AdaptiveNumber.bins of {name}", width)
        check("AdaptiveNumber.error", self.error, lambda v: v > 0, "positive")
        check("AdaptiveNumber.confidence", self.confidence, lambda v: (v > 0) & (v < 1), "between 0 and 1")
        if not self.bins:
            raise InputError("AdaptiveNumber.bins is empty: give the width of at least one state's bins.")
        for size in self.sizes:
            check_whole("AdaptiveNumber.sizes", size)
        if sorted(set(self.sizes)) != list(self.sizes) or self.sizes[-1] != self.inner.particles or self.sizes[0] < 2:
            raise InputError(
                f"AdaptiveNumber.sizes = {self.sizes}: must rise from at least 2 to the filter's {self.inner.particles}."
            )
        check_ancestors("AdaptiveNumber", self.inner.resampling, "Take numerics.systematic or Soft(...).")
        if self.inner.threshold < 1:
            raise InputError(
                f"AdaptiveNumber: inner.threshold = {self.inner.threshold}: must be 1, so that it resamples in every step."
            )

    def check(self, model):
        self.inner.check(model)
        check_names("AdaptiveNumber.bins", [name for name, _ in self.bins], model.states)

    def _init(self, model, row, key):
        return self.inner._init(model, row, key)

    def _step(self, model, belief, row):
        needed = self.number(belief)
        place = jnp.sum(needed > jnp.asarray(self.sizes[:-1], needed.dtype))
        return jax.lax.switch(place, [self._branch(size) for size in self.sizes], model, belief, row)

    def number(self, belief: ParticleBelief) -> Any:
        """The number of particles that the belief needs, before it is rounded up to one of the sizes."""
        dtype = belief.weights.dtype
        # The formula has no value for one filled bin; with two it gives few particles.
        k = jnp.maximum(self.filled_bins(belief), 2).astype(dtype) - 1.0
        z = jax.scipy.special.ndtri(jnp.asarray(self.confidence, dtype))
        part = 2.0 / (9.0 * k)
        return k / (2.0 * self.error) * (1.0 - part + z * jnp.sqrt(part)) ** 3

    def filled_bins(self, belief: ParticleBelief) -> Any:
        """The number of bins that draws from the belief fill."""
        key = jax.random.fold_in(jax.random.fold_in(belief.key, BINS), belief.count)
        ancestors = numerics.systematic(key, jax.lax.stop_gradient(belief.weights), self.inner.particles)
        drawn = jax.lax.stop_gradient(gather(belief.particles, ancestors))
        hashed = jnp.zeros(self.inner.particles, jnp.uint32)
        for name, width in self.bins:
            index = jnp.floor(getattr(drawn, name) / width).astype(jnp.int32).astype(jnp.uint32)
            hashed = (hashed ^ index) * HASH
        ordered = jnp.sort(hashed)
        return 1 + jnp.sum(ordered[1:] != ordered[:-1])

    def _branch(self, size: int):
        inside = dataclasses.replace(self.inner, particles=size)
        more = self.inner.particles - size

        def run(model, belief, row):
            after, info = inside._step(model, belief, row)
            # Filled up with copies of the first particle, of zero weight: values that the model accepts.
            longer = lambda field: jnp.concatenate([field, jnp.broadcast_to(field[:1], (more,))])
            particles = jax.tree.map(longer, after.particles)
            weights = jnp.pad(after.weights, (0, more))
            return ParticleBelief(
                particles, weights, longer(after.ancestors), after.key, after.t, after.u, after.count
            ), info

        return run

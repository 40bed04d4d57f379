"""Gradients of particle filters' log-likelihood: right with the share of choosing, biased without."""

import functools

import equinox as eqx
import jax
import numpy as np
import pytest
from drawn_systems import drawn, linear

from jaxveh import filters

SEEDS = 40


def gradients(filter_, seeds=SEEDS):
    """(seeds, k): with respect to the dynamics, the observation and the noise levels of both kinds."""
    model, rows = linear(), linear().rows(drawn(15))
    leaves, rest = eqx.partition(model, eqx.is_inexact_array)
    of = lambda leaves, key: filters.scan(filter_, eqx.combine(leaves, rest), rows, key).log_likelihood
    found = jax.jit(jax.vmap(jax.grad(of), in_axes=(None, 0)))(leaves, jax.random.split(jax.random.key(1), seeds))
    # Of a symmetric matrix a filter may read one triangle.
    matrix = np.asarray(found.process_noise.law.matrix)
    chosen = (
        found.system["A"],
        found.system["H"],
        *found.measurement_noise.std,
        0.5 * (matrix + matrix.swapaxes(-1, -2)),
    )
    return np.concatenate([np.asarray(leaf).reshape(seeds, -1) for leaf in chosen], axis=1)


@functools.cache
def exact_gradient():
    return gradients(filters.Kalman(), 1)[0]


def marginalised(particles):
    return filters.Marginalised(particles, ("x1",))


@pytest.mark.parametrize(
    "make",
    [
        filters.ParticleFilter,
        filters.AuxiliaryParticleFilter,
        filters.Guided,
        # The share of choosing is that of the first; declared in test_declared_gradients.
        pytest.param(marginalised, marks=pytest.mark.full),
    ],
)
def test_scores_give_the_exact_gradient_within_their_scatter(make):
    exact = exact_gradient()
    found = gradients(make(1000))
    scatter = found.std(axis=0) / np.sqrt(SEEDS)
    off = np.abs(found.mean(axis=0) - exact)
    # A few hundredths are the bias of a finite number of particles.
    assert (off < 4.0 * scatter + 0.03 * np.abs(exact) + 0.02).all()


def test_ancestors_that_are_held_bias_it():
    exact = exact_gradient()
    found = gradients(filters.ParticleFilter(1000, gradient="held"))
    scatter = found.std(axis=0) / np.sqrt(SEEDS)
    # Of the dynamics nothing but the bias is left: a smooth gradient that is another.
    off = np.abs(found.mean(axis=0) - exact)
    assert np.max(off / np.where(scatter > 0, scatter, np.inf)) > 20.0

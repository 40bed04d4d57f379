"""What every kind of belief says of itself: its standard deviations are those of its covariance, its draws have its mean."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from recorded_numbers import check_recorded
from test_every_filter import FILTERS, batch

from jaxveh.filters.delayed import _first
from jaxveh.filters.particle import without
from jaxveh.observers.base import PointBelief
from jaxveh.statespace import AbstractBelief

BELIEFS = {
    "Extended": "GaussianBelief", "bootstrap": "ParticleBelief", "marginalised": "MarginalisedBelief",
    "Ensemble": "EnsembleBelief", "interacting": "MixtureBelief", "federated": "FederatedBelief",
    "Sage-Husa": "Remembering", "delayed, in order": "DelayedBelief",
}  # fmt: skip
"""A filter of every kind of belief."""

NO_COVARIANCE = {
    "LaggedBelief": "a fixed-lag smoother's is asked of the filter inside",
    PointBelief.__name__: "a number of an observer: it has no spread",
}


def kinds(base):
    """The package's classes that derive from a belief and are nobody's base."""
    below = [one for one in base.__subclasses__() if one.__module__.startswith("jaxveh.")]
    return set().union(*map(kinds, below)) if below else {base.__name__}


def test_every_kind_of_belief_is_looked_at():
    assert kinds(AbstractBelief) == {*BELIEFS.values(), *NO_COVARIANCE}


@functools.cache
def made(name):
    """A filter's belief after the first row."""
    filter_, linear = FILTERS[name].make(), FILTERS[name].linear
    model, rows = batch("linear" if linear else "pendulum")
    row = jax.tree.map(lambda leaf: leaf[0, 0], rows)
    row = row._replace(u=jax.tree.map(lambda force: 0.1 + abs(force), row.u))
    return eqx.filter_jit(lambda row, key: filter_.init(model, row, key))(row, jax.random.key(5))[0]


@pytest.mark.parametrize("name", BELIEFS)
def test_standard_deviations_are_those_of_the_covariance_and_draws_have_the_mean(name):
    belief = made(name)
    assert type(belief).__name__ == BELIEFS[name]
    covariance, std = np.asarray(belief.covariance), np.asarray(belief.std)
    np.testing.assert_allclose(std**2, np.diag(covariance), rtol=1e-9)
    draws = np.asarray(belief.sample(jax.random.key(2), 4000))
    off = (draws.mean(axis=1) - np.asarray(belief.mean)) / (std / 4000**0.5)
    assert np.abs(off).max() < 4.0
    np.testing.assert_allclose(draws.std(axis=1), std, rtol=0.1)


@pytest.mark.whole
@pytest.mark.parametrize("name", BELIEFS)
def test_draws_are_those_recorded(name):
    check_recorded(__file__, name, {"draws": made(name).sample(jax.random.key(2), 5)})


@pytest.mark.parametrize(
    ("codes", "real", "first"),
    [([0, 3, 5], [1, 1, 1], 3), ([4, 0, 5], [0, 1, 1], 5), ([0, 0], [1, 1], 0), ([2], [0], 0)],
)
def test_the_first_failure_of_rows_filtered_anew_is_told(codes, real, first):
    assert int(_first(jnp.asarray(codes, jnp.int32), jnp.asarray(real, bool))) == first


def test_a_lost_particle_has_no_weight():
    logs = np.exp(np.asarray(without(jnp.asarray([False, True]), jnp.asarray([-1.0, -2.0]))))
    np.testing.assert_allclose(logs, [np.exp(-1.0), 0.0])

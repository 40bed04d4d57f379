"""What a filter's derivatives are, and whether its belief has a covariance: declared as they are, and asked for early."""

import jax
import jax.numpy as jnp
import pytest
from test_every_filter import FILTERS, batch, recordings

from jaxveh import InputError, filters, fitting, observers
from jaxveh.filters import Gradient
from jaxveh.statespace import AbstractFilter, kit

SCORED = {"ParticleFilter", "AuxiliaryParticleFilter", "Guided", "Marginalised"}
"""Whose derivatives test_particle_gradients compares with exact ones."""


@pytest.mark.parametrize("name", FILTERS)
def test_derivatives_are_exact_where_they_are_tested_to_be(name):
    """Of those that are `differentiable`, test_every_filter compares them with differences."""
    filter_ = FILTERS[name].make()
    kind = kit.gradients_of(filter_)
    assert (kind is Gradient.exact) == FILTERS[name].differentiable
    assert kind is not Gradient.on_average or type(kit.innermost(filter_)).__name__ in SCORED


def test_what_is_not_declared_is_no():
    assert not AbstractFilter.has_covariance and not filters.AbstractForm.differentiable
    # A wrapper is no better than what it goes around, and one that says nothing is `none`.
    assert kit.gradients_of(filters.FixedLag(filters.ParticleFilter(10), 2)) is Gradient.on_average
    assert kit.gradients_of(filters.FixedLag(filters.Cubature(form=filters.SingularValues()), 2)) is Gradient.none
    assert kit.gradients_of(filters.LiuWest(filters.ParticleFilter(10), names=("x2",))) is Gradient.none
    assert kit.gradients_of(filters.ParticleFilter(10, gradient="held")) is Gradient.none


@pytest.mark.parametrize("name", FILTERS)
def test_a_belief_has_the_covariance_that_is_declared(name):
    filter_, (model, rows) = FILTERS[name].make(), batch("linear")
    first = jax.tree.map(lambda leaf: leaf[0, 0], rows)
    shape = lambda: jax.eval_shape(lambda key: filter_._init(model, first, key)[0].covariance, jax.random.key(0)).shape
    if kit.who_lacks(filter_, "has_covariance") is None:
        assert shape() == (3, 3)
    else:
        with pytest.raises(InputError, match="has no covariance of the state"):
            shape()


@pytest.mark.parametrize(
    ("filter_", "who"),
    [
        (filters.Cubature(form=filters.SingularValues()), "Cubature"),
        (filters.LiuWest(filters.ParticleFilter(10), names=("x2",)), "LiuWest"),
        (filters.ParticleFilter(10, gradient="held"), "ParticleFilter"),
    ],
)
def test_a_fit_asks_for_derivatives(filter_, who):
    model, _ = batch("linear")
    where = lambda m: m.measurement_noise.std.y0
    with pytest.raises(
        InputError, match=f"maximum_likelihood: needs derivatives, and those of this {who} are `Gradient.none`"
    ):
        fitting.maximum_likelihood(filter_, model, recordings("linear")[0], where, key=jax.random.key(0))


def test_prediction_errors_ask_for_exact_ones():
    model, _ = batch("linear")
    where = lambda m: m.measurement_noise.std.y0
    with pytest.raises(InputError, match=r"prediction_error: needs derivatives.*SquareRoot\(\)\.$"):
        fitting.prediction_error(filters.Cubature(form=filters.SingularValues()), model, recordings("linear"), where)


def test_calibration_asks_for_a_covariance():
    model, _ = batch("linear")
    blind = observers.Luenberger(jnp.zeros((3, 2)))
    with pytest.raises(InputError, match="monte_carlo: Luenberger has no covariance of the state"):
        filters.monte_carlo(blind, model, recordings("linear")[0], jax.random.key(0), runs=2)

"""Sums over particles."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import numerics


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
@pytest.mark.parametrize("size", [1, 39, 79, 80, 81, 1000, 1003])
def test_total_is_the_sum(size, dtype):
    values = np.random.default_rng(size).normal(size=size).astype(dtype)
    expected = np.sum(np.asarray(values, np.float64))
    found = numerics.total(values)
    assert found.dtype == dtype
    np.testing.assert_allclose(found, expected, atol=1e-12 if dtype == jnp.float64 else 2e-5)


def test_total_of_every_element_counts_once_in_value_and_gradient():
    weights = np.arange(1003.0)
    gradient = jax.jit(jax.grad(lambda x: numerics.total(weights * x)))(np.ones(1003))
    np.testing.assert_array_equal(gradient, weights)
    assert numerics.total(weights) == 1003 * 1002 / 2


def test_total_of_a_batch_is_that_of_each_row():
    rows = np.random.default_rng(0).normal(size=(3, 130))
    np.testing.assert_allclose(jax.jit(jax.vmap(numerics.total))(rows), rows.sum(axis=1), atol=1e-12)

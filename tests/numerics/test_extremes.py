"""Largest and smallest values, and their derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import numerics


@pytest.mark.parametrize("shape", [(1,), (4,), (3, 5)])
def test_they_are_those_of_numpy(shape):
    values = np.random.default_rng(0).normal(size=shape)
    assert numerics.largest(values) == values.max() and numerics.smallest(values) == values.min()
    assert numerics.largest(values.astype(np.float32)).dtype == np.float32
    values.flat[-1] = np.nan
    assert np.isnan(numerics.largest(values)) and np.isnan(numerics.smallest(values))
    assert numerics.largest(np.array([-np.inf, -np.inf])) == -np.inf


def test_the_derivative_is_that_of_one_value_also_where_several_are_equal():
    values = jnp.array([1.0, 3.0, 3.0, 2.0])
    np.testing.assert_array_equal(jax.grad(numerics.largest)(values), [0.0, 1.0, 0.0, 0.0])
    np.testing.assert_array_equal(jax.grad(numerics.smallest)(values), [1.0, 0.0, 0.0, 0.0])
    curve = jax.hessian(lambda x: numerics.largest(x**2))(values)
    np.testing.assert_array_equal(curve, np.diag([0.0, 2.0, 0.0, 0.0]))

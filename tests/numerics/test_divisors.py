"""Divisors where there is something to divide by, and one elsewhere."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import numerics

VALUES = np.array([-2.0, 0.0, 0.5, np.nan, 3.0])
HERE = VALUES > 0.0


def test_a_divisor_is_one_elsewhere():
    np.testing.assert_array_equal(numerics.or_one(VALUES, HERE), [1.0, 1.0, 0.5, 1.0, 3.0])


@pytest.mark.parametrize("taken", [lambda x: 1 / x, jnp.sqrt, jnp.log])
def test_derivatives_of_what_is_not_taken_are_zero(taken):
    safe = lambda x: jnp.where(x > 0, taken(numerics.or_one(x, x > 0)), 0.0)
    slopes = np.asarray(jax.vmap(jax.grad(safe))(VALUES))
    np.testing.assert_array_equal(slopes[~HERE], 0.0)
    np.testing.assert_allclose(slopes[HERE], [jax.grad(taken)(x) for x in VALUES[HERE]])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_divisor_has_the_type_of_the_value(dtype):
    assert numerics.or_one(jnp.asarray(VALUES, dtype), HERE).dtype == dtype

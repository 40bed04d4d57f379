"""Numbers beside arrays."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import numerics


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", [(), (3,), (2, 3)])
def test_a_number_has_the_shape_and_precision_of_what_is_beside_it(shape, dtype):
    found = numerics.as_wide_as(-0.7, jnp.full(shape, 5.0, dtype))
    assert found.dtype == dtype
    np.testing.assert_array_equal(found, np.full(shape, -0.7, dtype))


def test_arrays_have_their_common_shape():
    found = numerics.as_wide_as(jnp.arange(3.0), jnp.ones((2, 1)))
    np.testing.assert_array_equal(found, [[0.0, 1.0, 2.0]] * 2)


def test_what_is_not_finite_beside_it_is_told_and_has_no_slope():
    np.testing.assert_array_equal(numerics.as_wide_as(1.0, jnp.asarray([2.0, np.nan, np.inf])), [1.0, np.nan, np.nan])
    assert jax.grad(numerics.as_wide_as, argnums=(0, 1))(2.0, 3.0) == (1.0, 0.0)

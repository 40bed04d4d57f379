"""Small systems with scalars for entries: against NumPy, in batches, with zeros that are Python numbers."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import numerics


@pytest.mark.parametrize("n", [1, 2, 6])
def test_solves_as_numpy_does(n):
    rng = np.random.default_rng(n)
    root = rng.standard_normal((5, n, n))
    A, b = root @ np.swapaxes(root, 1, 2) + np.eye(n), rng.standard_normal((5, n))
    lower = [[jnp.asarray(A[:, i, j]) for j in range(i + 1)] for i in range(n)]
    found = numerics.solve_scalars(lower, [jnp.asarray(b[:, i]) for i in range(n)])
    np.testing.assert_allclose(np.stack(found, 1), np.linalg.solve(A, b[..., None])[..., 0], rtol=1e-10, atol=1e-12)


def test_entries_may_be_numbers_and_broadcast():
    x = numerics.solve_scalars([[jnp.asarray(4.0)], [0.0, jnp.asarray([2.0, 5.0])]], [jnp.asarray(8.0), 10.0])
    np.testing.assert_array_equal(x[0], 2.0)
    np.testing.assert_array_equal(x[1], [5.0, 2.0])


def test_float32_stays():
    one = jnp.asarray(1.0, jnp.float32)
    found = jax.jit(lambda a: numerics.solve_scalars([[2.0 * a], [0.5 * a, 3.0 * a]], [a, a]))(one)
    assert all(v.dtype == jnp.float32 for v in found)

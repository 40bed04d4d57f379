"""Triangular factors of A A^T: LAPACK's answer, the digits that a covariance loses, derivatives, lower ranks."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh.numerics import lower_factor

pytestmark = pytest.mark.product

factor = jax.jit(lower_factor)


def random(n, k, seed=0):
    return np.random.default_rng(seed).normal(size=(n, k))


@pytest.mark.parametrize(("n", "k"), [(1, 1), (3, 3), (5, 14), (13, 40)])
def test_it_is_lapack_s_with_a_positive_diagonal(n, k):
    matrix = random(n, k)
    upper = np.linalg.qr(matrix.T, mode="r")
    expected = upper.T * np.sign(np.diagonal(upper))
    np.testing.assert_allclose(factor(matrix), expected, rtol=1e-12, atol=1e-13)


def test_it_keeps_the_digits_that_a_covariance_loses():
    # Two rows that agree in five digits: A A^T agrees in ten, more than float32 has.
    small = 1e-5
    matrix = np.asarray([[1.0, 0.0, 0.0], [1.0, small, 0.0], [0.0, 1.0, small]], np.float32)
    found = factor(matrix)
    np.testing.assert_allclose(np.abs(found), [[1, 0, 0], [1, small, 0], [0, 1, small]], rtol=1e-6)


@pytest.mark.parametrize("k", [4, 9])
def test_derivatives_in_both_directions_are_differences(k):
    matrix, change, weight = random(4, k), random(4, k, 1), random(4, 4, 2)

    @jax.jit
    def derivatives(matrix):
        """Forward along the change, and backward."""
        back = jax.grad(lambda m: jnp.sum(weight * lower_factor(m)))(matrix)
        return jax.jvp(lower_factor, (matrix,), (jnp.asarray(change),))[1], back

    forward, backward = derivatives(matrix)
    step = 1e-6
    difference = np.subtract(factor(matrix + step * change), factor(matrix - step * change)) / (2 * step)
    np.testing.assert_allclose(forward, difference, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(np.vdot(backward, change), np.vdot(weight, forward), rtol=1e-12)


def test_a_lower_rank_leaves_zeros_and_finite_derivatives():
    matrix = np.asarray([[1.0, 2.0, 2.0], [0.0, 0.0, 0.0], [1.0, 0.0, 1.0]])
    found = np.asarray(factor(matrix))
    np.testing.assert_allclose(found @ found.T, matrix @ matrix.T, rtol=1e-14)
    assert found[1, 1] == 0
    assert np.isfinite(jax.jit(jax.grad(lambda m: jnp.sum(lower_factor(m))))(matrix)).all()


def test_it_batches():
    batch = np.stack([random(3, 5, seed) for seed in range(4)])
    np.testing.assert_allclose(jax.jit(jax.vmap(lower_factor))(batch), [factor(one) for one in batch], rtol=1e-14)

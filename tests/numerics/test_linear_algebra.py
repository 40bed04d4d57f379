"""Small factors against the library's, with gradients, batches, and what happens without definiteness.

Left to `full`: float32 but at one size written out and at the library's; at the largest size written out, which compiles
long, the gradients of functions that are made of the others.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jaxveh import numerics
from jaxveh.numerics.linear_algebra import WRITTEN_OUT

pytestmark = pytest.mark.product

every_type = pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
SIZES = [1, 3, WRITTEN_OUT, WRITTEN_OUT + 1]
BATCHES = [(), (2, 3)]
every_size = pytest.mark.parametrize("n", SIZES)
cholesky = jax.jit(numerics.cholesky)


def definite(n, batch=(), dtype=jnp.float64, seed=0):
    root = np.random.default_rng(seed).normal(size=(*batch, n, 2 * n))
    return jnp.asarray(root @ np.swapaxes(root, -1, -2), dtype)


def close(value, expected, dtype):
    assert value.dtype == dtype
    np.testing.assert_allclose(
        value, expected, rtol=2e-4 if dtype == jnp.float32 else 1e-11, atol=1e-4 if dtype == jnp.float32 else 1e-12
    )


@jax.jit
def everything(matrix, vector, columns):
    """All functions of one matrix: one program a size."""
    factor = numerics.cholesky(matrix)
    solves = numerics.solve_lower, numerics.solve_lower_transposed, numerics.solve_psd
    return (
        factor,
        [[solve(factor, b) for solve in solves] for b in (vector, columns)],
        numerics.log_det(factor),
        numerics.inverse_psd(factor),
        numerics.mahalanobis(factor, vector),
    )


SINGLE = [
    pytest.param(
        n, batch, jnp.float32, marks=() if (n, batch) in ((3, (2, 3)), (WRITTEN_OUT + 1, (2, 3))) else pytest.mark.full
    )
    for n in SIZES
    for batch in BATCHES
]


@pytest.mark.parametrize(
    ("n", "batch", "dtype"), [(n, batch, jnp.float64) for n in SIZES for batch in BATCHES] + SINGLE
)
def test_against_the_library(n, batch, dtype):
    matrix = definite(n, batch, dtype)
    exact = np.asarray(matrix, float)
    vector = jnp.asarray(np.random.default_rng(1).normal(size=(*batch, n)), dtype)
    columns = jnp.asarray(np.random.default_rng(2).normal(size=(*batch, n, 4)), dtype)
    factor, solved, log_det, inverse, mahalanobis = everything(matrix, vector, columns)
    close(factor, np.linalg.cholesky(exact), dtype)
    np.testing.assert_array_equal(np.triu(factor, 1), 0.0)
    lower = np.asarray(factor, float)
    for b, expand, answers in ((vector, True, solved[0]), (columns, False, solved[1])):
        right = np.asarray(b, float)[..., None] if expand else np.asarray(b, float)
        for left, answer in zip((lower, np.swapaxes(lower, -1, -2), exact), answers, strict=True):
            expected = np.linalg.solve(left, right)
            close(answer, expected[..., 0] if expand else expected, dtype)
    close(log_det, np.linalg.slogdet(exact)[1], dtype)
    close(inverse, np.linalg.inv(exact), dtype)
    distance = np.einsum("...i,...ij,...j", vector, np.linalg.inv(exact), vector)
    close(mahalanobis, distance, dtype)


@every_size
def test_only_the_lower_triangle_is_read(n):
    matrix = definite(n)
    poisoned = jnp.where(jnp.triu(jnp.ones((n, n), bool), 1), jnp.nan, matrix)
    np.testing.assert_allclose(cholesky(poisoned), cholesky(matrix), rtol=1e-14)


@every_size
def test_the_inverse_is_symmetric(n):
    inverse = jax.jit(numerics.inverse_psd)(cholesky(definite(n)))
    np.testing.assert_allclose(inverse, inverse.T, rtol=1e-13)


@every_type
@every_size
def test_lost_definiteness_shows_in_the_last_element(n, dtype):
    for matrix in (
        -definite(n, dtype=dtype),
        jnp.zeros((n, n), dtype),
        definite(n, dtype=dtype).at[n // 2, n // 2].set(-1.0),
    ):
        assert np.isnan(cholesky(matrix)[-1, -1])
    mixed = jnp.stack((definite(n, dtype=dtype), -definite(n, dtype=dtype)))
    np.testing.assert_array_equal(np.isnan(np.asarray(cholesky(mixed))[:, -1, -1]), [False, True])


GRADIENTS = [
    pytest.param(n, name, marks=pytest.mark.full if n == WRITTEN_OUT and name != "cholesky" else ())
    for n in SIZES
    for name in ("cholesky", "solve", "inverse", "log_det", "mahalanobis", "transposed")
]


@pytest.mark.parametrize(("n", "name"), GRADIENTS)
def test_gradients(n, name):
    b = jnp.asarray(np.random.default_rng(1).normal(size=n))
    functions = {
        "cholesky": lambda factor, b: factor,
        "solve": numerics.solve_psd,
        "transposed": numerics.solve_lower_transposed,
        "inverse": lambda factor, b: numerics.inverse_psd(factor),
        "log_det": lambda factor, b: numerics.log_det(factor),
        "mahalanobis": numerics.mahalanobis,
    }

    @jax.jit
    def function(root, b):
        matrix = root @ root.T + 2.0 * jnp.eye(n)
        return functions[name](numerics.cholesky(matrix), b)

    root = jnp.asarray(np.random.default_rng(0).normal(size=(n, n)))
    check_grads(function, (root, b), order=1, modes=("fwd", "rev"), rtol=1e-5, atol=1e-6)
    if n <= 3:
        check_grads(function, (root, b), order=2, modes=("rev",), rtol=1e-4, atol=1e-5)


@jax.jit
def batches(matrix, b):
    """What should be the same with `vmap` and without."""
    factor = numerics.cholesky(matrix)
    return (
        (jax.vmap(numerics.cholesky)(matrix), factor),
        (jax.vmap(numerics.solve_psd)(factor, b), numerics.solve_psd(factor, b)),
        (jax.vmap(numerics.solve_lower, (None, 0))(factor[0], b)[3], numerics.solve_lower(factor[0], b[3])),
    )


@every_size
def test_batches_by_vmap(n):
    factors, solutions, lower = batches(definite(n, (6,)), jnp.ones((6, n)))
    np.testing.assert_allclose(*factors, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(*solutions, rtol=1e-10)
    np.testing.assert_allclose(*lower)


def test_symmetric_part():
    matrix = jnp.asarray([[1.0, 2.0], [4.0, 3.0]])
    np.testing.assert_array_equal(numerics.symmetric(matrix), [[1.0, 3.0], [3.0, 3.0]])
    assert numerics.symmetric(jnp.ones((4, 2, 2), jnp.float32)).dtype == jnp.float32


def test_small_matrices_call_no_library():
    text = jax.jit(lambda m: numerics.solve_psd(numerics.cholesky(m), m[0])).lower(definite(3)).as_text()
    assert "custom_call" not in text
    text = jax.jit(numerics.cholesky).lower(definite(WRITTEN_OUT + 1)).as_text()
    assert "cholesky" in text or "custom_call" in text


def test_bad_shapes_are_named():
    factor = numerics.cholesky(definite(3))
    with pytest.raises(ValueError, match=r"matrix has shape \(3, 2\)"):
        numerics.cholesky(jnp.ones((3, 2)))
    with pytest.raises(ValueError, match=r"b has shape \(4,\)"):
        numerics.solve_lower(factor, jnp.ones(4))
    with pytest.raises(ValueError, match=r"b has shape \(2, 3, 3\)"):
        numerics.solve_psd(factor, jnp.ones((2, 3, 3)))
    with pytest.raises(ValueError, match=r"residual has shape \(2,\)"):
        numerics.mahalanobis(factor, jnp.ones(2))

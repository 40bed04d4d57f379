"""Triangular factors of A A^T without forming it, for square-root filters."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import Array

from jaxveh.numerics.divisors import or_one
from jaxveh.numerics.fences import fence
from jaxveh.numerics.linear_algebra import solve_lower


@jax.custom_jvp
def lower_factor(matrix: Array) -> Array:
    """Lower triangular L (n, n) with a diagonal >= 0 and L L^T = A A^T, for a matrix A (n, k).

    The transposed R of a QR decomposition of A^T, by the modified Gram-Schmidt process, whose R is as accurate as
    Householder's (A. Bjorck, Numerical Methods for Least Squares Problems, sec. 2.4.4): no covariance is formed, so
    that L keeps the digits that a Cholesky factor of A A^T loses.

    The derivative is that of the equation L L^T = A A^T: with A = L Q^T and Z = L^-1 dA Q,

        dL = L low(Z + Z^T),    low: the lower triangle with half of the diagonal.

    Where A has a lower rank, L has zeros on its diagonal, and there the derivative leaves out its undefined part.
    """
    return _orthogonalise(matrix)[0]


@lower_factor.defjvp
def _lower_factor_jvp(primals, tangents):
    (matrix,), (change,) = primals, tangents
    factor, turned = _orthogonalise(matrix)
    diagonal = jnp.diagonal(factor)
    # A row that depends linearly on those before has a zero pivot, which must not be a divisor.
    regular = factor + jnp.diag(jnp.where(diagonal > 0, 0, 1).astype(factor.dtype))
    inner = solve_lower(regular, _times(change, turned.T))
    both = inner + inner.T
    low = jnp.tril(both, -1) + jnp.diag(0.5 * jnp.diagonal(both))
    return factor, jnp.tril(_times(factor, low))


def _orthogonalise(matrix: Array) -> tuple[Array, Array]:
    """L (n, n) and Q^T (n, k) with A = L Q^T; rows of Q^T are orthonormal, or zero where a row of A depends linearly on
    those before."""
    n = matrix.shape[0]
    columns, directions, rest = [], [], matrix
    for i in range(n):
        squared = jnp.sum(rest[0] * rest[0])
        some = squared > 0
        length = jnp.where(some, jnp.sqrt(or_one(squared, some)), 0)
        direction = rest[0] * jnp.where(some, 1 / or_one(length, some), 0)
        along = jnp.sum(rest[1:] * direction, axis=-1)
        columns.append(jnp.concatenate([jnp.zeros(i, matrix.dtype), length[None], along]))
        directions.append(direction)
        rest = fence(rest[1:] - along[:, None] * direction)
    return jnp.stack(columns, axis=-1), jnp.stack(directions)


def _times(a: Array, b: Array) -> Array:
    """The product (n, k) (k, m) as a sum that XLA fuses: its library's products round depending on the operands' place
    in memory."""
    return jnp.sum(a[:, None, :] * b.T[None], axis=-1)

"""Square-root algebra of small covariance matrices (..., n, n).

Up to `WRITTEN_OUT` rows the formulas are written out in scalars, several times faster on the CPU than a call of LAPACK for each
matrix; larger matrices use the library's routines. A factor is always lower triangular, and leading axes are a batch.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax import Array

from jaxveh.numerics.elementary import log
from jaxveh.numerics.fences import fence

WRITTEN_OUT = 8
"""The largest number of rows whose formulas are written out in scalars."""

Rows = list[list[Array]]


@jax.jit
def cholesky(matrix: Array) -> Array:
    """Lower factor L (..., n, n) of L L^T = matrix (..., n, n), of which only the lower triangle is read.

    If the matrix is not positive definite, at least the last diagonal element of its factor is NaN.
    """
    n = _square(matrix, "matrix")
    if n > WRITTEN_OUT:
        return jnp.linalg.cholesky(matrix, symmetrize_input=False)
    return _from_rows(_cholesky_rows([[matrix[..., i, j] for j in range(i + 1)] for i in range(n)]))


@jax.jit
def solve_lower(factor: Array, b: Array) -> Array:
    """The solution x of L x = b, for a factor L (..., n, n) and b (..., n), or (..., n, k) with as many axes as L."""
    return _by_columns(_forward, factor, b)


@jax.jit
def solve_lower_transposed(factor: Array, b: Array) -> Array:
    """The solution x of L^T x = b; shapes as for `solve_lower`."""
    return _by_columns(_backward, factor, b)


@jax.jit
def solve_psd(factor: Array, b: Array) -> Array:
    """The solution x of L L^T x = b, for the matrix that was factored; shapes as for `solve_lower`."""
    return solve_lower_transposed(factor, solve_lower(factor, b))


@jax.jit
def inverse_psd(factor: Array) -> Array:
    """The inverse (L L^T)^-1 (..., n, n), symmetric, from the factor L (..., n, n)."""
    n = _square(factor, "factor")
    if n > WRITTEN_OUT:
        identity = jnp.broadcast_to(jnp.eye(n, dtype=factor.dtype), factor.shape)
        inverse = solve_lower(factor, identity)
        return jnp.swapaxes(inverse, -1, -2) @ inverse
    rows = _inverse_rows(factor)
    upper = [[_dot([row[i] for row in rows[j:]], [row[j] for row in rows[j:]]) for j in range(i, n)] for i in range(n)]
    return _stack([[upper[min(i, j)][abs(i - j)] for j in range(n)] for i in range(n)])


@jax.jit
def log_det(factor: Array) -> Array:
    """Logarithm of the determinant of L L^T (...,), from the factor L (..., n, n)."""
    _square(factor, "factor")
    return 2.0 * jnp.sum(log(jnp.diagonal(factor, axis1=-2, axis2=-1)), axis=-1)


@jax.jit
def mahalanobis(factor: Array, residual: Array) -> Array:
    """r^T (L L^T)^-1 r (...,): the squared Mahalanobis distance of a residual r (..., n)."""
    n = _square(factor, "factor")
    if residual.shape[-1:] != (n,):
        raise ValueError(f"residual has shape {residual.shape}; for a factor {factor.shape} it must be (..., {n}).")
    if n > WRITTEN_OUT:
        whitened = _library_solve(factor, residual[..., None], transposed=False)[..., 0]
        return jnp.sum(whitened * whitened, axis=-1)
    rows = _forward(factor, [residual[..., i] for i in range(n)])
    return _dot(rows, rows)


@jax.jit
def symmetric(matrix: Array) -> Array:
    """The symmetric part (M + M^T) / 2 of a matrix (..., n, n)."""
    _square(matrix, "matrix")
    return 0.5 * (matrix + jnp.swapaxes(matrix, -1, -2))


def _square(matrix: Array, name: str) -> int:
    if matrix.ndim < 2 or matrix.shape[-1] != matrix.shape[-2] or matrix.shape[-1] == 0:
        raise ValueError(f"{name} has shape {matrix.shape}; it must be (..., n, n) with n >= 1.")
    return matrix.shape[-1]


def _dot(a: list[Array], b: list[Array]) -> Array:
    """Inner product of two non-empty lists of scalars (...,)."""
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total


def _cholesky_rows(lower: Rows) -> Rows:
    """The rows of the factor from those of the lower triangle."""
    rows: Rows = []
    inverses: list[Array] = []
    for entries in lower:
        row: list[Array] = []
        for j, entry in enumerate(entries[:-1]):
            rest = entry - _dot(row[:j], rows[j][:j]) if j else entry
            row.append(rest * inverses[j])
        pivot = entries[-1] - _dot(row, row) if row else entries[-1]
        root = jnp.sqrt(jnp.where(pivot > 0.0, pivot, jnp.nan))
        rows.append([*row, root])
        inverses.append(1.0 / root)
    return rows


def _inverse_rows(factor: Array) -> Rows:
    """The rows of the inverse of a lower triangular factor (..., n, n)."""
    rows: Rows = []
    for i in range(factor.shape[-1]):
        diagonal = 1.0 / factor[..., i, i]
        known = [_dot([factor[..., i, k] for k in range(j, i)], [rows[k][j] for k in range(j, i)]) for j in range(i)]
        rows.append([*(-diagonal * value for value in known), diagonal])
    return rows


def _from_rows(rows: Rows) -> Array:
    """The lower triangular matrix (..., n, n) with these rows of scalars (...,)."""
    zero = jnp.zeros_like(rows[0][0])
    rows = fence(rows)  # otherwise each entry of the stack would be computed from the beginning
    return jnp.stack([jnp.stack([*row, *[zero] * (len(rows) - len(row))], -1) for row in rows], -2)


def _stack(rows: Rows) -> Array:
    return jnp.stack([jnp.stack(row, -1) for row in fence(rows)], -2)


def _by_columns(solve: Callable[[Array, list[Array]], list[Array]], factor: Array, b: Array) -> Array:
    n = _square(factor, "factor")
    vector = b.ndim == factor.ndim - 1
    if b.ndim not in (factor.ndim - 1, factor.ndim) or b.shape[-1 if vector else -2] != n:
        raise ValueError(f"b has shape {b.shape}; for a factor {factor.shape} it must be (..., {n}) or (..., {n}, k).")
    if n > WRITTEN_OUT:
        columns = b[..., None] if vector else b
        solution = _library_solve(factor, columns, transposed=solve is _backward)
        return solution[..., 0] if vector else solution
    # For a matrix, all columns are solved at once: a row of the matrix takes the place of a vector's scalar.
    entries = factor if vector else factor[..., None, :, :]
    rows = [b[..., i] if vector else b[..., i, :] for i in range(n)]
    return jnp.stack(fence(solve(entries, rows)), -1 if vector else -2)


def _library_solve(factor: Array, b: Array, *, transposed: bool) -> Array:
    batch = jnp.broadcast_shapes(factor.shape[:-2], b.shape[:-2])
    factor = jnp.broadcast_to(factor, batch + factor.shape[-2:])
    b = jnp.broadcast_to(b, batch + b.shape[-2:])
    return jax.lax.linalg.triangular_solve(factor, b, left_side=True, lower=True, transpose_a=transposed)


def _forward(factor: Array, b: list[Array]) -> list[Array]:
    x: list[Array] = []
    for i, entry in enumerate(b):
        rest = entry - _dot([factor[..., i, j] for j in range(i)], x) if i else entry
        x.append(rest / factor[..., i, i])
    return x


def _backward(factor: Array, b: list[Array]) -> list[Array]:
    n = len(b)
    x: list[Array] = []
    for i in reversed(range(n)):
        rest = b[i] - _dot([factor[..., j, i] for j in reversed(range(i + 1, n))], x) if x else b[i]
        x.append(rest / factor[..., i, i])
    return x[::-1]

"""Small systems of linear equations whose entries are scalars, or arrays of a batch, by name."""

from collections.abc import Sequence

from jax import Array


def solve_scalars(lower: Sequence[Sequence[Array]], b: Sequence[Array]) -> list[Array]:
    """The solution x of A x = b for a symmetric, positive definite A with the rows `lower` up to the diagonal
    (1, 2, ... n entries).

    It works elementwise: entries broadcast against each other, without an axis of rows. It is Cholesky's factorisation
    without roots, A = L D L^T, written out; it does not detect a matrix that is not positive definite.
    """
    unit: list[list] = []  # rows of L left of the diagonal
    pivots: list = []
    for entries in lower:
        scaled: list = []  # the row of L D
        row: list = []
        for j, entry in enumerate(entries):
            rest = entry - sum(s * below for s, below in zip(scaled, unit[j] if j < len(unit) else row, strict=True))
            if j < len(unit):
                scaled.append(rest)
                row.append(rest / pivots[j])
            else:
                pivots.append(rest)
        unit.append(row)
    n = len(unit)
    y: list = []
    for i in range(n):
        y.append(b[i] - sum(unit[i][j] * y[j] for j in range(i)))
    x: list = [None] * n
    for i in reversed(range(n)):
        x[i] = y[i] / pivots[i] - sum(unit[j][i] * x[j] for j in range(i + 1, n))
    return x

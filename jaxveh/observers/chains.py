"""Poles that are repeated more often than there are channels."""

from __future__ import annotations

import numpy as np

from jaxveh._core.errors import InputError


def chained_gain(F: np.ndarray, C: np.ndarray, poles: np.ndarray) -> np.ndarray:
    """The gain L (n, m) that places the eigenvalues of `F - L C` (n, n) at the poles (n,), all equal unless m is 1.

    Ackermann's formula for several channels: the observability matrix is divided into one chain per channel (D. Luenberger,
    Canonical forms for linear multivariable systems, IEEE Trans. Autom. Control 12, 1967), each with its own polynomial.
    """
    # Rates over the fastest placed one: powers of F, which is near the identity, would lose the chains' digits.
    n, scale = len(F), np.max(np.abs(1.0 - poles))
    size = np.linalg.norm(C, axis=1)
    A, B = (F - np.eye(n)).T / scale, (C / np.where(size > 0, size, 1.0)[:, None]).T
    wanted = (poles - 1.0) / scale
    lengths = _chain_lengths(A, B)
    active = [j for j in range(B.shape[1]) if lengths[j]]
    powers = [np.linalg.matrix_power(A, k) for k in range(n)]
    basis = np.stack([powers[k] @ B[:, j] for j in active for k in range(lengths[j])], axis=1)
    ends = np.linalg.inv(basis)[np.cumsum([lengths[j] for j in active]) - 1]
    mixed = np.stack([q @ powers[lengths[j] - 1] @ B[:, active] for q, j in zip(ends, active, strict=True)])
    moved = np.stack([q @ _polynomial(A, wanted[: lengths[j]]) for q, j in zip(ends, active, strict=True)])
    gain = np.zeros((n, B.shape[1]))
    gain[:, active] = scale * np.linalg.solve(mixed, moved).T
    return gain / np.where(size > 0, size, 1.0)


def _chain_lengths(A: np.ndarray, B: np.ndarray) -> list[int]:
    """How many powers of A each column of B adds to the span (observability indices); the most independent of a power first."""
    n, m = B.shape
    found, lengths, heads = np.zeros((n, 0)), [0] * m, {j: B[:, j] for j in range(m)}
    for _ in range(n):
        waiting, heads = heads, {}
        while waiting and found.shape[1] < n:
            rests = {j: _apart(found, head) for j, head in waiting.items()}
            j = max(rests, key=lambda j: np.linalg.norm(rests[j]))
            head, size = waiting.pop(j), np.linalg.norm(rests[j])
            if size > 1e-10:
                found = np.column_stack([found, rests[j] / size])
                lengths[j] += 1
                heads[j] = A @ head
    if found.shape[1] < n:
        raise InputError(
            f"the model is hardly observable there: {found.shape[1]} of {n} directions reach the channels."
        )
    return lengths


def _apart(found: np.ndarray, head: np.ndarray) -> np.ndarray:
    """The part of a direction outside the span of the orthonormal columns `found`."""
    rest = head / (np.linalg.norm(head) or 1.0)
    rest = rest - found @ (found.T @ rest)
    return rest - found @ (found.T @ rest)


def _polynomial(A: np.ndarray, roots: np.ndarray) -> np.ndarray:
    product = np.eye(len(A), dtype=complex)
    for root in roots:
        product = product @ (A - root * np.eye(len(A)))
    return product.real

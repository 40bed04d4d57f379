"""Batches of scans with drawn bodies, of which some operands are of the batch and others shared, equal those of `lax.scan`."""

import random

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jaxveh import numerics

RUNS, ROWS = 3, 4
SCANS = {"batch last": numerics.scan_batch_last, "written out": numerics.scan_written_out}

OF_ONE = [
    jnp.sin,
    jnp.tanh,
    jax.jit(jnp.cos),
    lambda x: numerics.sqrt(1 + x * x),
    lambda x: 1 / (1.5 + x * x),
    lambda x: jnp.where(x > 0.1, x, 0.3 * x),
    lambda x: lax.stop_gradient(x) * x,
    lambda x: lax.cond(x > 0.2, jnp.sin, lambda y: y * y, x),
]
OF_TWO = [jnp.add, jnp.multiply, jnp.subtract, lambda x, y: x / (2 + y * y)]


def drawn_body(draw):
    """A body of three numbers that all runs share; its matrix and its slow part may be the same for all runs, or not."""
    steps = [
        (draw.random() < 0.4, draw.choice(OF_ONE), draw.choice(OF_TWO), draw.random(), draw.random()) for _ in range(20)
    ]
    places = [draw.random() for _ in range(4)]
    alone = draw.random() < 0.5

    def body(numbers, carry, row):
        a, w, m = numbers
        x, y, P, slow, count = carry
        known = [x, y, P[0, 0], P[0, 1], P[1, 1], row, a, w[0], w[1], m[0, 1], slow]
        for one, f, g, u, v in steps:
            p, q = known[int(u * len(known))], known[int(v * len(known))]
            known.append(jnp.tanh(f(p) if one else g(p, q)))
        chosen = [known[int(place * len(known))] for place in places]
        matrix = 0.5 * P @ P.T + 0.1 * a * jnp.eye(2) if alone else jnp.asarray(chosen[:2])[:, None] * m + jnp.eye(2)
        after = known[-1], chosen[2], matrix, 0.9 * slow + 0.1 * w @ w, count + 1
        return after, (known[-2], matrix[0], slow, jnp.where(count > 1, x, 0.0), chosen[3])

    return body


def drawn_start(draw):
    """The start and the rows, and which of them are of the batch."""
    whole = {"x": 0.3, "y": 0.5, "P": [[1.0, 0.2], [0.3, 0.8]], "slow": 0.4, "rows": np.linspace(0.1, 0.9, ROWS)}
    axes = {name: 0 if name == "x" or draw.random() < 0.5 else None for name in whole}
    scale = jnp.asarray([1.0, -0.6, 1.3])
    start = {
        name: jnp.asarray(value) if axes[name] is None else jnp.multiply.outer(scale, jnp.asarray(value))
        for name, value in whole.items()
    }
    return start, axes


@pytest.mark.parametrize("name", SCANS)
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(1, 12))])
def test_a_batch_is_that_of_the_scan(seed, name):
    draw = random.Random(seed)
    body, (start, axes) = drawn_body(draw), drawn_start(draw)
    numbers = jnp.asarray(0.7), jnp.asarray([0.3, -0.5]), jnp.asarray([[0.1, 0.6], [0.2, 0.4]])

    def value(scan, numbers, start):
        def run(start):
            carry = start["x"], start["y"], start["P"], start["slow"], jnp.int32(0)
            found = scan(lambda c, r: body(numbers, c, r), carry, start["rows"])
            leaves = [leaf for leaf in jax.tree.leaves(found) if jnp.issubdtype(leaf.dtype, jnp.floating)]
            return sum(
                jnp.sum(leaf * jnp.cos(jnp.arange(leaf.size, dtype=float).reshape(leaf.shape))) for leaf in leaves
            )

        return jnp.sum(jax.vmap(run, (axes,))(start) * jnp.asarray([1.0, 2.0, -0.7]))

    def every(scan):
        function = lambda *given: value(scan, *given)
        moved = jax.tree.map(jnp.ones_like, (numbers, start))
        slopes = jax.grad(function, (0, 1))
        of_many = jax.vmap(jax.grad(lambda a: function((a, *numbers[1:]), start)))(jnp.linspace(0.1, 0.9, 2))
        return function(numbers, start), jax.jvp(slopes, (numbers, start), moved), of_many

    wanted, found = (jax.jit(lambda scan=scan: every(scan))() for scan in (lax.scan, SCANS[name]))
    for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        np.testing.assert_allclose(a, b, 1e-9, 1e-11)

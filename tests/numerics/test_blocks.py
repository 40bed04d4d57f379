"""Sums in blocks are the plain sums, and so are their gradients."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import numerics
from jaxveh._core.errors import InputError

pytestmark = pytest.mark.product


class Rows(NamedTuple):
    x: Any
    y: Any
    shift: Any = 0.0
    absent: Any = None


class Law(eqx.Module):
    a: jax.Array
    b: jax.Array
    powers: jax.Array
    name: str = eqx.field(static=True, default="law")


def loss(law, rows):
    curve = jnp.sin(law.a * rows.x + rows.shift) + law.powers[0] * rows.x + law.powers[1] * rows.x**2
    return (law.b * curve - rows.y) ** 2


def plain(law, rows):
    return jnp.sum(loss(law, rows))


def made(count, dtype=jnp.float64, shift=0.25):
    x, y = jax.random.normal(jax.random.key(count), (2, count), dtype)
    law = Law(jnp.asarray(1.5, dtype), jnp.asarray(-0.4, dtype), jnp.asarray([0.3, -0.2], dtype))
    return law, Rows(x, y, jnp.asarray(shift, dtype))


def in_blocks(block):
    return lambda law, rows: numerics.sum_in_blocks(loss, law, rows, block=block)


def assert_close(found, expected, tolerance):
    assert jax.tree.structure(found) == jax.tree.structure(expected)
    for ours, theirs in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        assert ours.dtype == theirs.dtype
        assert ours.shape == theirs.shape
        np.testing.assert_allclose(
            ours, theirs, rtol=tolerance, atol=tolerance * max(1.0, float(jnp.abs(theirs).max()))
        )


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
@pytest.mark.parametrize(("count", "block"), [(1, 7), (7, 7), (20, 7), (21, 7), (1003, 100), (50, 500), (5, 1)])
def test_value_and_gradients_are_the_plain_ones(count, block, dtype):
    law, rows = made(count, dtype)
    found = jax.jit(jax.value_and_grad(in_blocks(block), argnums=(0, 1)))(law, rows)
    expected = jax.value_and_grad(plain, argnums=(0, 1))(law, rows)
    assert_close(found, expected, 1e-12 if dtype == jnp.float64 else 2e-5)
    assert in_blocks(block)(law, rows) == plain(law, rows)


def test_a_gradient_of_some_arguments_and_plain_numbers_in_rows():
    law, rows = made(33)
    rows = rows._replace(shift=0.25)
    assert_close(jax.grad(in_blocks(8))(law, rows), jax.grad(plain)(law, rows), 1e-12)
    by_b = lambda f: jax.grad(lambda b: f(eqx.tree_at(lambda law: law.b, law, b), rows))(law.b)
    assert_close(by_b(in_blocks(8)), by_b(plain), 1e-12)
    by_x = lambda f: jax.grad(lambda x: f(law, rows._replace(x=x)))(rows.x)
    assert_close(by_x(in_blocks(8)), by_x(plain), 1e-12)


def test_forward_mode_second_derivatives_and_batches():
    law, rows = made(33)
    slopes = jax.tree.map(lambda leaf: jnp.cos(leaf) + 1, (law, rows))
    assert_close(jax.jvp(in_blocks(8), (law, rows), slopes), jax.jvp(plain, (law, rows), slopes), 1e-12)
    for twice in (jax.hessian, lambda f: jax.jacrev(jax.grad(f))):
        assert_close(twice(in_blocks(8))(law, rows), twice(plain)(law, rows), 1e-12)
    many = jax.tree.map(lambda leaf: leaf * jnp.linspace(0.5, 1.5, 4).reshape(4, *[1] * leaf.ndim), law)
    over = lambda f: jax.vmap(jax.value_and_grad(f), (0, None))(many, rows)
    assert_close(over(in_blocks(8)), over(plain), 1e-12)


def test_a_row_that_is_not_finite_keeps_it_to_itself():
    law, rows = made(33)
    rows = rows._replace(y=rows.y.at[3].set(jnp.inf))
    found = jax.grad(in_blocks(8), argnums=1)(law, rows).y
    assert np.flatnonzero(~np.isfinite(found)).tolist() == [3]


def test_rows_of_several_lengths_and_no_block_raise():
    law, rows = made(5)
    with pytest.raises(InputError, match=r"rows: shapes \[\(4,\), \(5,\)\]"):
        numerics.sum_in_blocks(loss, law, rows._replace(x=rows.x[:4]))
    with pytest.raises(InputError, match=r"rows: shapes \[\]"):
        numerics.sum_in_blocks(loss, law, Rows(1.0, 2.0))
    with pytest.raises(InputError, match=r"rows: shapes \[\(5, 2\)\]"):
        numerics.sum_in_blocks(loss, law, Rows(jnp.ones((5, 2)), 2.0))
    with pytest.raises(InputError, match="block = 0: must be at least 1"):
        numerics.sum_in_blocks(loss, law, rows, block=0)

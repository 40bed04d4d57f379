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


def made(count, dtype=np.float64, shift=0.25):
    x, y = np.random.default_rng(count).normal(size=(2, count)).astype(dtype)
    law = Law(*(jnp.asarray(value, dtype) for value in (1.5, -0.4, [0.3, -0.2])))
    return law, Rows(jnp.asarray(x), jnp.asarray(y), jnp.asarray(shift, dtype))


def in_blocks(block):
    return lambda law, rows: numerics.sum_in_blocks(loss, law, rows, block=block)


def of_both(transform, block, *args):
    """What `transform` makes of the sum in blocks and of the plain one, from one program."""
    return jax.jit(lambda *args: [transform(f)(*args) for f in (in_blocks(block), plain)])(*args)


def assert_close(found, expected, tolerance):
    assert jax.tree.structure(found) == jax.tree.structure(expected)
    for ours, theirs in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        assert ours.dtype == theirs.dtype
        assert ours.shape == theirs.shape
        np.testing.assert_allclose(
            ours, theirs, rtol=tolerance, atol=tolerance * max(1.0, np.abs(np.asarray(theirs)).max())
        )


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(("count", "block"), [(1, 7), (7, 7), (20, 7), (21, 7), (1003, 100), (50, 500), (5, 1)])
def test_value_and_gradients_are_the_plain_ones(count, block, dtype):
    law, rows = made(count, dtype)
    with_value = lambda f: lambda *args: (f(*args), jax.value_and_grad(f, argnums=(0, 1))(*args))
    (value, found), (plain_value, expected) = of_both(with_value, block, law, rows)
    assert_close(found, expected, 1e-12 if dtype == np.float64 else 2e-5)
    assert value == plain_value


def test_a_gradient_of_some_arguments_and_plain_numbers_in_rows():
    law, rows = made(33)

    def gradients(f):
        def of(law, x, y):
            at = Rows(x, y, shift=0.25)
            by_law = jax.grad(f)(law, at)
            by_b = jax.grad(lambda b: f(eqx.tree_at(lambda law: law.b, law, b), at))(law.b)
            return by_law, by_b, jax.grad(lambda x: f(law, at._replace(x=x)))(x)

        return of

    assert_close(*of_both(gradients, 8, law, rows.x, rows.y), 1e-12)


def test_forward_mode_second_derivatives_and_batches():
    law, rows = made(33)
    slopes = jax.tree.map(lambda leaf: np.cos(leaf) + 1, (law, rows))
    many = jax.tree.map(lambda leaf: np.linspace(0.5, 1.5, 4).reshape(4, *[1] * leaf.ndim) * leaf, law)

    def derivatives(f):
        return lambda law, rows, slopes, many: (
            jax.jvp(f, (law, rows), slopes),
            jax.hessian(f)(law, rows),
            jax.jacrev(jax.grad(f))(law, rows),
            jax.vmap(jax.value_and_grad(f), (0, None))(many, rows),
        )

    assert_close(*of_both(derivatives, 8, law, rows, slopes, many), 1e-12)


def test_a_row_that_is_not_finite_keeps_it_to_itself():
    law, rows = made(33)
    rows = rows._replace(y=np.where(np.arange(33) == 3, np.inf, rows.y))
    found = jax.jit(jax.grad(in_blocks(8), argnums=1))(law, rows).y
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

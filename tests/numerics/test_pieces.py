"""A pass there and back in pieces is the pass over all rows, whatever their number, and so is its gradient."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import numerics


def forward(slope, carry, piece):
    """The carries before each row, and the last: a walk whose steps depend on time and on where it is."""

    def body(carry, given):
        time, row, here = given
        after = (jnp.sin(slope * carry[0] + row["a"]), time)
        step = jnp.sqrt(time - carry[1])  # without a slope where no time passes
        return jax.tree.map(lambda one, other: jnp.where(here, one, other), after, carry), (carry, step)

    return jax.lax.scan(body, carry, tuple(piece))


def back(slope, later, carry, piece):
    def body(later, given):
        (before, step), (_, row, here) = given
        found = jnp.cos(later - slope * before[0]) + step * row["b"].sum()
        return jnp.where(here, found, later), (found, before[0])

    return jax.lax.scan(body, later, (forward(slope, carry, piece)[1], tuple(piece)), reverse=True)


def passed(slope, time, rows):
    start, turn = (jnp.asarray(0.3), time[0] - 0.1), lambda carry: 2.0 * carry[0]
    ahead = lambda carry, piece: forward(slope, carry, piece)[0]
    last, shown = numerics.there_and_back(ahead, lambda *given: back(slope, *given), start, turn, time, rows)
    return jnp.sum(shown[0] ** 2) + last[0], (last, shown)


@pytest.mark.parametrize("count", [2, 10, 11, 29])
def test_pieces_give_what_one_piece_gives(count, monkeypatch):
    rng = np.random.default_rng(count)
    time = jnp.cumsum(jnp.asarray(rng.uniform(0.01, 0.2, count)))
    rows = {"a": jnp.asarray(rng.normal(size=count)), "b": jnp.asarray(rng.normal(size=(count, 3)))}
    value = jax.value_and_grad(lambda *given: passed(*given), argnums=(0, 1, 2), has_aux=True)
    whole = jax.jit(value)(0.7, time, rows)
    monkeypatch.setattr("jaxveh.numerics.pieces.PIECE", 10)
    assert numerics.pieces_of(count) == -(-count // 10)
    found = jax.jit(lambda *given: value(*given))(0.7, time, rows)
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(whole), strict=True):
        assert one.shape == other.shape and np.isfinite(one).all()
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-13)

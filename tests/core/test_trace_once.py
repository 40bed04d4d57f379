"""A function called several times in a program is traced once, and is what it was."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh._core.traced import trace_once


class Spring(eqx.Module):
    stiffness: jax.Array
    power: int = eqx.field(static=True)


SPRING = Spring(jnp.asarray(3.0), 3)


def counted():
    """A spring's force, and what it was scaled by each time that it was traced, or called outside of a trace."""
    calls = []

    def force(spring, x, scale=1.0):
        calls.append(scale)
        return -scale * spring.stiffness * x**spring.power

    return force, calls


def four_steps(call, spring, x):
    for _ in range(4):
        x = x + 0.1 * call(spring, x)
    return x


WAYS = {
    "value": (jax.jit, 0.3),
    "gradient": (lambda f: jax.jit(jax.grad(f)), 0.3),
    "second derivative": (lambda f: jax.jit(jax.jacfwd(jax.grad(f))), 0.3),
    "batch": (lambda f: jax.jit(jax.vmap(f)), [0.3, 0.5]),
    "scan": (lambda f: jax.jit(lambda x: jax.lax.scan(lambda x, _: (f(x), x), x, length=3)[1]), 0.3),
}


@pytest.mark.parametrize("way", WAYS)
def test_four_calls_are_traced_once_and_give_the_same(way):
    transform, x = WAYS[way]
    found = {}
    for name, of in (("plain", lambda force: force), ("once", lambda force: functools.partial(trace_once, force))):
        force, calls = counted()
        value = transform(lambda x, call=of(force): four_steps(call, SPRING, x))(jnp.asarray(x))
        found[name] = np.asarray(value), len(calls)
    assert found["plain"][1] >= 4 and found["once"][1] == 1
    np.testing.assert_allclose(found["once"][0], found["plain"][0], rtol=1e-14)


def test_the_gradient_reaches_what_is_in_the_operands():
    slope = jax.jit(jax.grad(lambda spring: four_steps(functools.partial(trace_once, counted()[0]), spring, 0.3)))
    plain = jax.grad(lambda spring: four_steps(counted()[0], spring, 0.3))(SPRING)
    np.testing.assert_allclose(slope(SPRING).stiffness, plain.stiffness, rtol=1e-14)


def test_other_shapes_types_and_settings_are_traces_of_their_own():
    force, calls = counted()
    call = lambda spring, x, scale: jax.jit(lambda x: trace_once(force, spring, x, scale))(x)
    x = jnp.asarray(0.3)
    # Equal in Python and different in arithmetic: each has its own trace, and asking again takes it.
    for scale in (1.0, 1, True, 0.0, -0.0, 1.0, 1, True, 0.0, -0.0):
        value = call(SPRING, x, scale)
        assert np.signbit(value) == np.signbit(-scale * 3.0 * 0.3**3)
    assert [(type(scale), str(scale)) for scale in calls] == [
        (float, "1.0"), (int, "1"), (bool, "True"), (float, "0.0"), (float, "-0.0")
    ]  # fmt: skip
    for other in (jnp.asarray([0.3]), jnp.asarray(0.3, jnp.float32)):
        call(Spring(SPRING.stiffness.astype(other.dtype), 3), other, 1.0)
    call(Spring(SPRING.stiffness, 2), x, 1.0)
    assert len(calls) == 8


def test_outside_of_a_trace_it_is_a_call():
    """So that checks on the host still see numbers, and nothing is compiled for them."""
    seen = []
    trace_once(lambda x: seen.append(float(x)), jnp.asarray(0.25))
    assert seen == [0.25]


def test_errors_are_those_of_the_function():
    def wrong(x):
        raise ValueError("said by the function")

    with pytest.raises(ValueError, match="said by the function"):
        jax.jit(lambda x: trace_once(wrong, x))(jnp.asarray(1.0))

"""Roots: known ones, each element by itself, and their derivatives."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics


def square(x, a):
    return x**2 - a


def test_roots_are_found_elementwise_and_stay_where_they_are():
    a = np.asarray([0.5, 2.0, 9.0])
    root = jax.jit(lambda a: numerics.secant(square, a, jnp.ones_like(a), 2 * jnp.ones_like(a), 1e-12))
    np.testing.assert_allclose(root(a), np.sqrt(a), rtol=1e-12)
    np.testing.assert_array_equal(root(a), [root(one) for one in a])


def test_derivatives_are_those_of_the_root():
    root = lambda a: numerics.secant(square, a, jnp.asarray(1.0), jnp.asarray(2.0), 1e-13)
    slopes = jax.jit(lambda a: (jax.grad(root)(a), jax.jvp(root, (a,), (jnp.ones(()),))[1]))
    np.testing.assert_allclose(slopes(np.asarray(3.0)), 0.5 / np.sqrt(3.0), rtol=1e-12)


def test_steps_bound_the_work():
    flat = lambda x, a: a + 0 * x
    assert np.isfinite(numerics.secant(flat, jnp.asarray(1.0), jnp.asarray(1.0), jnp.asarray(2.0), 1e-9))
    far = numerics.secant(square, jnp.asarray(1e6), jnp.asarray(1.0), jnp.asarray(2.0), 1e-12, steps=2)
    assert abs(float(far) - 1e3) > 1.0

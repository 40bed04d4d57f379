"""Tables: through their points, held at the ends, smooth where they say so."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from jaxveh import numerics

pytestmark = pytest.mark.product

POINTS = np.array([0.0, 1.0, 3.0, 4.0, 7.0, 8.0])
VALUES = np.array([1.0, 1.0, 0.4, 0.5, 2.0, 1.0])
ALONG = np.linspace(-1.0, 9.0, 37)
linear, smooth = jax.jit(numerics.interpolate_linear), jax.jit(numerics.interpolate_smooth)
BOTH = pytest.mark.parametrize("between", [linear, smooth], ids=["linear", "smooth"])


@BOTH
def test_tables_go_through_their_points_and_are_held_beyond(between):
    np.testing.assert_allclose(between(POINTS, POINTS, VALUES), VALUES, rtol=1e-14)
    np.testing.assert_array_equal(between(np.array([-5.0, 100.0]), POINTS, VALUES), [1.0, 1.0])


@BOTH
def test_tables_stay_between_their_points(between):
    x = np.linspace(0.0, 8.0, 801)
    after = np.clip(np.searchsorted(POINTS, x, side="right"), 1, 5)
    low, high = np.minimum(VALUES[after - 1], VALUES[after]), np.maximum(VALUES[after - 1], VALUES[after])
    found = np.asarray(between(x, POINTS, VALUES))
    assert (found >= low - 1e-14).all() and (found <= high + 1e-14).all()


def test_linear_is_numpys():
    x = np.linspace(-1.0, 9.0, 101)
    np.testing.assert_allclose(linear(x, POINTS, VALUES), np.interp(x, POINTS, VALUES), rtol=1e-14)


def test_smooth_is_scipys_but_for_its_level_ends():
    x = np.linspace(1.0, 7.0, 61)
    np.testing.assert_allclose(smooth(x, POINTS, VALUES), PchipInterpolator(POINTS, VALUES)(x), rtol=1e-13)


def test_smooth_has_a_continuous_slope():
    slope = jax.jit(jax.vmap(jax.grad(lambda x: smooth(x, POINTS, VALUES))))
    jumps = [np.max(np.abs(np.diff(slope(np.linspace(-1.0, 9.0, n))))) for n in (5001, 20001)]
    assert jumps[1] < 0.3 * jumps[0]


@BOTH
def test_gradients_are_those_of_differences(between):
    loss = jax.jit(jax.value_and_grad(lambda values: jnp.sum(between(ALONG, POINTS, values) ** 2)))
    values = VALUES + np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    steps = 1e-6 * np.eye(6)
    differences = [(float(loss(values + step)[0]) - float(loss(values - step)[0])) / 2e-6 for step in steps]
    np.testing.assert_allclose(loss(values)[1], differences, rtol=1e-6)


@BOTH
def test_flat_tables_have_finite_gradients(between):
    gradient = jax.jit(jax.grad(lambda values: jnp.sum(between(ALONG, POINTS, values))))
    assert np.isfinite(gradient(np.ones(6))).all()


@BOTH
def test_precision_stays(between):
    single = between(np.ones((2, 3), np.float32), POINTS.astype(np.float32), VALUES.astype(np.float32))
    assert single.dtype == jnp.float32 and single.shape == (2, 3)

"""Steps, ramps and limits with smooth edges: exact outside the edges, smooth in them."""

import jax
import numpy as np
import pytest

from jaxveh import numerics

x = np.linspace(-3.0, 3.0, 1201)
smooth_step, smooth_bump, smooth_ramp, smooth_clip = map(
    jax.jit, (numerics.smooth_step, numerics.smooth_bump, numerics.smooth_ramp, numerics.smooth_clip)
)


def derivative(function, order):
    for _ in range(order):
        function = jax.grad(function)
    return jax.jit(jax.vmap(function))


def test_step_goes_from_0_to_1():
    np.testing.assert_allclose(smooth_step(np.array([-1.0, 0.0, 0.25, 0.5, 1.0, 2.0])), [0, 0, 0.103515625, 0.5, 1, 1])


def test_bump_is_the_slope_of_the_step():
    np.testing.assert_allclose(smooth_bump(x), derivative(smooth_step, 1)(x), atol=1e-13)


def test_ramp_is_the_integral_of_the_step():
    slope = derivative(lambda v: smooth_ramp(v, 0.5), 1)(x)
    np.testing.assert_allclose(slope, smooth_step(x + 0.5), atol=1e-13)


def test_ramp_is_exact_outside_its_edge_and_splits_a_number_in_two():
    ramp, mirrored = (np.asarray(smooth_ramp(at, 0.5)) for at in (x, -x))
    np.testing.assert_array_equal(ramp[x >= 0.5], x[x >= 0.5])
    np.testing.assert_array_equal(ramp[x <= -0.5], 0.0)
    assert (ramp >= 0).all()
    np.testing.assert_allclose(ramp - mirrored, x, atol=1e-15)


def test_clip_is_exact_away_from_its_corners_and_stays_within_them():
    held = np.asarray(smooth_clip(x, -1.0, 2.0, 0.25))
    inside = (x >= -0.75) & (x <= 1.75)
    np.testing.assert_allclose(held[inside], x[inside], atol=1e-15)
    np.testing.assert_allclose(held[x > 2.25], 2.0, atol=1e-15)
    np.testing.assert_allclose(held[x < -1.25], -1.0, atol=1e-15)
    assert held.min() >= -1 - 1e-15 and held.max() <= 2 + 1e-15 and (np.diff(held) >= -1e-15).all()


@pytest.mark.parametrize(
    ("function", "order"),
    [
        (smooth_step, 2),
        (lambda v: smooth_ramp(v, 0.7), 3),
        (lambda v: smooth_clip(v, -1.0, 1.0, 0.4), 3),
    ],
)
def test_derivatives_are_continuous(function, order):
    jumps = [np.max(np.abs(np.diff(derivative(function, order)(np.linspace(-3.0, 3.0, n))))) for n in (6001, 24001)]
    assert np.isfinite(jumps).all() and jumps[1] < 0.3 * jumps[0]


def test_precision_stays():
    single = x.astype(np.float32)
    for values in (
        smooth_step(single),
        smooth_ramp(single, 0.5),
        smooth_clip(single, -1.0, 1.0, 0.1),
    ):
        assert values.dtype == np.float32

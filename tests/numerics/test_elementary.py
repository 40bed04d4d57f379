"""Accuracy over the whole range, special values, derivatives, types and batches of the elementary functions."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from forgetting import forget_traces
from jax.test_util import check_grads

from jaxveh import numerics
from jaxveh.numerics import elementary

pytestmark = pytest.mark.product

TYPES = [np.float32, np.float64]
UNARY = ["sin", "cos", "tan", "arctan", "sqrt", "log"]


def bound(dtype, single, double):
    return single if dtype == np.float32 else double


def spread(dtype, limit, count=200_001):
    """Both signs and all magnitudes down to 1e-30, and evenly spread numbers, up to `limit`."""
    rng = np.random.default_rng(7)
    magnitudes = np.exp(rng.uniform(np.log(1e-30), np.log(limit), count))
    return np.concatenate((magnitudes * rng.choice([-1, 1], count), rng.uniform(-limit, limit, count))).astype(dtype)


def error(function, reference, *arguments):
    value = np.asarray(function(*map(jnp.asarray, arguments)))
    assert value.dtype == arguments[0].dtype
    return np.abs(value.astype(np.longdouble) - reference(*(a.astype(np.longdouble) for a in arguments)))


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("limit", [np.pi, 100.0, "stated"])
@pytest.mark.parametrize("name", ["sin", "cos"])
def test_sine_and_cosine_in_their_range(dtype, limit, name):
    x = spread(dtype, bound(dtype, 2e4, 1e8) if limit == "stated" else limit)
    assert np.max(error(getattr(numerics, name), getattr(np, name), x)) < bound(dtype, 2e-7, 1e-15)


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("name", ["sin", "cos"])
def test_sine_and_cosine_beyond_their_range_lose_as_if_the_angle_were_rounded(dtype, name):
    x = spread(dtype, bound(dtype, 1e6, 1e14))
    allowed = bound(dtype, 2e-7, 1e-15) + 2 * np.abs(x) * np.finfo(dtype).eps
    assert np.all(error(getattr(numerics, name), getattr(np, name), x) < allowed)
    huge = np.asarray([1e12, -3e20, 1e30, np.finfo(dtype).max], dtype)
    assert np.all(np.abs(getattr(numerics, name)(jnp.asarray(huge))) <= 1.0 + 2 * np.finfo(dtype).eps)


@pytest.mark.parametrize("dtype", TYPES)
def test_relative_errors_near_zeros(dtype):
    limit = bound(dtype, 5e-7, 1e-15)
    x = spread(dtype, 1.0)
    for name in ("sin", "tan", "arctan"):
        reference = getattr(np, name)(x.astype(np.longdouble))
        assert np.max(error(getattr(numerics, name), getattr(np, name), x) / np.abs(reference)) < limit
    near_one = np.random.default_rng(0).uniform(0.5, 2.0, 200_001).astype(dtype)
    near_one = near_one[near_one != 1.0]
    reference = np.log(near_one.astype(np.longdouble))
    assert np.max(error(numerics.log, np.log, near_one) / np.abs(reference)) < limit


@pytest.mark.parametrize("dtype", TYPES)
def test_tangent(dtype):
    x = spread(dtype, np.pi)
    reference = np.tan(x.astype(np.longdouble))
    assert np.max(error(numerics.tan, np.tan, x) / np.abs(reference)) < bound(dtype, 4e-7, 1e-15)


@pytest.mark.parametrize("dtype", TYPES)
def test_arctangent_everywhere(dtype):
    for limit in (1.5, 10.0, float(np.finfo(dtype).max) / 2):
        assert np.max(error(numerics.arctan, np.arctan, spread(dtype, limit))) < bound(dtype, 2e-7, 4e-16)


@pytest.mark.parametrize("dtype", TYPES)
def test_arctangent_of_two_in_all_quadrants(dtype):
    rng = np.random.default_rng(3)
    limit = bound(dtype, 3e-7, 1e-15)
    y, x = rng.uniform(-3.0, 3.0, (2, 200_001)).astype(dtype)
    assert np.max(error(numerics.arctan2, np.arctan2, y, x)) < limit
    y, x = spread(dtype, 1e30), rng.permutation(spread(dtype, 1e30))
    assert np.max(error(numerics.arctan2, np.arctan2, y, x)) < limit


@pytest.mark.parametrize("dtype", TYPES)
def test_arctangent_of_two_on_axes_and_at_infinity(dtype):
    special = np.asarray([0.0, -0.0, 1.0, -2.0, 1e-30, np.inf, -np.inf], dtype)
    y, x = (grid.ravel() for grid in np.meshgrid(special, special))
    expected = np.arctan2(y, np.where(x == 0, np.abs(x), x))  # the sign of a zero x is ignored
    value = np.asarray(numerics.arctan2(jnp.asarray(y), jnp.asarray(x)))
    np.testing.assert_allclose(value, expected, rtol=0, atol=bound(dtype, 3e-7, 1e-15))
    np.testing.assert_array_equal(np.signbit(value), np.signbit(expected))


@pytest.mark.parametrize("dtype", TYPES)
def test_logarithm_and_roots(dtype):
    decades = bound(dtype, 37.0, 300.0)
    x = (10.0 ** np.random.default_rng(1).uniform(-decades, decades, 200_001)).astype(dtype)
    scale = np.maximum(1.0, np.abs(np.log(x.astype(np.longdouble))))
    assert np.max(error(numerics.log, np.log, x) / scale) < bound(dtype, 2e-7, 4e-16)
    np.testing.assert_allclose(numerics.sqrt(jnp.asarray(x)), np.sqrt(x), rtol=np.finfo(dtype).eps)
    a, b = spread(dtype, 1e15), spread(dtype, 1e15)[::-1]
    a, b = (np.where(np.abs(z) < 1e-15, dtype(0.5), z) for z in (a, b))
    length = np.hypot(a.astype(np.longdouble), b.astype(np.longdouble))
    assert np.max(error(numerics.hypot, np.hypot, a, b) / length) < 3 * np.finfo(dtype).eps


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("name", UNARY)
def test_special_values_are_numpy_s(dtype, name):
    x = np.asarray([0.0, -0.0, np.inf, -np.inf, np.nan, 1.0, -1.0], dtype)
    with np.errstate(all="ignore"):
        expected = getattr(np, name)(x)
    value = np.asarray(getattr(numerics, name)(jnp.asarray(x)))
    np.testing.assert_allclose(value, expected, rtol=bound(dtype, 4e-7, 1e-15))
    if name in ("arctan", "sqrt"):
        np.testing.assert_array_equal(np.signbit(value[:2]), np.signbit(expected[:2]))


@pytest.mark.parametrize("dtype", TYPES)
def test_exact_values(dtype):
    zero = jnp.zeros((), dtype)
    assert numerics.cos(zero) == 1.0
    assert numerics.sin(zero + math.pi / 2) == 1.0
    assert numerics.log(zero + 1.0) == 0.0
    assert numerics.arctan2(zero, zero) == 0.0


def test_nan_spreads_through_functions_of_two():
    for function in (numerics.arctan2, numerics.hypot):
        for pair in ((np.nan, 1.0), (1.0, np.nan), (np.nan, 0.0), (0.0, np.nan), (np.nan, np.nan)):
            assert np.isnan(function(*(jnp.asarray(v, dtype=np.float64) for v in pair)))


@pytest.mark.parametrize("name", UNARY)
def test_derivatives_of_functions_of_one(name):
    x = jnp.asarray([0.2, 0.9, 1.3, 4.0, 7.7])
    check_grads(jax.jit(getattr(numerics, name)), (x,), order=2, modes=("fwd", "rev"), rtol=1e-5)
    ours, library = (jax.jit(jax.vmap(jax.grad(jax.grad(jax.grad(getattr(m, name))))))(x) for m in (numerics, jnp))
    np.testing.assert_allclose(ours, library, rtol=1e-10)


@pytest.mark.parametrize("name", ["arctan2", "hypot"])
def test_derivatives_of_functions_of_two(name):
    y, x = jnp.asarray([0.2, -0.9, 1.3, -2.0, 0.0]), jnp.asarray([1.0, -0.5, 0.1, -1.0, 2.0])
    function = jax.jit(getattr(numerics, name))
    check_grads(function, (y, x), order=2, modes=("fwd", "rev"), rtol=1e-5)
    check_grads(function, (y, x[0]), order=1, modes=("fwd", "rev"), rtol=1e-5)  # broadcasting
    ours, library = (jax.jit(jax.vmap(jax.hessian(getattr(m, name), argnums=(0, 1))))(y, x) for m in (numerics, jnp))
    np.testing.assert_allclose(ours, library, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("derivative", [jax.grad, jax.jacfwd, lambda f: jax.jacfwd(jax.grad(f))])
def test_derivatives_at_zero_are_zero(dtype, derivative):
    zeros = jnp.zeros(2, dtype)
    for function in (
        lambda z: numerics.arctan2(z[0], z[1]),
        lambda z: numerics.hypot(z[0], z[1]),
        lambda z: numerics.sqrt(z[0]) + numerics.sqrt(z[1]),
    ):
        result = jax.jit(derivative(function))(zeros)
        assert result.dtype == dtype
        np.testing.assert_array_equal(result, jnp.zeros_like(result))


@pytest.mark.parametrize("name", UNARY)
def test_batches_compilation_and_scalars_agree(name):
    x = jnp.linspace(0.1, 3.0, 12).reshape(3, 4)
    function = getattr(numerics, name)
    expected = function(x)
    assert expected.shape == x.shape
    np.testing.assert_allclose(jax.jit(function)(x), expected, rtol=1e-14)
    np.testing.assert_allclose(jax.vmap(jax.vmap(function))(x), expected, rtol=1e-14)
    np.testing.assert_allclose(function(x[1, 2]), expected[1, 2], rtol=1e-14)


def test_types_follow_jax_numpy():
    single = jnp.ones(3, jnp.float32)
    assert (single * numerics.sin(2.0)).dtype == jnp.float32  # a Python number stays weakly typed
    assert numerics.arctan2(single, 2.0).dtype == jnp.float32
    assert numerics.arctan2(1, single).dtype == jnp.float32
    assert numerics.sqrt(4).dtype == jnp.sqrt(4).dtype
    assert numerics.cos(single.astype(jnp.float16)).dtype == jnp.float16
    np.testing.assert_allclose(numerics.arctan2(1, 1), np.pi / 4, rtol=1e-15)
    with pytest.raises(jax.dtypes.TypePromotionError):
        numerics.arctan2(single, jnp.ones(3, jnp.float64))


def test_without_64_bit_types(float32):
    x = jnp.linspace(0.1, 3.0, 50)
    for name in UNARY:
        value = getattr(numerics, name)(x)
        assert value.dtype == jnp.float32
        np.testing.assert_allclose(value, getattr(np, name)(np.asarray(x)), rtol=2e-6, atol=2e-7)


def test_the_library_s_functions_elsewhere(monkeypatch, request):
    request.addfinalizer(lambda: forget_traces(elementary))
    x = jnp.asarray([0.3, 1.0])
    of_library = lambda: " = sin " in str(jax.make_jaxpr(lambda x: numerics.sin(x) * 1.0)(x))
    assert not of_library()
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    # A process has one backend: traces of the other one are kept.
    forget_traces(elementary)
    assert of_library()
    for name in UNARY:
        np.testing.assert_array_equal(getattr(numerics, name)(x), getattr(jnp, name)(x))
    np.testing.assert_array_equal(jax.grad(numerics.arctan2, (0, 1))(0.0, 0.0), (0.0, 0.0))
    assert numerics.arctan2(jnp.asarray(0.0), jnp.asarray(-0.0)) == 0.0

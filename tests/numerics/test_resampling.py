"""Ancestors are in order, in range, unbiased and never of zero weight; weights survive dead particles."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jaxveh import numerics
from jaxveh.numerics import resampling

pytestmark = pytest.mark.product

TYPES = [jnp.float32, jnp.float64]
SCHEMES = [numerics.systematic, numerics.stratified, numerics.multinomial, numerics.residual]
every_scheme = pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: scheme.__name__)
every_type = pytest.mark.parametrize("dtype", TYPES)
# Statistics do not depend on the precision.
either_type = pytest.mark.parametrize("dtype", [jnp.float64, pytest.param(jnp.float32, marks=pytest.mark.full)])


def counts(scheme, weights, n, repetitions, seed=0):
    """Numbers of children (repetitions, N)."""
    keys = jax.random.split(jax.random.key(seed), repetitions)
    ancestors = jax.jit(jax.vmap(lambda key: scheme(key, weights, n)))(keys)
    flat = np.asarray(ancestors) + weights.size * np.arange(repetitions)[:, None]
    return np.bincount(flat.ravel(), minlength=repetitions * weights.size).reshape(repetitions, weights.size)


@every_scheme
@every_type
@pytest.mark.parametrize(("size", "n"), [(1, None), (17, 900), (1000, 1), (100_000, None)])
def test_ancestors_are_ordered_in_range_and_alive(scheme, dtype, size, n):
    rng = np.random.default_rng(size)
    weights = rng.exponential(size=size) ** 4
    weights[rng.random(size) < 0.4] = 0.0
    weights[-size // 5 :] = 0.0
    weights[0] += 1e-3
    for scale in (1.0, 1e-20, 1e12):
        scaled = jnp.asarray(weights * scale, dtype)
        ancestors = np.asarray(jax.jit(scheme, static_argnums=2)(jax.random.key(3), scaled, n))
        assert ancestors.dtype == np.int32
        assert ancestors.shape == (n or size,)
        assert np.all(np.diff(ancestors) >= 0)
        assert ancestors[0] >= 0 and ancestors[-1] < size
        assert np.all(np.asarray(scaled)[ancestors] > 0)


@every_scheme
@every_type
@pytest.mark.parametrize("where", [0, -1])
def test_a_single_living_particle_has_all_children(scheme, dtype, where):
    weights = np.zeros(100_000)
    weights[where] = 0.3
    ancestors = jax.jit(scheme)(jax.random.key(0), jnp.asarray(weights, dtype))
    np.testing.assert_array_equal(ancestors, np.full(100_000, where % 100_000))


@every_scheme
@either_type
@pytest.mark.parametrize("n", [None, 40])
def test_unbiased(scheme, dtype, n):
    weights = np.asarray([0.05, 0.0, 0.31, 0.02, 0.17, 0.0, 0.003, 0.4, 0.047])
    repetitions = 10_000
    children = counts(scheme, jnp.asarray(weights, dtype), n, repetitions)
    expected = (n or weights.size) * weights / weights.sum()
    deviation = np.maximum(np.std(children, axis=0), 0.02)
    assert np.all(np.abs(children.mean(axis=0) - expected) < 4 * deviation / np.sqrt(repetitions))
    assert np.all(children.sum(axis=1) == (n or weights.size))


@either_type
def test_order_of_variances(dtype):
    weights = jnp.asarray(np.random.default_rng(5).exponential(size=50), dtype)
    value = np.linspace(0.0, 1.0, 50) ** 2  # a smooth function of the particle, whose mean is to be kept
    variance = {scheme.__name__: np.var(counts(scheme, weights, None, 4000) @ value) for scheme in SCHEMES}
    assert variance["systematic"] < 0.5 * variance["residual"]
    assert variance["stratified"] < 0.5 * variance["residual"]
    assert variance["residual"] < 0.8 * variance["multinomial"]
    shares = np.asarray(weights / weights.sum(), float)
    multinomial = 50 * (shares @ value**2 - (shares @ value) ** 2)
    np.testing.assert_allclose(variance["multinomial"], multinomial, rtol=0.1)


@either_type
def test_numbers_of_children_are_bounded_as_each_scheme_promises(dtype):
    weights = jnp.asarray(np.random.default_rng(2).exponential(size=300), dtype)
    expected = 300 * np.asarray(weights, float) / float(weights.sum())
    tolerance = 1e-3
    systematic = counts(numerics.systematic, weights, None, 50)
    assert np.all(np.abs(systematic - expected) < 1 + tolerance)
    stratified = counts(numerics.stratified, weights, None, 50)
    assert np.all(np.abs(stratified - expected) < 2 + tolerance)
    residual = counts(numerics.residual, weights, None, 50)
    assert np.all(residual >= np.floor(expected))


# 1 / 11 and 1 / 20 sum to more than 1 when rounded.
@every_type
@pytest.mark.parametrize("size", [11, 20, pytest.param(99_999, marks=pytest.mark.full)])
def test_residual_keeps_whole_expectations_exactly(dtype, size):
    uniform = jnp.full(size, 1.0 / size, dtype)
    np.testing.assert_array_equal(numerics.residual(jax.random.key(0), uniform), np.arange(size))
    whole = np.random.default_rng(size).integers(0, 4, size)
    ancestors = numerics.residual(jax.random.key(0), jnp.asarray(whole / 7.0, dtype), int(whole.sum()))
    np.testing.assert_array_equal(ancestors, np.repeat(np.arange(size), whole))


def test_systematic_is_the_textbook_s():
    weights = np.random.default_rng(0).exponential(size=200)
    for seed in range(20):
        key = jax.random.key(seed)
        offset = float(numerics.uniform(key))
        expected = np.searchsorted(np.cumsum(weights) / weights.sum(), (np.arange(200) + offset) / 200)
        np.testing.assert_array_equal(numerics.systematic(key, jnp.asarray(weights)), expected)


def test_a_draw_on_a_boundary_belongs_to_the_next_living_particle():
    found = resampling._search(jnp.asarray([0, 3, 3, 5], jnp.int32), jnp.asarray([0, 2, 3, 4], jnp.int32))
    np.testing.assert_array_equal(found, [1, 1, 3, 3])


@every_scheme
def test_batches(scheme):
    weights = np.random.default_rng(1).exponential(size=(3, 40))
    keys = jax.random.split(jax.random.key(0), 3)
    batch = jax.jit(jax.vmap(scheme))(keys, weights)
    for row, key, w in zip(batch, keys, weights, strict=True):
        np.testing.assert_array_equal(row, scheme(key, w))


@pytest.mark.parametrize("size", [1, 8, 9, 64, 65, 5000])
def test_cumulative_sums_are_exact(size):
    values = np.random.default_rng(0).integers(0, 2**20, size)
    for dtype in (jnp.int32, jnp.int64):
        cumulated = jax.jit(resampling._cumulated_by_blocks)(jnp.asarray(values % 1000, dtype))
        assert cumulated.dtype == dtype
        np.testing.assert_array_equal(cumulated, np.cumsum(values % 1000))


@every_scheme
def test_without_64_bit_types(scheme, float32):
    ancestors = scheme(jax.random.key(0), jnp.ones(500))
    assert ancestors.dtype == jnp.int32
    assert np.all(np.diff(ancestors) >= 0)


@every_scheme
def test_bad_weights_are_named(scheme):
    key = jax.random.key(0)
    with pytest.raises(ValueError, match=r"weights have shape \(2, 3\)"):
        scheme(key, jnp.ones((2, 3)))
    with pytest.raises(ValueError, match="int32"):
        scheme(key, jnp.ones(3, jnp.int32))
    with pytest.raises(ValueError, match="n is 0"):
        scheme(key, jnp.ones(3), 0)


@every_type
def test_effective_sample_size(dtype):
    assert numerics.ess(jnp.ones(50, dtype)) == 50.0
    assert numerics.ess(jnp.zeros(50, dtype).at[3].set(0.2)) == 1.0
    assert numerics.ess(jnp.zeros(50, dtype)) == 0.0
    assert np.all(jax.grad(numerics.ess)(jnp.zeros(5, dtype)) == 0.0)
    weights = jnp.asarray([0.1, 0.4, 0.5], dtype)
    np.testing.assert_allclose(numerics.ess(7.0 * weights), 1.0 / 0.42, rtol=1e-6)


@every_type
def test_normalised_weights(dtype):
    log_weights = jnp.asarray([-1000.0, -1001.0, -np.inf, np.nan, -1002.5], dtype)
    weights, log_mean, alive = numerics.normalise(log_weights)
    raw = np.exp([0.0, -1.0, -np.inf, -np.inf, -2.5])
    np.testing.assert_allclose(weights, raw / raw.sum(), rtol=1e-6)
    np.testing.assert_allclose(log_mean, -1000.0 + np.log(raw.mean()), rtol=1e-6)
    assert alive
    assert weights.dtype == log_mean.dtype == dtype
    gradient = jax.grad(lambda values: numerics.normalise(values)[1])(log_weights)
    np.testing.assert_allclose(gradient, weights, rtol=1e-5)
    np.testing.assert_array_equal(gradient[2:4], 0.0)


@every_type
@pytest.mark.parametrize("dead", [-np.inf, np.nan, np.inf])
def test_all_dead(dtype, dead):
    log_weights = jnp.full(4, dead, dtype)
    weights, log_mean, alive = jax.jit(numerics.normalise)(log_weights)
    np.testing.assert_array_equal(weights, 0.25)
    assert log_mean == -np.inf
    assert not alive
    for output in (0, 1):
        gradient = jax.jit(jax.jacrev(lambda values: numerics.normalise(values)[output]))(log_weights)  # noqa: B023
        np.testing.assert_array_equal(gradient, jnp.zeros_like(gradient))


def test_gradients_of_normalised_weights():
    log_weights = jnp.asarray([0.3, -2.0, 1.5, -40.0])
    check_grads(jax.jit(lambda values: numerics.normalise(values)[:2]), (log_weights,), order=2, modes=("fwd", "rev"))

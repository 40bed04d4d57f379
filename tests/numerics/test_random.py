"""Words are jax's, distributions are the stated ones, nothing is infinite, and bad requests are refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from forgetting import forget_traces
from scipy import stats

from jaxveh import numerics
from jaxveh.numerics import elementary, random

pytestmark = pytest.mark.product

TYPES = [jnp.float32, jnp.float64]
COUNT = 400_000
KEY = jax.random.key(20)
DRAWS = {
    "normal": (numerics.normal, stats.norm()),
    "uniform": (numerics.uniform, stats.uniform()),
    "exponential": (numerics.exponential, stats.expon()),
    "cauchy": (numerics.cauchy, stats.cauchy()),
    "student_t_3": (lambda key, shape, dtype: numerics.student_t(key, 3.0, shape, dtype), stats.t(3)),
    "student_t_0.4": (lambda key, shape, dtype: numerics.student_t(key, 0.4, shape, dtype), stats.t(0.4)),
    "student_t_1e6": (lambda key, shape, dtype: numerics.student_t(key, 1e6, shape, dtype), stats.norm()),
}


@pytest.fixture
def fresh_caches():
    """Compiled programs know nothing of what a test replaces, before it or after."""
    forget_traces(random, elementary)
    yield
    forget_traces(random, elementary)


@pytest.mark.parametrize("key", [KEY, jax.random.PRNGKey(20)], ids=["typed", "raw"])
def test_words_are_those_of_jax(key):
    high, low = random._blocks(key, jnp.arange(1001, dtype=jnp.uint32))
    words = np.asarray(jax.random.bits(key, (1001,), jnp.uint64))
    np.testing.assert_array_equal(high, words >> 32)
    np.testing.assert_array_equal(low, words & 0xFFFFFFFF)


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("name", DRAWS)
def test_distribution(name, dtype):
    draw, law = DRAWS[name]
    sample = np.asarray(draw(KEY, (COUNT,), dtype))
    assert sample.dtype == dtype
    assert np.all(np.isfinite(sample))
    assert stats.kstest(sample.astype(float), law.cdf).pvalue > 0.01


@pytest.mark.parametrize("dtype", TYPES)
def test_moments_of_the_normal(dtype):
    z = np.asarray(numerics.normal(KEY, (COUNT,), dtype)).astype(float)
    for power, expected, variance in ((1, 0, 1), (2, 1, 2), (3, 0, 15), (4, 3, 96), (6, 15, 10395 - 225)):
        assert abs(np.mean(z**power) - expected) < 4 * np.sqrt(variance / COUNT)
    pairs = np.stack((z[: COUNT // 2], z[COUNT // 2 :]))  # from the same words
    assert abs(np.corrcoef(pairs)[0, 1]) < 4 / np.sqrt(COUNT / 2)
    assert abs(np.corrcoef(pairs**2)[0, 1]) < 4 / np.sqrt(COUNT / 2)
    assert abs(np.corrcoef(z[1:], z[:-1])[0, 1]) < 4 / np.sqrt(COUNT)
    tail = np.mean(np.abs(z) > 4.0)
    assert abs(tail - 6.334e-5) < 4 * np.sqrt(6.334e-5 / COUNT)


@pytest.mark.parametrize("dtype", TYPES)
def test_extreme_words_give_finite_numbers(dtype, monkeypatch, fresh_caches):
    words = jnp.asarray([0, 1, 2**31 - 1, 2**31, 2**32 - 2, 2**32 - 1], jnp.uint32)
    first, second = (grid.ravel() for grid in jnp.meshgrid(words, words))
    monkeypatch.setattr(random, "_blocks", lambda key, place: (first[place % 36], second[place % 36]))
    sizes = {"normal": 72, "uniform": 36, "exponential": 36, "cauchy": 36, "student_t_3": 36, "student_t_0.4": 36}
    largest = {}
    for name, size in sizes.items():
        sample = np.asarray(DRAWS[name][0](KEY, (size,), dtype))
        assert np.all(np.isfinite(sample)), name
        largest[name] = np.max(np.abs(sample))
    single = dtype == jnp.float32
    uniform = np.asarray(numerics.uniform(KEY, (36,), dtype))
    assert np.min(uniform) > 0 and np.max(uniform) < 1
    assert 6.7 < largest["normal"] < 6.8
    assert 22.8 < largest["exponential"] < 22.9 if single else 45.0 < largest["exponential"] < 45.1
    assert 6.8e8 < largest["cauchy"] < 6.9e8 if single else 2.9e18 < largest["cauchy"] < 3e18


def box_muller(words):
    """Both normal numbers of pairs of words of 32 bits, in float64."""
    first, second = words
    radius = np.sqrt(-2.0 * np.log((first.astype(float) + 0.5) / 2.0**32))
    angle = (second | np.uint32(1)).view(np.int32).astype(float) * (np.pi / 2.0**32)
    return radius * np.sin(angle), radius * np.cos(angle) * np.where(second & 1, -1, 1)


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("count", [1, 2, 3, 1000])
def test_normals_are_box_muller_s_of_jax_s_words(dtype, count):
    half = (count + 1) // 2
    words = np.asarray(jax.random.bits(KEY, (half,), jnp.uint64))
    sines, cosines = box_muller(((words >> 32).astype(np.uint32), words.astype(np.uint32)))
    tolerance = 5e-6 if dtype == jnp.float32 else 1e-14
    np.testing.assert_allclose(numerics.normal(KEY, (count,), dtype), np.append(sines, cosines)[:count], atol=tolerance)
    for field, row in zip(numerics.normals(KEY, 2, (half,), dtype), (sines, cosines), strict=True):
        np.testing.assert_allclose(field, row, atol=tolerance)
    if count == 2:
        np.testing.assert_allclose(numerics.normals(KEY, 2, (), dtype), (sines[0], cosines[0]), atol=tolerance)


def test_words_are_the_same_without_64_bit_types(float32):
    words = random._stored_blocks(KEY, 1001)
    for word, expected in zip(words, random._blocks(KEY, jnp.arange(1001, dtype=jnp.uint32)), strict=True):
        np.testing.assert_array_equal(word, expected)
    with jax.enable_x64(True):
        for word, expected in zip(random._stored_blocks(KEY, 1001), words, strict=True):
            np.testing.assert_array_equal(word, expected)


@pytest.mark.parametrize("dtype", TYPES)
def test_both_forms_of_the_normal_give_the_same_numbers(dtype, monkeypatch, fresh_caches):
    for count in (1, 2, 7, 1000):
        drawn = []
        for hold in (False, True):
            monkeypatch.setattr(random, "barriers_hold", lambda hold=hold: hold)
            forget_traces(random)
            drawn.append((numerics.normal(KEY, count, dtype), numerics.uniform(KEY, count, dtype)))
        np.testing.assert_allclose(drawn[0][0], drawn[1][0], rtol=1e-5 if dtype == jnp.float32 else 1e-13)
        np.testing.assert_array_equal(drawn[0][1], drawn[1][1])


def test_normals_are_independent_fields():
    fields = numerics.normals(KEY, 5, (2, 50_000))
    assert len(fields) == 5
    assert all(field.shape == (2, 50_000) and field.dtype == jnp.float64 for field in fields)
    flat = np.concatenate([np.asarray(field) for field in fields])
    correlation = np.corrcoef(flat) - np.eye(10)
    assert np.max(np.abs(correlation)) < 4.5 / np.sqrt(50_000)
    assert all(stats.kstest(row, "norm").pvalue > 1e-3 for row in flat)
    assert numerics.normals(KEY, 1)[0].shape == ()
    assert numerics.normals(KEY, 0) == ()


@pytest.mark.parametrize("name", DRAWS)
def test_shapes_batches_and_keys(name):
    draw, _ = DRAWS[name]
    assert draw(KEY, (), jnp.float32).shape == ()
    assert draw(KEY, 3, jnp.float32).shape == (3,)
    assert draw(KEY, (2, 0), jnp.float32).shape == (2, 0)
    assert draw(KEY, (2, 5), jnp.float64).shape == (2, 5)
    keys = jax.random.split(KEY, 4)
    one = jax.jit(lambda key: draw(key, (7,), jnp.float64))
    batch = jax.jit(jax.vmap(one))(keys)
    np.testing.assert_allclose(batch, [one(key) for key in keys], rtol=1e-12)
    assert len(np.unique(batch)) == 28


def test_degrees_of_freedom_broadcast_and_differentiate():
    df = jnp.asarray([3.0, 5.0, 50.0])
    assert numerics.student_t(KEY, df, (4, 3)).shape == (4, 3)

    @jax.jit
    @jax.value_and_grad
    def spread(df):
        return jnp.mean(numerics.student_t(KEY, df, (1000,)) ** 2)

    step = 1e-5
    difference = (float(spread(5.0 + step)[0]) - float(spread(5.0 - step)[0])) / (2 * step)
    np.testing.assert_allclose(spread(5.0)[1], difference, rtol=1e-6)
    assert difference < 0


def test_without_64_bit_types(float32):
    sample = numerics.normal(jax.random.key(1), (1001,))
    assert sample.dtype == jnp.float32
    assert 0.9 < np.std(sample) < 1.1
    with pytest.raises(ValueError, match="jax_enable_x64"):
        numerics.normal(jax.random.key(1), (3,), np.float64)


def test_bad_requests_name_the_value():
    with pytest.raises(ValueError, match="float16"):
        numerics.normal(KEY, (3,), jnp.float16)
    with pytest.raises(ValueError, match=r"\(2,\).*vmap"):
        numerics.normal(jax.random.split(KEY, 2), (3,))
    with pytest.raises(ValueError, match=r"rbg.*threefry2x32"):
        numerics.uniform(jax.random.key(0, impl="rbg"), (3,))


def test_the_library_s_normal_elsewhere(monkeypatch, fresh_caches):
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    np.testing.assert_array_equal(numerics.normal(KEY, (5,)), jax.random.normal(KEY, (5,), jnp.float64))
    assert len(numerics.normals(KEY, 3, (2,))) == 3

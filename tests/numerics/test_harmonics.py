"""Sums of harmonics: variance, autocorrelation and band as stated, the same for the same key."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import numerics

KEYS = jax.random.split(jax.random.key(7), 4000)


def signals(draw, x):
    """One signal a key, (keys, points)."""
    return np.asarray(jax.jit(jax.vmap(lambda key: numerics.sum_of_harmonics(x, *draw(key))))(KEYS))


def test_gauss_markov_has_the_exponential_autocorrelation_over_keys():
    length = 50.0
    lags = np.array([0.0, 10.0, 50.0, 150.0])
    drawn = signals(lambda key: numerics.gauss_markov_harmonics(key, length, 2.0, 40), 300.0 + lags)
    np.testing.assert_allclose(np.mean(drawn, axis=0), 0.0, atol=4 / np.sqrt(4000))
    # Four standard errors of a correlation of Gaussian numbers.
    np.testing.assert_allclose(
        np.mean(drawn[:, :1] * drawn, axis=0), np.exp(-lags / length), atol=4 * np.sqrt(2 / 4000)
    )


def test_gauss_markov_has_its_variance_over_a_long_way():
    x = np.arange(0.0, 200_000.0, 4.0)
    draw = lambda key: numerics.sum_of_harmonics(x, *numerics.gauss_markov_harmonics(key, 50.0, 0.1, 60))
    signal = np.asarray(jax.jit(draw)(jax.random.key(1)))
    np.testing.assert_allclose(np.var(signal), 1.0, rtol=0.02)
    np.testing.assert_allclose(np.mean(signal[25:] * signal[:-25]), np.exp(-100 / 50), atol=0.05)


def test_frequencies_stay_in_their_band_one_in_each_share():
    drawn = jax.jit(
        lambda key: (numerics.band_harmonics(key, 0.5, 2.5, 20), numerics.gauss_markov_harmonics(key, 50.0, 0.1, 20))
    )
    (frequencies, phases), (others, _) = jax.tree.map(np.asarray, drawn(jax.random.key(2)))
    np.testing.assert_array_equal(np.floor((frequencies - 0.5) / 0.1), np.arange(20))
    assert (phases >= 0).all() and (phases <= 2 * np.pi).all()
    assert (others > 0).all() and (others < 0.1).all() and (np.diff(others) > 0).all()


def test_same_key_same_signal():
    draw = jax.jit(lambda key: numerics.band_harmonics(key, 0.5, 2.5, 8))
    one, same, other = (draw(jax.random.key(k)) for k in (3, 3, 4))
    np.testing.assert_array_equal(one, same)
    assert not np.allclose(one[1], other[1])


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_shape_and_precision_are_those_of_the_argument(dtype):
    draw = lambda key, x: numerics.sum_of_harmonics(x, *numerics.gauss_markov_harmonics(key, 50.0, 0.1, 8, dtype))
    signal = jax.jit(draw)(jax.random.key(3), np.zeros((3, 2), dtype))
    assert signal.shape == (3, 2) and signal.dtype == dtype

"""Sums of harmonics: variance, autocorrelation and band as stated, the same for the same key."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import numerics

KEYS = jax.random.split(jax.random.key(7), 4000)


def signals(draw, x):
    """One signal a key, (keys, points)."""
    return jax.vmap(lambda key: numerics.sum_of_harmonics(x, *draw(key)))(KEYS)


def test_gauss_markov_has_the_exponential_autocorrelation_over_keys():
    length = 50.0
    lags = jnp.array([0.0, 10.0, 50.0, 150.0])
    drawn = signals(lambda key: numerics.gauss_markov_harmonics(key, length, 2.0, 40), 300.0 + lags)
    np.testing.assert_allclose(jnp.mean(drawn, axis=0), 0.0, atol=4 / np.sqrt(4000))
    # Four standard errors of a correlation of Gaussian numbers.
    np.testing.assert_allclose(
        jnp.mean(drawn[:, :1] * drawn, axis=0), np.exp(-lags / length), atol=4 * np.sqrt(2 / 4000)
    )


def test_gauss_markov_has_its_variance_over_a_long_way():
    frequencies, phases = numerics.gauss_markov_harmonics(jax.random.key(1), 50.0, 0.1, 60)
    x = jnp.arange(0.0, 200_000.0, 4.0)
    signal = numerics.sum_of_harmonics(x, frequencies, phases)
    np.testing.assert_allclose(jnp.var(signal), 1.0, rtol=0.02)
    np.testing.assert_allclose(jnp.mean(signal[25:] * signal[:-25]), np.exp(-100 / 50), atol=0.05)


def test_frequencies_stay_in_their_band_one_in_each_share():
    frequencies, phases = numerics.band_harmonics(jax.random.key(2), 0.5, 2.5, 20)
    np.testing.assert_array_equal(np.floor((frequencies - 0.5) / 0.1), np.arange(20))
    assert (phases >= 0).all() and (phases <= 2 * np.pi).all()
    frequencies, _ = numerics.gauss_markov_harmonics(jax.random.key(2), 50.0, 0.1, 20)
    assert (frequencies > 0).all() and (frequencies < 0.1).all() and (np.diff(frequencies) > 0).all()


def test_same_key_same_signal():
    one, same, other = (numerics.band_harmonics(jax.random.key(k), 0.5, 2.5, 8) for k in (3, 3, 4))
    np.testing.assert_array_equal(one, same)
    assert not np.allclose(one[1], other[1])


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_shape_and_precision_are_those_of_the_argument(dtype):
    drawn = numerics.gauss_markov_harmonics(jax.random.key(3), 50.0, 0.1, 8, dtype)
    signal = numerics.sum_of_harmonics(jnp.zeros((3, 2), dtype), *drawn)
    assert signal.shape == (3, 2) and signal.dtype == dtype

"""The small extended Kalman filter: its update against the information form, trust, and float32."""

from collections import namedtuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh.estimators import sequential


def belief_of(seed, n, dtype=jnp.float64):
    root = jax.random.normal(jax.random.key(seed), (n, n), jnp.float64)
    mean = jax.random.normal(jax.random.key(seed + 100), (n,), jnp.float64)
    return sequential.Belief(mean.astype(dtype), (root @ root.T + 0.1 * jnp.eye(n)).astype(dtype))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("trust", [1.0, 0.3, 0.0])
def test_an_update_is_that_of_a_sensor_whose_noise_is_larger_by_the_trust(seed, trust):
    """inv(P') = inv(P) + h h' / R, of the noise R that the expected variance over the trust leaves."""
    n, noise = 4, 0.2
    belief = belief_of(seed, n)
    h = jax.random.normal(jax.random.key(seed + 200), (n,), jnp.float64)
    expected = h @ belief.covariance @ h + noise
    found = sequential.update(belief, sequential.Innovation(jnp.asarray(0.7), expected, h), jnp.asarray(trust))
    told = 0.0 if trust == 0 else 1.0 / (expected / trust - h @ belief.covariance @ h)
    covariance = np.linalg.inv(np.linalg.inv(belief.covariance) + told * np.outer(h, h))
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.mean, belief.mean + covariance @ h * told * 0.7, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("gate", [0.5, 2.0])
@pytest.mark.parametrize("fall", [1.0, 4.0])
@pytest.mark.parametrize("error", [0.3, -1.0, 5.0, -40.0])
def test_beyond_a_gate_a_correction_stays_the_same_or_falls(gate, fall, error):
    one = namedtuple("One", ["x", "y"])
    belief = belief_of(3, 2)
    variance = belief.covariance[0, 0] + 0.2
    value = belief.mean[0] + error * np.sqrt(variance)
    error_of, noise = (lambda state: value - state.x), jnp.asarray(0.2)
    ask = lambda gate, fall: sequential.correct(belief, sequential.Measurement(error_of, noise, True, gate, fall), one)
    plain, gated = ask(None, 1.0), ask(gate, fall)
    weight = 1.0 if abs(error) < gate else (gate / abs(error)) ** fall
    moved, whole = np.asarray(gated.mean - belief.mean), np.asarray(plain.mean - belief.mean)
    np.testing.assert_allclose(moved, weight * whole, rtol=1e-9)
    loss, most = belief.covariance - gated.covariance, belief.covariance - plain.covariance
    np.testing.assert_allclose(loss, weight * most, rtol=1e-9, atol=1e-12)


def test_in_float32_ten_thousand_measurements_leave_a_covariance():
    """No eigenvalue becomes negative by more than rounding, of slopes in all directions; both forms of the update do that."""
    belief = sequential.Belief(jnp.zeros(3, jnp.float32), jnp.diag(jnp.asarray([1e4, 1e2, 1.0], jnp.float32)))
    slopes = jax.random.normal(jax.random.key(0), (10_000, 3), jnp.float32)

    def step(belief, h):
        found = sequential.Innovation(jnp.zeros((), jnp.float32), h @ belief.covariance @ h + jnp.float32(1e-6), h)
        belief = sequential.update(belief, found, jnp.ones((), jnp.float32))
        return belief, jnp.linalg.eigvalsh(belief.covariance)[0] / jnp.trace(belief.covariance)

    last, least = jax.lax.scan(step, belief, slopes)
    assert last.covariance.dtype == jnp.float32
    assert float(least.min()) > -1e-6

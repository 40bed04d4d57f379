"""Prediction-error fits: the optimum of the likelihood, in one piece or several, with a prior and with a reference."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from nile import NILE

from jaxveh import InputError, Recording, filters, fitting, statespace


class Level(NamedTuple):
    level: jnp.ndarray


class Flow(NamedTuple):
    flow: jnp.ndarray


def stay(system, t0, t1, x, u):
    return x


def see(system, t, x, u):
    return Flow(x.level)


def model(flow=120.0, walk=40.0):
    return statespace.StateSpace(
        transition=stay,
        observation=see,
        process_noise=statespace.Discrete(statespace.Gaussian({"level": walk})),
        measurement_noise=statespace.Gaussian({"flow": flow}),
        prior=statespace.Prior(Level(0.0), {"level": 1e7**0.5}),
    )


def levels(m):
    return (m.measurement_noise.std.flow, m.process_noise.law.std.level)


RECORDING = Recording(np.arange(1871.0, 1971.0), {"flow": NILE})


@pytest.fixture(scope="module")
def fit():
    return fitting.prediction_error(filters.Unscented(), model(), RECORDING, levels, tolerance=1e-8)


def test_finds_the_noise_levels_of_the_nile(fit):
    # Durbin & Koopman (2012), sec. 2.10: 15099 and 1469.1, with a diffuse start.
    found = np.asarray(fit.parameters.array()) ** 2
    np.testing.assert_allclose(found, [15099.0, 1469.1], rtol=0.01)
    assert int(fit.result) == 0


def test_the_optimum_is_the_likelihoods(fit):
    at = lambda z: float(filters.run(filters.Unscented(), model(*np.exp(z)), RECORDING).log_likelihood)
    z = np.asarray(fit.unconstrained)
    best = at(z)
    assert -float(fit.cost) == pytest.approx(best, abs=1e-6)
    for i in (0, 1):
        for step in (-0.05, 0.05):
            moved = z.copy()
            moved[i] += step
            assert at(moved) < best


def test_standard_errors_are_those_of_the_curvature():
    # Expected and observed information agree in a long series; in the Nile's hundred years they need not.
    rng = np.random.default_rng(0)
    level = np.cumsum(40.0 * rng.standard_normal(3000))
    long = Recording(np.arange(3000.0), {"flow": level + 120.0 * rng.standard_normal(3000)})
    fit = fitting.prediction_error(filters.Unscented(), model(), long, levels)
    rows = model().rows(long)
    negative = lambda z: -filters.scan(filters.Unscented(), model(*jnp.exp(z)), rows).log_likelihood
    observed = np.asarray(jax.jit(jax.hessian(negative))(fit.unconstrained))
    spread = np.sqrt(np.diag(np.linalg.inv(observed))) * np.asarray(fit.parameters.array())
    np.testing.assert_allclose(np.asarray(fit.parameters_std.array()), spread, rtol=0.1)
    assert np.all(
        np.abs(np.asarray(fit.parameters.array()) - [120.0, 40.0]) < 3 * np.asarray(fit.parameters_std.array())
    )


def test_a_tight_prior_holds_and_centre_moves_it():
    tight = {"flow": 0.01, "level": 0.01}
    held = fitting.prediction_error(
        filters.Unscented(), model(100.0, 50.0), RECORDING, levels, prior=tight, tolerance=1e-8
    )
    np.testing.assert_allclose(np.asarray(held.parameters.array()), [100.0, 50.0], rtol=0.01)
    elsewhere = fitting.prediction_error(
        filters.Unscented(),
        model(100.0, 50.0),
        RECORDING,
        levels,
        prior=tight,
        centre=model(120.0, 40.0),
        tolerance=1e-8,
    )
    np.testing.assert_allclose(np.asarray(elsewhere.parameters.array()), [120.0, 40.0], rtol=0.01)


def test_rows_of_the_warm_up_do_not_count():
    wild = NILE.copy()
    wild[:5] += np.array([3000.0, -3000.0, 3000.0, -3000.0, 3000.0])
    recording = Recording(np.arange(1871.0, 1971.0), {"flow": wild})
    with_them = fitting.prediction_error(filters.Unscented(), model(), recording, levels, tolerance=1e-8)
    without = fitting.prediction_error(filters.Unscented(), model(), recording, levels, warm_up=30)
    assert float(with_them.parameters.array()[0]) > 200.0
    assert 90.0 < float(without.parameters.array()[0]) < 160.0


def test_a_reference_pulls_the_fit(fit):
    # Asked to report a level that follows every measurement, the fit must trust the sensor more.
    target = fitting.Target("level", (NILE,), weight=5.0, bend=1e6)
    pulled = fitting.prediction_error(filters.Unscented(), model(), RECORDING, levels, target=target)
    gain = lambda fit: float(fit.parameters.array()[1] / fit.parameters.array()[0])
    assert gain(pulled) > 1.5 * gain(fit)


def test_bad_input_is_named():
    short = RECORDING.rows(slice(0, 50))
    with pytest.raises(InputError, match="same number of rows"):
        fitting.prediction_error(filters.Unscented(), model(), [RECORDING, short], levels)
    with pytest.raises(InputError, match="whitened"):
        fitting.prediction_error(filters.ParticleFilter(10), model(), RECORDING, levels)
    target = fitting.Target("level", (NILE, NILE), 5.0, 1.0)
    with pytest.raises(InputError, match="target"):
        fitting.prediction_error(filters.Unscented(), model(), RECORDING, levels, target=target)

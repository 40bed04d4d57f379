"""Particle filters on nonlinear models against a dense grid, and NEES of Gaussian filters."""

import functools

import equinox as eqx
import jax
import numpy as np
import pytest
from filter_systems import linear_model
from nonlinear_systems import as_recording, grid_filter, growth, growth_like_volatility, simulate, volatility

from jaxveh import Recording, diagnostics, filters, numerics
from jaxveh import statespace as ss

ROWS, SEEDS, N = 40, 30, 2000
MODELS = {"volatility": (volatility, -9.0, 9.0), "growth": (growth, -45.0, 45.0)}
PARTICLE = {
    "bootstrap": filters.ParticleFilter(N),
    "auxiliary": filters.AuxiliaryParticleFilter(N),
    "multinomial, by ESS": filters.ParticleFilter(N, numerics.multinomial, threshold=0.5),
    "guided": filters.Guided(N),
    "guided, unscented, auxiliary": filters.Guided(N, "unscented", auxiliary=True),
}


@functools.cache
def answer(name):
    make, low, high = MODELS[name]
    model = make()
    _, measured = simulate(model, jax.random.key(3), ROWS)
    return model, measured, *grid_filter(model, measured, low, high)


@eqx.filter_jit
def runs(filter_, model, rows, keys):
    of = lambda key: filters.scan(filter_, model, rows, key)
    found = jax.vmap(of)(keys)
    return found.log_likelihood, found.mean.x, found.result


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", PARTICLE)
def test_likelihood_and_means_are_the_grid_s_within_their_scatter(name, model):
    if "guided" in name and model == "volatility":
        pytest.skip("its measurement noise has no covariance")
    if name == "guided, unscented, auxiliary" and model == "growth":
        pytest.skip("what is guided from one peak misses the other: weights without useful variance")
    system, measured, total, means = answer(model)
    if model == "growth" and isinstance(PARTICLE[name], filters.ParticleFilter):
        system = growth_like_volatility()
    rows = system.rows(as_recording(measured))
    keys = jax.random.split(jax.random.key(5), SEEDS)
    logs, found, results = map(np.asarray, runs(PARTICLE[name], system, rows, keys))
    assert not results.any()
    # The likelihood itself is unbiased, its logarithm half a variance low.
    spread = np.std(logs)
    assert abs(np.mean(logs) + 0.5 * spread**2 - total) < 4.0 * spread / np.sqrt(SEEDS) + 1e-3
    scatter = np.std(found, axis=0) / np.sqrt(SEEDS)
    assert (np.abs(np.mean(found, axis=0) - means) < 5.0 * scatter + 2e-2).all()


GAUSSIAN = {
    "Kalman": filters.Kalman(),
    "Unscented, square root": filters.Unscented(form=filters.SquareRoot()),
    "Cubature": filters.Cubature(),
    "Iterated": filters.Iterated(filters.Cubature()),
    "federated": filters.Federated(filters.Cubature(), (("y0",), ("y1",))),
}


@pytest.mark.parametrize("name", GAUSSIAN)
def test_nees_is_in_its_band_where_the_model_is_linear(name):
    model = linear_model(2, 2, seed=3)
    model = eqx.tree_at(lambda m: m.measurement_noise, model, ss.Gaussian({"y0": 0.4, "y1": 0.3}))
    schedule = Recording(0.1 * np.arange(15), {"force": np.full(15, 0.3)})
    runs = filters.monte_carlo(GAUSSIAN[name], model, schedule, jax.random.key(2), 400)
    found = diagnostics.nees(runs.error, runs.covariance)
    assert found.row_low[-1] < found.by_row[-1] < found.row_high[-1]
    assert found.consistent

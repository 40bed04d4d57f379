"""Right filters pass every test of calibration, wrong ones are found out; likelihood scatter, bounds, kept beliefs."""

import functools
from collections import namedtuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import kalman, linear_model, linear_recording
from nonlinear_systems import growth, growth_like_volatility, volatility

from jaxveh import FilterError, InputError, Recording, diagnostics, filters
from jaxveh import statespace as ss
from jaxveh.filters.calibration.batches import in_batches
from jaxveh.filters.marginalised import MarginalisedBelief
from jaxveh.filters.wrappers.interacting import MixtureBelief

X = namedtuple("X", "a b")

ROWS, RUNS = 40, 120
SURE = 0.999


def linear():
    return linear_model(2, 2, seed=5)


def with_process_noise(factor):
    """The linear model with `factor` times the covariance of its process noise."""
    return eqx.tree_at(lambda m: m.process_noise.law.matrix, linear(), replace_fn=lambda matrix: factor * matrix)


def with_measurement_noise(factor):
    return eqx.tree_at(lambda m: m.measurement_noise.matrix, linear(), replace_fn=lambda matrix: factor * matrix)


MODELS = {
    "right": linear,
    "R x 4": functools.partial(with_measurement_noise, 4.0),
    "Q x 0.1": functools.partial(with_process_noise, 0.1),
}


@functools.cache
def schedule():
    return linear_recording(linear(), ROWS)


@functools.cache
def runs(name):
    return filters.monte_carlo(filters.Kalman(), MODELS[name](), schedule(), jax.random.key(1), RUNS, truth=linear())


def test_the_right_filter_passes():
    found = runs("right")
    assert found.error.shape == (RUNS, ROWS, 2)
    assert diagnostics.nis(found, SURE).consistent
    assert all(one.consistent for one in diagnostics.nis_by_channel(found, SURE).values())
    nees = diagnostics.nees(found.error, found.covariance, SURE)
    assert nees.consistent
    assert nees.share_inside > 0.95
    assert diagnostics.whiteness(found, lags=6, confidence=SURE).white


@pytest.mark.parametrize(("name", "verdict"), [("R x 4", "too cautious"), ("Q x 0.1", "too confident")])
def test_wrong_noises_are_found_out_by_every_test(name, verdict):
    found = runs(name)
    assert diagnostics.nis(found, SURE).verdict == verdict
    assert all(one.verdict == verdict for one in diagnostics.nis_by_channel(found, SURE).values())
    assert diagnostics.nees(found.error, found.covariance, SURE).verdict == verdict
    assert not diagnostics.whiteness(found, lags=6, confidence=SURE).white


@functools.cache
def bound():
    return ss.posterior_cramer_rao(linear(), schedule(), jax.random.key(0), runs=2)


def test_the_right_filter_is_at_the_bound_and_no_other():
    found = filters.rmse_beside_bound(runs("right"), bound())
    squares = runs("right").error ** 2
    np.testing.assert_allclose(found.rmse.x0, np.sqrt(squares[:, :, 0].mean(axis=0)))
    np.testing.assert_array_equal(found.bound.x0, bound().std.x0)
    # For Gaussian errors: a share 1 / sqrt(2 R) of the root mean square error.
    np.testing.assert_allclose(np.mean(found.standard_error.x1 / found.rmse.x1), (2 * RUNS) ** -0.5, rtol=0.1)
    for right, wrong in zip(found.table(), filters.rmse_beside_bound(runs("Q x 0.1"), bound()).table(), strict=True):
        name, rmse, line, share = right
        assert name == wrong[0]
        assert share == line / rmse
        assert 0.95 < share < 1.05
        assert wrong[3] < share - 0.02


def test_a_bound_of_something_else_is_refused():
    other = bound()._replace(time=schedule().time[:5])
    with pytest.raises(InputError, match="the times of its 5 rows differ from those of the runs' 40 rows"):
        filters.rmse_beside_bound(runs("right"), other)
    with pytest.raises(InputError, match="bound: its states are y, the runs' x0, x1"):
        filters.rmse_beside_bound(runs("right"), other._replace(std=ss.model.record("X", {"y": np.zeros(5)})))


def test_batches_make_the_same_runs_and_report():
    said = []
    draw = lambda keys: {"x": jax.vmap(jax.random.normal)(keys)}
    report = lambda done, total, stage: said.append((done, total, stage))
    found = in_batches(draw, jax.random.key(1), 5, 2, report, "runs")
    assert said == [(n, 5, "runs") for n in (0, 2, 4, 5)]
    np.testing.assert_array_equal(found["x"], draw(jax.random.split(jax.random.key(1), 5))["x"])
    np.testing.assert_array_equal(found["x"], in_batches(draw, jax.random.key(1), 5, None, report, "runs")["x"])


SHORT = Recording(np.arange(12.0), {})
CHECKED = {
    "particles": (filters.ParticleFilter(200), volatility, True),
    "particles, two peaks": (filters.ParticleFilter(200), growth_like_volatility, True),
    "auxiliary": (filters.AuxiliaryParticleFilter(200), volatility, True),
    "guided, two peaks": (filters.Guided(200), growth, True),
    "Gaussian where beliefs have two peaks": (filters.Unscented(), growth, False),
}


@pytest.mark.parametrize("name", CHECKED)
def test_simulation_based_calibration_of_nonlinear_models(name):
    filter_, model, right = CHECKED[name]
    found = filters.simulation_based_calibration(filter_, model(), SHORT, jax.random.key(8), runs=800)
    counts = found.histogram().x
    assert counts.sum() == 800
    expected = np.sum((counts - 80.0) ** 2) / 80
    assert (found.p_values().x > 0.01) == (expected < 21.666)
    assert found.is_calibrated() is right


@pytest.mark.thorough
def test_simulation_based_calibration_of_a_linear_model():
    rank = functools.partial(
        filters.simulation_based_calibration,
        filters.Kalman(),
        schedule=schedule(),
        key=jax.random.key(2),
        runs=600,
        batch=300,
    )
    assert rank(linear()).is_calibrated()
    narrow = rank(with_process_noise(0.1), truth=linear())
    assert not narrow.is_calibrated()
    # Heaps at both ends.
    assert narrow.histogram().x0[[0, -1]].min() > 75


def test_draws_of_beliefs_have_their_moments():
    belief = lambda mean, factor: filters.GaussianBelief(
        jnp.asarray(mean), jnp.asarray(factor), None, jnp.asarray(0.0), None, jnp.int32(0), X, None
    )
    one, two = belief([1.0, -2.0], [[1.0, 0.0], [0.5, 0.2]]), belief([4.0, 0.0], [[0.3, 0.0], [0.0, 2.0]])
    both = MixtureBelief((one, two), jnp.asarray([0.25, 0.75]))
    members = X(jnp.asarray([1.0, 2.0, 4.0]), jnp.asarray([3.0, 2.0, 0.0]))
    weighted = filters.ParticleBelief(members, jnp.asarray([0.2, 0.3, 0.5]), None, None, None, None, None)
    ensemble = filters.EnsembleBelief(members, None, None, None, None)
    within = jnp.asarray([[[0.5]], [[2.0]], [[0.1]]])
    marginalised = MarginalisedBelief(members, within, jnp.asarray([0.2, 0.3, 0.5]), *[None] * 5, linear=("b",))
    moments = eqx.filter_jit(lambda belief, key: (belief.sample(key, 20_000), belief.mean, belief.covariance))
    for given, correction in ((one, 1), (both, 1), (weighted, 1), (ensemble, 2 / 3), (marginalised, 1)):
        drawn, mean, covariance = moments(given, jax.random.key(3))
        drawn, covariance = np.stack(drawn), correction * np.asarray(covariance)
        np.testing.assert_allclose(drawn.mean(axis=1), mean, atol=0.05)
        np.testing.assert_allclose(np.cov(drawn), covariance, atol=0.04 * np.max(covariance))


@pytest.mark.thorough
def test_log_likelihood_scatter_halves_with_four_times_the_particles():
    model = volatility()
    recording = ss.draw(model, Recording(np.arange(40.0), {}), jax.random.key(3)).recording
    of = lambda n: filters.log_likelihood_spread(filters.ParticleFilter(n), model, recording, jax.random.key(4), 200)
    few, many = of(100), of(400)
    np.testing.assert_allclose(few.std / many.std, 2.0, rtol=0.25)
    np.testing.assert_allclose(many.standard_error, many.std / np.sqrt(398))
    logs = many.log_likelihoods
    np.testing.assert_allclose(many.log_mean_likelihood, np.log(np.mean(np.exp(logs - logs[0]))) + logs[0])
    np.testing.assert_allclose(few.log_mean_likelihood, many.log_mean_likelihood, atol=4 * few.std / np.sqrt(200))
    assert many.particles_for(400, std=many.std / 2) == 1600
    assert many._replace(std=2.4).particles_for(400) == 1600
    assert few._replace(std=1.2).good_for_pmmh
    assert [few._replace(std=std).good_for_pmmh for std in (0.5, 1.01, 1.69, 1.71)] == [False, True, True, False]


def test_what_is_kept_of_every_row():
    model, recording = linear(), schedule()
    estimate, covariance = filters.run_and_keep(filters.Kalman(), model, recording, lambda belief: belief.covariance)
    np.testing.assert_allclose(covariance, kalman(model, recording)["covariance"], rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(estimate.time, recording.time)
    bootstrap = filters.ParticleFilter(50)
    key, keep = jax.random.key(0), lambda belief: belief.ancestors
    estimate, ancestors = filters.run_and_keep(bootstrap, model, recording, keep, key=key)
    found = diagnostics.ancestry(ancestors)
    assert found.surviving[0] < 10 < found.parents.min() + 10
    assert found.surviving[-1] == 50
    health = diagnostics.particle_health(estimate)
    assert health.particles == 50
    assert 0 < health.lowest < health.median <= 1
    nis = diagnostics.nis_by_channel(estimate)
    assert set(nis) == {"y0", "y1"}


def test_mistakes_are_named():
    model, key = linear(), jax.random.key(0)
    with pytest.raises(InputError, match="monte_carlo: FixedLag has no covariance of the state"):
        filters.monte_carlo(filters.FixedLag(filters.Kalman(), 2), model, schedule(), key, runs=2)
    with pytest.raises(InputError, match=r"truth: its states are x0, x1, x2, the filter's model's x0, x1"):
        filters.monte_carlo(filters.Kalman(), model, schedule(), key, truth=linear_model(3, 2))
    with pytest.raises(InputError, match=r"runs = 0: must be a whole number of at least 1"):
        filters.monte_carlo(filters.Kalman(), model, schedule(), key, runs=0)
    with pytest.raises(InputError, match=r"batch = 0: must be a whole number of at least 1"):
        filters.monte_carlo(filters.Kalman(), model, schedule(), key, batch=0)
    with pytest.raises(InputError, match=r"draws = 0: must be a whole number of at least 1"):
        filters.simulation_based_calibration(filters.Kalman(), model, schedule(), key, draws=0)
    with pytest.raises(InputError, match=r"unknown name\(s\) force"):
        filters.simulation_based_calibration(filters.Kalman(), model, SHORT, key)
    found = filters.CalibrationRanks(ss.model.record("X", {"x": np.arange(100)}), 99)
    with pytest.raises(
        InputError, match=r"bins = 7: must be a whole number of at least 2 that divides draws \+ 1 = 100"
    ):
        found.histogram(7)
    assert found.histogram(np.int64(10)).x.tolist() == [10] * 10
    with pytest.raises(InputError, match=r"bins = 50: must be at most 20"):
        found.p_values(50)
    given = linear_recording(model, 4)
    with pytest.raises(InputError, match="Kalman has the same log-likelihood for every key"):
        filters.log_likelihood_spread(filters.Kalman(), model, given, key, 3)
    lost = eqx.tree_at(lambda m: m.system["A"], model, replace_fn=lambda A: 1e300 * jnp.ones_like(A))
    with pytest.raises(FilterError, match=r"Kalman failed in 120 of 120 runs, first in run 0: .*throw=False"):
        filters.monte_carlo(filters.Kalman(), lost, schedule(), key, RUNS, truth=model)

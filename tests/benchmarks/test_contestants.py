"""All contestants solve the same problem: a fast wrong answer is no contestant."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks import ours
from benchmarks.peers import numpy_filters
from benchmarks.problems import single_track, speed_and_mass
from jaxveh import filters


@pytest.fixture(scope="module", autouse=True)
def double_precision():
    with jax.enable_x64(True):
        yield


@pytest.fixture(scope="module")
def speed():
    return speed_and_mass(rows=200, runs=1, seed=5)


@pytest.fixture(scope="module")
def expected_speed(speed):
    return numpy_filters.unscented(speed)()


def assert_same_unscented(problem, expected, mean, log_likelihood):
    assert np.abs((np.asarray(mean) - expected.mean[:, :, 0]) / problem.prior_std).max() < 1e-7
    assert float(log_likelihood) == pytest.approx(float(expected.log_likelihood[0]), abs=1e-6)


def test_our_unscented_filter_equals_numpy(speed, expected_speed):
    done = filters.run(filters.Unscented(), ours.speed_model(speed, np.float64), ours.speed_recording(speed))
    assert_same_unscented(speed, expected_speed, np.stack(done.mean, axis=-1), done.log_likelihood)


@pytest.mark.peers
@pytest.mark.parametrize("name", ["dynamax", "smcx"])
def test_jax_peers_unscented_equals_numpy(name, speed, expected_speed):
    pytest.importorskip(name)
    if name == "dynamax":
        from benchmarks.peers import dynamax_filters as peer
    else:
        from benchmarks.peers import smcx_filters as peer
    mean, std, log_likelihood = peer.unscented(speed, np.float64)(jnp.asarray(speed.speed[:, 0]))
    assert_same_unscented(speed, expected_speed, mean, log_likelihood)
    assert std.shape == mean.shape


@pytest.mark.peers
def test_filterpy_equals_numpy(speed, expected_speed):
    pytest.importorskip("filterpy")
    from benchmarks.peers import filterpy_filters

    done = filterpy_filters.unscented(speed)()
    assert_same_unscented(speed, expected_speed, done.mean[:, :, 0], done.log_likelihood[0])


@pytest.fixture(scope="module")
def drive():
    return single_track(rows=80, seed=1)


@pytest.fixture(scope="module")
def numpy_logs(drive):
    run = numpy_filters.particle_filter(drive, 2000, auxiliary=False)
    return [float(run(seed).log_likelihood) for seed in range(6)]


def assert_same_likelihood(logs, expected):
    """Means of log-likelihood estimates, within their errors and the bias of half their variance."""
    logs, expected = np.array(logs), np.array(expected)
    error = np.sqrt(logs.var(ddof=1) / len(logs) + expected.var(ddof=1) / len(expected))
    assert abs(logs.mean() - expected.mean()) < 4.5 * error + 0.5 * logs.var(ddof=1)


def test_our_particle_filter_agrees_with_numpy(drive, numpy_logs):
    # One filter is enough: it is the model that is written twice.
    model, recording = ours.single_track_model(drive, np.float64), ours.single_track_recording(drive)
    filter_ = filters.ParticleFilter(2000)
    logs = [filters.run(filter_, model, recording, key=jax.random.key(s)).log_likelihood for s in range(6)]
    assert_same_likelihood(logs, numpy_logs)


def test_the_librarys_vehicle_is_the_same_model(drive):
    own, library = ours.single_track_model(drive, np.float64), ours.vehicle_model(drive, np.float64)
    order = [library.states.index(name) for name in own.states]
    draws = np.random.default_rng(0).standard_normal((11, 50))
    x = drive.prior_mean[:, None] + 5 * drive.prior_std[:, None] * draws
    told = library.rows(ours.single_track_recording(drive)).u
    ahead = jax.jit(lambda x, u: (library.transition(0.0, drive.step, x, u), library.observation(0.0, x, u)))
    for k in (0, 40):
        u = type(told)(*[np.asarray(leaf)[k] for leaf in told])
        placed = type(library.prior.mean)(*[x[list(own.states).index(name)] for name in library.states])
        moved, seen = ahead(placed, u)
        moved = np.stack(moved)[order]
        np.testing.assert_allclose(moved, drive.transition(x, drive.steer[k], drive.speed[k]), rtol=1e-9, atol=1e-12)
        front, rear = drive.axle_forces(x, drive.steer[k], drive.speed[k])
        np.testing.assert_allclose(seen.a_y, (front + rear) / drive.mass, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(np.stack(library.prior.mean)[order], drive.prior_mean, rtol=1e-12)
    for law, expected in (
        (library.prior.law, drive.prior_std),
        (library.process_noise.over(drive.step), drive.process_std),
    ):
        std = dict(zip(law.names, np.sqrt(np.diagonal(law.covariance())), strict=True))
        np.testing.assert_allclose([std[name] for name in own.states], expected, rtol=1e-9)


@pytest.mark.peers
@pytest.mark.parametrize("auxiliary", [False, True], ids=["pf", "apf"])
@pytest.mark.parametrize("name", ["particles", "smcx"])
def test_peers_particle_filters_agree_with_numpy(name, auxiliary, drive, numpy_logs):
    pytest.importorskip(name)
    if name == "particles":
        from benchmarks.peers import particles_filters

        run = particles_filters.particle_filter(drive, 2000, auxiliary=auxiliary)
        results = [run(seed) for seed in range(6)]
    else:
        from benchmarks.peers import smcx_filters

        run = smcx_filters.particle_filter(drive, 2000, auxiliary=auxiliary, dtype=np.float64)
        with jax.numpy_dtype_promotion("standard"):  # the library mixes types
            results = [run(jax.random.key(seed)) for seed in range(6)]
    assert_same_likelihood([float(log_likelihood) for _, log_likelihood in results], numpy_logs)
    assert np.asarray(results[0][0]).shape == (drive.rows, 11)

"""Smoothers and calibrations on a level that walks: the smallest models, beside their equations in NumPy.

Larger models, every form and every filter are in `test_smoothers.py` and `test_calibration.py`, of which little runs by default.
"""

import functools
import json
from collections import namedtuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import Level, see_level

from jaxveh import InputError, Recording, filters
from jaxveh import statespace as ss

TIME = np.array([0.0, 1.0, 2.5, 3.0, 4.0])
FLOW = np.array([1.5, -0.8, np.nan, 4.0, 3.2])
Q, R, P0 = 0.5, 4.0, 2.0
KEY = jax.random.key(3)
Two = namedtuple("Two", "a b")


def decay(system, t0, t1, x, u):
    return Level((1.0 - 0.2 * (t1 - t0)) * x.level)


def level(mean=0.7, noise=ss.Continuous(ss.Gaussian({"level": Q**0.5}))):
    return ss.StateSpace(
        transition=decay,
        observation=see_level,
        process_noise=noise,
        measurement_noise=ss.Gaussian({"flow": R**0.5}),
        prior=ss.Prior(Level(mean), {"level": P0**0.5}),
    )


MODEL = level()
STILL = level(noise=None)
RECORDING = Recording(TIME, {"flow": FLOW})


def filtered(rows=5):
    """Means, variances, log-likelihoods and squared innovations of the Kalman filter."""
    m, P, found = 0.7, P0, []
    for k, y in enumerate(FLOW[:rows]):
        if k:
            dt = TIME[k] - TIME[k - 1]
            m, P = (1.0 - 0.2 * dt) * m, (1.0 - 0.2 * dt) ** 2 * P + Q * dt
        S, logs, nis = P + R, 0.0, 0.0
        if np.isfinite(y):
            nis = (y - m) ** 2 / S
            logs = -0.5 * (nis + np.log(2.0 * np.pi * S))
            m, P = m + P / S * (y - m), P - P**2 / S
        found.append((m, P, logs, nis))
    return np.array(found).T


def smoothed(rows=5):
    """Rauch, Tung & Striebel of the first `rows`: means and variances."""
    m, P, *_ = filtered(rows)
    for k in range(rows - 2, -1, -1):
        dt = TIME[k + 1] - TIME[k]
        F = 1.0 - 0.2 * dt
        ahead = F**2 * P[k] + Q * dt
        G = P[k] * F / ahead
        m[k], P[k] = m[k] + G * (m[k + 1] - F * m[k]), P[k] + G**2 * (P[k + 1] - ahead)
    return m, P


def test_the_parallel_smoother_is_the_smoother_and_its_filter_the_filter():
    found = filters.smooth_parallel(filters.Kalman(), MODEL, RECORDING)
    m, P = smoothed()
    np.testing.assert_allclose(found.mean.level, m, rtol=1e-9)
    np.testing.assert_allclose(found.std.level, np.sqrt(P), rtol=1e-9)
    m, P, logs, nis = filtered()
    np.testing.assert_allclose(found.filtered.mean.level, m, rtol=1e-9)
    np.testing.assert_allclose(found.filtered.std.level, np.sqrt(P), rtol=1e-9)
    np.testing.assert_allclose(found.filtered.info.log_likelihood, logs, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.filtered.info.nis, nis, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.filtered.log_likelihood, np.sum(logs), rtol=1e-12)
    np.testing.assert_array_equal(found.time, TIME)
    with pytest.raises(InputError, match=r"must be Kalman\(\) or Iterated"):
        filters.smooth_parallel(filters.Kalman(filters.SquareRoot()), MODEL, RECORDING)


def gauss_newton(passes):
    """The path (5,) after so many linearisations of `level + 0.3 level^2`, the first at the prior, by least squares."""
    there, step = np.isfinite(FLOW), np.diff(TIME)
    path = np.full(5, 0.7)
    for _ in range(passes):
        slope, seen = 1.0 + 0.6 * path, path + 0.3 * path**2
        rows, right = [np.eye(5)[0] / P0**0.5], [0.7 / P0**0.5]
        for k in range(4):
            rows.append((np.eye(5)[k + 1] - (1.0 - 0.2 * step[k]) * np.eye(5)[k]) / (Q * step[k]) ** 0.5)
            right.append(0.0)
        for k in np.flatnonzero(there):
            rows.append(slope[k] * np.eye(5)[k] / R**0.5)
            right.append((FLOW[k] - seen[k] + slope[k] * path[k]) / R**0.5)
        path = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0]
    return path


def test_a_parallel_smoother_linearises_as_often_as_it_is_told():
    see = lambda system, t, x, u: see_level(system, t, Level(x.level + 0.3 * x.level**2), u)
    model = ss.StateSpace(
        transition=decay, observation=see, process_noise=MODEL.process_noise, measurement_noise=MODEL.measurement_noise,
        prior=MODEL.prior,
    )  # fmt: skip
    for passes in (1, 3):
        found = filters.smooth_parallel(filters.Iterated(filters.Extended(), passes), model, RECORDING)
        np.testing.assert_allclose(found.mean.level, gauss_newton(passes), rtol=1e-9)


@pytest.mark.parametrize("form", [filters.Covariance, filters.SquareRoot])
def test_a_fixed_lag_is_the_smoother_of_the_rows_so_far(form):
    found = filters.smooth(filters.Kalman(form()), MODEL, RECORDING, lag=2)
    for k in range(5):
        m, P = smoothed(min(k + 3, 5))
        np.testing.assert_allclose(found.mean.level[k], m[k], rtol=1e-9)
        np.testing.assert_allclose(found.std.level[k], np.sqrt(P[k]), rtol=1e-9)


@functools.cache
def kept():
    """Particles (5, N), ancestors (5, N) and the last weights (N,) of a filter."""
    keep = lambda belief: (belief.particles.level, belief.ancestors, belief.weights)
    _, found = filters.run_and_keep(PARTICLES, STILL, RECORDING, keep, key=KEY)
    return [np.asarray(leaf) for leaf in found]


PARTICLES = filters.ParticleFilter(300)


def weighted(values, weights):
    mean = weights @ values
    return mean, np.sqrt(weights @ (values - mean) ** 2)


def lines(ancestors, first, last):
    """The particles of row `first` from which those of row `last` descend."""
    at = np.arange(ancestors.shape[1])
    for k in range(last, first, -1):
        at = ancestors[k][at]
    return at


def test_a_genealogy_is_the_paths_of_the_last_particles():
    """The default without process noise, where paths cannot be drawn backwards."""
    particles, ancestors, weights = kept()
    found = filters.smooth(PARTICLES, STILL, RECORDING, key=KEY)
    for k in range(5):
        path = particles[k][lines(ancestors, k, 4)]
        np.testing.assert_array_equal(found.trajectories.level[k], path)
        np.testing.assert_allclose((found.mean.level[k], found.std.level[k]), weighted(path, weights[-1]), rtol=1e-9)
    np.testing.assert_array_equal(found.weights, weights[-1])
    # Without noise a path is its start, faded.
    steps = np.cumprod(1.0 - 0.2 * np.diff(TIME))
    np.testing.assert_allclose(found.trajectories.level[1:], np.outer(steps, found.trajectories.level[0]), rtol=1e-9)


def test_a_fixed_lag_of_particles_is_the_genealogy_of_the_rows_so_far():
    particles, ancestors, weights = kept()
    found = filters.smooth(PARTICLES, STILL, RECORDING, key=KEY, lag=2)
    for k in range(5):
        last = min(k + 2, 4)
        path = particles[k][lines(ancestors, k, last)]
        shown = found.mean.level[k], found.std.level[k]
        np.testing.assert_allclose(shown, weighted(path, weights[last]), rtol=1e-9, atol=1e-9)


def test_paths_drawn_backwards_have_the_smoother_s_moments_and_steps():
    """The default with process noise: 200 paths, so that a mean has a fourteenth of the spread as its standard error."""
    found = filters.smooth(filters.ParticleFilter(2000), MODEL, RECORDING, key=KEY)
    m, P = smoothed()
    np.testing.assert_array_less(np.abs(found.mean.level - m) / np.sqrt(P), 4 * 200**-0.5)
    np.testing.assert_allclose(found.std.level, np.sqrt(P), rtol=4 * 400**-0.5)
    paths = np.asarray(found.trajectories.level)
    assert paths.shape == (5, 200)
    np.testing.assert_allclose(found.weights, 1 / 200)
    # What the state at one instant tells of that at the next: their covariance is G P, with the later one's smoothed P.
    before, after = (paths[k] - paths[k].mean() for k in (2, 3))
    F, ahead = 1.0 - 0.2 * 0.5, filtered()[1][2]
    G = ahead * F / (F**2 * ahead + Q * 0.5)
    correlation = G * (P[3] / P[2]) ** 0.5
    np.testing.assert_allclose(np.corrcoef(before, after)[0, 1], correlation, atol=4 * (1 - correlation**2) / 200**0.5)


def test_log_likelihoods_of_several_keys_are_those_of_runs_and_their_numbers_are_numpy_s():
    filter_ = filters.ParticleFilter(20)
    found = filters.log_likelihood_spread(filter_, MODEL, RECORDING, KEY, 4)
    logs = [filters.run(filter_, MODEL, RECORDING, key=key).log_likelihood for key in jax.random.split(KEY, 4)]
    np.testing.assert_allclose(found.log_likelihoods, logs, rtol=1e-12)
    spread = np.std(logs, ddof=1)
    expected = (np.mean(logs), spread, spread / np.sqrt(2 * 3), np.log(np.mean(np.exp(logs))))
    np.testing.assert_allclose(found[1:], expected, rtol=1e-12)


def spread_of(std):
    return filters.LogLikelihoodSpread(np.zeros(3), 0.0, std, 0.1, 0.0)


def test_the_variance_of_a_log_likelihood_falls_with_the_number_of_particles():
    assert [spread_of(std).good_for_pmmh for std in (0.99, 1.0, 1.3, 1.7, 1.71)] == [False, True, True, True, False]
    assert spread_of(2.4).particles_for(400) == 1600
    assert spread_of(1.0).particles_for(100, std=0.5) == 400
    assert spread_of(1.0).particles_for(100, std=0.7) == 205
    assert spread_of(0.1).particles_for(100) == 2
    with pytest.raises(InputError, match="std = 0"):
        spread_of(1.0).particles_for(100, std=0.0)


def ranks(*fields):
    return filters.CalibrationRanks(Two(*map(np.asarray, fields)), 99)


def test_ranks_are_counted_and_judged_by_pearson_s_test():
    from scipy import stats

    even, heaps = np.arange(100), np.concatenate([np.arange(50), np.full(50, 99)])
    found = ranks(even, heaps)
    counts = found.histogram(5)
    np.testing.assert_array_equal(counts[0], [20] * 5)
    np.testing.assert_array_equal(counts[1], [20, 20, 10, 0, 50])
    np.testing.assert_allclose(found.p_values(5), [stats.chisquare(count).pvalue for count in counts], rtol=1e-9)
    assert not found.is_calibrated(0.01, 5) and ranks(even, even).is_calibrated()
    # Of two states each has half of the level.
    uneven = np.concatenate([np.repeat(np.arange(4), 20), np.repeat(4, 36)]) * 20
    p = float(ranks(uneven, uneven).p_values(5)[0])
    assert 0.01 < p < 0.1
    for level, passes in ((1.9 * p, True), (2.1 * p, False)):
        assert ranks(uneven, uneven).is_calibrated(level, 5) is passes


def test_the_truth_s_rank_is_the_number_of_draws_below_it():
    """A truth far above all beliefs has every draw below it, one far below none; the right one has any number."""
    rank = functools.partial(filters.simulation_based_calibration, filters.Kalman(), level(), RECORDING, KEY, 60, 9)
    assert np.all(rank(truth=level(1e3)).ranks.level == 9)
    assert np.all(rank(truth=level(-1e3)).ranks.level == 0)
    found = rank()
    assert found.draws == 9 and set(np.asarray(found.ranks.level)) == set(range(10))
    # Uniform on 0 to 9: of mean 4.5 and standard deviation 2.87.
    assert abs(np.mean(found.ranks.level) - 4.5) < 4 * 2.87 / 60**0.5
    with pytest.raises(InputError, match="bins = 5: must be at most 2"):
        filters.CalibrationRanks(Level(np.arange(10)), 9).p_values(5)


def beliefs():
    """Of a Gaussian filter, and of particles with a key."""
    one = filters.GaussianBelief(
        jnp.array([1.5]),
        jnp.array([[0.3]]),
        None,
        jnp.asarray(2.0),
        None,
        jnp.int32(3),
        Level,
        filters.Extended().rule(1),
    )
    members = Level(jnp.array([0.5, 2.0]))
    many = filters.ParticleBelief(
        members, jnp.array([0.25, 0.75]), jnp.array([1, 1], jnp.int32), KEY, jnp.asarray(2.0), None, jnp.int32(3)
    )
    return {"Gaussian": one, "particles": many}


@pytest.mark.parametrize("name", ["Gaussian", "particles"])
def test_a_belief_comes_back_from_its_file_bit_for_bit(name, tmp_path):
    belief = beliefs()[name]
    path = filters.save_belief(tmp_path / "belief.npz", belief)
    like = jax.tree.map(lambda leaf: leaf if jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key) else 0 * leaf, belief)
    again = filters.load_belief(path, like)
    words = lambda leaf: jax.random.key_data(leaf) if jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key) else leaf
    for a, b in zip(jax.tree.leaves(belief), jax.tree.leaves(again), strict=True):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(words(a), words(b))
    # An older file is replaced, and what is no such file, or of another belief, is told.
    filters.save_belief(path, belief)
    (tmp_path / "other.npz").write_text("no archive")
    with pytest.raises(InputError, match="is not a file of save_belief"):
        filters.load_belief(tmp_path / "other.npz", like)
    other = beliefs()["particles" if name == "Gaussian" else "Gaussian"]
    with pytest.raises(InputError, match="the file (has|lacks) .*: it is of another filter or model"):
        filters.load_belief(path, other)


def test_an_exported_filter_gives_the_filter_s_numbers(tmp_path):
    folder = filters.export_filter(tmp_path / "level", filters.Kalman(), MODEL)
    said = json.loads((folder / "names.json").read_text())
    assert (said["inputs"], said["channels"], said["report"]) == ([], ["flow"], ["level"])
    assert said["numbers"] == ["log_likelihood", "nis", "ess", "result"]
    init, step = (
        jax.export.deserialize(bytearray((folder / f"{name}.jaxexport").read_bytes())) for name in ("init", "step")
    )
    after, (m, P, logs, nis) = None, filtered()
    for k, (t, y) in enumerate(zip(TIME, FLOW, strict=True)):
        given = np.asarray(t), np.zeros(0), np.array([y])
        after = step.call(after[0], *given) if k else init.call(*given)
        _, mean, std, numbers = after
        np.testing.assert_allclose((mean[0], std[0] ** 2), (m[k], P[k]), rtol=1e-9)
        np.testing.assert_allclose(numbers[:2], (logs[k], nis[k]), rtol=1e-9, atol=1e-12)
        assert numbers[3] == 0
    with pytest.raises(InputError, match="exists already"):
        filters.export_filter(folder, filters.Kalman(), MODEL)

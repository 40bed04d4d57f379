"""Tests of estimates on numbers drawn with and without what they look for, and the chi-squared law against SciPy."""

from collections import namedtuple
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from jaxveh import InputError, Result, diagnostics
from jaxveh.statespace.belief import Info

Pair = namedtuple("Pair", "a b")


def test_chi_squared_is_scipy_s():
    for dof in (0.5, 1, 2, 3.7, 40, 3000):
        for share in (1e-6, 0.025, 0.3, 0.5, 0.9, 0.975, 1 - 1e-6):
            value = stats.chi2.ppf(share, dof)
            np.testing.assert_allclose(diagnostics.chi_squared_quantile(share, dof), value, rtol=2e-9)
            tails = stats.chi2.cdf(value, dof), stats.chi2.sf(value, dof)
            np.testing.assert_allclose(diagnostics.chi_squared_tails(value, dof), tails, rtol=3e-12)
    assert diagnostics.chi_squared_tails(0.0, 3) == (0.0, 1.0)
    assert diagnostics.chi_squared_tails(np.inf, 3) == (1.0, 0.0)
    np.testing.assert_allclose(diagnostics.chi_squared_tails(900.0, 5)[1], stats.chi2.sf(900.0, 5), rtol=1e-10)
    np.testing.assert_allclose(diagnostics.chi_squared_band(7, 0.9), stats.chi2.ppf((0.05, 0.95), 7), rtol=1e-10)


def test_chi_squared_names_mistakes():
    with pytest.raises(InputError, match=r"share = 1\.5: must be above 0 and below 1"):
        diagnostics.chi_squared_quantile(1.5, 3)
    with pytest.raises(InputError, match=r"degrees of freedom = 0: must be positive"):
        diagnostics.chi_squared_tails(1.0, 0)
    with pytest.raises(InputError, match=r"confidence = 1: must be above 0 and below 1"):
        diagnostics.chi_squared_band(3, 1)


def estimate(runs=4, rows=300, seed=0, missing=0.3, scale=(1.0, 1.0), colour=0.0, whitened=True):
    """What a filter reports of innovations with spreads 2 and 0.5, `scale` times as large as it says, some missing."""
    rng = np.random.default_rng(seed)
    white = rng.normal(size=(runs, rows, 2))
    for k in range(1, rows):
        white[:, k] = colour * white[:, k - 1] + (1 - colour**2) ** 0.5 * white[:, k]
    white = white * scale
    here = rng.uniform(size=white.shape) >= missing
    here[:, 11] = False
    innovation = np.where(here, white * (2.0, 0.5), np.nan)
    spread = np.where(here, (2.0, 0.5), np.nan)
    white = np.where(here, white, 0.0)
    pair = lambda values: Pair(values[..., 0], values[..., 1])
    nan = np.full((runs, rows), np.nan)
    info = Info(
        log_likelihood=nan, innovation=pair(innovation), innovation_std=pair(spread), nis=np.sum(white**2, axis=-1), ess=nan,
        result=np.zeros((runs, rows), np.int32), whitened=pair(white) if whitened else None,
    )  # fmt: skip
    return SimpleNamespace(info=info)


def test_nis_counts_the_channels_present():
    given = estimate()
    found = diagnostics.nis(given)
    here = np.isfinite(np.stack(given.info.innovation))
    total = here.sum()
    assert found.degrees_of_freedom == total
    np.testing.assert_allclose(found.mean, np.sum(given.info.nis) / total)
    np.testing.assert_allclose((found.low, found.high), stats.chi2.ppf((0.025, 0.975), total) / total, rtol=1e-9)
    value = found.mean * total
    np.testing.assert_allclose(found.p_value, 2 * min(stats.chi2.cdf(value, total), stats.chi2.sf(value, total)))
    count = here[:, :, 3].sum()
    np.testing.assert_allclose(found.by_row[3], given.info.nis[:, 3].sum() / count)
    np.testing.assert_allclose(found.row_high[3], stats.chi2.ppf(0.975, count) / count)
    assert np.isnan([found.by_row[11], found.row_low[11], found.row_high[11]]).all()
    assert found.consistent
    assert found.verdict == "consistent"
    assert 0.92 < found.share_inside < 0.98
    assert diagnostics.nis(given, skip=20).degrees_of_freedom == here[:, :, 20:].sum()
    one = SimpleNamespace(info=diagnostics_row(given.info, 2))
    np.testing.assert_allclose(diagnostics.nis(one).mean, given.info.nis[2].sum() / here[:, 2].sum())


def diagnostics_row(info, run):
    """One run's info, (T,) leaves."""
    take = lambda value: (
        None if value is None else Pair(*[v[run] for v in value]) if isinstance(value, tuple) else value[run]
    )
    return Info(*[take(value) for value in info])


def test_nis_rejects_as_often_as_it_says():
    rejected = [not diagnostics.nis(estimate(1, 60, seed), confidence=0.9).consistent for seed in range(200)]
    assert 0.04 < np.mean(rejected) < 0.17


def test_nis_finds_the_channel_that_is_wrong():
    found = diagnostics.nis_by_channel(estimate(scale=(1.0, 1.2)))
    assert found["a"].consistent
    assert found["b"].verdict == "too confident"
    np.testing.assert_allclose(found["b"].mean, 1.44, rtol=0.1)
    assert diagnostics.nis(estimate(scale=(0.8, 0.8))).verdict == "too cautious"


def errors(runs=40, rows=25, seed=3, colour=0.0):
    """Errors (R, T, 3) that have the covariances (R, T, 3, 3), of states with very different units."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(runs, rows, 3, 3)) * np.array([1e-4, 1.0, 1e5])[:, None]
    white = rng.normal(size=(runs, rows, 3))
    for k in range(1, rows):
        white[:, k] = colour * white[:, k - 1] + (1 - colour**2) ** 0.5 * white[:, k]
    return np.einsum("rtij,rtj->rti", root, white), root @ np.swapaxes(root, -1, -2)


def test_nees_has_the_band_of_all_runs_in_a_row():
    error, covariance = errors()
    found = diagnostics.nees(error, covariance)
    band = stats.chi2.ppf((0.025, 0.975), 120) / 120
    np.testing.assert_allclose((found.row_low[2], found.row_high[2]), band, rtol=1e-9)
    expected = np.mean([e @ np.linalg.solve(p, e) for e, p in zip(error[:, 4], covariance[:, 4], strict=True)]) / 3
    np.testing.assert_allclose(found.by_row[4], expected, rtol=1e-6)
    assert found.consistent
    assert found.share_inside > 0.8
    assert diagnostics.nees(1.3 * error, covariance).verdict == "too confident"
    assert diagnostics.nees(0.7 * error, covariance).verdict == "too cautious"
    assert len(diagnostics.nees(error, covariance, skip=5).by_row) == 20
    few = diagnostics.nees(error[:5], covariance[:5])
    assert few.degrees_of_freedom == 15
    np.testing.assert_allclose((few.low, few.high), stats.chi2.ppf((0.025, 0.975), 15) / 15, rtol=1e-9)


def test_nees_of_all_rows_has_the_degrees_of_freedom_that_are_left():
    """Squares of correlated rows correlate by colour^(2 lag): the variance of their mean is known."""
    colour, rows = 0.9, 25
    lags = np.arange(1, rows)
    effective = rows / (1 + 2 * np.sum((1 - lags / rows) * colour ** (2 * lags)))
    found = diagnostics.nees(*errors(400, rows, colour=colour))
    np.testing.assert_allclose(found.degrees_of_freedom, 400 * 3 * effective, rtol=0.2)
    rejected = [not diagnostics.nees(*errors(20, rows, seed, colour), confidence=0.9).consistent for seed in range(200)]
    assert 0.04 < np.mean(rejected) < 0.2


@pytest.mark.parametrize("whitened", [True, False])
def test_whiteness_lets_white_innovations_pass_and_finds_colour(whitened):
    found = diagnostics.whiteness(estimate(whitened=whitened), lags=np.int64(10))
    assert found.white
    assert found.channels == ("a", "b")
    assert found.degrees_of_freedom == 40
    assert found.share_inside > 0.85
    # The same scale on both is no colour, nor is a wrong one.
    assert diagnostics.whiteness(estimate(whitened=whitened, scale=(3.0, 0.2)), lags=10).white
    coloured = diagnostics.whiteness(estimate(whitened=whitened, colour=0.3), lags=10)
    assert not coloured.white
    np.testing.assert_allclose(coloured.correlations[0, [0, 1], [0, 1]], 0.3, atol=0.08)
    np.testing.assert_allclose(coloured.correlations[1, [0, 1], [0, 1]], 0.09, atol=0.08)


def test_whiteness_without_gaps_is_ljung_and_box_s():
    rng = np.random.default_rng(5)
    w = rng.normal(size=80)
    info = SimpleNamespace(
        innovation=Pair(w, np.full(80, np.nan)), whitened=None, innovation_std=Pair(np.ones(80), np.ones(80))
    )
    found = diagnostics.whiteness(SimpleNamespace(info=info), lags=7)
    r = np.array([np.sum(w[:-lag] * w[lag:]) for lag in range(1, 8)]) / np.sum(w**2)
    expected = 80 * 82 * np.sum(r**2 / (80 - np.arange(1, 8)))
    np.testing.assert_allclose(found.statistic, expected, rtol=1e-12)
    assert found.degrees_of_freedom == 7
    np.testing.assert_allclose(found.p_value, stats.chi2.sf(expected, 7), rtol=1e-10)
    np.testing.assert_allclose(found.band[3, 0, 0], stats.norm.ppf(0.975) / np.sqrt(76))
    assert np.isnan(found.correlations[:, 1]).all()


def test_whiteness_rejects_as_often_as_it_says():
    rejected = [not diagnostics.whiteness(estimate(1, 120, seed), 8, 0.9).white for seed in range(200)]
    assert 0.04 < np.mean(rejected) < 0.17


def particles(ess, result=None, n=100):
    ess = np.asarray(ess, float)
    codes = np.zeros(ess.shape, np.int32) if result is None else np.asarray(result, np.int32)
    belief = SimpleNamespace(weights=np.full(n, 1 / n))
    return SimpleNamespace(info=SimpleNamespace(ess=ess, result=codes), belief=belief)


def test_particle_health():
    found = diagnostics.particle_health(particles([50.0, 5.0, 100.0, 20.0]))
    assert (found.particles, found.lowest, found.median, found.worst_row) == (100, 0.05, 0.35, 1)
    assert (found.share_below, found.result, found.failed_at, found.healthy) == (0.25, Result.successful, -1, False)
    np.testing.assert_allclose(found.quantiles[0.25], np.quantile([0.5, 0.05, 1.0, 0.2], 0.25))
    assert diagnostics.particle_health(particles([50.0, 12.0])).healthy
    dead = diagnostics.particle_health(particles([[50.0, 40.0, 60.0], [50.0, 100.0, 60.0]], [[0, 0, 0], [0, 2, 4]]))
    assert (dead.result, dead.failed_at, dead.healthy) == (Result.all_particles_dead, 1, False)


def test_ancestry():
    found = diagnostics.ancestry(np.array([[9, 9, 9, 9], [0, 0, 1, 3], [1, 1, 2, 2], [0, 1, 1, 3]]))
    np.testing.assert_array_equal(found.parents, [4, 3, 2, 3])
    # The last come from 0, 1, 3, these from 1, 1, 2, these from 0 and 1.
    np.testing.assert_array_equal(found.surviving, [2, 2, 3, 4])
    assert found.coalescence == -1
    assert diagnostics.ancestry(np.array([[0, 1], [1, 1], [0, 1], [0, 1]])).coalescence == 3


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: diagnostics.nis(estimate(), skip=300), r"skip = 300: must be from 0 to 299"),
        (lambda: diagnostics.nis(estimate(missing=1.1)), "no row has a measurement"),
        (lambda: diagnostics.nis_by_channel(estimate(missing=1.1)), "no row has a measurement"),
        (lambda: diagnostics.whiteness(estimate(missing=1.1)), "no row has a measurement"),
        (lambda: diagnostics.whiteness(estimate(), lags=300), r"lags = 300: must be a whole number from 1 to 299"),
        (lambda: diagnostics.nees(np.zeros((5, 3)), np.zeros((5, 3, 3))), r"must be \(R, T, n\) and \(R, T, n, n\)"),
        (lambda: diagnostics.nees(np.ones((1, 1, 2)), np.ones((1, 1, 2, 2))), "not positive definite"),
        (lambda: diagnostics.nees(np.ones((1, 1, 2)), np.zeros((1, 1, 2, 2))), "a variance is not positive"),
        (lambda: diagnostics.nees(np.full((1, 1, 1), np.nan), np.ones((1, 1, 1, 1))), "not finite"),
        (lambda: diagnostics.particle_health(particles([np.nan, np.nan])), "only particle filters have one"),
        (lambda: diagnostics.particle_health(particles([1.0]), threshold=2.0), r"threshold = 2\.0: must be above 0"),
        (lambda: diagnostics.particle_health(estimate()), "has no weights"),
        (lambda: diagnostics.ancestry(np.zeros((3, 2))), r"float64 of shape \(3, 2\): must be whole numbers"),
        (lambda: diagnostics.ancestry(np.array([[0, 1], [0, 2]])), "from 0 to 2: must be from 0 to 1"),
    ],
)
def test_mistakes_are_named(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_a_filter_without_nis_says_what_to_take():
    given = estimate()
    given.info = given.info._replace(nis=np.full_like(given.info.nis, np.nan))
    with pytest.raises(InputError, match="use nis_by_channel"):
        diagnostics.nis(given)
    given.info = given.info._replace(innovation_std=Pair(*np.full((2, 4, 300), np.nan)), whitened=None)
    for of in (diagnostics.nis_by_channel, diagnostics.whiteness):
        with pytest.raises(InputError, match="a is not finite|a over its predicted standard deviation is not finite"):
            of(given)

"""Paired comparisons: known ratios and wins, failures that count as losses, intervals that cover."""

import jax
import numpy as np
import pytest

from jaxveh import InputError, sweeps


def test_ratios_wins_and_ties():
    a, b = np.array([[1.0, 2.0, 3.0, 4.0]]), np.array([[2.0, 2.0, 2.0, 2.0]])
    found = sweeps.compare(a, b)
    np.testing.assert_allclose(found.ratio.value, [1.25])
    np.testing.assert_allclose(found.of_medians.value, [1.25])
    np.testing.assert_allclose(found.wins, [0.375])
    assert found.ratio.low[0] <= 1.25 <= found.ratio.high[0]


def test_a_common_factor_has_no_spread():
    b = np.random.default_rng(0).uniform(1.0, 100.0, 30)
    found = sweeps.compare(0.5 * b, b)
    np.testing.assert_allclose([*found.ratio], 0.5)
    assert found.wins == 1.0
    # Of medians there is a spread: another sample has others.
    np.testing.assert_allclose(found.of_medians.value, 0.5)


def test_runs_that_failed_have_lost():
    good = np.array([1.0, 1.0, 1.0])
    found = sweeps.compare(np.array([np.nan, 0.5, np.inf]), good)
    assert found.ratio.value == np.inf and found.wins == pytest.approx(1 / 3)
    both = sweeps.compare(np.array([np.nan] * 3), np.array([np.inf] * 3))
    assert both.ratio.value == 1.0 and both.wins == 0.5
    assert sweeps.compare(good, np.array([np.nan] * 3)).ratio.value == 0.0


def test_intervals_cover_the_true_ratio_as_often_as_they_say():
    rng, hits, trials = np.random.default_rng(1), 0, 200
    for _ in range(trials):
        logs = np.log(0.8) + 0.5 * rng.normal(size=40)
        b = rng.lognormal(size=40)
        found = sweeps.compare(np.exp(logs) * b, b, level=0.9)
        hits += found.ratio.low <= 0.8 <= found.ratio.high
    # Within four standard errors of 0.9.
    assert abs(hits / trials - 0.9) < 4 * np.sqrt(0.9 * 0.1 / trials)


@pytest.mark.parametrize(
    ("a", "b", "message"),
    [
        ([1.0, 2.0], [1.0], r"a has shape \(2,\), b \(1,\)"),
        ([1.0], [1.0], "1 seed: a comparison needs at least two"),
        ([1.0, -2.0], [1.0, 1.0], "must not be negative"),
    ],
)
def test_mistakes_are_named(a, b, message):
    with pytest.raises(InputError, match=message):
        sweeps.compare(np.array(a), np.array(b))


def test_the_digits_of_numpy_are_kept_without_x64():
    with jax.enable_x64(False):
        found = sweeps.compare(np.ones(5), np.full(5, 1.0 + 1e-9))
    assert found.wins == 1.0

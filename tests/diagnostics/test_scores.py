"""Scores of estimates with bands: each number by its definition."""

import numpy as np
import pytest

from jaxveh import InputError
from jaxveh.diagnostics import score_band


def drawn(rows=20000, spread=1.0):
    rng = np.random.default_rng(0)
    std = rng.uniform(0.5, 2.0, rows)
    mean = rng.normal(size=rows)
    return mean + spread * std * rng.normal(size=rows), mean, std


def test_errors_are_split_into_a_constant_and_the_rest():
    reference = np.array([1.0, 2.0, np.nan, 4.0, 50.0])
    found = score_band(reference, np.array([1.5, 2.0, 7.0, 5.3, 0.0]), which=np.array([True, True, True, True, False]))
    errors = np.array([0.5, 0.0, 1.3])
    assert found.rows == 3
    assert found.rmse == pytest.approx(np.sqrt(np.mean(errors**2)))
    assert found.constant == pytest.approx(0.6)
    assert found.rmse_without_constant == pytest.approx(np.std(errors))
    assert found.worst == pytest.approx(1.3)
    assert np.isnan([found.coverage_50, found.coverage_95, found.crps, found.crps_constant]).all()


@pytest.mark.parametrize("spread", [1.0, 2.0, 0.5])
def test_bands_cover_what_a_normal_law_says(spread):
    from scipy.stats import norm

    reference, mean, std = drawn(spread=spread)
    found = score_band(reference, mean, std)
    for share, covered in ((0.5, found.coverage_50), (0.95, found.coverage_95)):
        expected = 2 * norm.cdf(norm.ppf(0.5 + share / 2) / spread) - 1
        assert covered == pytest.approx(expected, abs=4 * np.sqrt(expected * (1 - expected) / len(mean)))


def test_the_crps_is_the_integral_that_defines_it():
    from scipy.stats import norm

    reference, mean, std = (one[:20] for one in drawn())
    x = np.linspace(-20, 20, 200001)
    integrals = [
        np.trapezoid((norm.cdf(x, m, s) - (x >= r)) ** 2, x) for r, m, s in zip(reference, mean, std, strict=True)
    ]
    assert score_band(reference, mean, std).crps == pytest.approx(np.mean(integrals), abs=2e-4)


def test_a_constant_band_is_the_best_one():
    reference, mean, std = drawn()
    found = score_band(reference, mean, std)
    constant = [score_band(reference, mean, np.full(len(mean), width)).crps for width in np.linspace(0.3, 3.0, 28)]
    assert found.crps_constant == pytest.approx(min(constant), rel=0.01)
    # Bands that know where they are narrow are worth more.
    assert found.crps < found.crps_constant
    assert score_band(mean, mean, std).crps_constant == 0.0


def test_a_reference_without_a_row_is_refused():
    with pytest.raises(InputError, match="NaN in every row"):
        score_band(np.full(3, np.nan), np.zeros(3))

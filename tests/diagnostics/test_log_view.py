"""What the checks of a log stand on: the even grid and the robust fit."""

import numpy as np
import pytest

from jaxveh import Recording
from jaxveh.diagnostics.log_findings import LogView, fit


def test_the_grid_is_as_fine_as_the_fastest_channel():
    time = np.round(np.arange(0.0, 2.0001, 0.01), 10)
    slow = np.where(np.arange(time.size) % 5 == 0, time, np.nan)
    log = LogView.of(Recording(time, {"slow": slow, "fast": time**2}), None)
    np.testing.assert_allclose(log.grid, time, atol=1e-12)
    np.testing.assert_allclose(log.even("slow"), time, atol=1e-12)
    np.testing.assert_allclose(log.slope(log.even("fast"))[1:-1], 2 * time[1:-1], atol=1e-9)


def test_gaps_are_not_bridged():
    time = np.arange(300) * 0.01
    values = time.copy()
    values[50:80] = np.nan  # 0.31 s
    values[150:240] = np.nan  # 0.91 s
    on_grid = LogView.of(Recording(time, {"a": values}), None).even("a")
    np.testing.assert_allclose(on_grid[50:80], time[50:80], atol=1e-12)
    assert np.isnan(on_grid[150:240]).all()
    assert np.isfinite(on_grid[[149, 240, 299]]).all()
    seldom = np.where(np.arange(300) % 100 == 0, time, np.nan)  # once a second, by design
    on_grid = LogView.of(Recording(time, {"a": values, "seldom": seldom}), None).even("seldom")
    np.testing.assert_allclose(on_grid[:201], time[:201], atol=1e-12)


def test_the_average_delays_nothing():
    time = np.arange(400) * 0.01
    log = LogView.of(Recording(time, {"a": time}), None)
    smooth = log.smooth(3 * time + 1, 0.1)
    np.testing.assert_allclose(smooth[5:-5], (3 * time + 1)[5:-5], rtol=1e-12)
    assert np.isnan(smooth[:5]).all()
    assert np.isnan(smooth[-5:]).all()
    assert np.isnan(log.smooth(time, 10.0)).all()


def test_fit_sees_through_outliers():
    rng = np.random.default_rng(0)
    x = rng.normal(size=500)
    y = 2 + 3 * x + 0.1 * rng.normal(size=500)
    y[::50] += 40
    y[7] = np.nan
    coefficients, _, correlation = fit(y, x)
    np.testing.assert_allclose(coefficients, [2, 3], atol=0.03)
    assert correlation > 0.99


def test_errors_of_a_fit_are_honest():
    rng = np.random.default_rng(1)
    scores = []
    for _ in range(300):
        x, noise = (np.repeat(rng.normal(size=200), 10) for _ in range(2))  # ten neighbours are one
        coefficients, errors, _ = fit(1 + 2 * x + 0.5 * noise, x)
        scores.append((coefficients - [1, 2]) / errors)
    np.testing.assert_allclose(np.std(scores, axis=0), 1.0, atol=0.15)
    np.testing.assert_allclose(np.mean(scores, axis=0), 0.0, atol=0.2)


@pytest.mark.parametrize("rows", [0, 3, 9])
def test_few_rows_tell_nothing(rows):
    coefficients, errors, correlation = fit(np.ones(rows), np.ones(rows))
    np.testing.assert_array_equal(coefficients, 0)
    assert np.isinf(errors).all()
    assert correlation == 0

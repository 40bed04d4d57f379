"""`diagnostics.delay`: signals that come late by a known time."""

import numpy as np
import pytest

from jaxveh import diagnostics

TIME = np.arange(0.0, 30.0, 0.02)


def wave(t):
    return np.sin(1.3 * t) + 0.5 * np.sin(3.1 * t + 1.0)


@pytest.mark.parametrize("late", [0.0, 0.013, 0.2, 1.1, -0.3])
def test_a_late_signal_is_late_by_as_much_whatever_its_constant_error(late):
    found = diagnostics.delay(TIME, wave(TIME - late) + 3.0, wave(TIME))
    assert found == pytest.approx(late, abs=2e-3)


def test_noise_and_gaps_do_not_move_it_much():
    rng = np.random.default_rng(0)
    mean = wave(TIME - 0.15) + 0.1 * rng.normal(size=TIME.size)
    truth = np.where(rng.random(TIME.size) < 0.3, np.nan, wave(TIME))
    mean[300:400] = np.nan
    assert diagnostics.delay(TIME, mean, truth) == pytest.approx(0.15, abs=0.02)


def test_what_does_not_move_or_is_later_than_allowed_has_no_delay():
    assert np.isnan(diagnostics.delay(TIME, wave(TIME), np.full(TIME.size, 2.0)))
    assert np.isnan(diagnostics.delay(TIME, np.full(TIME.size, np.nan), wave(TIME)))
    assert np.isnan(diagnostics.delay(TIME, wave(TIME - 0.9), wave(TIME), longest=0.4))

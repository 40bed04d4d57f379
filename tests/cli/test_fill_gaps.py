"""`--fill`: gaps of any place and length in the inputs, drawn at random, against NumPy's interpolation."""

import numpy as np
import pytest

from jaxveh import InputError, Recording
from jaxveh.cli import blanking

ROWS = 50
TIME = 0.1 * np.arange(ROWS)


def log_with(missing):
    values = np.where(missing, np.nan, 20.0 + np.sin(TIME))
    plain = np.zeros(ROWS)
    return Recording(TIME, {"v_x": values, "yaw_rate": plain, "steer": values, "a_x": plain}, {}, "")


@pytest.mark.parametrize("seed", range(30))
def test_short_gaps_are_filled_and_long_ones_told(seed):
    draw = np.random.default_rng(seed)
    missing = np.zeros(ROWS, bool)
    for _ in range(draw.integers(1, 4)):
        begin = draw.choice([0, ROWS - 3, draw.integers(ROWS)])
        missing[begin : begin + draw.integers(1, 6)] = True
    drive, reach = log_with(missing), draw.uniform(0.15, 0.75)
    known = np.flatnonzero(~missing)
    expected = np.interp(TIME, TIME[known], np.asarray(drive["v_x"])[known])
    before = np.array([TIME[known[known <= k][-1]] if (known <= k).any() else -np.inf for k in range(ROWS)])
    after = np.array([TIME[known[known >= k][0]] if (known >= k).any() else np.inf for k in range(ROWS)])
    # At the ends the one sample that there is must be near.
    gap = np.where(np.isfinite(before) & np.isfinite(after), after - before, np.minimum(TIME - before, after - TIME))
    if (gap > reach).any():
        with pytest.raises(InputError, match=rf"is NaN in {int((gap > reach).sum())} rows.*raise --fill"):
            blanking.fill_gaps(drive, reach)
        return
    filled = blanking.fill_gaps(drive, reach)
    for name in ("v_x", "steer"):
        np.testing.assert_allclose(filled[name], expected, rtol=1e-12)
    assert np.array_equal(np.asarray(filled["v_x"])[known], np.asarray(drive["v_x"])[known])


def test_without_the_option_a_gap_stays_an_error():
    missing = np.arange(ROWS) == ROWS - 1
    with pytest.raises(InputError, match=r"v_x is NaN in 1 rows, first at t = 4\.9 s.*add --fill SECONDS"):
        blanking.fill_gaps(log_with(missing), None)
    assert np.isfinite(np.asarray(blanking.fill_gaps(log_with(missing), 0.2)["v_x"])).all()

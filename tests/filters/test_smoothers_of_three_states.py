"""Smoothers on three states that are coupled, of a few rows: products of matrices in another order, or of entries, show.

Every rule and form, and long recordings, are in `test_smoothers.py`, of which little runs by default; on one state
(`test_smoothers_of_one_state.py`) products of matrices are those of numbers.
"""

import numpy as np
import pytest
from filter_systems import kalman
from test_smoothers import MODEL, RECORDING, exact

from jaxveh import filters

ROWS = 9
"""Of which one has a channel and one nothing at all."""

pytestmark = pytest.mark.whole
FEW = RECORDING.rows(slice(0, ROWS))
MEANS, SPREADS = exact(ROWS)


def test_what_is_missing():
    missing = np.isnan([FEW[name] for name in MODEL.channels])
    assert missing.all(axis=0).any() and (missing.any(axis=0) & ~missing.all(axis=0)).any()


@pytest.mark.parametrize("smooth", [filters.smooth, filters.smooth_parallel])
def test_the_smoothed_states_and_the_filter_s_are_numpy_s(smooth):
    found = smooth(filters.Kalman(), MODEL, FEW)
    np.testing.assert_allclose(np.stack(found.mean, axis=1), MEANS, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(np.stack(found.std, axis=1), SPREADS, rtol=1e-9)
    expected = {name: values[:ROWS] for name, values in kalman(MODEL, RECORDING).items()}
    np.testing.assert_allclose(np.stack(found.filtered.mean, axis=1), expected["mean"], rtol=1e-9, atol=1e-10)
    variances = np.diagonal(expected["covariance"], axis1=1, axis2=2)
    np.testing.assert_allclose(np.stack(found.filtered.std, axis=1), np.sqrt(variances), rtol=1e-9)

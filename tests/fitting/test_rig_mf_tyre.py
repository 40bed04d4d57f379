"""MF-Tyre 6.1 from rig data: the reference tyre's forces are found again from a generic start."""

import numpy as np
import pandas as pd
import pytest
from rig_sweeps import measured_of, peak, plan, table, truth
from shared_data import shared

from jaxveh import fitting, io

CHANNELS = ("F_x", "F_y")
NOISE = 0.02


def start(rig):
    return fitting.starting_tyre("mf61", rig)


@pytest.mark.full
def test_a_generic_start_comes_to_the_truth_through_noise():
    columns, run = plan()
    clean = measured_of(truth(), columns, CHANNELS)
    data = table(clean, columns, run, NOISE, seed=1)
    fit = fitting.fit_rig(start(data), data)
    assert fit.stages[-1].converged and [stage.name for stage in fit.stages][-1] == "joint"
    found = measured_of(fit.tyre, columns, CHANNELS)
    for name in CHANNELS:
        error = np.sqrt(np.mean((found[name] - clean[name]) ** 2)) / peak(clean[name])
        assert error < 0.005 < NOISE < 0.05 < fit.start_rmse[name] / fit.peak[name]
        np.testing.assert_allclose(fit.noise[name] / peak(clean[name]), NOISE, rtol=0.05)
    # Camber and pressure never vary together here, and PKY4 was not asked for.
    for name, value in (("lateral.PPY5", 0.0), ("lateral.PKY4", 2.0)):
        assert np.isnan(fit.parameters_std[name]) and fit.parameters[name] == value
    assert 55 <= fit.identified < len(fit.names)


@pytest.mark.full
def test_a_fit_to_the_reference_s_own_rows():
    """Both modes of the reference, as if they were rig data: its forces to 1 % of their peak."""
    data = io.read_rig_table(shared("mfeval_mf61.csv"))
    assert {"in_alpha", "useMode"} <= set(pd.read_csv(shared("mfeval_mf61.csv"), nrows=1).columns)
    fit = fitting.fit_rig(start(data), data, measured=CHANNELS, throw=False)
    for name in CHANNELS:
        assert fit.rmse[name] < 0.01 * fit.peak[name] < 0.05 * fit.peak[name] < fit.start_rmse[name]

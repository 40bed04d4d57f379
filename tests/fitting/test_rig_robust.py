"""Outliers: they are noticed, a robust fit is hardly moved by them, and its standard errors are right."""

import dataclasses

import numpy as np
import pytest
from rig_sweeps import brush, measured_of, peak, small_plan, table
from test_rig import TRUE, start

from jaxveh import fitting
from jaxveh.cli.tyre_fit_report import warnings_of

CHANNELS = ("F_x", "F_y", "M_z")
COLUMNS, RUN = small_plan()


@pytest.fixture(scope="module")
def clean():
    return measured_of(brush(), COLUMNS, CHANNELS)


def spoilt(clean, seed, share=0.05):
    """Noise of 2 % of the peak, and a share of rows that are off by anything to twice the peak, to one side."""
    random, data = np.random.default_rng(100 + seed), table(clean, COLUMNS, RUN, 0.02, seed)
    found = {}
    for name in CHANNELS:
        wrong = random.random(RUN.size) < share
        found[name] = getattr(data, name) + wrong * random.uniform(0.0, 2.0, RUN.size) * peak(clean[name])
    return dataclasses.replace(data, **found)


def error(fit, clean):
    """RMS of a tyre's forces and moments from the true ones, over their peaks."""
    found = measured_of(fit.tyre, COLUMNS, CHANNELS)
    return np.sqrt(np.mean([((found[name] - clean[name]) / peak(clean[name])) ** 2 for name in CHANNELS]))


def test_outliers_move_a_robust_fit_little(clean):
    def mean_error(share, robust):
        fits = [fitting.fit_rig(start(), spoilt(clean, seed, share), robust=robust) for seed in range(4)]
        return np.mean([error(fit, clean) for fit in fits])

    errors = {setting: mean_error(*setting) for setting in ((0.0, False), (0.05, False), (0.05, True))}
    assert errors[0.0, False] < 0.005 and errors[0.05, False] > 5 * errors[0.0, False]
    assert errors[0.05, True] < 1.3 * errors[0.0, False]


def test_standard_errors_of_robust_fits_cover(clean):
    fits = [fitting.fit_rig(start(), spoilt(clean, seed), robust=True) for seed in range(50)]
    values, std = (np.array([getattr(fit, name).array() for fit in fits]) for name in ("parameters", "parameters_std"))
    np.testing.assert_allclose(std.mean(axis=0), values.std(axis=0), rtol=0.3)
    assert 0.88 < np.mean(np.abs(values - TRUE) < 1.96 * std) < 0.99


def test_heavy_tails_are_told_and_normal_noise_is_not():
    random = np.random.default_rng(0)
    for rows in (20, 45, 300, 5000):
        assert all(fitting.heavy_tails(random.standard_normal(rows)) is None for _ in range(40))
    noise = 7.0 * random.standard_normal(2000)
    noise[:100] += 200.0
    noise[5] = np.nan
    tails = fitting.heavy_tails(noise)
    assert tails is not None
    assert tails.share == pytest.approx(0.05, abs=0.002) and tails.deviation == pytest.approx(7.0, rel=0.1)
    assert tails.ratio == pytest.approx(np.sqrt(np.nanmean(noise**2)) / tails.deviation)
    assert fitting.heavy_tails(np.zeros(50)) is None and fitting.heavy_tails(np.full(5, np.nan)) is None


def test_the_program_s_words_have_the_figure_and_the_way_out(clean):
    data = spoilt(clean, 0)
    plain, robust = (fitting.fit_rig(start(), data, robust=robust) for robust in (False, True))
    words = [one for one in warnings_of(plain) if one.startswith("F_y: residuals have heavy tails")]
    share = 100 * fitting.heavy_tails(plain.residuals["F_y"]).share
    assert len(words) == 1 and f"{share:.2g} % of the rows" in words[0] and "try --robust" in words[0]
    after = [one for one in warnings_of(robust, robust=True) if one.startswith("F_y: ")]
    assert len(after) == 1 and "had little weight" in after[0] and "--robust" not in after[0]
    assert warnings_of(fitting.fit_rig(start(), table(clean, COLUMNS, RUN, 0.02, 1))) == []

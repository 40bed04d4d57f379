"""Figures of rig fits: what is drawn is what was measured, fitted and left over, in the units on the axes."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Parameters, plots
from jaxveh.fitting import RigFit
from jaxveh.io import RigTable
from jaxveh.plots.rig_fit import DOTS, GROUPS, group_means, slip_of
from jaxveh.tyres import Brush

ROWS = 60


def table(**changes):
    random = np.random.default_rng(1)
    columns = {
        "slip_angle": np.linspace(-0.2, 0.2, ROWS),
        "slip_ratio": np.zeros(ROWS),
        "load": np.tile([2000.0, 4000.0, 6000.0], ROWS // 3),
        "F_y": 3e3 * random.standard_normal(ROWS),
        "M_z": 40 * random.standard_normal(ROWS),
    }
    return RigTable(**(columns | changes))


def fit_of(rig, **residuals):
    """A fit with these residuals, so that no fit has to be made."""
    rmse = {name: float(np.sqrt(np.nanmean(value**2))) for name, value in residuals.items()}
    peak = {name: 10.0 * value for name, value in rmse.items()}
    none, empty = np.zeros(0), Parameters({})
    return RigFit(
        parameters=empty, parameters_std=empty, unconstrained=none, covariance=none, cost=0.0, steps=0,
        result=0, model=Brush(9e4, 6e4), chosen=(), identified=0,
        rmse=rmse, start_rmse=rmse, cross_validation=rmse, peak=peak, noise=rmse,
        residuals=residuals, stages=(), problem=None,
    )  # fmt: skip


@pytest.fixture
def rig():
    return table()


@pytest.fixture
def fit(rig):
    noise = np.random.default_rng(2).standard_normal((2, ROWS))
    return fit_of(rig, F_y=50 * noise[0], M_z=2 * noise[1])


def test_measured_fitted_and_residuals_are_drawn(fit, rig):
    (block,) = plots.rig_fit(fit, rig, ["F_y"]).subfigs
    curve, over_slip, over_load, histogram = block.axes[:4]
    shown = curve.collections[0].get_offsets()
    np.testing.assert_allclose(shown, np.stack([np.degrees(rig.slip_angle), rig.F_y / 1e3], axis=1))
    np.testing.assert_allclose(curve.get_lines()[0].get_ydata(), (rig.F_y + fit.residuals["F_y"]) / 1e3)
    np.testing.assert_allclose(over_slip.collections[0].get_offsets()[:, 1], fit.residuals["F_y"])
    np.testing.assert_allclose(over_load.collections[0].get_offsets()[:, 0], rig.load / 1e3)
    np.testing.assert_allclose(sum(bar.get_height() for bar in histogram.patches), 100.0)
    assert curve.get_ylabel() == "lateral force [kN]" and over_slip.get_ylabel() == "residual [N]"
    assert [ax.get_xlabel() for ax in (curve, over_load)] == ["slip angle [°]", "load [kN]"]
    assert block.get_suptitle() == f"F_y, lateral force: RMSE {fit.rmse['F_y']:.3g} N, 10 % of peak"


def test_every_channel_has_its_block_and_missing_values_are_left_out(rig):
    left_over = np.where(np.arange(ROWS) < 10, np.nan, 1.0)
    fit = fit_of(rig, F_y=np.ones(ROWS), M_z=left_over)
    force, moment = plots.rig_fit(fit, rig).subfigs
    assert moment.axes[0].get_ylabel() == "aligning moment [N m]"
    assert len(force.axes[1].collections[0].get_offsets()) == ROWS
    assert len(moment.axes[1].collections[0].get_offsets()) == ROWS - 10


def test_it_is_drawn_over_the_slip_that_varies(rig):
    ratio = np.linspace(-0.2, 0.2, ROWS)
    assert slip_of("F_y", rig) == slip_of("F_x", rig) == "slip_angle"
    assert slip_of("F_x", table(slip_ratio=ratio)) == "slip_ratio"
    only = table(slip_angle=np.zeros(ROWS), slip_ratio=ratio)
    assert slip_of("M_z", only) == "slip_ratio"
    figure = plots.rig_fit(fit_of(only, M_z=np.ones(ROWS)), only)
    (block,) = figure.subfigs
    np.testing.assert_allclose(block.axes[0].collections[0].get_offsets()[:, 0], 100 * ratio)
    assert block.axes[0].get_xlabel() == "slip ratio [%]"


def test_many_rows_are_thinned_but_all_of_them_count():
    many = np.linspace(-0.2, 0.2, 3 * DOTS)
    wide = np.ones(many.size)
    rig = RigTable(slip_angle=many, slip_ratio=0 * many, load=4e3 * wide, F_y=1e4 * many)
    residual = np.where(np.arange(many.size) % 3 == 0, 0.0, 3.0)
    (block,) = plots.rig_fit(fit_of(rig, F_y=residual), rig).subfigs
    assert len(block.axes[1].collections[0].get_offsets()) == DOTS
    mean = block.axes[1].get_lines()[-1].get_ydata()
    assert mean.size == GROUPS
    np.testing.assert_allclose(mean, 2.0, atol=0.01)


def test_means_are_of_neighbours():
    x, mean = group_means(np.array([2.0, 1.0, 2.0, 1.0]), np.array([4.0, 1.0, 6.0, 3.0]))
    np.testing.assert_array_equal([x, mean], [[1.0, 2.0], [2.0, 5.0]])
    # Pure slip of the other kind: its rows are one group, those of either side are not mixed with them.
    values = np.concatenate([np.zeros(100), np.linspace(-1.0, -0.1, 60), np.linspace(0.1, 1.0, 60)])
    x, mean = group_means(values, np.sign(values))
    assert set(mean) == {-1.0, 0.0, 1.0} and list(x) == sorted(x)
    assert np.sum(mean == 0) == 1 and mean.size > 8


def test_outliers_beyond_the_histogram_are_told(rig):
    residual = np.full(ROWS, 0.1)
    residual[5] = 100.0
    (block,) = plots.rig_fit(fit_of(rig, F_y=residual), rig).subfigs
    assert [text.get_text() for text in block.axes[3].texts] == ["1 beyond"]


def test_it_can_be_drawn_into_ones_own_figure_and_saved(fit, rig, tmp_path):
    from matplotlib.figure import Figure

    mine = Figure(figsize=(8, 9))
    assert plots.rig_fit(fit, rig, figure=mine) is mine and len(mine.subfigs) == 2
    path = plots.save(plots.rig_fit(fit, rig), tmp_path / "fit.png")
    assert path.stat().st_size > 20_000


def test_channels_that_were_not_fitted_are_named(fit, rig):
    with pytest.raises(InputError, match="channels = 'F_x': must be one of 'F_y', 'M_z'"):
        plots.rig_fit(fit, rig, ["F_x"])


def test_float32_tyres_are_drawn(fit, rig):
    assert plots.rig_fit(fit_of(rig, F_y=np.asarray(jnp.ones(ROWS, jnp.float32))), rig).subfigs

"""Figures of an estimate along a log: rows, the worst part, innovations, the rear axle."""

from collections import namedtuple
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Recording, estimators, io, plots
from jaxveh.estimators import sideslip
from jaxveh.plots.innovations import slow_squares
from jaxveh.plots.quantities import quantity

TIME = np.arange(0.0, 150.0, 0.05)
WAVE = np.sin(0.3 * TIME)
Report = namedtuple("Report", ("sideslip", "v_y", "slip_angle_rear", "F_yr"))
Balance = namedtuple("Balance", ("slip_balance",))


def an_estimate(**more):
    flat = np.ones_like(TIME)
    mean = Report(0.05 * WAVE, WAVE, 0.02 * WAVE, 3000.0 * WAVE)._replace(**more.pop("mean", {}))
    std = Report(0.01 * flat, 0.2 * flat, 0.01 * flat, 100.0 * flat)._replace(**more.pop("std", {}))
    return SimpleNamespace(time=TIME, mean=mean, std=std, **more)


def label(ax):
    return ax.get_title(loc="left")


def line(ax, name):
    (found,) = [one for one in ax.get_lines() if one.get_label() == name]
    return found


def edges(band):
    """Lower and upper edge of a band that is as wide everywhere, about zero."""
    corners = band.get_paths()[0].vertices[:, 1]
    return corners.min(), corners.max()


def test_every_quantity_of_an_estimator_has_its_unit_at_the_axis():
    modules = [one for name in estimators.__all__ if hasattr(one := getattr(estimators, name), "SHOWN")]
    assert len(modules) > 8
    for module in modules:
        for name, unit in module.SHOWN.items():
            shown = quantity(name)
            assert shown == quantity(name, unit), name
            assert bool(shown.unit) == (unit != "-"), name
            assert not shown.unit or shown.label.endswith(f" [{shown.unit}]"), name


def test_bands_of_50_and_95_percent_hold_as_many_draws_of_a_normal_law():
    figure = plots.estimate(an_estimate(mean={"sideslip": 0 * WAVE}), quantities=["sideslip"], seconds=1e3)
    wide, narrow = figure.axes[0].collections
    draws = np.degrees(0.01) * np.random.default_rng(0).normal(size=100_000)
    for band, share in ((wide, 0.95), (narrow, 0.5)):
        low, high = edges(band)
        assert band.get_label() == f"estimate, {100 * share:.0f} % band"
        np.testing.assert_allclose(np.mean((draws > low) & (draws < high)), share, atol=0.005)


def test_several_estimates_show_their_wide_bands_alone():
    figure = plots.estimate({"UKF": an_estimate(), "APF": an_estimate()}, quantities=["v_y"], seconds=1e3)
    assert [band.get_label() for band in figure.axes[0].collections] == ["UKF, 95 % band", "APF, 95 % band"]


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6])
def test_the_legend_of_several_estimates_is_no_wider_than_the_figure(count):
    names = ("extended", "unscented", "particles", "walking", "one of a longer name", "last")[:count]
    figure = plots.estimate({name: an_estimate() for name in names}, {"v_y": WAVE}, ["v_y"], seconds=1e3)
    figure.draw_without_rendering()
    (legend,) = figure.legends
    assert legend.get_window_extent().x1 <= figure.bbox.x1


def test_who_claims_no_spread_has_no_band():
    silent = an_estimate(std={"v_y": np.full_like(TIME, np.nan)})
    figure = plots.estimate({"UKF": an_estimate(), "formula": silent}, quantities=["v_y"], seconds=1e3)
    assert [band.get_label() for band in figure.axes[0].collections] == ["UKF, 95 % band"]
    assert line(figure.axes[0], "formula").get_visible()


def test_a_long_log_is_shown_in_rows_of_about_a_minute_to_one_scale():
    truth = {"sideslip": 0.05 * WAVE - np.radians(0.5)}
    figure = plots.estimate(an_estimate(), truth, ["sideslip"], errors=True)
    assert [label(ax) for ax in figure.axes] == ["sideslip [°]", "error [°]"] * 2
    spans = [ax.get_xlim() for ax in figure.axes]
    np.testing.assert_allclose(spans, [(0.0, TIME[-1] / 2)] * 2 + [(TIME[-1] / 2, TIME[-1])] * 2)
    for one, other in ((0, 2), (1, 3)):
        assert figure.axes[one].get_ylim() == figure.axes[other].get_ylim()
    np.testing.assert_allclose(line(figure.axes[1], "estimate").get_ydata(), 0.5)
    figure.draw_without_rendering()
    assert [text.get_text() for text in figure.axes[3].get_xticklabels()][1:3] == ["80 s", "90 s"]
    # A quantity without a truth has no errors.
    assert len(plots.estimate(an_estimate(), truth, ["sideslip", "v_y"], errors=True).axes) == 6
    assert len(plots.estimate(an_estimate(), quantities=["v_y"], seconds=1.0).axes) == 12


def test_rows_of_no_time():
    with pytest.raises(InputError, match="seconds"):
        plots.estimate(an_estimate(), seconds=0.0)


def log(**more):
    channels = {"v_x": np.full_like(TIME, 20.0), "yaw_rate": 0.1 * WAVE, "steer": 0.02 * WAVE, "a_x": 0 * TIME, **more}
    return Recording(TIME, channels, {"steer": "rad", "yaw_rate": "rad/s"})


def test_the_worst_part_is_about_the_largest_error_and_has_the_channels_below():
    error = np.radians(np.where(np.abs(TIME - 100.0) < 0.04, -4.0, np.where(TIME < 1.0, 2.0, 0.1)))
    figure = plots.closeup(an_estimate(), log(), {"sideslip": 0.05 * WAVE + error})
    assert [label(ax) for ax in figure.axes] == [
        "sideslip [°]",
        "longitudinal speed [m/s]",
        "yaw rate [°/s]",
        "steer [°]",
    ]
    np.testing.assert_allclose(figure.axes[0].get_xlim(), (90.0, 110.0), atol=0.06)
    assert figure.axes[0].get_title(loc="right") == "largest error 4 ° at 100 s"
    shown = line(figure.axes[0], "truth")
    assert shown.get_xdata().min() >= 90.0 - 0.06 and shown.get_xdata().max() <= 110.06
    steer = figure.axes[3].get_lines()[0]
    np.testing.assert_allclose(steer.get_ydata(), np.degrees(0.02 * np.sin(0.3 * steer.get_xdata())))


def test_without_a_truth_the_widest_band_is_the_worst_and_slow_rows_do_not_count():
    std = np.where(TIME > 149.0, 0.05, np.where(TIME < 1.0, 1.0, 0.01))
    speed = np.where(TIME < 1.0, 0.5, 20.0)
    figure = plots.closeup(an_estimate(std={"sideslip": std}), log(v_x=speed), channels=["v_x"], least_speed=3.0)
    np.testing.assert_allclose(figure.axes[0].get_xlim(), (TIME[-1] - 20.0, TIME[-1]))
    assert figure.axes[0].get_title(loc="right").startswith("widest 95 % band, ±5.6 ° at 149")
    anywhere = plots.closeup(an_estimate(std={"sideslip": std}), log(v_x=speed))
    np.testing.assert_allclose(anywhere.axes[0].get_xlim(), (0.0, 20.0))
    with pytest.raises(InputError, match="no row at 30 m/s or more"):
        plots.closeup(an_estimate(), log(), least_speed=30.0)
    with pytest.raises(InputError, match="3000 rows estimated, 100 in the recording"):
        plots.closeup(an_estimate(), log().rows(slice(0, 100)))


def filtered(innovation):
    name = Balance(innovation)
    info = SimpleNamespace(innovation=name, innovation_std=Balance(np.full_like(TIME, 2.0)), whitened=None)
    return SimpleNamespace(time=TIME, info=info)


def test_innovations_of_right_spreads_stay_in_their_bands_and_others_do_not():
    white = np.random.default_rng(1).normal(size=TIME.size)
    figure = plots.innovations(SimpleNamespace(filtered=filtered(2.0 * white)), lags=40)
    squared, correlation = figure.axes
    assert label(squared) == "normalised innovation squared of slip balance [1]"
    assert squared.get_ylim()[0] > 0 and squared.get_xlabel() == "time [s]" and correlation.get_xlabel() == "lag [s]"
    rows = line(squared, "a row")
    np.testing.assert_allclose(rows.get_ydata(), np.clip(white**2, 1e-3, 1e2))
    mean = np.asarray(line(squared, "mean over 1 s").get_ydata())
    (band,) = [patch for patch in squared.patches if patch.get_label().startswith("95 %")]
    low, high = band.get_extents().transformed(squared.transData.inverted()).intervaly
    assert 0.9 < np.mean((mean > low) & (mean < high)) < 1.0
    np.testing.assert_allclose(np.mean(mean), np.mean(white**2), rtol=0.01)
    by_row, _, _, by_second, *_ = squared.texts[0].get_text().split("mean ")[1].split()
    np.testing.assert_allclose([float(by_row), float(by_second)], 1.0, atol=0.25)
    assert int(correlation.texts[0].get_text().split(" %")[0]) >= 85
    # Errors that last: small row by row, too large over a second.
    slow = np.repeat(np.random.default_rng(2).normal(size=TIME.size // 20), 20) * 0.5
    figure = plots.innovations(filtered(2.0 * slow), lags=40)
    assert figure.axes[0].texts[0].get_text().startswith("expected 1; mean 0.2")
    assert int(figure.axes[1].texts[0].get_text().split(" %")[0]) < 60
    with pytest.raises(InputError, match="no row has a measurement"):
        plots.innovations(filtered(np.full_like(TIME, np.nan)))


def test_means_of_innovations_are_of_rows_of_which_half_are_measured():
    step = float(np.median(np.diff(TIME)))
    white = np.random.default_rng(3).normal(size=TIME.size)
    gone = (np.arange(TIME.size) >= 400) & (np.arange(TIME.size) < 700)
    (one,) = plots.innovation_points(filtered(2.0 * np.where(gone, np.nan, white)), seconds=100 * step, lags=20)
    np.testing.assert_array_equal(np.isnan(one.squared), gone)
    assert np.isnan(one.mean[455:645]).all() and np.isfinite(one.mean[:345]).all()
    np.testing.assert_allclose(one.mean[200], np.mean(one.squared[150:250]), rtol=0.05)
    np.testing.assert_allclose(one.lag, step * np.arange(1, 21), rtol=1e-9)
    assert one.low < 1.0 < one.high and one.by_row == pytest.approx(1.0, abs=0.15)


def test_sums_of_rows_are_judged_by_their_own_spread():
    draws = np.random.default_rng(3).normal(size=100_000)
    np.testing.assert_allclose(slow_squares(draws, 10), 1.0, atol=0.04)
    np.testing.assert_allclose(slow_squares(np.repeat(draws[:10_000], 10), 10), 10.0, rtol=0.05)
    gaps = np.where(np.arange(100_000) % 10 == 0, np.nan, draws)
    np.testing.assert_allclose(slow_squares(gaps, 10), 1.0, atol=0.04)
    assert np.isnan(slow_squares(draws[:5], 10))


CAR = io.CarSpecification(1400.0, 2000.0, 1.1, 1.6, 9e4, 1.2e5)


def test_the_rear_axle_shows_the_curve_of_its_own_law_and_where_the_log_was():
    system = sideslip.model(CAR).system
    s, g, n = (float(value) for value in (system.stiffness, system.grip, system.shape))
    found = plots.rear_axle_points(CAR, an_estimate(), log())
    within = np.isfinite(found.share)
    a = found.slip[within]
    np.testing.assert_allclose(found.share[within], s * a / (1 + np.abs(s * a / g) ** n) ** (1 / n), atol=2e-4)
    load = 1400.0 * 9.81 * 1.1 / 2.7
    np.testing.assert_allclose(found.visited_share, 3000.0 * WAVE / load, rtol=1e-3)
    assert found.low is None and found.turning.all()
    braking = plots.rear_axle_points(CAR, an_estimate(), log(a_x=np.where(TIME < 75.0, -8.0, 0.0)))
    np.testing.assert_array_equal(braking.turning, TIME >= 75.0)
    # Slow rows are left out.
    slow = plots.rear_axle_points(CAR, an_estimate(), log(v_x=np.where(TIME < 75.0, 1.0, 20.0)))
    assert slow.visited_slip.size == np.sum(TIME >= 75.0)
    figure = plots.rear_axle(CAR, an_estimate(), log())
    (ax,) = figure.axes
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("slip angle of the rear axle [°]", "lateral force over load [1]")
    np.testing.assert_allclose(line(ax, "visited").get_xdata(), np.degrees(0.02 * WAVE))
    np.testing.assert_allclose(line(ax, "curve of the car file").get_ydata(), found.share)


def test_the_band_of_a_calibrated_curve_is_what_its_covariance_says():
    from jaxveh import Parameters
    from jaxveh._core.parameter import resolve
    from jaxveh.estimators import Calibration, Span
    from jaxveh.fitting import Fit

    model = sideslip.model(CAR)
    chosen = resolve(model, lambda m: (m.system.stiffness,))
    z = jnp.log(model.system.stiffness)[None]
    fit = Fit(
        parameters=Parameters({"stiffness": model.system.stiffness}), parameters_std=Parameters({"stiffness": 0.0}),
        unconstrained=z, covariance=jnp.array([[0.05**2]]), cost=jnp.zeros(()), steps=jnp.zeros(()), result=jnp.zeros((), int),
        model=model, chosen=chosen,
    )  # fmt: skip
    found = plots.rear_axle_points(Calibration("sideslip", fit, (Span(0.0, 1.0),)), an_estimate(), log())
    near = np.argmin(np.abs(found.slip - 0.004))  # where the force goes with the stiffness
    np.testing.assert_allclose(found.high[near] / found.share[near], np.exp(1.96 * 0.05), rtol=0.02)
    np.testing.assert_allclose(found.low[near] / found.share[near], np.exp(-1.96 * 0.05), rtol=0.02)

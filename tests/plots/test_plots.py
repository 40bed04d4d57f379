"""Figures show the data that they were given, in the units that the axes name."""

from collections import namedtuple
from types import SimpleNamespace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Parameters, Recording, plots, vehicles
from jaxveh.tyres import Contact

TIME = np.linspace(0.0, 2.0, 21)
WAVE = np.sin(TIME)


def line(ax, name):
    (found,) = [one for one in ax.get_lines() if one.get_label() == name]
    return found


def label(ax):
    """What the y axis shows, above the panel."""
    return ax.get_title(loc="left")


def drive():
    channels = {"yaw_rate": WAVE, "true.yaw_rate": 0.9 * WAVE, "steer": 0.1 * WAVE, "a_x": np.full(21, np.nan)}
    return Recording(TIME, channels, {"yaw_rate": "rad/s", "steer": "deg", "oil": "degC"})


def test_recording_shows_channels_in_readable_units_and_truth_beside():
    figure = plots.recording(drive(), ["yaw_rate", "steer"])
    first, second = figure.axes
    assert label(first) == "yaw rate [°/s]"
    np.testing.assert_allclose(line(first, "measured").get_ydata(), np.degrees(WAVE))
    np.testing.assert_allclose(line(first, "truth").get_ydata(), np.degrees(0.9 * WAVE))
    # A unit that the file gave is shown as it is.
    assert label(second) == "steer [deg]"
    np.testing.assert_allclose(line(second, "measured").get_ydata(), 0.1 * WAVE)
    assert second.get_xlabel() == "time [s]"


def test_recording_by_default_shows_what_was_measured_and_says_what_is_silent():
    figure = plots.recording(drive(), spans=[(0.0, 1.0, "calibration")])
    assert [label(ax) for ax in figure.axes] == [
        "yaw rate [°/s]",
        "longitudinal acceleration [m/s²]",
        "steer [deg]",
    ]
    assert [text.get_text() for text in figure.axes[1].texts] == ["no finite sample"]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["calibration", "measured", "truth"]


def test_samples_of_a_slow_device_are_dots():
    speed = np.where(np.arange(21) % 5 == 0, 20.0 + TIME, np.nan)
    speed[6] = 20.0
    (ax,) = plots.recording(Recording(TIME, {"speed": speed}), ["speed"]).axes
    (dots,) = [one for one in ax.get_lines() if one.get_marker() == "."]
    np.testing.assert_allclose(dots.get_xdata(), TIME[[0, 10, 15, 20]])
    np.testing.assert_allclose(dots.get_ydata(), speed[[0, 10, 15, 20]])
    (line_only,) = plots.recording(drive(), ["steer"]).axes
    assert {one.get_marker() for one in line_only.get_lines()} == {"None"}


def test_recording_refuses_unknown_channels():
    with pytest.raises(InputError, match="unknown name"):
        plots.recording(drive(), ["yaw_rat"])
    with pytest.raises(InputError, match="no channel to show"):
        plots.recording(drive(), [])


def an_estimate():
    report = namedtuple("Report", ("sideslip", "front_B"))
    flat = np.ones_like(WAVE)
    return SimpleNamespace(time=TIME, mean=report(0.1 * WAVE, 7 * flat), std=report(0.02 * flat, 0.5 * flat))


def test_estimate_shows_mean_band_and_truth():
    truth = {"sideslip": 0.1 * WAVE + 0.01}
    others = {"open-loop linear model": {"sideslip": 0.2 * WAVE}}
    figure = plots.estimate(an_estimate(), truth, others=others)
    first, second = figure.axes
    assert label(first) == "sideslip [°]"
    assert label(second) == "front B"
    np.testing.assert_allclose(line(first, "estimate").get_ydata(), np.degrees(0.1 * WAVE))
    np.testing.assert_allclose(line(first, "truth").get_ydata(), np.degrees(truth["sideslip"]))
    np.testing.assert_allclose(line(first, "open-loop linear model").get_ydata(), np.degrees(0.2 * WAVE))
    band, half = first.collections
    assert half.get_label() == "estimate, 50 % band"
    assert band.get_label() == "estimate, 95 % band"
    corners = band.get_paths()[0].vertices[:, 1]
    np.testing.assert_allclose(corners.min(), np.degrees(np.min(0.1 * WAVE) - 1.959964 * 0.02), rtol=1e-6)


def test_errors_beside_are_the_estimate_less_the_truth():
    figure = plots.estimate(an_estimate(), {"sideslip": 0.1 * WAVE + 0.01}, errors=True)
    _, beside, _, nothing_to_compare = figure.axes
    assert not nothing_to_compare.get_visible()
    assert label(beside) == "error [°]"
    np.testing.assert_allclose(line(beside, "estimate").get_ydata(), np.degrees(-0.01))
    with pytest.raises(InputError, match="errors need a truth"):
        plots.estimate(an_estimate(), errors=True)


def test_estimate_refuses_a_truth_of_another_length_and_unknown_quantities():
    with pytest.raises(InputError, match="must agree"):
        plots.estimate(an_estimate(), {"sideslip": WAVE[:-1]})
    with pytest.raises(InputError, match="unknown name"):
        plots.estimate(an_estimate(), quantities=["slip"])
    with pytest.raises(InputError, match="no estimate"):
        plots.estimate({})


def stiffer(car, share):
    return eqx.tree_at(lambda c: c.front.D, car, car.front.D * share)


def test_force_curves_show_forces_over_the_visited_slips_and_errors_in_percent_of_the_peak():
    car = vehicles.passenger_car()
    visited = {"front": np.radians([-3.0, 6.0]), "rear": np.radians([-2.0, 2.0])}
    figure = plots.force_curves({"truth": car, "UKF": stiffer(car, 1.02)}, visited)
    front, rear, error, _ = figure.axes
    assert front.get_title(loc="left") == "front axle"
    assert front.get_ylabel() == "lateral force [kN]"
    assert error.get_xlabel() == "slip angle [°]"
    assert error.get_ylabel() == "error [% of peak]"
    shown = line(front, "truth")
    slip = np.asarray(shown.get_xdata())
    np.testing.assert_allclose([slip[0], slip[-1]], [-3.0, 6.0])
    forces = car.front.forces(Contact(slip_angle=jnp.radians(jnp.asarray(slip)))).F_y
    np.testing.assert_allclose(shown.get_ydata(), np.asarray(forces) / 1e3)
    # Two per cent more of D is two per cent more of the greatest force.
    np.testing.assert_allclose(np.max(line(error, "UKF").get_ydata()), 2.0, rtol=1e-9)
    np.testing.assert_allclose(line(rear, "UKF").get_ydata(), line(rear, "truth").get_ydata())


def test_force_curves_band_holds_the_central_draws():
    car = vehicles.passenger_car()
    shares = jnp.linspace(0.5, 1.5, 101)
    wide = lambda tyre: eqx.tree_at(lambda t: t.D, _spread_leaves(tyre, 101), tyre.D * shares)
    draws = eqx.tree_at(lambda c: (c.front, c.rear), car, (wide(car.front), wide(car.rear)))
    figure = plots.force_curves(
        {"prior": car}, {"front": np.radians([0.0, 5.0]), "rear": np.radians([0.0, 5.0])}, draws=draws
    )
    front = figure.axes[0]
    assert len(figure.axes) == 2
    corners = front.collections[0].get_paths()[0].vertices
    last = corners[np.isclose(corners[:, 0], 5.0), 1]
    force = float(car.front.forces(Contact(slip_angle=jnp.radians(5.0))).F_y) / 1e3
    np.testing.assert_allclose([last.min(), last.max()], [0.525 * force, 1.475 * force], rtol=1e-6)


def _spread_leaves(tyre, count):
    import jax

    return jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (count,)), tyre)


def test_force_curves_refuse_missing_slips():
    with pytest.raises(InputError, match="rear"):
        plots.force_curves({"truth": vehicles.passenger_car()}, {"front": np.zeros(3)})


def test_parameters_are_deviations_in_prior_spreads():
    named = lambda B, E: Parameters({"front.B": B, "front.E": E})
    figure = plots.parameters(
        named(7.0, -0.1), {"UKF": named(7.7, -0.1)}, {"UKF": named(0.35, 0.1)}, scale=named(0.7, 0.2)
    )
    (ax,) = figure.axes
    assert "prior standard deviations" in ax.get_xlabel()
    assert [text.get_text() for text in ax.get_yticklabels()] == ["front.B  (7)", "front.E  (-0.1)"]
    (bars,) = ax.containers
    np.testing.assert_allclose(bars.lines[0].get_xdata(), [1.0, 0.0], atol=1e-12)
    low, high = bars.lines[2][0].get_segments()[0][:, 0]
    np.testing.assert_allclose((high - low) / 2, 1.959964 * 0.5, rtol=1e-6)


def test_parameters_refuse_names_that_do_not_agree():
    one, two = {"a": 1}, {"a": 1, "b": 1}
    with pytest.raises(InputError, match=r"mean of UKF has no b; truth has: a, b"):
        plots.parameters(two, {"UKF": one}, {"UKF": one}, scale=two)
    with pytest.raises(InputError, match=r"std of UKF: unknown name\(s\) b; there are: a"):
        plots.parameters(one, {"UKF": one}, {"UKF": two}, scale=one)
    with pytest.raises(InputError, match=r"mean of UKF: a has shape \(3,\): must be one number"):
        plots.parameters(one, {"UKF": {"a": np.ones(3)}}, {"UKF": one}, scale=one)
    with pytest.raises(InputError, match="scale"):
        plots.parameters(one, {"UKF": one}, {"UKF": one}, scale={"a": 0})


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_the_same_figure_is_the_same_file(tmp_path, suffix):
    paths = [plots.save(plots.recording(drive()), tmp_path / f"{name}{suffix}") for name in ("a", "b")]
    first, second = (path.read_bytes() for path in paths)
    assert first == second
    assert len(first) > 1000


def test_save_refuses_other_suffixes(tmp_path):
    with pytest.raises(InputError, match=r"'\.gif'"):
        plots.save(plots.recording(drive()), tmp_path / "a.gif")
    with pytest.raises(InputError, match="plots.save: figure = 'a.png': must be an object with savefig"):
        plots.save("a.png", plots.recording(drive()))
    assert list(tmp_path.iterdir()) == []


def test_settings_and_backend_of_the_user_stay():
    import matplotlib

    before = dict(matplotlib.rcParams)
    plots.recording(drive())
    assert dict(matplotlib.rcParams) == before


def test_a_notebook_shows_a_figure_by_itself():
    assert plots.recording(drive())._repr_png_().startswith(b"\x89PNG")


def test_figures_can_be_drawn_into_ones_own():
    from matplotlib.figure import Figure

    mine = Figure()
    left, right = mine.subfigures(1, 2)
    assert plots.recording(drive(), ["steer"], figure=left) is left
    assert len(left.axes) == 1
    assert right.axes == []


def test_an_estimate_that_diverges_leaves_the_truth_readable():
    one = an_estimate()
    one = SimpleNamespace(time=TIME, mean=one.mean._replace(sideslip=np.exp(20 * TIME)), std=one.std)
    figure = plots.estimate(one, {"sideslip": 0.1 * WAVE}, ["sideslip"])
    bottom, top = figure.axes[0].get_ylim()
    reach = np.degrees(0.1 * (WAVE.max() - WAVE.min()))
    assert top <= np.degrees(0.1 * WAVE.max()) + reach / 2 + 1e-9
    assert bottom < 0 < top


def test_labels_stay_inside_the_figure():
    figure = plots.recording(drive().without("true.yaw_rate"), ["yaw_rate", "steer"])
    figure.draw_without_rendering()
    height = figure.bbox.height
    assert all(ax.get_title(loc="left") for ax in figure.axes)
    assert max(ax.get_tightbbox().y1 for ax in figure.axes) <= height

"""Figures of tyres: forces that are the law's, limits and slopes that are known in closed form, units that fit."""

import jax
import numpy as np
import pytest

from jaxveh import InputError, plots, vehicles
from jaxveh.plots.friction_ellipse import DIRECTIONS, ellipse, limit
from jaxveh.plots.friction_ellipse import POINTS as RATIOS
from jaxveh.plots.gradient_map import POINTS
from jaxveh.tyres import Brush, Contact

LOAD, MU, STIFFNESS, SLIP_STIFFNESS = 4000.0, 0.9, 6e4, 8e4


@pytest.fixture
def brush():
    return Brush(slip_stiffness=SLIP_STIFFNESS, cornering_stiffness=STIFFNESS, friction=MU)


@pytest.fixture
def lateral_only():
    return vehicles.passenger_car().front


@jax.jit
def _forces(law, slip_angle, slip_ratio, load):
    return law.forces(Contact(slip_angle=slip_angle, slip_ratio=slip_ratio, load=load))


def forces_of(law, slip_angle=0.0, slip_ratio=0.0, load=LOAD):
    """The law's forces, one program a shape."""
    return _forces(law, *(np.array(value, float) for value in np.broadcast_arrays(slip_angle, slip_ratio, load)))


def lines(ax, name):
    return [np.stack(one.get_data()) for one in ax.get_lines() if one.get_label() == name]


def panels(figure):
    """Title to panel and its map, (slip ratios, slip angles)."""
    found = [ax for ax in figure.axes if ax.get_visible() and ax.get_title(loc="left")]
    size = (POINTS, POINTS)
    return {ax.get_title(loc="left"): (ax, np.reshape(ax.collections[0].get_array(), size)) for ax in found}


def bar_labels(figure):
    return [ax.get_ylabel() for ax in figure.axes if ax.get_label() == "<colorbar>"]


def test_the_tyre_figure_shows_the_law_s_forces(brush):
    figure = plots.tyre(brush, [2000.0, LOAD])
    across, along, moment, combined = figure.axes
    (shown,) = lines(across, "4 kN")
    found = forces_of(brush, np.radians(shown[0]))
    np.testing.assert_allclose(shown[1], np.asarray(found.F_y) / 1e3, rtol=1e-12)
    np.testing.assert_allclose(lines(moment, "4 kN")[0][1], found.M_z, rtol=1e-12)
    (shown,) = lines(along, "2 kN")
    found = forces_of(brush, slip_ratio=shown[0] / 100, load=2000.0)
    np.testing.assert_allclose(shown[1], np.asarray(found.F_x) / 1e3, rtol=1e-12)
    assert combined.get_ylabel() == "lateral force [kN] at 4 kN"


def test_what_a_law_does_not_have_has_no_panel(lateral_only):
    (across,) = plots.tyre(lateral_only).axes
    assert across.get_ylabel() == "lateral force [kN]" and len(across.get_lines()) == 3


def test_the_limit_of_a_brush_is_a_circle(brush):
    figure = plots.friction_ellipse(brush, LOAD, np.radians([0.0, 3.0]))
    (ax,) = figure.axes
    assert ax.get_aspect() == 1.0
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("longitudinal force [kN] at a load of 4 kN", "lateral force [kN]")
    for name in ("limit", "ellipse of the pure peaks"):
        ((F_x, F_y),) = lines(ax, name)
        np.testing.assert_allclose(np.hypot(F_x, F_y), MU * LOAD / 1e3, rtol=1e-12)
        # All the way round, in steps of no more than some sectors.
        assert np.max(np.abs(np.diff(np.unwrap(np.arctan2(F_y, F_x))))) < 4 * 2 * np.pi / DIRECTIONS
        assert np.hypot(F_x[0] - F_x[-1], F_y[0] - F_y[-1]) < 1e-12


def test_curves_of_a_slip_angle_go_both_ways_with_one_entry_in_the_legend(brush):
    figure = plots.friction_ellipse(brush, LOAD, np.radians([0.0, 3.0]))
    (ax,) = figure.axes
    (straight,) = lines(ax, "slip angle 0°")
    np.testing.assert_array_equal(straight[1], 0.0)
    left, right = lines(ax, "±3°")
    pure = float(forces_of(brush, np.radians(3.0)).F_y) / 1e3
    np.testing.assert_allclose(left[1][RATIOS // 2], pure, rtol=1e-12)
    np.testing.assert_allclose(right[1], -left[1], rtol=1e-12)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "slip angle 0°",
        "±3°",
        "limit",
        "ellipse of the pure peaks",
    ]


def test_the_limit_is_the_greatest_force_of_each_direction():
    F_x, F_y = limit(np.array([1.0, 3.0, 2.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0, -5.0]))
    # Downwards, ahead, to the left, and closed.
    np.testing.assert_array_equal(F_x, [0.0, 3.0, 0.0, 0.0])
    np.testing.assert_array_equal(F_y, [-5.0, 0.0, 1.0, -5.0])


def test_the_ellipse_has_a_peak_of_its_own_each_way():
    F_x, F_y = ellipse(np.array([-2.0, 3.0]), np.array([-4.0, 5.0]))
    found = [F_x.min(), F_x.max(), F_y.min(), F_y.max()]
    np.testing.assert_allclose(found, [-2.0, 3.0, -4.0, 5.0], rtol=1e-4)


def test_slopes_at_zero_slip_are_the_stiffnesses(brush):
    figure = plots.gradient_map(brush, LOAD)
    shown = panels(figure)
    (along, kappa), (across, alpha) = shown.values()
    assert list(shown) == ["longitudinal force over slip ratio", "lateral force over slip angle"]
    assert bar_labels(figure) == ["dF_x/dκ [kN/%]", "dF_y/dα [kN/°]"]
    middle = POINTS // 2
    np.testing.assert_allclose(kappa[middle, middle], SLIP_STIFFNESS / 1e3 / 100, rtol=1e-9)
    np.testing.assert_allclose(alpha[middle, middle], STIFFNESS / 1e3 * np.pi / 180, rtol=1e-9)
    # Pure slip beyond full sliding: nothing more.
    np.testing.assert_allclose(kappa[-1, middle], 0.0, atol=1e-12)
    np.testing.assert_allclose(alpha[middle, -1], 0.0, atol=1e-12)
    assert across.get_xlabel() == "slip angle [°]" and along.get_ylabel() == "slip ratio [%]"
    np.testing.assert_allclose([*along.get_xlim(), *along.get_ylim()], [-18, 18, -30, 30])


def test_colours_are_centred_at_zero(brush):
    for ax, values in panels(plots.gradient_map(brush, LOAD, lambda tyre: tyre.friction)).values():
        low, high = ax.collections[0].get_clim()
        np.testing.assert_allclose([low, high], [-np.abs(values).max(), np.abs(values).max()])


def test_sensitivities_are_differences_of_forces_in_newtons(brush):
    figure = plots.gradient_map(brush, LOAD, lambda tyre: (tyre.friction, tyre.cornering_stiffness))
    shown = panels(figure)
    assert bar_labels(figure)[2:] == ["p dF_x/dp [N]", "p dF_y/dp [N]"] * 2
    angle = np.linspace(-np.radians(18), np.radians(18), POINTS)
    step = 1e-4
    for name, change in (("friction", dict(friction=MU)), ("cornering_stiffness", dict(cornering_stiffness=STIFFNESS))):
        settings = dict(slip_stiffness=SLIP_STIFFNESS, cornering_stiffness=STIFFNESS, friction=MU)
        high, low = (
            forces_of(Brush(**{**settings, **{key: value * share for key, value in change.items()}}), angle, 0.3)
            for share in (1 + step, 1 - step)
        )
        for force in ("F_x", "F_y"):
            expected = (np.asarray(getattr(high, force)) - np.asarray(getattr(low, force))) / (2 * step)
            _, values = shown[f"{force}, p = {name}"]
            np.testing.assert_allclose(values[-1], expected, atol=1e-5 * LOAD)


def test_a_coefficient_that_is_zero_counts_by_its_scale_and_a_silent_one_is_told(brush, lateral_only):
    figure = plots.gradient_map(lateral_only, LOAD, lambda tyre: (tyre.B, tyre.S_h))
    assert list(panels(figure)) == ["lateral force over slip angle", "F_y, p = B", "F_y, p = S_h"]
    assert bar_labels(figure)[-1] == "0.02 dF_y/dp [N]"
    # A shift is a slip angle: 0.02 rad of it.
    (_, slope), _, (_, shift) = panels(figure).values()
    np.testing.assert_allclose(shift, 0.02 * slope * 1e3 * 180 / np.pi, rtol=1e-9, atol=1e-9)
    silent = plots.gradient_map(brush, LOAD, lambda tyre: tyre.half_length).axes[2]
    assert silent.get_title(loc="left") == "p = half_length"
    assert [text.get_text() for text in silent.texts] == ["seen in neither force"]


def test_peaks_are_drawn_where_force_falls_beyond(brush, lateral_only):
    count = lambda law: len(plots.gradient_map(law, LOAD).axes[0].collections)
    # The map and its line at half the greatest slope; then the line of the peak.
    assert count(brush) == 2
    assert count(lateral_only) == 3


@pytest.mark.parametrize("draw", [plots.friction_ellipse, plots.gradient_map])
@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"load": 0.0}, "load = 0.0: must be positive"),
        ({"slip_ratio": -0.1}, "slip_ratio = -0.1: must be positive"),
        ({"slip_angle": np.nan}, "slip_angle = nan: must be positive"),
    ],
)
def test_bad_ranges_are_named(brush, draw, settings, message):
    with pytest.raises(InputError, match=message):
        draw(brush, **{"load": LOAD, **settings})


def test_what_cannot_be_shown_is_named(brush, lateral_only):
    with pytest.raises(InputError, match=r"slip_angles = -0\.1: must be at least 0"):
        plots.friction_ellipse(brush, LOAD, [0.1, -0.1])
    with pytest.raises(InputError, match="MagicFormula has no longitudinal force"):
        plots.friction_ellipse(lateral_only, LOAD)
    with pytest.raises(InputError, match="must pick leaves of Brush"):
        plots.gradient_map(brush, LOAD, lambda tyre: tyre.stiffness)


def test_they_can_be_drawn_into_ones_own_figure(brush):
    from matplotlib.figure import Figure

    left, right = Figure(figsize=(10, 4)).subfigures(1, 2)
    assert plots.friction_ellipse(brush, LOAD, figure=left) is left
    assert plots.gradient_map(brush, LOAD, figure=right) is right
    assert len(left.axes) == 1 and len(right.axes) == 4

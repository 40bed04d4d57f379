"""Figures of fitted parameters and of cars: what is drawn is what they say."""

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from jaxveh import InputError, Parameters, fitting, io, plots, tyres, vehicles

FOUND = Parameters({"B": 9.0, "S_h": -0.01, "E": 0.0})
STD = Parameters({"B": 0.45, "S_h": np.nan, "E": 0.02})


def drawn(figure):
    """Places of dots and half lengths of bars, (p,) each."""
    (container,) = figure.axes[0].containers
    dots, _, (bars,) = container
    halves = [np.ptp(segment[:, 0]) / 2 for segment in bars.get_segments()]
    return np.asarray(dots.get_xdata()), np.array(halves)


class Found:
    parameters, parameters_std = FOUND, STD


def test_deviations_and_bars_are_per_cent_of_the_truth():
    places, halves = drawn(plots.fit(Found, {"B": 10.0, "S_h": 0.02, "E": 0.0}))
    np.testing.assert_allclose(places, [-10.0, -150.0, 0.0])
    # Of zero there is no per cent: one stands for it.
    np.testing.assert_allclose(halves, [1.959964 * 4.5, 0.0, 1.959964 * 2.0], rtol=1e-6)


def test_without_a_truth_bars_are_per_cent_of_the_value():
    places, halves = drawn(plots.fit(Found))
    np.testing.assert_array_equal(places, 0.0)
    np.testing.assert_allclose(halves[0], 1.959964 * 5.0, rtol=1e-6)
    assert drawn(plots.fit(FOUND))[1].max() == 0  # no standard errors


def test_what_no_fit_is_drawn_of():
    with pytest.raises(InputError, match=r"plots.fit: truth: unknown name\(s\) S_h, E; there are: B"):
        plots.fit(Found, {"B": 10.0})
    with pytest.raises(InputError, match="41 parameters: must be 1 to 40"):
        plots.fit(Parameters({f"p{k}": 1.0 for k in range(41)}))
    assert issubclass(fitting.Fit, fitting.AbstractFit) and fitting.Fit.drawn_by == "fit"


def words(figure):
    return {text.get_text() for text in figure.axes[0].texts}


def test_a_car_has_its_lengths():
    car = vehicles.named_car("sedan", "seven-dof")
    front, rear = float(car.front_axle_to_cg), float(car.rear_axle_to_cg)
    expected = {f"{front:.3f}", f"{rear:.3f}", f"{front + rear:.3f} m", f"{float(car.track_front):.3f}"}
    assert expected <= words(plots.car(car))
    one_track = vehicles.passenger_car()
    assert words(plots.car(one_track)) == {
        f"{float(one_track.front_axle_to_cg):.3f}", f"{float(one_track.rear_axle_to_cg):.3f}",
        f"{float(one_track.front_axle_to_cg + one_track.rear_axle_to_cg):.3f} m",
    }  # fmt: skip
    file = io.CarSpecification(1400.0, 2000.0, 1.0, 1.6, 9e4, 1e5, track_front=1.5, track_rear=1.52)
    assert words(plots.car(file)) == {"1.000", "1.600", "2.600 m", "1.500", "1.520"}


def test_a_tyre_with_states_is_drawn_as_it_has_settled():
    law = tyres.Brush(8e4, 6e4, 0.9)
    plain, relaxed = plots.tyre(law), plots.tyre(tyres.Relaxed(law, 0.3, 0.4))
    for one, other in zip(plain.axes[0].lines, relaxed.axes[0].lines, strict=True):
        np.testing.assert_allclose(one.get_ydata(), other.get_ydata(), rtol=1e-6, atol=1e-9)
    assert [line.get_label() for line in plain.axes[0].lines] == ["2 kN", "4 kN", "6 kN"]


def test_rig_data_are_the_rows_that_were_measured():
    force = np.array([1e3, np.nan, 3e3])
    rig = io.RigTable(np.radians([1.0, 2.0, 4.0]), np.zeros(3), np.array([2e3, 3e3, 4e3]), F_y=force, M_z=-force)
    figure = plots.rig(rig)
    dots = [ax.collections[0] for ax in figure.axes[:2]]
    np.testing.assert_allclose(dots[0].get_offsets(), [[1.0, 1.0], [4.0, 3.0]], rtol=1e-12)
    np.testing.assert_allclose(dots[1].get_offsets(), [[1.0, -1e3], [4.0, -3e3]], rtol=1e-12)
    np.testing.assert_array_equal(dots[0].get_array(), [2.0, 4.0])
    assert len(plots.rig(rig, ["M_z"]).axes) == 2  # and the loads' colours
    with pytest.raises(InputError, match=r"plots.rig: unknown name\(s\) F_x; there are: F_y, M_z"):
        plots.rig(rig, ["F_x"])

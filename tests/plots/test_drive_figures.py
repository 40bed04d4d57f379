"""Figures of drives show the data and the numbers that they were given, with units; recordings are made by hand."""

import functools
import math

import jax
import numpy as np
import pytest

from jaxveh import InputError, Recording, diagnostics, manoeuvres, plots, tyres, vehicles
from jaxveh.manoeuvres import MANOEUVRES
from jaxveh.plots.car_outline import footprint, rotate, wheel_forces
from jaxveh.plots.drives import _FIGURES
from jaxveh.plots.panels import round_number
from jaxveh.plots.wheel_loads import wheel_lift

pytestmark = pytest.mark.product

TIME = 0.02 * np.arange(301)
WHEELS = ("fl", "fr", "rl", "rr")


def label(ax):
    """What the y axis shows, above the panel."""
    return ax.get_title(loc="left")


def lines(ax, name):
    return [one for one in ax.get_lines() if one.get_label() == name]


def line(ax, name):
    return lines(ax, name)[0]


def drive(**more):
    """A car that turns slowly to the left at 20 m/s; six seconds."""
    yaw = 0.05 * TIME
    channels = {
        "true.x": 400 * np.sin(yaw), "true.y": 400 * (1 - np.cos(yaw)), "true.yaw": yaw, "true.v_x": 20.0 + 0 * TIME,
        "true.yaw_rate": 0.05 + 0 * TIME, "true.a_y": 1.0 + 0 * TIME, "true.sideslip": 0.001 * TIME, "steer": 0.01 + 0 * TIME,
    }  # fmt: skip
    return Recording(TIME, {**channels, **more})


def with_forces(**more):
    forces = {f"true.F_y_{wheel}": 1000.0 + 0 * TIME for wheel in WHEELS}
    forces |= {f"true.F_x_{wheel}": (-3000.0 if wheel == "fl" else 0.0) + 0 * TIME for wheel in WHEELS}
    return drive(**forces, **more)


def step():
    since = np.maximum(TIME - 1.0, 0.0)
    steer = np.where(TIME >= 1.0, 0.02, 0.0)
    answer = 0.2 * (1 - np.exp(-3 * since) * (np.cos(4 * since) + 0.75 * np.sin(4 * since)))
    return Recording(TIME, {"steer": steer, "yaw_rate": answer, "a_y": 20 * answer, "sideslip": -0.1 * answer})


def test_step_response_marks_the_numbers_of_the_standard():
    figure = plots.step_response(step())
    found = diagnostics.step_response(step())
    assert [label(ax) for ax in figure.axes] == [
        "steer [°]", "yaw rate [°/s]", "lateral acceleration [m/s²]", "sideslip [°]",
    ]  # fmt: skip
    ax = figure.axes[1]
    np.testing.assert_allclose(line(ax, "steady value").get_ydata(), math.degrees(found.steady))
    ((x, y),) = line(ax, "90 % of it").get_xydata()
    np.testing.assert_allclose([x, y], [found.reference + found.response_time, math.degrees(0.9 * found.steady)])
    ((x, y),) = line(ax, "peak").get_xydata()
    np.testing.assert_allclose([x, y], [found.reference + found.peak_response_time, math.degrees(found.peak)])
    assert f"{found.response_time:.3f} s" in ax.get_title(loc="right")
    assert f"{100 * found.overshoot:.1f} % over" in ax.get_title(loc="right")
    assert figure.axes[-1].get_xlabel() == "time [s]"


def test_step_response_counts_from_where_the_quantity_stood():
    offset = step().replace(yaw_rate=step()["yaw_rate"] + 0.1)
    ax = plots.step_response(offset, ["yaw_rate"]).axes[1]
    found = diagnostics.step_response(step())
    np.testing.assert_allclose(line(ax, "steady value").get_ydata(), math.degrees(found.steady + 0.1))


def shaken(gain=4.0):
    time = 0.02 * np.arange(1500)
    steer = 0.01 * sum(np.sin(2 * np.pi * f * time + f) for f in np.arange(0.2, 2.0, 0.1))
    return Recording(time, {"steer": steer, "yaw_rate": gain * steer, "a_y": 50 * steer})


def test_frequency_response_shows_gains_per_degree_and_a_closed_form():
    figure = plots.frequency_response(shaken(), closed_form={"yaw_rate": lambda f: 5.0 * np.exp(-0.5j * f)})
    gain, other, phase, _, coherence, _ = figure.axes
    assert label(gain) == "yaw rate over steer [1/s]"
    assert label(other) == "lateral acceleration over steer [m/s² per °]"
    np.testing.assert_allclose(line(gain, "drive").get_ydata(), 4.0, rtol=1e-6)
    np.testing.assert_allclose(line(other, "drive").get_ydata(), 50 * np.pi / 180, rtol=1e-6)
    np.testing.assert_allclose(line(gain, "closed form").get_ydata(), 5.0)
    np.testing.assert_allclose(
        line(phase, "closed form").get_ydata(), np.degrees(-0.5 * line(phase, "closed form").get_xdata())
    )
    np.testing.assert_allclose(coherence.get_lines()[0].get_ydata(), 1.0, atol=1e-9)
    assert coherence.get_xlabel() == "frequency [Hz]"
    assert len(plots.frequency_response(shaken(), "a_y").axes) == 3


def ramp(gradient=0.004, wheelbase=2.5, speed=20.0):
    a_y = 0.4 * TIME * 2.5
    time = TIME * 4
    steer = gradient * a_y + wheelbase * a_y / speed**2
    channels = {"steer": steer, "a_y": a_y, "yaw_rate": a_y / speed, "v_x": speed + 0 * TIME, "sideslip": -0.001 * a_y}
    return Recording(time, channels)


def test_handling_diagram_draws_and_writes_the_understeer_gradient():
    left, right = plots.handling_diagram(ramp(), 2.5).axes
    assert label(left) == "steer less wheelbase / radius [°]" and label(right) == "sideslip [°]"
    np.testing.assert_allclose(
        line(left, "drive").get_ydata(), np.degrees(0.004 * line(left, "drive").get_xdata()), atol=1e-12
    )
    assert [text.get_text() for text in left.texts] == ["drive: understeer gradient 0.229 ° per m/s²"]
    (x0, y0), (x1, y1) = line(left, "linear to 4 m/s²").get_xydata()
    np.testing.assert_allclose((y1 - y0) / (x1 - x0), math.degrees(0.004))
    assert x1 <= 4.0 < np.max(line(left, "drive").get_xdata())


def test_handling_diagram_of_several_and_without_a_wheelbase():
    figure = plots.handling_diagram({"a": ramp(), "b": ramp(0.002)}, {"a": 2.5, "b": 2.5})
    assert "b: understeer gradient 0.115" in figure.axes[0].texts[0].get_text()
    bare = plots.handling_diagram(ramp())
    assert label(bare.axes[0]) == "steer [°]" and not bare.axes[0].texts


@functools.cache
def dwell_steer():
    steering = manoeuvres.sine_with_dwell(20.0, 0.1)
    return np.asarray(jax.jit(lambda time: steering.inputs(time).steer)(TIME))


def dwell(left=0.1):
    steer = dwell_steer()
    yaw_rate = np.interp(TIME, [0, 1, 1.5, 2.5, 3.9, 4.7, 6], [0, 0, 0.3, -0.4, -left, -left / 2, 0])
    y = np.where(TIME >= 1.0, 3 * (TIME - 1.0) ** 2, 0.0)
    return Recording(TIME, {"steer": steer, "yaw_rate": yaw_rate, "yaw": 0 * TIME, "x": 20 * TIME, "y": y})


def test_sine_with_dwell_says_in_words_whether_it_passed():
    figure = plots.sine_with_dwell(dwell())
    found = diagnostics.sine_with_dwell(dwell())
    steer, yaw_rate, way = figure.axes
    assert steer.get_title(loc="right") == "FMVSS 126: passed"
    first, second = lines(yaw_rate, "within the limit")
    np.testing.assert_allclose(first.get_xdata(), [found.completed + 1.0])
    np.testing.assert_allclose(second.get_xdata(), [found.completed + 1.75])
    limits = [one.get_ydata()[0] for one in lines(yaw_rate, "limit")]
    np.testing.assert_allclose(limits, [-0.35 * math.degrees(found.peak), -0.2 * math.degrees(found.peak)])
    np.testing.assert_allclose(line(way, "limit").get_ydata(), 1.83)
    assert label(way) == "lateral displacement [m]"
    failed = plots.sine_with_dwell(dwell(0.2))
    assert failed.axes[0].get_title(loc="right") == "FMVSS 126: failed (yaw rate left too high)"
    assert lines(failed.axes[1], "beyond the limit")
    slow = dwell().replace(y=0.4 * dwell()["y"])
    titles = {A: plots.sine_with_dwell(slow, steer_at_03g=A).axes for A in (0.02, 0.03, None)}
    assert [axes[0].get_title(loc="right") for axes in titles.values()] == [
        "FMVSS 126: failed (displacement too small)",
        "FMVSS 126: passed (no limit of displacement below 5 A)",
        "FMVSS 126: yaw rate within its limits; displacement not judged without the steer at 0.3 g",
    ]
    assert lines(titles[0.02][2], "limit") and not lines(titles[0.03][2], "limit")
    assert titles[0.03][2].get_title(loc="right").endswith("(not judged)")
    assert len(plots.sine_with_dwell(dwell().without("x", "y").replace(a_y=0 * TIME)).axes) == 2


def braked(**more):
    v_x = np.maximum(20.0 - 8.0 * np.maximum(TIME - 1.0, 0.0), 0.0)
    wheels = {f"omega_{wheel}": 0.9 * v_x / 0.3 + (TIME < 1.0) * 0.1 * v_x / 0.3 for wheel in WHEELS}
    slips = {f"slip_ratio_{wheel}": np.where(TIME < 1.0, 0.0, -0.1) for wheel in WHEELS}
    return Recording(TIME, {"v_x": v_x, "brake_torque": 3000.0 * (TIME >= 1.0), **wheels, **slips, **more})


def test_braking_shows_wheel_speeds_slips_and_deceleration():
    figure = plots.braking(braked())
    speed, slip, deceleration, _ = figure.axes
    v_x = line(speed, "car").get_ydata()
    np.testing.assert_allclose(line(speed, "rear left").get_ydata(), np.where(TIME < 1.0, v_x, 0.9 * v_x), atol=1e-9)
    np.testing.assert_allclose(line(slip, "front right").get_ydata()[-1], -10.0)
    assert np.max(deceleration.get_lines()[0].get_ydata()) == pytest.approx(8.0)
    assert [label(ax) for ax in figure.axes] == [
        "speed [m/s]", "slip ratio [%]", "deceleration [m/s²]", "brake torque, all wheels [kN m]",
    ]  # fmt: skip
    assert "deceleration 8.00 m/s²" in speed.get_title(loc="right")
    given = plots.braking(braked(), wheel_radius=0.6).axes[0]
    np.testing.assert_allclose(line(given, "rear left").get_ydata()[0], 40.0)
    assert len(plots.braking(braked().select(["v_x"])).axes) == 2


def test_loads_shade_the_lift_of_a_wheel():
    loads = {f"load_{wheel}": 4000.0 + 0 * TIME for wheel in WHEELS}
    loads["load_rl"] = np.where((TIME > 2.0) & (TIME < 3.0), 0.0, 4000.0)
    log = Recording(TIME, {**loads, "a_y": TIME})
    up = wheel_lift(log)
    assert up.sum() == 49 and TIME[up][0] == pytest.approx(2.02)
    figure = plots.loads(log)
    (span,) = figure.axes[0].patches
    np.testing.assert_allclose([span.get_x(), span.get_x() + span.get_width()], [2.02, 3.0])
    assert "rear left" in figure.axes[0].get_title(loc="right")
    np.testing.assert_allclose(line(figure.axes[0], "front left").get_ydata(), 4.0)
    axles = plots.loads(Recording(TIME, {"load_front": 7e3 + TIME, "load_rear": 6e3 + TIME})).axes[0]
    assert label(axles) == "axle loads [kN]" and len(axles.get_lines()) == 2


def test_top_view_shows_the_cones_of_a_slalom_whose_lanes_are_open_to_one_side():
    course = manoeuvres.slalom_cones(count=3)
    figure = plots.top_view(with_forces(), course, every=2.0)
    for ax in figure.axes[:-1]:
        np.testing.assert_allclose(ax.get_lines()[0].get_xydata(), [[57.0, 0.0], [75.0, 0.0], [93.0, 0.0]], atol=1e-12)
        assert np.isfinite([*ax.get_xlim(), *ax.get_ylim()]).all()


def test_top_view_shows_path_cars_forces_and_cones():
    course = manoeuvres.iso_3888_1(1.8)
    figure = plots.top_view(with_forces(), course, every=2.0)
    rows, bar = figure.axes[:-1], figure.axes[-1]
    assert label(rows[0]) == "y [m]" and all(ax.get_aspect() == 1.0 for ax in rows)
    widths = [np.diff(ax.get_xlim())[0] for ax in rows]
    np.testing.assert_allclose(widths, widths[0])
    cones = rows[0].get_lines()[0].get_xydata()
    np.testing.assert_allclose(cones, manoeuvres.cones(course))
    shown = {text.get_text() for ax in rows for text in ax.texts}
    assert {"0 s", "2 s", "4 s", "6 s"} <= shown and any(text.endswith(" kN") for text in shown)
    assert bar.get_xlabel() == "speed [m/s]"
    assert plots.top_view(drive(), colour="time").axes[-1].get_xlabel() == "time [s]"


def test_arrows_are_the_wheels_forces_turned_into_the_car():
    recording = with_forces().replace(steer=np.full(TIME.size, math.pi / 2))
    feet = footprint(recording, None, 2.6, 1.5)
    forces = wheel_forces(recording, feet)
    # A front wheel that stands across: along the wheel is the car's left, across it the car's rear.
    np.testing.assert_allclose(forces["fl"][0], [-1000.0, -3000.0], atol=1e-9)
    np.testing.assert_allclose(forces["rr"][0], [0.0, 1000.0])
    assert wheel_forces(drive(), feet) == {}
    np.testing.assert_allclose(rotate([(1.0, 0.0)], math.pi / 2), [[0.0, 1.0]], atol=1e-15)


def test_a_single_track_has_its_forces_at_the_axles():
    recording = drive(**{"true.F_yf": 2000.0 + 0 * TIME, "true.F_yr": 1500.0 + 0 * TIME})
    feet = footprint(recording, vehicles.passenger_car(), None, None)
    assert feet.single and feet.wheels == {"f": (0.96, 0.0), "r": (-1.59, 0.0)}
    forces = wheel_forces(recording, feet)
    np.testing.assert_allclose(forces["f"][0], [-2000 * math.sin(0.01), 2000 * math.cos(0.01)])
    np.testing.assert_allclose(forces["r"][0], [0.0, 1500.0])


def test_the_footprint_is_the_cars_or_scaled_to_a_wheelbase():
    feet = footprint(drive(), vehicles.Travelling(vehicles.passenger_car()), None, 1.4)
    assert (feet.front, feet.rear, feet.track_front) == (0.96, 1.59, 1.4)
    scaled = footprint(drive(), None, 5.4, None)
    np.testing.assert_allclose([scaled.front + scaled.rear, scaled.front / scaled.rear], [5.4, 1.2 / 1.5])


def test_a_standing_car_is_shown_once():
    still = drive(**{"true.x": 0 * TIME, "true.y": 0 * TIME, "true.yaw": 0 * TIME, "true.v_x": 0 * TIME})
    times = [text.get_text() for ax in plots.top_view(still, every=1.0).axes for text in ax.texts]
    assert times == ["0 s"]


# The brake is pressed within the row before t = 1 s: 0.4 m at 20 m/s, then (20^2 - 2^2) / 16 m.
BRAKED = "from 20.0 m/s: mean fully developed deceleration 8.00 m/s², 25.1 m to a tenth"

DRIVES = {
    "step-steer": (step, 4, "steer [°]", "times count from half of the step"),
    "swept-sine": (shaken, 6, "yaw rate over steer [1/s]", ""),
    "random-steering": (shaken, 6, "yaw rate over steer [1/s]", ""),
    "ramp-steer": (ramp, 2, "steer [°]", ""),
    "steady-circle": (ramp, 2, "steer [°]", ""),
    "sine-with-dwell": (dwell, 3, "steer [°]", "FMVSS 126: passed"),
    "braking-in-a-turn": (braked, 4, "speed [m/s]", BRAKED),
    "mu-jump-braking": (braked, 4, "speed [m/s]", BRAKED),
    "iso-lane-change": (with_forces, 7, "y [m]", ""),
    "slalom": (drive, 7, "y [m]", ""),
    "cruise": (drive, 5, "steer [°]", ""),
}  # fmt: skip


@pytest.mark.parametrize("name", DRIVES)
def test_a_drive_has_the_figure_of_its_manoeuvre(name, tmp_path):
    make, count, first, note = DRIVES[name]
    figure = plots.drive(make(), name)
    assert (len(figure.axes), label(figure.axes[0]), figure.axes[0].get_title(loc="right")) == (count, first, note)
    assert plots.save(figure, tmp_path / "drive.png").stat().st_size > 10_000


def test_every_manoeuvre_with_a_figure_is_one():
    assert set(_FIGURES) <= set(MANOEUVRES)
    assert len(plots.drive(drive()).axes) == 5


def test_the_car_gives_the_wheelbase():
    figure = plots.drive(ramp(), "ramp-steer", car=vehicles.passenger_car())
    assert "understeer gradient" in figure.axes[0].texts[0].get_text()


def test_figures_can_be_drawn_into_ones_own():
    from matplotlib.figure import Figure

    mine = Figure(figsize=(8, 9))
    above, below = mine.subfigures(2, 1)
    assert plots.loads(Recording(TIME, {"load_front": TIME, "load_rear": TIME}), figure=above) is above
    assert plots.top_view(drive(), figure=below) is below


def test_round_numbers():
    assert [round_number(value) for value in (0.99, 1.0, 4.9, 5.0, 730.0)] == [0.5, 1.0, 2.0, 5.0, 500.0]


BAD = {
    "unknown manoeuvre": (lambda: plots.drive(drive(), "drift"), "manoeuvre = 'drift': must be one of 'double-lane-change'"),
    "colour": (lambda: plots.top_view(drive(), colour="blue"), "colour = 'blue': must be one of 'speed', 'time'"),
    "every": (lambda: plots.top_view(drive(), every=0.0), "every = 0.0: must be positive"),
    "track": (lambda: plots.top_view(drive(), track=-1.0), "track = -1.0: must be positive"),
    "no position": (lambda: plots.top_view(step()), "no channel 'x'"),
    "no loads": (lambda: plots.loads(step()), "neither load_fl"),
    "radius": (lambda: plots.braking(braked(), wheel_radius=0.0), "wheel_radius = 0.0: must be positive"),
    "no drives": (lambda: plots.handling_diagram({}), "no recording to show"),
    "closed form": (
        lambda: plots.frequency_response(shaken(), "a_y", closed_form={"yaw_rate": abs}),
        "closed_form: unknown name",
    ),
    "still wheels": (
        lambda: plots.braking(braked(**{f"omega_{w}": 0 * TIME for w in WHEELS})),
        "the wheels do not turn in the first row",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_input(name):
    make, words = BAD[name]
    with pytest.raises(InputError) as error:
        make()
    assert words in str(error.value)


def test_a_sweep_has_the_linear_car_beside_it():
    numbers = dict(mass=1500.0, yaw_inertia=2500.0, front_axle_to_cg=1.2, rear_axle_to_cg=1.4)
    car = vehicles.LinearSingleTrack(**numbers, front_stiffness=80000.0, rear_stiffness=90000.0)
    sweep = shaken().replace(v_x=np.full(1500, 20.0))
    drawn = line(plots.drive(sweep, "swept-sine", car=car).axes[0], "closed form")
    np.testing.assert_allclose(drawn.get_ydata()[0], car.yaw_rate_gain(20.0), rtol=0.05)
    # A car with tyres of the same slopes is the same linear car.
    axles = vehicles.SingleTrack(**numbers, front=tyres.Linear(80000.0), rear=tyres.Linear(90000.0))
    same = line(plots.drive(sweep, "random-steering", car=axles).axes[0], "closed form")
    np.testing.assert_allclose(same.get_ydata(), drawn.get_ydata(), rtol=1e-9)
    assert not lines(plots.drive(sweep, "swept-sine").axes[0], "closed form")

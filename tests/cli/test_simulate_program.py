"""`jaxveh simulate`: vehicles, manoeuvres, roads, devices and events by name; numbers and figures; bad input in one line."""

import dataclasses
import json
import math

import jax
import numpy as np
import pytest
from programs import CAR, error_line, run, write_car

from jaxveh import InputError, Recording, io, roads, simulation, vehicles
from jaxveh.cli.drive_report import numbers_of, print_numbers, steer_at_03g
from jaxveh.cli.manoeuvre import course_of, make, parse_manoeuvre
from jaxveh.cli.vehicle import AS_PRINTED, BUILT_IN, vehicle_of
from jaxveh.manoeuvres import MANOEUVRES, USUAL
from jaxveh.sensors import DEVICES, named_devices
from jaxveh.vehicles import kit

QUICK = ("--duration", "1", "--rate", "50", "--manoeuvre", "step-steer", "--set", "start=0.1")
LINEAR = (*QUICK, "--fidelity", "linear", "--set", "ramp=0.05", "--duration", "2")
"""One program for those to whom the car is all the same."""


def simulate(*arguments):
    return run("simulate", *arguments)


def read_json(path):
    return json.loads(path.read_text())


def test_list_shows_all_that_there_is():
    result = simulate("--list")
    assert result.exit_code == 0, result.output
    for names in (BUILT_IN, kit.FIDELITIES, MANOEUVRES, roads.ROADS, DEVICES):
        for name in names:
            assert name in result.stdout
    assert "ramp=0.2 start=1" in result.stdout
    assert "25 m/s, 7°" in result.stdout
    assert "A BMW 320i, rear-wheel drive" in result.stdout


def test_help_teaches_by_examples():
    text = " ".join(simulate("--help").stdout.split())
    for word in (
        "--manoeuvre step-steer",
        "--fidelity seven-dof",
        "--until standstill",
        "--set",
        "--list",
        "split-mu",
        "proving",
    ):
        assert word in text


def test_every_manoeuvre_has_usual_values_and_can_be_made():
    assert set(USUAL) == set(MANOEUVRES)
    car = vehicles.passenger_car()
    for name in MANOEUVRES:
        one = parse_manoeuvre(name, None, None, None, (), car)
        assert make(one, jax.random.key(0)).duration > 0
        assert (course_of(one) is not None) == (name.startswith("iso-") or name == "slalom-course")


def test_what_the_manoeuvre_wants_of_the_car_comes_from_the_car():
    car = vehicle_of("passenger_car", "seven-dof")
    brakes = parse_manoeuvre("braking-in-a-turn", None, None, None, (), car).options
    assert brakes == {"mass": 1420.0, "wheel_radius": pytest.approx(0.3)}
    path = parse_manoeuvre("iso-lane-change", None, None, None, ("wheelbase=3", "width=2"), car)
    understeer = float(vehicles.linear_single_track(car).understeer_gradient)
    assert 0.003 < understeer < 0.008
    assert path.options == {"wheelbase": 3.0, "width": 2.0, "understeer_gradient": understeer}
    assert course_of(path).lanes[0].left == pytest.approx((1.1 * 2 + 0.25) / 2)
    slalom = parse_manoeuvre("slalom-course", None, None, None, ("count=4", "spacing=20"), car)
    assert slalom.options["count"] == 4 and [lane.start for lane in course_of(slalom).lanes] == [60, 80, 100, 120]


def test_a_car_s_file_says_which_wheels_are_steered(tmp_path):
    """With a rear angle of a fifth of the front's it turns by four fifths as much; each wheel has its angle."""
    turned = {}
    for name, more in (("front", ""), ("four-wheel", 'steering = "four-wheel"\nrear_steer_ratio = 0.2\n')):
        car = write_car(tmp_path, more + CAR)
        assert simulate(*LINEAR, "--vehicle", car, "-o", tmp_path / f"{name}.csv").exit_code == 0
        turned[name] = io.read_recording(tmp_path / f"{name}.csv")["true.yaw_rate"][-1]
    np.testing.assert_allclose(turned["four-wheel"], 0.8 * turned["front"], rtol=0.01)
    car = write_car(tmp_path, 'steering = "rear"\n' + CAR)
    assert simulate(*QUICK, "--vehicle", car, "-o", tmp_path / "rear.csv").exit_code == 0
    drive = io.read_recording(tmp_path / "rear.csv")
    assert np.ptp(drive["steer"]) > 0.01 and not np.any(drive["steer_rear"])
    assert drive.unit("steer_rear") == "rad"


def straight_drive():
    time = np.linspace(0.0, 10.0, 501)
    return Recording(time, {"x": 20 * time, "y": 0 * time, "yaw": 0 * time})


@pytest.mark.parametrize(("name", "title"), [("iso-lane-change", "ISO 3888-1"), ("slalom-course", "slalom")])
def test_the_clearance_says_of_what_body_it_is(name, title):
    car = vehicle_of("passenger_car", "single-track")
    found = numbers_of(straight_drive(), parse_manoeuvre(name, None, None, None, (), car), car)
    where = f"{title} (body of 4.5 m x 1.8 m centred on the centre of gravity)"
    assert found[where]["clearance"] < 0


def test_the_sine_with_dwell_is_judged_by_the_cars_own_steer_at_03g(capsys):
    car = vehicle_of("passenger_car", "single-track")
    linear = vehicles.linear_single_track(car)
    straight = 0.3 * 9.80665 * float(linear.wheelbase / (80 / 3.6) ** 2 + linear.understeer_gradient)
    assert steer_at_03g(car) == pytest.approx(straight, rel=1e-6)
    assert steer_at_03g(vehicle_of("passenger_car", "longitudinal")) is None
    print_numbers({"sine with dwell": {"amplitude": 3.5, "stable": True, "responsive": None, "displacement": math.nan}})
    assert capsys.readouterr().out.strip().endswith("sine with dwell: amplitude 3.5, stable yes, responsive not judged")


RATIO = {"four-wheel": 0.25}
"""The rear angle over the front angle at the steer at 0.3 g, by the kind of steering; of the others it is 0."""


@pytest.mark.parametrize("kind", kit.STEERINGS)
def test_the_steer_at_03g_is_that_of_every_steering_or_of_none(kind):
    car = vehicle_of("passenger_car", "single-track")
    make = kit.STEERINGS[kind]
    steered = dataclasses.replace(car, steering=make(RATIO[kind]) if kind in RATIO else make())
    if kind == "independent":
        assert steer_at_03g(steered) is None
        return
    expected = steer_at_03g(car) / (1.0 - RATIO.get(kind, 0.0))
    assert steer_at_03g(steered) == pytest.approx(expected, rel=1e-6)
    assert steer_at_03g(vehicles.Steered(steered, 16.0)) == steer_at_03g(steered)
    alike = dataclasses.replace(car, steering=vehicles.FourWheelSteering(1.0))
    assert steer_at_03g(alike) is None, "wheels that are turned alike turn no car"


@pytest.mark.parametrize("fidelity", [name for name in kit.FIDELITIES if name != "kinematic-trailer"])
def test_every_fidelity_is_made_of_a_named_car(fidelity):
    assert type(vehicle_of("passenger_car", fidelity)) is kit.FIDELITIES[fidelity]


def test_a_car_file_is_made_into_what_its_numbers_reach_for(tmp_path):
    car = write_car(tmp_path)
    assert float(vehicle_of(car, "single-track").mass) == float(vehicle_of(car, "linear").mass) == 1420.0
    line = error_line(simulate("--vehicle", car, "--fidelity", "seven-dof", "-o", tmp_path / "out.csv"))
    assert "SevenDOF needs track_front, track_rear, cg_height" in line


def test_the_car_as_printed_is_a_single_track_alone(tmp_path):
    assert float(vehicle_of(AS_PRINTED).front_axle_to_cg) == 1.59
    line = error_line(simulate("--vehicle", AS_PRINTED, "--fidelity", "linear", "-o", tmp_path / "out.csv"))
    assert "--fidelity of passenger_car_as_printed = 'linear': must be one of 'single-track'" in line


def test_settings_options_and_road_reach_the_drive(tmp_path):
    drive, numbers = tmp_path / "drive.csv", tmp_path / "numbers.json"
    car = write_car(tmp_path)
    extra = ("--vehicle", car, "--fidelity", "linear", "--speed", "15", "--steer-deg", "1", "--set", "ramp=0.1")
    result = simulate(
        *QUICK, *extra, "--devices", "none", "--road", "banked", "--solver", "explicit", "-o", drive, "--json", numbers
    )
    assert result.exit_code == 0, result.output
    recording = io.read_recording(drive)
    assert len(recording) == 51 and "yaw_rate" not in recording
    np.testing.assert_allclose(np.hypot(recording["true.v_x"], recording["true.v_y"]), 15.0)
    steer, time = np.asarray(recording["steer"]), np.asarray(recording.time)
    np.testing.assert_allclose(
        np.interp([0.1, 0.15, 0.2], time, steer), [0, math.radians(0.5), math.radians(1)], atol=0.003
    )
    assert np.ptp(np.asarray(recording["true.bank"])) > 0
    content = read_json(numbers)
    told = content["manifest"]["configuration"]
    assert told["road"] == "banked" and told["options"] == {"start": 0.1, "ramp": 0.1, "duration": 1.0}
    assert told["fidelity"] == "linear" and told["devices"] == "none"
    assert content["numbers"]["peaks"]["a_y"] == pytest.approx(np.max(np.abs(recording["true.a_y"])), rel=1e-6)
    assert content["end"] == 1.0


def test_numbers_of_the_standard_and_figures(tmp_path):
    out, numbers = tmp_path / "figures", tmp_path / "numbers.json"
    result = simulate(*LINEAR, "--out", out, "--json", numbers)
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in out.iterdir()) == ["channels.png", "drive.png", "loads.png", "top_view.png"]
    found = read_json(numbers)["numbers"]["step response of yaw_rate (ISO 7401)"]
    car = vehicle_of("passenger_car", "linear")
    assert found["gain"] == pytest.approx(float(car.yaw_rate_gain(25.0)), rel=0.01)
    assert f"response_time {found['response_time']:.4g}" in result.stdout
    assert read_json(numbers)["file"] is None


def test_a_drive_too_short_for_its_standard_says_so_and_is_written(tmp_path):
    drive = tmp_path / "drive.csv"
    result = simulate(*QUICK, "--duration", "0.5", "--set", "ramp=0.3", "--out", tmp_path / "figures", "-o", drive)
    assert result.exit_code == 0, result.output
    assert "warning: no numbers of step-steer" in result.stderr and "warning: no figure of step-steer" in result.stderr
    assert drive.exists() and (tmp_path / "figures" / "drive.png").exists()


@pytest.mark.parametrize("name", ["production", "proving-ground"])
def test_wheel_speeds_are_measured_where_wheels_spin(name):
    measured = {
        f: named_devices(name, vehicle_of("sedan", f), {"yaw_rate": 0.01, "a_y": 0.1})
        for f in kit.FIDELITIES
        if "trailer" not in f
    }
    for fidelity, suite in measured.items():
        assert ("wheel_speed_fl" in suite.channels) == (fidelity in ("seven-dof", "fourteen-dof")), fidelity


def test_devices_speak_at_their_own_rates(tmp_path):
    drive = tmp_path / "drive.parquet"
    result = simulate(*QUICK, "--devices", "production", "--seed", "2", "-o", drive)
    assert result.exit_code == 0, result.output
    recording = io.read_recording(drive)
    assert {"a_y", "yaw_rate", "steer"} <= set(recording.names)
    spoke = np.isfinite(np.asarray(recording["yaw_rate"]))
    # 100 Hz for the inertial unit, 5 Hz for the satellites, whatever --rate says.
    assert 90 <= spoke.sum() <= 101
    satellites = [name for name in recording.names if np.isfinite(np.asarray(recording[name])).sum() <= 6]
    assert satellites


def test_a_cruise_holds_its_speed(tmp_path):
    drive = tmp_path / "drive.csv"
    named = ("--manoeuvre", "cruise", "--fidelity", "longitudinal", "--speed", "20", "--duration", "30")
    result = simulate(*named, "--set", "speed_std=0", "--rate", "10", "--devices", "none", "-o", drive)
    assert result.exit_code == 0, result.output
    recording = io.read_recording(drive)
    np.testing.assert_allclose(recording["true.v_x"], 20.0, atol=0.3)
    assert np.ptp(np.asarray(recording["drive_torque"])) > 50.0


def test_driver_road_and_devices_draw_from_keys_of_their_own(tmp_path, monkeypatch):
    """Devices fold their place into their key: none of what they get may be the driver's or the road's key."""
    from jaxveh.cli import manoeuvre

    own, used = [], []
    make, named_road = manoeuvre.make, roads.named_road
    monkeypatch.setattr(manoeuvre, "make", lambda one, key: own.append(key) or make(one, key))
    monkeypatch.setattr(roads, "named_road", lambda name, key: own.append(key) or named_road(name, key))

    def stop(car, driver, fitted, key, **options):
        used.extend([key, *[jax.random.fold_in(key, place) for place in range(64)]])
        raise InputError("stop")

    monkeypatch.setattr(simulation, "simulate", stop)
    simulate(*QUICK, "--road", "hills", "--seed", "3", "-o", tmp_path / "out.csv")
    words = lambda key: tuple(np.asarray(jax.random.key_data(key)).tolist())
    drawn = [words(key) for key in (*own, *used)]
    assert len(own) == 2 and len(set(drawn)) == len(drawn) == 67


def test_the_seed_makes_the_hills(tmp_path):
    grades = []
    for seed in (0, 1, 1):
        drive = tmp_path / "drive.csv"
        options = ("--fidelity", "kinematic", "--devices", "none", "--road", "hills", "--seed", seed, "--force")
        result = simulate(*QUICK, *options, "-o", drive)
        assert result.exit_code == 0, result.output
        grades.append(np.asarray(io.read_recording(drive)["true.grade"]))
    assert np.max(np.abs(grades[1] - grades[0])) > 1e-3
    np.testing.assert_array_equal(grades[1], grades[2])


def test_braking_ends_at_standstill(tmp_path):
    drive = tmp_path / "drive.csv"
    settings = ("--set", "brake_at=0.1", "--set", "brake_ramp=0.1", "--speed", "6", "--duration", "3")
    named = ("--manoeuvre", "mu-jump-braking", "--fidelity", "longitudinal", "--until", "standstill")
    result = simulate(*named, *settings, "--rate", "50", "--devices", "none", "-o", drive)
    assert result.exit_code == 0, result.output
    recording = io.read_recording(drive)
    assert 0.5 < recording.time[-1] < 2.0
    assert 0.05 < recording["true.v_x"][-1] < 0.5
    assert "braking (UN R13-H): " in result.stdout and "mean_deceleration" in result.stdout
    assert "note: --until" not in result.stdout


def test_an_event_that_does_not_happen_is_told(capsys):
    from jaxveh import Recording
    from jaxveh.cli.simulate import _print

    _print({}, Recording([0.0, 0.5, 1.0], {}), "standstill", 1.0)
    assert "note: --until standstill: it does not happen within 1 s." in capsys.readouterr().out
    _print({}, Recording([0.0, 0.5], {}), "standstill", 1.0)
    assert "--until" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--manoeuvre", "drift"), "--manoeuvre = 'drift': must be one of 'double-lane-change'"),
        (
            ("--manoeuvre", "step-steer", "--set", "radius=40"),
            "--set radius=40: step-steer has no option 'radius'; there are: ramp",
        ),
        (("--set", "period"), "--set period: must be NAME=VALUE, such as --set start=2."),
        (("--set", "period=fast"), "--set period=fast: 'fast' is not a number."),
        (("--set", "speed=30"), "--set speed=30: speed has an option of its own, --speed."),
        (("--manoeuvre", "slalom-course", "--set", "count=2.5"), "--set count=2.5: '2.5' is not a whole number."),
        (("--set", "period=-1"), "period = -1.0: must be positive"),
        (("--fidelity", "42-dof"), "--fidelity = '42-dof': must be one of 'longitudinal'"),
        (("--road", "moon"), "road = 'moon': must be one of level"),
        (("--devices", "radar"), "--devices = 'radar': must be one of 'none'"),
        (("--solver", "magic"), "--solver = 'magic': must be one of 'auto'"),
        (("--until", "dawn"), "--until = 'dawn': must be one of 'standstill', 'wheel-lift'"),
        (("--vehicle", "tank"), "--vehicle tank: must be the path of a .toml file"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(tmp_path, arguments, words):
    line = error_line(simulate(*arguments, "-o", tmp_path / "out.csv"))
    assert words in line
    assert list(tmp_path.iterdir()) == []


def test_an_event_that_the_car_cannot_have_is_refused(tmp_path):
    result = simulate(*QUICK, "--until", "wheel-lift", "-o", tmp_path / "out.csv")
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1].startswith("error: wheel_lift: the car has no load per wheel")
    assert list(tmp_path.iterdir()) == []


def test_nothing_to_write_is_refused():
    assert "nothing to write" in error_line(simulate("--manoeuvre", "step-steer"))


def test_a_product_that_exists_is_kept_unless_forced(tmp_path):
    drive = tmp_path / "drive.csv"
    drive.write_text("mine")
    assert "exists already" in error_line(simulate(*LINEAR, "-o", drive))
    assert drive.read_text() == "mine"
    assert simulate(*LINEAR, "-o", drive, "--force").exit_code == 0
    assert len(io.read_recording(drive)) == 101

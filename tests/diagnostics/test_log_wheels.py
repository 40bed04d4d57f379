"""The check of a log compares the wheels with each other and with the yaw rate, and finds angles of counters that overflow."""

import numpy as np
import pytest

from jaxveh import Recording
from jaxveh.diagnostics import check_log

TRACK, RADIUS = 1.6, 0.33
CORNERS = {"fl": -1.0, "fr": 1.0, "rl": -1.0, "rr": 1.0}
OTHER = {"fl": "fr", "fr": "fl", "rl": "rr", "rr": "rl"}


def drive(seed=0, scale=1.0, kind="wheel_speed"):
    """A drive in bends, each wheel with noise of its own; wheel speeds, or `omega` in rad/s."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 60.0, 0.01)
    v_x = 18.0 + 5.0 * np.sin(0.2 * time)
    yaw_rate = 0.15 * np.sin(0.5 * time + seed) + 0.05 * np.sin(1.7 * time)
    wheels = {
        f"{kind}_{at}": scale * (v_x + 0.5 * side * TRACK * yaw_rate) + 0.02 * rng.normal(size=time.size)
        for at, side in CORNERS.items()
    }
    channels = {"v_x": v_x, "yaw_rate": yaw_rate, "yaw": np.cumsum(yaw_rate) * 0.01, **wheels}
    return time, channels


def told(time, channels, *beginnings):
    """The findings of at least a warning about channels that begin so."""
    found = check_log(Recording(time, channels))
    return [one for one in found if one.severity in ("warning", "error") and one.channel.startswith(beginnings)]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["wheel_speed", "omega"])
def test_sound_wheels_and_headings_raise_no_alarm(seed, kind):
    time, channels = drive(seed, 1.0 if kind == "wheel_speed" else 1.0 / RADIUS, kind)
    wrapped = {"yaw": np.mod(channels["yaw"], 2 * np.pi), "course": np.mod(channels["yaw"] + 3.0, 2 * np.pi)}
    assert not told(time, channels | wrapped, "wheel", "omega", "yaw", "course")
    assert not told(time, channels | {name: np.degrees(one) for name, one in wrapped.items()}, "wheel", "omega")


@pytest.mark.parametrize("kind", ["wheel_speed", "omega"])
@pytest.mark.parametrize("axles", ["f", "r", "fr"])
def test_sides_that_are_swapped_are_an_error(kind, axles):
    time, channels = drive(1, 1.0 if kind == "wheel_speed" else 1.0 / RADIUS, kind)
    swapped = {f"{kind}_{at}": channels[f"{kind}_{OTHER[at]}"] for at in CORNERS if at[0] in axles}
    found = told(time, channels | swapped, kind)
    assert [one.channel for one in found] == [f"{kind}_{axle}l, {kind}_{axle}r" for axle in axles]
    assert all(one.severity == "error" and "swapped" in one.message and one.values["slope"] < 0 for one in found)


@pytest.mark.parametrize("without_speed", [False, True])
@pytest.mark.parametrize("factor", [3.6, 1 / 0.44704, 1.0 / RADIUS, 1 / 3.6, 0.0])
@pytest.mark.parametrize("at", CORNERS)
def test_one_corner_in_another_unit_is_an_error(at, factor, without_speed):
    time, channels = drive(2)
    name = f"wheel_speed_{at}"
    channels[name] = factor * channels[name]
    if without_speed:
        del channels["v_x"]
    found = [one for one in told(time, channels, name) if "ratio" in one.values]
    assert [one.channel for one in found] == [name] and found[0].severity == "error"
    assert found[0].values["ratio"] == pytest.approx(factor, rel=0.02, abs=1e-6)


@pytest.mark.parametrize("name", ["yaw", "heading", "course"])
@pytest.mark.parametrize("bits", [15, 16])
@pytest.mark.parametrize("step", [0.01, 0.1])
def test_an_angle_of_a_counter_that_overflows_is_an_error(name, bits, step):
    time, channels = drive()
    degrees = 2.0 ** (bits - 1) * step - 10.0 + np.degrees(channels.pop("yaw"))
    count = np.round(degrees / step)
    channels[name] = np.radians(((count + 2 ** (bits - 1)) % 2**bits - 2 ** (bits - 1)) * step)
    turns = np.count_nonzero(np.abs(np.diff(channels[name])) > 1.0)
    found = [one for one in told(time, channels, name) if "jump" in one.values]
    assert turns and len(found) == 1 and found[0].severity == "error"
    assert found[0].values["count"] == turns and abs(found[0].values["jump"]) == pytest.approx(
        np.radians(2.0**bits * step), rel=0.01
    )


@pytest.mark.parametrize("rate", [1.0, 2.0, 5.0])
@pytest.mark.parametrize("low", [0.0, -np.pi])
@pytest.mark.parametrize("seed", range(3))
def test_a_course_that_a_slow_receiver_repeats_is_no_counter_that_overflows(rate, low, seed):
    """A car in tight bends: between two samples it turns by up to 90 degrees, and the compass by a whole turn more or less."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 120.0, 0.05)
    yaw_rate = 1.5 * np.sin(0.31 * time + rng.uniform(0, 6))
    course = low + np.mod(np.cumsum(yaw_rate) * 0.05 + 0.02 * rng.normal(size=time.size) - low, 2 * np.pi)
    held = course[(np.floor(time * rate + 1e-9) / rate / 0.05 + 1e-9).astype(int)]
    assert np.count_nonzero(np.abs(np.diff(held)) > np.pi) > 2
    found = told(time, {"speed": np.full(time.size, 15.0) + np.sin(time), "course": held}, "course")
    assert not [one for one in found if "jump" in one.values]


def test_a_car_that_stands_has_any_course():
    time, channels = drive()
    stands = time < 20.0
    random = np.random.default_rng(0).uniform(-np.pi, np.pi, time.size // 50 + 1).repeat(50)[: time.size]
    still = {name: np.where(stands, 0.0, channels[name]) for name in channels if name != "yaw"}
    assert not told(time, still | {"course": np.where(stands, random, channels["yaw"])}, "course")


TURNS = {
    "0 to 2 pi": (2 * np.pi, 0.0),
    "-pi to pi": (2 * np.pi, -np.pi),
    "0 to 360": (360.0, 0.0),
    "-180 to 180": (360.0, -180.0),
}


@pytest.mark.parametrize(
    "name", ["yaw", "heading", "course", "GPS Heading", "bearing", "HEADING_MOTION", "vehicleCourse"]
)
@pytest.mark.parametrize("form", TURNS)
@pytest.mark.parametrize("seed", range(2))
def test_a_direction_that_swings_about_its_jump_has_no_spikes(name, form, seed):
    """A car that drives north for a while: its compass goes to and fro between 0 and 360."""
    turn, low = TURNS[form]
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 60.0, 0.04)
    angle = low + turn * (0.2 * np.sin(0.1 * time) + 0.002 * rng.normal(size=time.size))
    angle[time > 55.0] = low + 0.002 * turn * rng.normal(size=np.count_nonzero(time > 55.0))
    wrapped = low + np.mod(angle - low, turn)
    assert np.count_nonzero(np.abs(np.diff(wrapped)) > 0.5 * turn) > 20
    other = {"v_x": 20.0 + np.sin(time), "rate": np.sin(time)}
    assert not [one for one in told(time, {name: wrapped, **other}, name) if "spike" in one.message]
    wild = wrapped.copy()
    wild[300] = low + np.mod(wild[300] + 0.3 * turn - low, turn)
    found = [one for one in told(time, {name: wild, **other}, name) if "spike" in one.message]
    assert len(found) == 1 and found[0].values["count"] == 1 and found[0].values["time"] == pytest.approx(time[300])


@pytest.mark.parametrize("name", ["yaw_rate", "HEADING_RATE", "Yaw Velocity", "gyro yaw", "a_y"])
def test_a_spike_of_a_whole_turn_in_what_is_no_direction_is_found(name):
    time = np.arange(0.0, 20.0, 0.01)
    values = 0.03 * np.sin(time) + 0.005 * np.random.default_rng(1).normal(size=time.size)
    values[900] -= 6.25
    found = [one for one in told(time, {"v_x": 20.0 + np.sin(time), name: values}, name) if "spike" in one.message]
    assert len(found) == 1 and found[0].values["count"] == 1

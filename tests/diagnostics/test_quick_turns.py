"""The check of a log of quick turns: the sideslip's own rate and a late compass are no wrong unit and no wrong sign."""

import zlib

import numpy as np
import pytest

from jaxveh import InputError, Recording, vehicles
from jaxveh.diagnostics import check_log
from jaxveh.diagnostics import kit as kit_of_checks
from jaxveh.vehicles import kit

TIME = 0.01 * np.arange(1500)


def linear_cars():
    """The files of all cars by name that have both stiffnesses, as a linear single track needs them."""
    for name, make in kit.CARS.items():
        try:
            car = vehicles.specification_of(make())
        except InputError:
            continue
        yield name, car


CARS = dict(linear_cars())


def drive(car, speed, frequency, seed):
    """A linear single track on a sine of steer, from its frequency response, with the noise of usual sensors."""
    m, I_z, a, b = car.mass, car.yaw_inertia, car.front_axle_to_cg, car.rear_axle_to_cg
    C_f, C_r = float(car.front_cornering_stiffness), float(car.rear_cornering_stiffness)
    A = -np.array([
        [(C_f + C_r) / (m * speed), (a * C_f - b * C_r) / (m * speed) + speed],
        [(a * C_f - b * C_r) / (I_z * speed), (a * a * C_f + b * b * C_r) / (I_z * speed)],
    ])  # fmt: skip
    omega, steer = 2 * np.pi * frequency, 0.02
    v_y, r = np.linalg.solve(1j * omega * np.eye(2) - A, np.array([C_f / m, a * C_f / I_z])) * steer
    a_y = 1j * omega * v_y + speed * r
    rng = np.random.default_rng(seed)
    wave = lambda of, noise: (of * np.exp(1j * omega * TIME)).imag + noise * rng.normal(size=TIME.size)
    channels = {
        "steer": wave(steer, 1e-4),
        "v_x": speed + wave(0, 0.03),
        "yaw_rate": wave(r, 3e-3),
        "a_y": wave(a_y, 0.05),
    }
    angles = {"heading": wave(r / (1j * omega), 1e-3), "course": wave(a_y / speed / (1j * omega), 1e-3)}
    return Recording(TIME, channels), angles


def errors(recording, car):
    return [(one.channel, one.message) for one in check_log(recording, car=car) if one.severity == "error"]


def test_there_are_cars_of_every_size():
    assert len(CARS) >= 8 and max(car.mass for car in CARS.values()) > 5 * min(car.mass for car in CARS.values())


@pytest.mark.parametrize("name", CARS)
def test_quick_turns_of_a_linear_car_are_no_fault(name):
    """In quick turns a_y is any share of v_x yaw_rate: dv_y/dt takes the rest, and the rest looked like mph, km/h or g."""
    car, seed = CARS[name], zlib.crc32(name.encode())
    for speed in (8.0, 20.0, 35.0):
        for frequency in (0.25, 0.5, 0.7, 1.0, 1.5, 2.0):
            log, _ = drive(car, speed, frequency, seed)
            for told in (car, None):
                assert not errors(log, told), (speed, frequency, told)


@pytest.mark.parametrize("name", CARS)
@pytest.mark.parametrize(("wrong", "factor"), [("v_x", 3.6), ("a_y", 1 / 9.81), ("yaw_rate", 180 / np.pi)])
def test_in_slow_turns_a_wrong_unit_is_still_an_error(name, wrong, factor):
    car = CARS[name]
    log, _ = drive(car, 15.0, 0.15, 1)
    for told in (car, None):
        found = errors(log.replace(**{wrong: factor * np.asarray(log[wrong])}), told)
        assert any(channel == wrong for channel, _ in found), (told, found)


@pytest.mark.parametrize("name", CARS)
def test_in_quick_turns_a_wrong_unit_is_never_silent(name):
    log, _ = drive(CARS[name], 15.0, 0.7, 2)
    found = check_log(log.replace(a_y=np.asarray(log["a_y"]) / 9.81), car=CARS[name])
    (told,) = [one for one in found if "times v_x yaw_rate" in one.message]
    assert told.severity == "warning", told


@pytest.mark.parametrize("angle", ["heading", "course"])
@pytest.mark.parametrize("late", [0.0, 0.1, 0.3, 0.5])
def test_a_late_compass_in_quick_turns_counts_in_no_wrong_direction(angle, late):
    for seed, frequency in enumerate((0.25, 0.5, 0.7, 1.0, 1.5)):
        for name in ("sedan", "truck"):
            log, angles = drive(CARS[name], 20.0, frequency, seed)
            shown = np.interp(TIME - late, TIME, angles[angle])
            shown[np.arange(TIME.size) % 10 != 0] = np.nan
            found = check_log(log.replace(**{angle: shown}), car=CARS[name])
            told = [one for one in found if one.channel == angle and "times yaw_rate" in one.message]
            assert not [one for one in told if one.severity in ("error", "warning")], (frequency, name, told)


def test_the_rear_axle_tells_what_the_sideslip_takes_of_a_y():
    log, _ = drive(CARS["truck"], 16.0, 0.5, 3)
    for told in (CARS["truck"], None):
        (found,) = [one for one in check_log(log, car=told) if "times v_x yaw_rate" in one.message]
        assert found.severity == "note" and found.values["slope"] < 0.7
        assert 0.85 < found.values["with_sideslip"] < 1.2


@pytest.mark.parametrize("name", CARS)
@pytest.mark.parametrize("late", [0.0, 0.1])
def test_the_delay_of_a_y_is_found_in_quick_turns_too(name, late):
    """The linear car's a_y follows from its yaw rate exactly, its yaw inertia included."""
    car = CARS[name]
    for speed, frequency in ((8.0, 0.7), (20.0, 1.0), (20.0, 0.25)):
        log, _ = drive(car, speed, frequency, 3)
        log = log.replace(a_y=np.interp(TIME - late, TIME, np.asarray(log["a_y"])))
        found = kit_of_checks.a_y_delay(log, car)
        assert found.correlation > 0.95
        assert abs(found.seconds - late) < 0.012 + 2 * found.error, (speed, frequency, found)

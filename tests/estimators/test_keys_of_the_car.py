"""What a car's file says is used by every recommended method to which it matters, or there is a reason: from the file's own list
of keys, so that no key is ignored in silence."""

import dataclasses

import method_logs
import numpy as np
import pytest
from test_every_method import QUANTITIES, every, made

from jaxveh import estimators, io
from jaxveh.estimators import kit
from jaxveh.estimators.at_centre import AtCentre, at_centre, moved_to_centre
from jaxveh.estimators.catalogue import FULL_CAR

INERTIAL, SKY, STEERED = {"a_x", "a_y"}, {"speed", "course"}, {"steer", "steering_wheel"}
TORQUES = {"drive_torque", "brake_torque", *(f"torque_{at}" for at in method_logs.CORNERS)}
MATTERS = {
    "mass": INERTIAL, "yaw_inertia": {"a_y"}, "front_axle_to_cg": {"a_y", "course"}, "rear_axle_to_cg": {"a_y", "course"},
    "front_cornering_stiffness": STEERED, "rear_cornering_stiffness": {"a_y"}, "steering_ratio": {"steering_wheel"},
    "steer_offset": STEERED, "cg_height": TORQUES, "track_front": {"wheel_speed_fl"}, "track_rear": {"wheel_speed_rl"},
    "sensor_position": INERTIAL, "antenna_position": SKY, "low_pass": INERTIAL, "inertial_delay": INERTIAL,
    "satellite_delay": SKY, "camera_delay": {"lane_offset"}, "wheel_radius": TORQUES, "wheel_inertia": TORQUES, "drag": TORQUES,
    "rolling_resistance": TORQUES, "front_drive": {"wheel_speed_fl"}, "front_brake": {"brake_torque_fl", "torque_fl"},
    "brake_torque_per_pressure": {"brake_pressure"}, "roll_gradient": {"a_y"}, "pitch_gradient": {"a_x"},
    "roll_frequency": {"roll_rate"}, "roll_damping": {"roll_rate"}, "front": {"steer"}, "rear": {"a_y"},
}  # fmt: skip
"""The keys, and the channels of which one makes a method depend on it."""

NO_NUMBERS = {
    "name": "a name", "steering": "steered rear wheels are refused where they matter (test_steered_rear_wheels)",
    "rear_steer_ratio": "the same", "rear_steer_ratio_fast": "the same", "rear_steer_speed": "the same",
    "reference_position": "where a truth was measured, for the scores (test_sideslip)",
    "front_tyre": "a file for cars with four wheels", "rear_tyre": "the same",
}  # fmt: skip

LINEAR = "its tyres are linear, with the file's cornering stiffnesses"
WHOLE = "the forces of the whole car along the road, with bends as a small correction"
MEAN = "the mean of left and right wheels"
SMALL = "a few per cent of a longitudinal force that only reduces the grip"
TURNS = "lateral velocities are those of steady turns"
EXEMPT = {
    ("bank", "yaw_inertia"): "the rear axle's force is its share of the lateral acceleration", ("bank", "track_front"): MEAN,
    ("bank", "track_rear"): MEAN, ("bank", "pitch_gradient"): "its gyroscope pitches with the body, too",
    ("bank", "front"): LINEAR, ("bank", "rear"): LINEAR,
    ("friction", "drag"): SMALL, ("friction", "pitch_gradient"): SMALL,
    ("geometry", "track_front"): MEAN, ("geometry", "track_rear"): MEAN,
    ("geometry", "pitch_gradient"): "its gyroscope pitches with the body, too", ("geometry", "rear"): LINEAR,
    ("grade", "yaw_inertia"): WHOLE, ("grade", "cg_height"): WHOLE, ("grade", "rear"): LINEAR,
    ("mass", "yaw_inertia"): WHOLE, ("mass", "cg_height"): WHOLE, ("mass", "rear"): LINEAR,
    ("sideslip", "inertial_delay"): "all it measures is as late; its answer is, too",
    ("sideslip", "rear_cornering_stiffness"): "the coefficients of the rear axle, where a file has both",
    ("sideslip", "pitch_gradient"): SMALL,
    ("speed", "yaw_inertia"): TURNS, ("speed", "roll_gradient"): TURNS, ("speed", "front"): TURNS, ("speed", "rear"): TURNS,
    ("speed", "wheel_inertia"): "a wheel whose speed changes fast is left out",
    ("stiffness", "cg_height"): "its axles' grip is a state", ("stiffness", "front"): "its axles' grip is a state",
    ("stiffness", "rear"): "its axles' grip is a state",
}  # fmt: skip
EXEMPT |= {("roll", key): why for (quantity, key), why in EXEMPT.items() if quantity == "bank"}


def test_every_key_of_a_file_is_listed():
    assert {field.name for field in dataclasses.fields(io.CarSpecification)} == {*MATTERS, *NO_NUMBERS}
    assert all(getattr(FULL_CAR, key) is not None for key in MATTERS)


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_a_key_is_used_where_it_matters_or_there_is_a_reason(quantity):
    entry = QUANTITIES[quantity].METHODS[QUANTITIES[quantity].RECOMMENDED]
    reads = {need.channel for need in entry.make(FULL_CAR).needs}
    ignored = {key for key, channels in MATTERS.items() if channels & reads} - {*kit.keys_used(entry)}
    assert ignored == {key for name, key in EXEMPT if name == quantity}


PLACES = dataclasses.replace(method_logs.CAR, sensor_position=(1.3, 0.4, 0.0), antenna_position=(-1.5, 0.5, 0.9))


def test_what_turns_with_the_car_is_moved_to_the_centre_of_gravity():
    """Against the motion of a rigid body, of which a place is followed over ground."""
    t = np.linspace(0.0, 4.0, 40001)
    yaw, x, y = 0.4 * np.sin(1.3 * t), 20.0 * t, 3.0 * np.sin(0.9 * t)
    c, s, rate = np.cos(yaw), np.sin(yaw), lambda one: np.gradient(one, t)
    ahead, left = 1.3, 0.4
    at = x + c * ahead - s * left, y + s * ahead + c * left
    felt = [rate(rate(one)) for one in at]
    centre = [rate(rate(one)) for one in (x, y)]
    in_car = lambda one: (c * one[0] + s * one[1], -s * one[0] + c * one[1])
    turn = rate(yaw)
    found = moved_to_centre(*in_car(felt), turn, rate(turn), ahead, left)
    for a, b in zip(found, in_car(centre), strict=True):
        np.testing.assert_allclose(a[100:-100], b[100:-100], atol=2e-4)


def displaced(log, car):
    """The log of a plane motion, measured at the places of a car's file instead of at its centre of gravity."""
    (x, y), (ahead, left) = car.sensor_position[:2], car.antenna_position[:2]
    time = np.asarray(log.time)
    motion = method_logs.motion(time, 15.0)
    turn, late = motion["yaw_rate"], np.interp(time - 0.125, time, motion["yaw_rate"])
    quicker = np.gradient(turn, time)
    more = {
        "a_x": -quicker * y - turn**2 * x, "a_y": quicker * x - turn**2 * y, "course": late * ahead / motion["v_x"],
        "speed": -late * left,
    }  # fmt: skip
    return log.replace(**{name: np.asarray(log[name]) + by for name, by in more.items() if name in log})


@every
def test_every_method_that_reads_what_turns_with_the_car_hears_it_at_the_centre(quantity, name):
    here, there = made(quantity, name), made(quantity, name, PLACES)
    reads = {need.channel for need in here.needs}
    assert isinstance(there, AtCentre) == (bool(reads & (INERTIAL | SKY)) and not here.knows_places)
    if isinstance(there, AtCentre):
        assert isinstance(there, kit.AbstractSmoothable) == isinstance(here, kit.AbstractSmoothable)
        unit = PLACES.sensor_position[:2] if reads & INERTIAL else (0.0, 0.0)
        antenna = PLACES.antenna_position[:2] if reads & SKY else (0.0, 0.0)
        places = there.unit_x, there.unit_y, there.antenna_x, there.antenna_y
        np.testing.assert_array_equal(places, (*unit, *antenna))


class Hears(estimators.AbstractMethod):
    """Answers what it hears."""

    CHANNELS = ("a_x", "a_y", "course", "speed")

    @property
    def needs(self):
        return tuple(kit.Need(name, io.canonical_unit(name), optional=True) for name in self.CHANNELS)

    def first(self, t, values):
        return None, kit.answer({name: values[name] for name in self.CHANNELS})

    def next(self, memory, t, values):
        return self.first(t, values)


def test_what_is_heard_is_that_of_the_centre_of_gravity_and_of_the_place_where_nothing_turns():
    there = at_centre(Hears(), PLACES)
    log = method_logs.log(there.needs).replace(
        yaw_rate=method_logs.motion(method_logs.STEP * np.arange(method_logs.ROWS), 15.0)["yaw_rate"]
    )
    moved = displaced(log, PLACES)
    found = kit.follow("here", there, moved)
    for name in Hears.CHANNELS:
        right, ignored = np.asarray(log[name])[20:], np.asarray(moved[name])[20:]
        off = lambda one, right=right: np.sqrt(np.nanmean(np.square(one - right)))
        assert off(np.asarray(found[name])[20:]) < 0.2 * off(ignored), name
        np.testing.assert_array_equal(np.isnan(found[name]), np.isnan(moved[name]))
    # Without a yaw rate nothing is moved.
    silent = kit.follow("here", there, moved.without("yaw_rate"))
    for name in Hears.CHANNELS:
        np.testing.assert_array_equal(silent[name], moved[name])
    # Standing, with a course and a speed of noise.
    parked = moved.replace(speed=np.full(len(moved), 0.1))
    np.testing.assert_array_equal(kit.follow("here", there, parked)["course"], moved["course"])


@pytest.mark.full
@every
def test_a_unit_and_an_antenna_elsewhere_give_nearly_the_same_answers(quantity, name):
    here, there = made(quantity, name), made(quantity, name, PLACES)
    log = method_logs.log(there.needs)
    moved = displaced(log, PLACES)
    right, found, ignored = (
        kit.follow(quantity, method, one) for method, one in ((here, log), (there, moved), (here, moved))
    )
    for field in QUANTITIES[quantity].SHOWN:
        off = lambda one, field=field: np.sqrt(
            np.nanmean(np.square(np.asarray(one[field]) - np.asarray(right[field]))[50:])
        )
        assert off(found) <= 0.5 * off(ignored) + 1e-9, field


def test_a_smoothed_estimate_of_a_displaced_unit_is_that_of_the_centre():
    log = method_logs.log(made("bank", "filter", PLACES).needs)
    moved = displaced(log, PLACES)
    of = lambda car, log: np.asarray(estimators.bank.estimate(car, log, smoothed=True)["bank"])
    right, found, ignored = of(method_logs.CAR, log), of(PLACES, moved), of(method_logs.CAR, moved)
    assert np.std(found - right) <= 0.5 * np.std(ignored - right)

"""Drives of cars whose rear wheels are steered: by the car's own ratio, by channels of a recording, and not at all."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import Recording, manoeuvres, vehicles
from jaxveh.manoeuvres import replay
from jaxveh.simulation import simulate

SPEED = 20.0


def linear(steering):
    car = vehicles.linear_single_track(vehicles.passenger_car())
    return dataclasses.replace(car, steering=steering)


def test_a_step_of_the_steering_ends_in_the_book_s_steady_turn():
    car = linear(vehicles.FourWheelSteering(-0.3, fast_ratio=0.4, middle_speed=15.0))
    drive = simulate(car, manoeuvres.step_steer(SPEED, 0.02, start=0.1, duration=4.0), dt=0.1)
    np.testing.assert_allclose(drive["true.yaw_rate"][-1], 0.02 * car.yaw_rate_gain(SPEED), rtol=1e-4)
    np.testing.assert_allclose(drive["true.sideslip"][-1], 0.02 * car.sideslip_gain(SPEED), rtol=1e-3)
    square = (SPEED / 15.0) ** 2
    ratio = (-0.3 + 0.4 * square) / (1.0 + square)
    plain = float(linear(vehicles.FrontSteering()).yaw_rate_gain(SPEED))
    np.testing.assert_allclose(car.yaw_rate_gain(SPEED), (1.0 - ratio) * plain, rtol=1e-12)


@pytest.mark.parametrize("steering", [vehicles.RearSteering(), vehicles.IndependentSteering()])
def test_a_manoeuvre_that_says_no_more_turns_the_front_wheels(steering):
    manoeuvre = manoeuvres.step_steer(SPEED, 0.02, start=0.1, duration=1.0)
    drive, front = (simulate(linear(s), manoeuvre, dt=0.1) for s in (steering, vehicles.FrontSteering()))
    np.testing.assert_allclose(drive["true.yaw_rate"], front["true.yaw_rate"], atol=1e-9)
    for name in steering.inputs:
        rear = name in ("steer_rear", "steer_rl", "steer_rr")
        np.testing.assert_allclose(drive[name], 0.0 * front["steer"] if rear else front["steer"], atol=1e-15)
        assert drive.unit(name) == "rad"


def test_a_replay_steers_the_wheels_of_which_it_has_channels():
    """Front and rear alike: the car ends going aside, as far as the wheels point, and does not turn."""
    time = np.linspace(0.0, 4.0, 81)
    angle = 0.02 * np.minimum(time, 1.0)
    recording = Recording(time, {"steer": angle, "steer_rear": angle, "v_x": np.full(81, SPEED)})
    assert replay(recording).names == ("steer", "v_x", "steer_rear")
    drive = simulate(linear(vehicles.RearSteering()), replay(recording), dt=0.1)
    np.testing.assert_allclose(drive["true.sideslip"][-1], 0.02, rtol=1e-3)
    np.testing.assert_allclose(drive["true.yaw_rate"][-1], 0.0, atol=1e-5)
    same = Recording(time, {**dict.fromkeys(vehicles.IndependentSteering().inputs, angle), "v_x": np.full(81, SPEED)})
    own = replay(same, (*vehicles.IndependentSteering().inputs, "v_x"))
    other = simulate(linear(vehicles.IndependentSteering()), own, dt=0.1)
    np.testing.assert_allclose(other["true.sideslip"], drive["true.sideslip"], atol=1e-6)


def test_a_kinematic_car_with_a_steered_rear_axle_goes_on_its_circle():
    car = vehicles.Kinematic(2.7, 1.5, steering=vehicles.FourWheelSteering(-0.5))
    drive = simulate(car, manoeuvres.step_steer(3.0, 0.2, start=0.0, duration=2.0), dt=0.1)
    expected = 3.0 * (np.tan(0.2) - np.tan(-0.1)) / 2.7
    np.testing.assert_allclose(drive["true.yaw_rate"][-1], expected, rtol=1e-6)
    np.testing.assert_allclose(np.tan(drive["true.sideslip"][-1]), np.tan(-0.1) + 1.5 * expected / 3.0, rtol=1e-6)


def test_pedals_hand_on_the_angles_of_other_wheels():
    """Of a driver who says them; a plain one's inputs are `PedalInputs` as before."""
    time = np.linspace(0.0, 1.0, 11)
    channels = {"steer": 0.1 * time, "steer_rear": -0.05 * time, "v_x": np.full(11, 10.0)}
    moves = vehicles.Motion(*[jnp.asarray(value) for value in (0.0, 0.0, 0.0, 9.0, 0.0, 0.0)])
    for names in (("steer", "v_x"), ("steer", "v_x", "steer_rear")):
        control = manoeuvres.SpeedControl(replay(Recording(time, channels), names), 1500.0)
        u = control.inputs(0.5, moves, control.start(0.0, moves))
        assert float(u.drive_torque) > 100.0 and ("steer_rear" in u._fields) == ("steer_rear" in names)
        np.testing.assert_allclose(u.steer, 0.05, rtol=1e-12)
    np.testing.assert_allclose(u.steer_rear, -0.025, rtol=1e-12)

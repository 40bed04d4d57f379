"""Roll: each method where the right answer is known, and the filter on simulated cars."""

import dataclasses
import math

import jax.numpy as jnp
import numpy as np
import pytest
from banked_drives import DEGREE, file_of, follow_all
from method_logs import CAR
from steady_logs import G, banked_circle, log
from winding_roads import SCORED, heard_of

from jaxveh.estimators import bank, grade, mass, roll
from jaxveh.estimators.delays import unit_delay
from jaxveh.estimators.leaning import leaning_filter


def test_a_gyroscope_s_offset_is_found_and_its_roll_stays_the_accelerometer_s():
    method = roll.METHODS["gyro"].make(CAR)
    steady, angle = banked_circle(method.needs, rows=6000)
    found = roll.estimate(method, steady.replace(roll_rate=np.full(6000, 0.01)))
    np.testing.assert_allclose(found["roll"][-1], angle, rtol=0.01)
    np.testing.assert_allclose(found.mean.roll_rate_bias[-1], 0.01, rtol=0.02)
    np.testing.assert_allclose(found["roll_rate"][-1], 0.0, atol=2e-4)


def test_a_gyroscope_follows_a_fast_roll():
    method = roll.METHODS["gyro"].make(CAR)
    time = 0.01 * np.arange(3000)
    angle = 0.05 * np.sin(3.0 * time)
    made = {"a_y": G * np.sin(angle), "yaw_rate": 0.0, "v_x": 20.0, "roll_rate": 0.15 * np.cos(3.0 * time), "a_x": 0.0}
    found = roll.estimate(method, log(method.needs, made, 3000))
    assert np.abs(found["roll"] - angle)[1000:].max() < 0.003


@pytest.mark.parametrize("hertz", [0.3, 1.0, 2.0])
def test_the_filter_s_roll_is_that_of_now_though_its_unit_is_late(hertz):
    """A body swings on its springs on a level road: exact phasors, delayed."""
    method, late = leaning_filter(CAR, "roll"), unit_delay(CAR)
    method = dataclasses.replace(method, steering=None)
    s, v_x, f_y = 2j * math.pi * hertz, 20.0, 2.0
    w, damping = 2.0 * math.pi * float(method.roll_frequency), float(method.roll_damping)
    angle = float(method.roll_gradient) * f_y * w * w / (w * w + 2.0 * damping * w * s + s * s)
    c, b = float(method.rear_compliance), float(method.rear_axle_to_cg)
    made = {"a_y": f_y + G * angle, "yaw_rate": f_y * (1.0 + s * v_x * c) / (v_x + s * b), "roll_rate": s * angle}
    time = 0.01 * np.arange(2000)
    swing = lambda phasor, t: np.real(phasor * np.exp(s * t))
    heard = {name: swing(phasor, time - late) for name, phasor in made.items()} | {"v_x": v_x, "a_x": 0.0}
    recording = log(method.needs, heard, len(time))
    found = roll.estimate(method, recording)
    before = roll.estimate(dataclasses.replace(method, unit_delay=jnp.zeros(())), recording)
    for name, truth in (("roll", angle), ("roll_rate", s * angle)):
        error = (np.asarray(found[name]) - swing(truth, time))[1000:]
        assert error.std() < 0.45 * (np.asarray(before[name]) - swing(truth, time))[1000:].std()
        assert error.std() < np.sqrt(np.mean(np.square(getattr(found.std, name)[1000:])))


def test_the_suspension_s_roll_is_that_of_its_gradient_and_its_step_response_that_of_a_second_order():
    steady, springs = (roll.METHODS[name].make(CAR) for name in ("steady", "springs"))
    made = log(steady.needs, {"a_y": 2.0}, 1000, step=0.002)
    end = 2.0 * CAR.roll_gradient / (1.0 + G * CAR.roll_gradient)
    np.testing.assert_allclose(roll.estimate(steady, made)["roll"][-1], end, rtol=1e-6)
    found = roll.estimate(springs, made)
    w, damping = 2.0 * math.pi * CAR.roll_frequency, CAR.roll_damping * 2.0 * math.pi * CAR.roll_frequency
    rings = math.sqrt(w * w * (1.0 + G * CAR.roll_gradient) - damping**2)
    time = np.asarray(made.time)
    exact = end * (1.0 - np.exp(-damping * time) * (np.cos(rings * time) + damping / rings * np.sin(rings * time)))
    np.testing.assert_allclose(found["roll"], exact, atol=0.01 * end)


def test_six_axes_find_the_attitude_of_a_car_that_goes_straight_on_a_bank():
    method = roll.METHODS["six_axis"].make(CAR)
    made = {"a_x": -G * math.sin(0.03), "a_y": G * math.sin(0.05) * math.cos(0.03), "v_x": 20.0}
    made |= dict.fromkeys(("yaw_rate", "roll_rate", "pitch_rate"), 0.0)
    found = roll.estimate(method, log(method.needs, made, 3000))
    np.testing.assert_allclose(found["roll"][-1], 0.05, atol=2e-3)
    np.testing.assert_allclose(found.mean.pitch[-1], 0.03, atol=2e-3)
    assert found.known.roll[-1]


def test_six_axes_carry_roll_over_into_pitch_in_a_turn():
    # A car that turns by a quarter on a plane that tilts: what was bank becomes climb.
    method = roll.METHODS["six_axis"].make(CAR)
    time = 0.01 * np.arange(2000)
    yaw = np.clip(0.1 * (time - 4.0), 0.0, math.pi / 2.0)
    turn = np.where((yaw > 0) & (yaw < math.pi / 2.0), 0.1, 0.0)
    normal = np.array([-math.sin(0.05), math.cos(0.05)])
    # World: the plane rises along y; its slope seen by the car.
    across, along = normal[0] * np.cos(yaw), normal[0] * np.sin(yaw)
    made = {
        "a_x": -G * along,
        "a_y": 20.0 * turn - G * across,
        "yaw_rate": turn,
        "roll_rate": 0.0,
        "pitch_rate": 0.0,
        "v_x": 20.0,
    }
    found = roll.estimate(method, log(method.needs, made, 2000))
    assert abs(found["roll"][390] - 0.05) < 0.005
    assert abs(found["roll"][1999]) < 0.01 and abs(found.mean.pitch[1999] + 0.05) < 0.01


def test_the_filter_s_roll_is_bank_and_body_roll_together():
    method = roll.METHODS["filter"].make(CAR)
    found = roll.estimate(method, banked_circle(method.needs)[0])
    np.testing.assert_allclose(
        found["roll"], np.asarray(found.mean.bank) + np.asarray(found.mean.body_roll), atol=1e-12
    )


def test_what_a_silent_accelerometer_leaves_is_not_known():
    method = roll.METHODS["filter"].make(CAR)
    steady = banked_circle(method.needs)[0]
    cut = np.where(np.arange(1500) < 1000, np.asarray(steady["a_y"]), np.nan)
    found = roll.estimate(method, steady.replace(a_y=cut))
    assert found.known.roll[999] and not found.known.roll[1100:].any()


@pytest.mark.full
def test_all_at_smoke_size_on_a_simulated_car():
    cases, truths, offsets, time = heard_of(("passenger_car",), (0, 1), 40.0, True)
    late = slice(1000, None)
    said = follow_all(lambda car: roll.METHODS["filter"].make(file_of(car)), cases, time)
    wrong = lambda values, name: np.stack([values[k] - truth[name] for k, truth in enumerate(truths)])[:, late]
    assert np.sqrt(np.mean(wrong(said.mean.roll, "horizon_roll") ** 2)) < 0.6 * DEGREE
    assert np.sqrt(np.mean(wrong(said.mean.bank, "bank") ** 2)) < 0.6 * DEGREE
    said = follow_all(lambda car: grade.METHODS["filter"].make(file_of(car, 1.12)), cases, time)
    assert np.sqrt(np.mean(wrong(said.mean.grade, "grade") ** 2)) < 0.4 * DEGREE
    assert np.abs(said.mean.a_x_bias[:, -1] - [one["a_x"] for one in offsets]).max() < 0.06
    said = follow_all(lambda car: mass.METHODS["filter"].make(file_of(car, 1.12)), cases, time)
    assert np.abs(said.mean.mass[:, -1] / file_of("passenger_car").mass - 1.0).max() < 0.05
    assert bank.RECOMMENDED == roll.RECOMMENDED == "filter"


@pytest.mark.full
@pytest.mark.parametrize(("six_axes", "most"), [(False, 0.5), (True, 0.5)])
def test_on_unseen_cars_roll_is_known_to_what_the_offset_leaves(six_axes, most):
    cases, truths, _, time = heard_of(SCORED, range(4), 120.0, six_axes)
    said = follow_all(lambda car: roll.METHODS["filter"].make(file_of(car)), cases, time)
    error = np.stack([said.mean.roll[k] - truth["horizon_roll"] for k, truth in enumerate(truths)])[:, 1000:]
    assert np.sqrt(np.mean(error**2)) < most * DEGREE
    assert 0.4 < np.mean((error / said.std.roll[:, 1000:]) ** 2) < 2.0
    # Not 0.3 degrees: what two minutes leave of the offset of a_y is as much as that.
    if six_axes:  # What is left without its mean is fast, and small.
        assert np.sqrt(np.mean((error - error.mean(1, keepdims=True)) ** 2)) < 0.2 * DEGREE

"""Drivers in closed loop with cars of the tests' own: lanes kept, circles held, speeds followed, limits respected."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from simple_cars import Linear, clearance, drive, driven, push

from jaxveh import InputError, manoeuvres
from jaxveh._core.names import record
from jaxveh.manoeuvres import Motion, OpenLoop, PathDriver, SpeedControl

WIDTH, LENGTH = 1.8, 4.5
CAR = Linear()
KNOWN = {"wheelbase": 2.7, "understeer_gradient": CAR.understeer_gradient}


def rows(driver, dt=0.005):
    return np.arange(0.0, driver.duration, dt)


LONGEST = np.arange(0.0, 10.5, 0.005)
"""Rows of the slowest drive through three lanes: the others go on straight ahead, and all are one program."""


def left_beside(driver, course, car=CAR):
    assert driver.duration < LONGEST[-1]
    motion, _ = drive(car, driver, LONGEST)
    return float(clearance(motion.x, motion.y, motion.yaw, WIDTH, LENGTH, course)[0])


@pytest.mark.parametrize("kmh", [60.0, 80.0])
def test_a_linear_car_passes_iso_3888_1(kmh):
    assert left_beside(manoeuvres.iso_lane_change(kmh / 3.6, **KNOWN), manoeuvres.iso_3888_1(WIDTH)) > 0


@pytest.mark.parametrize("front_stiffness", [75e3, 90e3, 130e3])
def test_it_passes_with_a_driver_who_does_not_know_the_car(front_stiffness):
    """Understeering, ordinary and nearly neutral cars."""
    car = CAR._replace(front_stiffness=front_stiffness)
    assert left_beside(manoeuvres.iso_lane_change(80 / 3.6), manoeuvres.iso_3888_1(WIDTH), car) > 0


def test_a_linear_car_passes_iso_3888_2():
    assert left_beside(manoeuvres.iso_obstacle_avoidance(45 / 3.6, **KNOWN), manoeuvres.iso_3888_2(WIDTH)) > 0


def test_a_driver_who_looks_too_far_cuts_the_corners_and_hits_cones():
    far = manoeuvres.iso_lane_change(80 / 3.6, preview_time=1.5, **KNOWN)
    assert left_beside(far, manoeuvres.iso_3888_1(WIDTH)) < -0.1


@pytest.mark.parametrize("radius", [40.0, -40.0])
def test_a_steady_circle_is_a_circle_whatever_the_driver_thinks_of_the_car(radius):
    driver = manoeuvres.steady_circle(radius, 5.0, 15.0, time=40.0, understeer_gradient=0.0)
    motion, state = drive(CAR, driver, rows(driver, 0.01))
    late = rows(driver, 0.01) > 20.0
    away = np.hypot(motion.x, motion.y - radius)[late]
    np.testing.assert_allclose(away, abs(radius), atol=0.03)
    # ISO 4138: the steer over the lateral acceleration is a line whose slope is the understeer gradient.
    a_y = (motion.v_x * motion.yaw_rate)[late]
    slope, first = np.polyfit(a_y, state.steer[late], 1)
    np.testing.assert_allclose(slope, CAR.understeer_gradient, rtol=0.05)
    np.testing.assert_allclose(first, 2.7 / radius, rtol=0.02)


def test_the_slalom_goes_round_its_cones_on_alternating_sides():
    driver = manoeuvres.slalom_course(12.0, 1.5, spacing=20.0, count=6, **KNOWN)
    motion, _ = drive(CAR, driver, rows(driver))
    y = np.interp(30.0 + 20.0 * (1.5 + np.arange(6)), motion.x, motion.y)
    assert (y * np.array([-1, 1, -1, 1, -1, 1]) > 1.1).all()
    course = manoeuvres.slalom_cones(20.0, 6)
    assert clearance(motion.x, motion.y, motion.yaw, WIDTH, LENGTH, course)[0] > 0


def test_on_a_straight_the_driver_comes_back_to_the_line_and_turns_no_wheel():
    driver = PathDriver(path=manoeuvres.Straight(), speed=manoeuvres.SteadySpeed(20.0), duration=10.0)
    motion, state = drive(CAR, driver, rows(driver), (0.0, 2.0, 0.05))
    np.testing.assert_allclose([motion.y[-1], motion.yaw[-1], state.steer[-1]], 0.0, atol=1e-4)
    assert np.min(motion.y) > -0.5
    motion, state = drive(CAR, driver, rows(driver))
    np.testing.assert_array_equal(state.steer, 0.0)


def test_steer_and_its_rate_stay_within_their_limits():
    driver = PathDriver(
        path=manoeuvres.Straight(), speed=manoeuvres.SteadySpeed(15.0), duration=10.0, steer_limit=0.06, rate_limit=0.2
    )
    _, state = drive(CAR, driver, rows(driver), (0.0, 6.0, 0.5))
    assert 0.055 < np.max(np.abs(state.steer)) <= 0.06 + 1e-9
    assert 0.19 < np.max(np.abs(np.diff(state.steer))) / 0.005 <= 0.2 + 1e-9


def test_the_driver_lags_by_his_reaction():
    driver = PathDriver(path=manoeuvres.Straight(), speed=manoeuvres.SteadySpeed(15.0), duration=8.0, reaction_lag=0.25)
    motion = Motion(*map(jnp.asarray, (0.0, 0.02, 0.0, 15.0, 0.0, 0.0)))
    settled, rates = jax.jit(lambda m: (own := driver.start(0.0, m), driver.derivatives(0.0, m, own)))(motion)
    # For an arc to (ahead, left) at a car that runs straight: the whole of it is missing.
    needed = 2.7 + 0.003 * 15.0**2
    distance = np.hypot(0.6 * 15.0, 2.0)
    np.testing.assert_allclose(settled.steer, needed * 2 * -0.02 / (distance**2 + 0.02**2), rtol=1e-9)
    np.testing.assert_allclose(rates.steer, np.asarray(settled.steer) / 0.25, rtol=1e-9)


def test_a_drive_can_be_differentiated_through():
    # Values and gradients by one program.
    @jax.jit
    @jax.value_and_grad
    def last(preview_time):
        driver = manoeuvres.iso_lane_change(22.0, preview_time=preview_time)
        return driven(CAR, driver, np.arange(0.0, 4.0, 0.01), (0.0, 0.0, 0.0))[0].y[-1]

    difference = (float(last(0.6 + 1e-5)[0]) - float(last(0.6 - 1e-5)[0])) / 2e-5
    np.testing.assert_allclose(last(0.6)[1], difference, rtol=1e-5)


# Speed control

MASS = 1500.0


def controlled(speed, **parameters):
    path = PathDriver(path=manoeuvres.Straight(), speed=speed, duration=60.0)
    return SpeedControl(path, MASS, **{"drag_area": 1e-6, "rolling_resistance": 1e-9, **parameters})


def test_speed_is_followed_uphill_by_an_integral_that_carries_the_slope():
    driver = controlled(manoeuvres.ChangingSpeed(10.0, 20.0, 2.0, 10.0))
    v, _, own = push(driver, rows(driver, 0.01), MASS, 0.3, 0.05, 10.0)
    np.testing.assert_allclose(v[-1], 20.0, atol=1e-3)
    np.testing.assert_allclose(own.speed_integral[-1], 9.80665 * np.sin(0.05), rtol=1e-3)


def test_feedforward_follows_a_ramp_on_the_level_without_an_error():
    driver = controlled(manoeuvres.ChangingSpeed(10.0, 20.0, 2.0, 10.0))
    times = rows(driver, 0.01)
    v, u, own = push(driver, times, MASS, 0.3, 0.0, 10.0)
    np.testing.assert_allclose(v, u.v_x, atol=1e-6)
    np.testing.assert_allclose(own.speed_integral, 0.0, atol=1e-6)
    middle = np.argmin(np.abs(times - 7.0))
    np.testing.assert_allclose(u.drive_torque[middle] - u.brake_torque[middle], MASS * 0.3 * 1.0, rtol=1e-6)


def test_torques_are_never_negative_and_drive_or_brake():
    # By 3 m/s^2; in ten seconds as the others, so that it is their program.
    driver = controlled(manoeuvres.ChangingSpeed(35.0, 5.0, 2.0, 10.0))
    _, u, _ = push(driver, rows(driver, 0.01), MASS, 0.3, 0.0, 35.0)
    assert (u.drive_torque >= 0).all() and (u.brake_torque >= 0).all()
    braking = u.brake_torque > 0.1 * MASS * 0.3
    assert braking.any() and (u.drive_torque[braking] == 0).all()


def test_the_integral_does_not_wind_up_at_the_limit():
    """A wish of 20 m/s^2 for a second, of which the limit leaves 2: afterwards there is hardly an overshoot."""
    driver = controlled(manoeuvres.ChangingSpeed(0.0, 20.0, 1.0, 1.0, 0.2), drive_limit=2.0)
    v, u, _ = push(driver, rows(driver, 0.01), MASS, 0.3, 0.0, 0.0)
    assert np.max(u.drive_torque) <= 2.0 * MASS * 0.3 + 1e-9
    assert np.max(v) < 20.6
    np.testing.assert_allclose(v[-1], 20.0, atol=0.05)


def test_resistance_is_fed_forward():
    driver = SpeedControl(
        manoeuvres.step_steer(20.0, 0.1), MASS, wheel_radius=0.4, drag_area=0.8, rolling_resistance=0.02
    )
    motion = Motion(*map(jnp.asarray, (0.0, 0.0, 0.0, 20.0, 0.0, 0.0)))
    u = driver.inputs(0.0, motion, driver.start(0.0, motion))
    force = 0.5 * 1.2 * 0.8 * 400 + MASS * 9.80665 * 0.02
    np.testing.assert_allclose(u.drive_torque, 0.4 * force, rtol=1e-3)
    assert float(u.brake_torque) == 0 and float(u.v_x) == 20.0


def test_what_the_driver_presses_himself_is_added():
    noisy = manoeuvres.cruise(20.0, jax.random.key(1), speed_std=0.0, pedal_noise=100.0)
    quiet = manoeuvres.cruise(20.0, jax.random.key(1), speed_std=0.0, pedal_noise=0.0)
    motion = Motion(*map(jnp.asarray, (0.0, 0.0, 0.0, 20.0, 0.0, 0.0)))
    given = eqx.filter_jit(lambda driver, motion: driver.inputs(3.0, motion, driver.start(3.0, motion)))
    torques = []
    for own in (noisy, quiet):
        driver = SpeedControl(own, MASS)
        u = given(driver, motion)
        torques.append(float(u.drive_torque) - float(u.brake_torque))
    pressed = noisy.inputs(3.0)
    np.testing.assert_allclose(torques[0] - torques[1], pressed.drive_torque - pressed.brake_torque, rtol=1e-9)


def test_open_loop_is_the_manoeuvre_whatever_the_car_does():
    m = manoeuvres.step_steer(20.0, 0.1)
    driver = OpenLoop(m)
    for motion in (Motion(*[0.0] * 6), Motion(*[3.0] * 6)):
        assert driver.inputs(2.0, motion, driver.start(2.0, motion)) == m.inputs(2.0)
    assert driver.duration == m.duration and driver.state_names == ()


class NoSpeed(manoeuvres.AbstractManoeuvre):
    """Steers, and wants no speed."""

    duration: float = 5.0

    def inputs(self, t):
        return record("Inputs", {"steer": t})


def test_speed_control_needs_a_speed_to_follow():
    motion = Motion(*map(jnp.asarray, (0.0, 0.0, 0.0, 20.0, 0.0, 0.0)))
    driver = SpeedControl(NoSpeed(), MASS)
    with pytest.raises(InputError, match="the driver gives steer, but no v_x to follow"):
        driver.inputs(0.0, motion, driver.start(0.0, motion))


STEADY = manoeuvres.SteadySpeed(20.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: OpenLoop(3.0), r"OpenLoop\.manoeuvre = [0-9.]+: must be a manoeuvre or a driver"),
        (lambda: SpeedControl(None, MASS), r"OpenLoop\.manoeuvre = None"),
        (lambda: SpeedControl(manoeuvres.step_steer(20.0, 0.1), -1.0), r"SpeedControl\.mass = -1\.0: must be positive"),
        (lambda: PathDriver(path=3.0, speed=STEADY, duration=5.0), r"PathDriver\.path = [0-9.]+: must be a path"),
        (lambda: PathDriver(path=manoeuvres.Straight(), speed=20.0, duration=5.0), r"PathDriver\.speed = 20.0: must"),
        (lambda: manoeuvres.iso_lane_change(preview_time=0.0), r"PathDriver\.preview_time = 0\.0: must be positive"),
        (lambda: manoeuvres.steady_circle(40.0, -1.0), r"speed = -1\.0: must be between 0 and 150 m/s"),
    ],
)
def test_bad_input_raises_by_name_value_and_range(make, message):
    with pytest.raises(InputError, match=message):
        make()

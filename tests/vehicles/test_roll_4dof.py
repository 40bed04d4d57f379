"""The rolling body under torques: energy and momentum, the planar car as a limit, symmetry, standstill, precision."""

import jax.numpy as jnp
import numpy as np
import pytest
from four_wheel_cars import (
    BODY,
    ROLLING,
    SLOPES,
    TRACKS,
    assert_finite,
    assert_gradients,
    assert_symmetric,
    asymmetric,
    brush,
    car_of,
    drive,
    inputs,
    state,
)

from jaxveh import InputError, tyres, vehicles
from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles import GRAVITY, Roll3DOF, Roll4DOF
from jaxveh.vehicles.rolling_body import roll_geometry

U = inputs(steer=0.04, drive_torque=400.0, brake_torque=0.0)
COASTING = inputs(steer=0.04, drive_torque=0.0, brake_torque=0.0)
ICE = Ground(0.0, 0.0, 0.0, 0.0)
RADIUS = 0.32


def turning(car, **more):
    leaning = {"roll": 0.06, "roll_rate": -0.2}
    return state(car, **{"v_x": 22.0, "v_y": -0.4, "yaw": 0.3, "yaw_rate": 0.25, **leaning, **more})


class OnIce(vehicles.AbstractVehicle):
    """A car where no wheel has any grip."""

    car: vehicles.AbstractVehicle
    inputs = property(lambda self: self.car.inputs)
    state_type = property(lambda self: self.car.state_type)
    units = property(lambda self: self.car.units)

    def start(self, t, u, **values):
        return self.car.start(t, u, **values)

    def motion(self, x, u):
        return self.car.motion(x, u)

    def evaluate(self, t, x, u, ground=LEVEL):
        return self.car.evaluate(t, x, u, ICE)


def sprung_velocity(car, x):
    """Velocity of the sprung mass's centre of gravity in the car's axes, m/s."""
    h, s, c = roll_geometry(car).arm, np.sin(x.roll), np.cos(x.roll)
    return x.v_x + h * s * x.yaw_rate, x.v_y - h * c * x.roll_rate, -h * s * x.roll_rate


def energy(car, x):
    """Of motion, height and springs, J."""
    unsprung, h = roll_geometry(car).unsprung_mass, roll_geometry(car).arm
    kinetic = 0.5 * unsprung * (x.v_x**2 + x.v_y**2) + 0.5 * car.sprung_mass * sum(
        v**2 for v in sprung_velocity(car, x)
    )
    kinetic += 0.5 * car.yaw_inertia * x.yaw_rate**2 + 0.5 * car.roll_inertia * x.roll_rate**2
    kinetic -= car.roll_yaw_product * x.yaw_rate * x.roll_rate
    stiffness = car.roll_stiffness_front + car.roll_stiffness_rear
    return kinetic + car.sprung_mass * GRAVITY * h * np.cos(x.roll) + 0.5 * stiffness * x.roll**2


def spinning(car):
    x = state(car, v_x=10.0, v_y=1.0, yaw_rate=0.8, roll=0.1, roll_rate=0.5)
    return drive(OnIce(car), lambda t: COASTING, x, 4.0, 1e-3)


def test_without_grip_and_dampers_energy_and_momentum_stay():
    car = car_of(Roll4DOF, roll_damping_front=0.0, roll_damping_rear=0.0)
    x = spinning(car)
    swing = 0.5 * (ROLLING["roll_stiffness_front"] + ROLLING["roll_stiffness_rear"]) * 0.1**2
    assert np.ptp(energy(car, x)) < 1e-7 * swing
    assert np.max(x.roll) > 0.09 and np.min(x.roll) < -0.09 and x.yaw[-1] > 2.0
    unsprung, (u, v, _) = roll_geometry(car).unsprung_mass, sprung_velocity(car, x)
    along, across = unsprung * x.v_x + car.sprung_mass * u, unsprung * x.v_y + car.sprung_mass * v
    world = along * np.cos(x.yaw) - across * np.sin(x.yaw), along * np.sin(x.yaw) + across * np.cos(x.yaw)
    assert all(np.ptp(p) < 1e-8 * car.mass for p in world)


def test_dampers_take_what_energy_is_lost():
    car = car_of(Roll4DOF)
    x = spinning(car)
    x = type(x)(*[np.asarray(leaf)[1:] for leaf in x])
    power = (ROLLING["roll_damping_front"] + ROLLING["roll_damping_rear"]) * x.roll_rate**2
    lost = 1e-3 / 3 * (power[:-1:2] + 4 * power[1::2] + power[2::2]).sum()
    found = energy(car, x)
    np.testing.assert_allclose(found[0] - found[-1], lost, rtol=1e-6)
    assert lost > 100.0


def test_without_torques_it_is_the_car_at_a_given_speed():
    # The accelerations that the loads feel differ, those of the torques (none) and the given one: they stay static in both.
    static = vehicles.StaticLoads()
    car, given = car_of(Roll4DOF, load_transfer=static), car_of(Roll3DOF, load_transfer=static)
    x = turning(car)
    rates, out = car.evaluate(0.0, x, COASTING)
    found = given.derivatives(0.0, given.state_type(*x[1:]), inputs(steer=0.04, v_x=out.v_x, a_x=out.a_x))
    np.testing.assert_allclose(rates[1:], found, rtol=1e-10)


def test_speeding_up_by_hand():
    car = car_of(Roll4DOF, drag=0.4, rolling_resistance=0.012, load_transfer=vehicles.QuasiStatic())
    out = car.outputs(0.0, state(car, v_x=30.0), inputs(steer=0.0, drive_torque=600.0, brake_torque=0.0))
    m = BODY["mass"]
    np.testing.assert_allclose(out.a_x, (600.0 / RADIUS - 360.0 - 0.012 * m * GRAVITY) / m, rtol=1e-12)
    front = m * GRAVITY * 1.55 / 2.7 - 600.0 / RADIUS * BODY["cg_height"] / 2.7
    np.testing.assert_allclose(out.load_fl + out.load_fr, front, rtol=1e-12)
    np.testing.assert_allclose(out.drive_power, 600.0 / RADIUS * 30.0, rtol=1e-12)


def test_accelerometers_say_the_forces_over_the_mass():
    car = car_of(Roll4DOF, drag=0.4)
    x = turning(car)
    out = car.outputs(0.0, x, U, SLOPES)
    np.testing.assert_allclose(out.a_y, out.F_y / BODY["mass"], rtol=1e-13)
    np.testing.assert_allclose(out.a_x, (out.F_x - 0.4 * 22.0**2) / BODY["mass"], rtol=1e-13)


def test_motors_that_differ_turn_the_car():
    car = car_of(Roll4DOF, drive=vehicles.FourMotors(), roll_yaw_product=0.0)
    u = inputs(steer=0.0, torque_fl=-100.0, torque_fr=100.0, torque_rl=0.0, torque_rr=0.0)
    out = car.outputs(0.0, state(car, v_x=20.0), u)
    moment = 100.0 / RADIUS * TRACKS["track_front"]
    np.testing.assert_allclose(out.yaw_acceleration, moment / BODY["yaw_inertia"], rtol=1e-12)


def test_on_a_slope_it_rolls_with_gravity():
    car = car_of(Roll4DOF)
    rates = car.derivatives(0.0, state(car), COASTING, LEVEL._replace(grade=0.1))
    np.testing.assert_allclose(rates.v_x, -GRAVITY * np.sin(0.1), rtol=1e-12)


def test_an_asymmetric_tyre_makes_a_symmetric_car():
    car = car_of(Roll4DOF, front=asymmetric(), rear=asymmetric())
    assert_symmetric(car, turning(car), U)


@pytest.mark.parametrize(
    "tyre", [tyres.Relaxed(brush(), sigma_y=0.4), tyres.LuGre(180.0, 180.0, 1.0, 0.8, 6.0)], ids=["relaxed", "lugre"]
)
def test_tyres_with_states_bring_them_and_start_settled(tyre):
    car = car_of(Roll4DOF, rear=tyre)
    names = [f"{corner}_{name}" for corner in ("rl", "rr") for name in tyre.state_names]
    assert car.state_type._fields == (
        "v_x",
        "v_y",
        "yaw",
        "yaw_rate",
        "roll",
        "roll_rate",
        "a_x_felt",
        "a_y_felt",
        *names,
    )
    x = car.start(0.0, U, v_x=22.0, v_y=-0.3, yaw_rate=0.2, roll=0.03)
    rates = car.derivatives(0.0, x, U)
    np.testing.assert_allclose([getattr(rates, name) for name in names], 0.0, atol=1e-12)


def test_gradients_beyond_the_grip_agree_with_differences():
    car = car_of(Roll4DOF, drag=0.4, rolling_resistance=0.012)
    assert_gradients(car, turning(car), U._replace(drive_torque=jnp.asarray(-9000.0)))


@pytest.mark.parametrize("brake", [0.0, 1e5])
def test_slopes_of_a_braked_car_are_finite(brake):
    car = car_of(Roll4DOF)
    u = inputs(steer=0.1, drive_torque=0.0, brake_torque=brake)
    for x in (state(car), turning(car, roll=0.5)):
        assert_finite(car, x, u)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("grip", 0.0, r"Roll4DOF\.grip = 0\.0: must be positive"),
        ("roll_stiffness_rear", -3e4, r"Roll4DOF\.roll_stiffness_rear = -30000\.0: must be positive"),
        ("cg_height", 7.0, r"or the body falls over"),
        ("rear", 3.0, r"Roll4DOF\.rear = [0-9.]+: must be a tyre"),
    ],
)
def test_bad_input_is_named(field, value, message):
    with pytest.raises(InputError, match=message):
        car_of(Roll4DOF, **{field: value})

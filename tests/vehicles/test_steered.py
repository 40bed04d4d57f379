"""The steering wheel: an exact ratio, compliance with its time constants and its twist, and the driver's torque."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from four_wheel_cars import (
    assert_symmetric,
    asymmetric,
    car_of,
    drive,
    evaluated,
    inputs,
    state,
)

from jaxveh import InputError, vehicles
from jaxveh.roads import LEVEL
from jaxveh.vehicles import Motion, Roll4DOF, SingleTrack3DOF, Steered, TwoTrack2DOF, TwoTrack3DOF

U = inputs(steering_wheel=0.6, v_x=22.0)
COMPLIANT = {"compliance": 1e-4, "damping": 400.0}


def inner():
    return car_of(TwoTrack2DOF)


def test_rigid_it_is_the_vehicle_at_the_ratio():
    car = Steered(inner(), 15.0)
    assert car.inputs == ("steering_wheel", "v_x") and car.state_type._fields == car.vehicle.state_type._fields
    x = state(car, v_y=-0.3, yaw_rate=0.2)
    rates, out = car.evaluate(0.0, x, U)
    expected, told = car.vehicle.evaluate(0.0, car.vehicle.state_type(*x), inputs(steer=0.6 / 15.0, v_x=22.0))
    np.testing.assert_array_equal(rates, expected)
    np.testing.assert_array_equal([getattr(out, name) for name in told._fields], told)
    assert out.steering_wheel == 0.6 and out.steer == 0.6 / 15.0


def test_the_drivers_torque_is_the_aligning_moment_over_ratio_and_assistance():
    x = state(Steered(inner(), 15.0), v_y=-0.3, yaw_rate=0.2)
    plain, trailing, assisted = (
        Steered(inner(), 15.0, **more).outputs(0.0, x, U)
        for more in ({}, {"trail": 0.03}, {"trail": 0.03, "assist": 2.0})
    )
    np.testing.assert_allclose(plain.steering_torque, -(plain.M_z_fl + plain.M_z_fr) / 15.0, rtol=1e-13)
    mechanical = 0.03 * (plain.F_y_fl + plain.F_y_fr) / 15.0
    np.testing.assert_allclose(trailing.steering_torque - plain.steering_torque, mechanical, rtol=1e-12)
    np.testing.assert_allclose(assisted.steering_torque, trailing.steering_torque / 3.0, rtol=1e-13)
    # A driver who turns left pushes left against the tyres, which want to run straight.
    assert plain.steering_torque > 0.0 and mechanical > 0.0


@pytest.mark.parametrize("inertia", [None, 8.0])
def test_at_standstill_the_wheels_turn_as_a_spring_and_damper_do(inertia):
    car = Steered(inner(), 15.0, **COMPLIANT, inertia=inertia)
    u = inputs(steering_wheel=0.6, v_x=0.0)
    x = drive(car, lambda t: u, car.start(0.0, u, steer=0.0), 0.3, 2e-4)
    k, C, end = 1e4, 400.0, 0.6 / 15.0
    # The hands feel the spring, not the road, which pushes back with nothing here.
    torque = car.outputs(0.0, car.start(0.0, u, steer=0.0), u).steering_torque
    np.testing.assert_allclose(torque, k * end / 15.0, rtol=1e-12)
    t = 2e-4 * np.arange(1, len(x.steer) + 1)
    if inertia is None:
        expected = end * (1 - np.exp(-k / C * t))
    else:
        fading, ring = C / (2 * inertia), np.sqrt(k / inertia - (C / (2 * inertia)) ** 2)
        expected = end * (1 - np.exp(-fading * t) * (np.cos(ring * t) + fading / ring * np.sin(ring * t)))
        assert expected.max() > 1.04 * end  # It rings: exp(-pi) is the first overshoot.
    np.testing.assert_allclose(x.steer, expected, rtol=1e-6, atol=1e-12)


def settled(car, u, **start):
    x = drive(car, lambda t: u, car.start(0.0, u, **start), 6.0, 2e-3)
    last = jax.tree.map(lambda leaf: leaf[-1], x)
    return evaluated(car, last, u)[1]


def test_in_a_steady_turn_the_twist_is_compliance_times_moment():
    rigid, soft, heavy = (
        settled(Steered(inner(), 15.0, trail=0.03, **more), U)
        for more in ({}, COMPLIANT, {**COMPLIANT, "inertia": 8.0})
    )
    moment = soft.M_z_fl + soft.M_z_fr - 0.03 * (soft.F_y_fl + soft.F_y_fr)
    np.testing.assert_allclose(soft.steer, 0.6 / 15.0 + 1e-4 * moment, rtol=1e-8)
    np.testing.assert_allclose(soft.steering_torque, -moment / 15.0, rtol=1e-6)
    np.testing.assert_allclose((heavy.steer, heavy.yaw_rate), (soft.steer, soft.yaw_rate), rtol=1e-7)
    # What gives way under the aligning moment understeers.
    assert soft.steer < 0.95 * rigid.steer and 0 < soft.yaw_rate < rigid.yaw_rate


def test_a_stiff_steering_is_a_rigid_one():
    stiff, rigid = (settled(Steered(inner(), 15.0, **more), U) for more in ({"compliance": 1e-9, "damping": 5e6}, {}))
    np.testing.assert_allclose((stiff.yaw_rate, stiff.v_y), (rigid.yaw_rate, rigid.v_y), rtol=2e-4)


def test_an_axle_on_one_track_says_its_moment_too():
    car = Steered(car_of(SingleTrack3DOF), 15.0, trail=0.02)
    u = inputs(steering_wheel=0.3, drive_torque=0.0, brake_torque=0.0)
    out = car.outputs(0.0, state(car, v_x=20.0), u)
    np.testing.assert_allclose(out.steering_torque, (0.02 * out.F_yf - out.M_zf) / 15.0, rtol=1e-13)
    plain = Steered(vehicles.passenger_car(), 15.0, trail=0.02)
    out = plain.outputs(0.0, plain.start(0.0, U), U)
    np.testing.assert_allclose(out.steering_torque, 0.02 * out.F_yf / 15.0, rtol=1e-13)
    assert out.steering_torque > 1.0


def test_the_start_has_the_wheels_where_the_steering_wheel_is():
    car = Steered(car_of(Roll4DOF), 16.0, **COMPLIANT, inertia=8.0)
    u = inputs(steering_wheel=0.32, drive_torque=0.0, brake_torque=0.0)
    x = car.start(0.0, u, v_x=20.0, roll=0.01)
    assert (x.steer, x.steer_rate, x.v_x, x.roll) == (0.02, 0.0, 20.0, 0.01)
    assert car.start(0.0, u, steer=0.1, steer_rate=1.0)[-2:] == (0.1, 1.0)
    with pytest.raises(InputError, match=r"unknown name\(s\) speed"):
        car.start(0.0, u, speed=3.0)


def test_it_wraps_and_is_wrapped():
    car = vehicles.Travelling(Steered(inner(), 15.0, **COMPLIANT))
    within = Steered(vehicles.Travelling(inner()), 15.0, **COMPLIANT)
    x = {"x": 3.0, "y": 1.0, "yaw": 0.4, "v_y": -0.2, "yaw_rate": 0.1, "steer": 0.03}
    rates = [one.derivatives(0.0, state(one, **x), U)._asdict() for one in (car, within)]
    assert rates[0].keys() == rates[1].keys()
    np.testing.assert_allclose(list(rates[0].values()), list(rates[1].values()), rtol=1e-13)
    assert (
        within.motion(state(within, **x), U) == car.motion(state(car, **x), U) == Motion(3.0, 1.0, 0.4, 22.0, -0.2, 0.1)
    )
    np.testing.assert_array_equal(within.wheel_positions, inner().wheel_positions)


@pytest.mark.parametrize("more", [{}, COMPLIANT, {**COMPLIANT, "inertia": 8.0, "trail": 0.03, "assist": 1.0}], ids=str)
def test_it_is_symmetric_in_every_form(more):
    car = Steered(inner(), 15.0, **more)
    steering = dict.fromkeys(car.own_states, 0.03)
    x = state(car, v_y=-0.4, yaw=0.3, yaw_rate=0.25, **steering)
    assert_symmetric(car, x, U)


def test_an_asymmetric_tyre_makes_a_symmetric_steering():
    car = Steered(car_of(TwoTrack2DOF, front=asymmetric()), 15.0, **COMPLIANT, trail=0.03)
    assert_symmetric(car, state(car, v_y=-0.4, yaw_rate=0.25, steer=0.03), U)


class Cart(vehicles.AbstractVehicle):
    """A point that turns as it is told, without a force."""

    length: jax.Array
    inputs = ("steer", "v_x")
    state_type = property(lambda self: vehicles.SingleTrackState)
    units = property(lambda self: {"yaw": "rad"})

    def start(self, t, u, **values):
        return vehicles.SingleTrackState(0.0 * u.v_x, 0.0 * u.v_x, 0.0 * u.v_x)

    def motion(self, x, u):
        return Motion(0.0, 0.0, x.yaw, u.v_x, x.v_y, u.v_x * u.steer / self.length)

    def evaluate(self, t, x, u, ground=LEVEL):
        zero = 0.0 * u.v_x
        return vehicles.SingleTrackState(zero, u.v_x * u.steer / self.length, zero), x


def test_a_vehicle_without_forces_says_no_torque_and_twists_nothing():
    cart = Cart(jnp.asarray(2.5))
    car = Steered(cart, 15.0)
    rates, out = car.evaluate(0.0, car.start(0.0, U), U)
    np.testing.assert_allclose(rates.yaw, 22.0 * 0.04 / 2.5, rtol=1e-13)
    assert out._fields[-2:] == ("steering_wheel", "steer")
    np.testing.assert_allclose(car.motion(car.start(0.0, U), U).yaw_rate, 22.0 * 0.04 / 2.5, rtol=1e-13)
    soft = Steered(cart, 15.0, **COMPLIANT)
    with pytest.raises(InputError, match=r"Steered\.vehicle = Cart: has no front lateral force"):
        soft.evaluate(0.0, soft.start(0.0, U), U)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"ratio": 0.0}, r"Steered\.ratio = 0\.0: must be positive"),
        ({"compliance": -1e-4}, r"Steered\.compliance = -0\.0001: must be positive"),
        ({"compliance": 1e-4, "damping": 0.0}, r"Steered\.damping = 0\.0: must be positive"),
        ({"inertia": 5.0}, r"Steered\.compliance = None: must be given"),
        ({"assist": -0.5}, r"Steered\.assist = -0\.5: must be at least 0"),
        ({"trail": float("nan")}, r"Steered\.trail = nan: must be finite"),
        ({"vehicle": 3.0}, r"Steered\.vehicle = [0-9.]+: must be a vehicle"),
    ],
)
def test_bad_input_is_named(given, message):
    with pytest.raises(InputError, match=message):
        Steered(**{"vehicle": inner(), "ratio": 15.0, **given})


def test_a_vehicle_without_a_steer_is_refused():
    with pytest.raises(InputError, match=r"its inputs are steering_wheel, v_x; steer must be one"):
        Steered(Steered(inner(), 15.0), 15.0)
    assert "steer" not in Steered(car_of(TwoTrack3DOF), 15.0).inputs

"""Steering rate and acceleration as inputs: limits, what the vehicle is told, and CommonRoad's derivatives."""

import jax.numpy as jnp
import numpy as np
import pytest
from planar_cars import LINEAR, limited, linear, point

from jaxveh import InputError, vehicles
from jaxveh.roads import Ground
from jaxveh.vehicles import GRAVITY

STEER = vehicles.SteerLimits(-0.6, 0.5, -0.4, 0.3)
DRIVE = vehicles.AccelerationLimits(10.0, 5.0, -12.0, 50.0)


@pytest.mark.parametrize(
    ("steer", "wished", "allowed"),
    [
        (0.0, 0.2, 0.2), (0.0, 0.9, 0.3), (0.0, -0.9, -0.4), (0.5, 0.1, 0.0), (0.6, 0.1, 0.0), (0.5, -0.1, -0.1),
        (-0.6, -0.1, 0.0), (-0.7, 0.9, 0.3),
    ],
)  # fmt: skip
def test_steering_stops_at_its_angle_and_its_rate(steer, wished, allowed):
    np.testing.assert_allclose(STEER.limit(jnp.asarray(steer), jnp.asarray(wished)), allowed, rtol=1e-15)


@pytest.mark.parametrize(
    ("speed", "wished", "allowed"),
    [
        (3.0, 4.0, 4.0), (3.0, 12.0, 10.0), (20.0, 12.0, 2.5), (20.0, -12.0, -10.0), (50.0, 1.0, 0.0), (50.0, -1.0, -1.0),
        (-12.0, -1.0, 0.0), (-12.0, 1.0, 1.0), (-5.0, 12.0, 10.0),
    ],
)  # fmt: skip
def test_acceleration_stops_at_grip_power_and_speed(speed, wished, allowed):
    np.testing.assert_allclose(DRIVE.limit(jnp.asarray(speed), jnp.asarray(wished)), allowed, rtol=1e-15)


def test_steer_and_speed_become_states_of_the_same_vehicle():
    plain, vehicle = vehicles.Kinematic(2.7, 1.5), vehicles.Commanded(vehicles.Kinematic(2.7, 1.5))
    assert vehicle.inputs == ("steer_rate", "acceleration")
    assert vehicle.state_type._fields == ("steer", "v_x", "yaw")
    x, u = point(vehicle)
    rates, out = vehicle.evaluate(0.0, x, u)
    assert (float(rates.steer), float(rates.v_x)) == (0.1, 1.2)
    assert float(rates.yaw) == float(plain.derivatives(0.0, *point(plain)).yaw)
    assert (float(out.steer), float(out.steer_rate), float(out.v_x_rate)) == (0.08, 0.1, 1.2)
    assert vehicle.wheel_positions[2] == plain.wheel_positions[2]
    assert vehicle.units["acceleration"] == "m/s^2"


def test_a_vehicle_that_asks_gets_what_an_accelerometer_says():
    car = vehicles.build(vehicles.sets.passenger_car(), vehicles.SingleTrack, cg_height=0.54)
    vehicle = limited(car)
    x, u = point(vehicle)
    assert car.inputs == ("steer", "v_x", "a_x")
    np.testing.assert_allclose(vehicle.outputs(0.0, x, u).a_x, 1.2 - 0.3 * 0.2, rtol=1e-12)
    uphill = Ground(grade=jnp.asarray(0.1))
    expected = 1.2 - 0.3 * 0.2 + GRAVITY * np.sin(0.1)
    np.testing.assert_allclose(vehicle.outputs(0.0, x, u, uphill).a_x, expected, rtol=1e-12)


def test_limits_reach_the_loads():
    vehicle = limited(linear(cg_height=0.55))
    x, u = point(vehicle, v_x=28.0, acceleration=9.0)
    out = vehicle.outputs(0.0, x, u)
    np.testing.assert_allclose([out.v_x_rate, out.a_x], 11.5 * 7.0 / 28.0, rtol=1e-12)


def test_at_a_crawl_the_wheels_roll_and_the_states_follow():
    vehicle = limited(vehicles.KinematicCrawl(linear(cg_height=0.55, crawl_speed=0.1)))
    lean = LINEAR["rear_axle_to_cg"] / 2.7
    steer, v_x = 0.3, 0.05
    x, u = point(vehicle, v_x=v_x, steer=steer, sideslip=np.arctan(lean * np.tan(steer)))
    rates, moves = vehicle.derivatives(0.0, x, u), vehicle.motion(x, u)
    np.testing.assert_allclose(moves.yaw_rate, v_x * np.cos(x.sideslip) * np.tan(steer) / 2.7, rtol=1e-12)
    np.testing.assert_allclose(np.arctan2(moves.v_y, moves.v_x), x.sideslip, rtol=1e-12)
    assert float(rates.yaw) == float(moves.yaw_rate)
    # Along the motion the rates are the slopes of the sideslip and the yaw rate of the wheels.
    step = 1e-6
    later = steer + 0.1 * step
    sideslip = lambda angle: np.arctan(lean * np.tan(angle))
    turning = lambda angle, v: v * np.cos(sideslip(angle)) * np.tan(angle) / 2.7
    np.testing.assert_allclose(rates.sideslip, (sideslip(later) - sideslip(steer)) / step, rtol=1e-5)
    slope = (turning(later, v_x + 1.2 * step) - turning(steer, v_x)) / step
    np.testing.assert_allclose(rates.yaw_rate, slope, rtol=1e-5)
    # From 0.1 m/s upwards it is the linear car.
    x, u = point(vehicle, v_x=0.1, steer=steer)
    linear_car = limited(linear(cg_height=0.55, crawl_speed=0.1))
    np.testing.assert_allclose(vehicle.derivatives(0.0, x, u), linear_car.derivatives(0.0, x, u), rtol=1e-15)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: vehicles.Commanded(vehicles.Longitudinal(1e3)),
            "has the inputs drive_torque, brake_torque: must be steer",
        ),
        (
            lambda: vehicles.KinematicCrawl(vehicles.Kinematic(2.7)),
            "KinematicCrawl.vehicle = Kinematic: must be a Linear",
        ),
        (lambda: vehicles.KinematicCrawl(linear(), below=-1.0), r"KinematicCrawl\.below = -1\.0: must be positive"),
        (lambda: vehicles.SteerLimits(0.1, 0.5, -0.4, 0.4), r"SteerLimits\.smallest = 0\.1: must be negative"),
        (
            lambda: vehicles.AccelerationLimits(10.0, 5.0, 1.0, 50.0),
            r"AccelerationLimits\.backwards = 1\.0: must be neg",
        ),
    ],
)
def test_bad_input_raises(make, message):
    with pytest.raises(InputError, match=message):
        make()


BMW = {
    "mass": 1093.2952334674046,
    "yaw_inertia": 1791.5995300122856,
    "front_axle_to_cg": 1.1561957064,
    "rear_axle_to_cg": 1.4227170936,
}
THEIR_G = 9.81

# Derivatives by vehicle_dynamics_ks, _kst and _st of commonroad-vehicle-models 3.0.2 (BSD-3), vehicle 2, KST with vehicle 4:
# model, state, inputs, derivative, in their order.
ROWS = [
    ("ks", (3.0, -2.0, 0.21, 16.5, 0.8), (0.15, 4.0),
     (11.495660704228229, 11.836375499842125, 0.15, 4.0, 1.3636949385468362)),
    ("ks", (0.0, 1.0, 1.066, 60.0, -2.0), (0.7, 9.0),
     (-24.968810192828546, -54.557845609540905, 0.0, 0.0, 42.10615888568698)),
    ("ks", (0.0, 1.0, -0.3, -5.0, 2.5), (-0.9, -14.0),
     (4.005718077734668, -2.9923607205197826, -0.4, -11.5, 0.5997415841466669)),
    ("kst", (3.0, -2.0, 0.21, 6.5, 0.8, -0.4), (0.15, 4.0),
     (4.528593610756575, 4.6628145908468985, 0.15, 4.0, 0.3848405245797764, -0.0723443239617235)),
    ("kst", (3.0, -2.0, -0.5, -2.0, 0.8, 0.9), (-0.9, -4.0),
     (-1.3934134186943308, -1.4347121817990456, -0.7103, -4.0, 0.3035013832465503, -0.11008733148667779)),
    ("st", (3.0, -2.0, 0.05, 16.5, 0.8, 0.3, 0.02), (0.15, 4.0),
     (11.256649920245623, 12.063906190493782, 0.15, 4.0, 0.3, 0.021885603354077965, -0.2051002282802774)),
    ("st", (3.0, -2.0, -0.12, 35.0, -1.8, -0.3, -0.1), (-0.8, -12.0),
     (-11.315134840222624, -33.12050306905951, -0.4, -11.5, -0.3, -4.047613553108764, 0.33986555901174675)),
    ("st", (3.0, -2.0, 0.3, 0.5, 0.1, 0.05, 0.1), (0.2, 1.0),
     (0.4900332889206208, 0.09933466539753061, 0.2, 1.0, 0.05, 3.0224402575852842, 27.68113261258491)),
]  # fmt: skip


def commonroad(model):
    """Our vehicle and the names of their vector."""
    names = ("x", "y", "steer", "v_x", "yaw")
    if model == "kst":
        limits = (
            vehicles.SteerLimits(-0.55, 0.55, -0.7103, 0.7103),
            vehicles.AccelerationLimits(11.5, 7.824, -2.78, 22.22),
        )
        return vehicles.Travelling(vehicles.Commanded(vehicles.KinematicTrailer(3.6, 8.1), *limits)), (
            *names,
            "hitch_angle",
        )
    limits = (vehicles.SteerLimits(-1.066, 1.066, -0.4, 0.4), vehicles.AccelerationLimits(11.5, 7.319, -13.9, 50.8))
    a, b = BMW["front_axle_to_cg"], BMW["rear_axle_to_cg"]
    if model == "ks":
        return vehicles.Travelling(vehicles.Commanded(vehicles.Kinematic(a + b), *limits)), names
    stiffness = 21.92 * BMW["mass"] * THEIR_G / (a + b)
    car = vehicles.LinearSingleTrack(
        **BMW,
        front_stiffness=stiffness * b,
        rear_stiffness=stiffness * a,
        cg_height=0.61373004 * GRAVITY / THEIR_G,
        crawl_speed=0.1,
    )
    crawl = vehicles.KinematicCrawl(car, below=0.1)
    return vehicles.Travelling(vehicles.Commanded(crawl, *limits)), (*names, "yaw_rate", "sideslip")


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_derivatives_are_commonroads(row):
    model, state, inputs, expected = row
    vehicle, names = commonroad(model)
    x = vehicle.state_type(**{name: jnp.asarray(value) for name, value in zip(names, state, strict=True)})
    _, u = point(vehicle.vehicle, steer_rate=inputs[0], acceleration=inputs[1])
    found = vehicle.derivatives(0.0, x, u)
    np.testing.assert_allclose([getattr(found, name) for name in names], expected, rtol=1e-12, atol=1e-13)

"""The single track under torques: the single track at a given speed, closed forms, grip, slopes, standstill, precision."""

import jax.numpy as jnp
import numpy as np
import pytest
from four_wheel_cars import (
    BODY,
    SLOPES,
    assert_finite,
    assert_gradients,
    assert_symmetric,
    brush,
    car_of,
    drive,
    inputs,
    state,
)

from jaxveh import InputError, tyres, vehicles
from jaxveh.roads import LEVEL
from jaxveh.vehicles import GRAVITY, SingleTrack3DOF, TwoTrack3DOF

U = inputs(steer=0.04, drive_torque=400.0, brake_torque=0.0)
RADIUS = 0.32


def turning(car, **more):
    return state(car, **{"v_x": 22.0, "v_y": -0.4, "yaw": 0.3, "yaw_rate": 0.25, **more})


def test_without_torques_it_is_the_single_track_at_its_speed():
    coasting = inputs(steer=0.04, drive_torque=0.0, brake_torque=0.0)
    car = car_of(SingleTrack3DOF)
    numbers = {name: BODY[name] for name in ("mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg")}
    single = vehicles.SingleTrack(**numbers, front=brush(2), rear=brush(2))
    x, slope = turning(car), LEVEL._replace(bank=0.1, friction_fl=0.4)
    rates = car.derivatives(0.0, x, coasting, slope)
    expected = single.derivatives(0.0, vehicles.SingleTrackState(*x[1:]), inputs(steer=0.04, v_x=22.0), slope)
    np.testing.assert_allclose(rates[1:], expected, rtol=1e-12)


def test_it_is_two_tracks_without_track_whose_load_moves_lengthwise_only():
    wide = car_of(TwoTrack3DOF, track_front=1e-9, track_rear=1e-9, load_transfer=vehicles.StaticLoads())
    car = car_of(SingleTrack3DOF, load_transfer=vehicles.StaticLoads(), drag=0.4, rolling_resistance=0.01)
    wide = car_of(
        TwoTrack3DOF, track_front=1e-9, track_rear=1e-9, load_transfer=vehicles.StaticLoads(), drag=0.4,
        rolling_resistance=0.01,
    )  # fmt: skip
    x, u = turning(car), U._replace(drive_torque=jnp.asarray(1200.0))
    np.testing.assert_allclose(car.derivatives(0.0, x, u), wide.derivatives(0.0, x, u), rtol=1e-7)


def test_speeding_up_by_hand():
    car = car_of(SingleTrack3DOF, drag=0.4, rolling_resistance=0.012, drive=vehicles.AxleDrive(front_drive=0.3))
    out = car.outputs(0.0, state(car, v_x=30.0), inputs(steer=0.0, drive_torque=900.0, brake_torque=0.0))
    m, h = BODY["mass"], BODY["cg_height"]
    np.testing.assert_allclose(out.a_x, (900.0 / RADIUS - 360.0 - 0.012 * m * GRAVITY) / m, rtol=1e-12)
    moved = 900.0 / RADIUS * h / 2.7
    front = m * GRAVITY * BODY["rear_axle_to_cg"] / 2.7 - moved
    np.testing.assert_allclose((out.load_front, out.load_rear), (front, m * GRAVITY - front), rtol=1e-12)
    np.testing.assert_allclose(out.F_xf, 270.0 / RADIUS - 0.012 * front, rtol=1e-12)


def test_full_braking_leaves_a_tenth_of_the_lateral_force():
    car = car_of(SingleTrack3DOF, grip=0.8, load_transfer=vehicles.StaticLoads())
    brake = inputs(steer=0.0, drive_torque=0.0, brake_torque=5e4)
    free, locked = (car.outputs(0.0, turning(car), u) for u in (brake._replace(brake_torque=jnp.zeros(())), brake))
    np.testing.assert_allclose(locked.a_x, -np.sqrt(0.99) * 0.8 * GRAVITY, rtol=1e-12)
    np.testing.assert_allclose((locked.F_yf, locked.M_zr), (0.1 * free.F_yf, 0.1 * free.M_zr), rtol=1e-12)


def test_loads_follow_lagged_accelerations():
    car = car_of(SingleTrack3DOF, load_transfer=vehicles.LaggedLoads(0.2))
    u = inputs(steer=0.0, drive_torque=900.0, brake_torque=0.0)
    x = drive(car, lambda t: u, car.start(0.0, u, v_x=10.0), 0.2, 1e-3)
    a_x = 900.0 / RADIUS / BODY["mass"]
    np.testing.assert_allclose(x.a_x_felt[-1], a_x * (1 - np.exp(-1.0)), rtol=1e-6)
    np.testing.assert_allclose(x.v_x[-1], 10.0 + 0.2 * a_x, rtol=1e-12)


def test_the_torques_of_four_motors_add_up_by_axle():
    car = car_of(SingleTrack3DOF, drive=vehicles.FourMotors())
    u = inputs(steer=0.0, torque_fl=100.0, torque_fr=50.0, torque_rl=-30.0, torque_rr=-60.0)
    out = car.outputs(0.0, state(car, v_x=20.0), u)
    np.testing.assert_allclose((out.F_xf, out.F_xr), (150.0 / RADIUS, -90.0 / RADIUS), rtol=1e-12)
    np.testing.assert_allclose(out.drive_power, 60.0 / RADIUS * 20.0, rtol=1e-12)


def test_on_a_slope_it_rolls_with_gravity():
    car = car_of(SingleTrack3DOF)
    rest = inputs(steer=0.0, drive_torque=0.0, brake_torque=0.0)
    rates = car.derivatives(0.0, state(car), rest, LEVEL._replace(grade=-0.07))
    np.testing.assert_allclose(rates.v_x, GRAVITY * np.sin(0.07), rtol=1e-12)


def test_a_symmetric_tyre_makes_a_symmetric_car():
    car = car_of(SingleTrack3DOF)
    assert_symmetric(car, turning(car), U)


@pytest.mark.parametrize(
    "tyre", [tyres.Relaxed(brush(2), sigma_y=0.4), tyres.LuGre(180.0, 180.0, 1.0, 0.8, 6.0)], ids=["relaxed", "lugre"]
)
def test_tyres_with_states_bring_them_and_start_settled(tyre):
    car = car_of(SingleTrack3DOF, rear=tyre)
    names = [f"rear_{name}" for name in tyre.state_names]
    assert car.state_type._fields == ("v_x", "v_y", "yaw", "yaw_rate", *names)
    x = car.start(0.0, U, v_x=22.0, v_y=-0.3, yaw_rate=0.2)
    rates = car.derivatives(0.0, x, U)
    np.testing.assert_allclose([getattr(rates, name) for name in names], 0.0, atol=1e-12)
    assert abs(getattr(x, names[-1])) > 1e-4


def test_gradients_beyond_the_grip_agree_with_differences():
    car = car_of(SingleTrack3DOF, drag=0.4, rolling_resistance=0.012)
    assert_gradients(car, turning(car), U._replace(drive_torque=jnp.asarray(-9000.0)))


@pytest.mark.parametrize("brake", [0.0, 1e5])
def test_slopes_of_a_braked_car_are_finite(brake):
    car = car_of(SingleTrack3DOF)
    u = inputs(steer=0.1, drive_torque=0.0, brake_torque=brake)
    for x in (state(car), turning(car)):
        assert_finite(car, x, u, SLOPES._replace(friction_rl=0.0, friction_rr=0.0))


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("mass", -1.0, r"SingleTrack3DOF\.mass = -1\.0: must be positive"),
        ("cg_height", 0.0, r"SingleTrack3DOF\.cg_height = 0\.0"),
        ("grip", float("nan"), r"SingleTrack3DOF\.grip = nan"),
        ("rear", 3.0, r"SingleTrack3DOF\.rear = [0-9.]+: must be a tyre"),
    ],
)
def test_bad_input_is_named(field, value, message):
    with pytest.raises(InputError, match=message):
        car_of(SingleTrack3DOF, **{field: value})
    with pytest.raises(InputError, match=r"unknown name\(s\) speed"):
        car_of(SingleTrack3DOF).start(0.0, U, speed=3.0)

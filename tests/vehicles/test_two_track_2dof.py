"""Two tracks at a given speed: the single track as a limit, loads, symmetry, tyres with states, standstill, precision."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from four_wheel_cars import (
    BODY,
    TRACKS,
    assert_finite,
    assert_symmetric,
    asymmetric,
    brush,
    car_of,
    close,
    drive,
    evaluated,
    inputs,
    state,
)

from jaxveh import InputError, tyres, vehicles
from jaxveh.roads import LEVEL
from jaxveh.vehicles import GRAVITY, TwoTrack2DOF

U = inputs(steer=0.04, v_x=22.0)


def turning(car, **more):
    return state(car, **{"v_y": -0.4, "yaw": 0.3, "yaw_rate": 0.25, **more})


def test_without_track_and_height_it_is_the_single_track():
    flat = car_of(TwoTrack2DOF, track_front=1e-9, track_rear=1e-9, cg_height=1e-15)
    numbers = {name: BODY[name] for name in ("mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg")}
    single = vehicles.SingleTrack(**numbers, front=brush(2), rear=brush(2))
    slope = LEVEL._replace(bank=0.1)
    rates = [car.derivatives(0.0, turning(car), U, slope) for car in (flat, single)]
    np.testing.assert_allclose(rates[0], rates[1], rtol=1e-7)
    assert abs(rates[1].yaw_rate) > 0.1


@pytest.mark.parametrize("v", [8.0, 30.0])
def test_linear_tyres_have_the_poles_of_the_textbooks_single_track(v):
    C_f, C_r = 60e3, 66e3
    car = car_of(TwoTrack2DOF, front=tyres.Linear(C_f), rear=tyres.Linear(C_r))
    m, J, a, b = (BODY[name] for name in ("mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg"))

    def rates(z):
        found = car.derivatives(
            0.0, car.state_type(z[0], jnp.zeros(()), z[1]), inputs(steer=0.0, v_x=v)._replace(steer=z[2])
        )
        return jnp.stack([found.v_y, found.yaw_rate])

    found = np.asarray(jax.jit(jax.jacfwd(rates))(np.zeros(3)))
    expected = 2 * np.array(
        [
            [-(C_f + C_r) / (m * v), -(a * C_f - b * C_r) / (m * v) - v / 2, C_f / m],
            [-(a * C_f - b * C_r) / (J * v), -(a**2 * C_f + b**2 * C_r) / (J * v), a * C_f / J],
        ]
    )
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_loads_of_a_steady_turn_by_hand():
    car = car_of(TwoTrack2DOF, front_roll_share=0.6)
    out = car.outputs(0.0, turning(car), U)
    m, a, b, h = (BODY[name] for name in ("mass", "front_axle_to_cg", "rear_axle_to_cg", "cg_height"))
    a_x, a_y = 0.4 * 0.25, 22.0 * 0.25
    front, rear = m * (GRAVITY * b - a_x * h) / (a + b), m * (GRAVITY * a + a_x * h) / (a + b)
    moved_f, moved_r = 0.6 * m * a_y * h / TRACKS["track_front"], 0.4 * m * a_y * h / TRACKS["track_rear"]
    found = out.load_fl, out.load_fr, out.load_rl, out.load_rr
    np.testing.assert_allclose(
        found, [front / 2 - moved_f, front / 2 + moved_f, rear / 2 - moved_r, rear / 2 + moved_r], rtol=1e-13
    )
    np.testing.assert_allclose(out.a_x, a_x, rtol=1e-13)


def test_a_lifted_wheel_leaves_the_axles_load_to_the_other():
    out = car_of(TwoTrack2DOF, cg_height=1.6).outputs(0.0, turning(car_of(TwoTrack2DOF), yaw_rate=0.6), U)
    assert out.load_fl == out.load_rl == out.F_y_fl == 0.0
    np.testing.assert_allclose(out.load_fr + out.load_rr, BODY["mass"] * GRAVITY, rtol=1e-13)


def test_what_an_axle_on_one_wheel_cannot_take_the_other_takes():
    # At 7 m/s^2 the front axle, with nearly all of the transfer, stands on one wheel before the car does.
    car = car_of(TwoTrack2DOF, cg_height=0.8, front_roll_share=0.9)
    out = car.outputs(0.0, turning(car, yaw_rate=7.0 / 22.0), U)
    assert out.load_fl == 0.0 and out.load_rl > 0.0
    moment = 0.5 * TRACKS["track_front"] * (out.load_fr - out.load_fl)
    moment = moment + 0.5 * TRACKS["track_rear"] * (out.load_rr - out.load_rl)
    np.testing.assert_allclose(moment, BODY["mass"] * 7.0 * 0.8, rtol=1e-12)


def test_the_speeds_rate_and_slopes_move_load_between_the_axles():
    car = car_of(TwoTrack2DOF)
    at_rest = car.outputs(0.0, state(car), inputs(steer=0.0, v_x=20.0))
    speeding = car.outputs(0.0, state(car), inputs(steer=0.0, v_x=20.0, v_x_rate=2.0))
    climbing = car.outputs(0.0, state(car), inputs(steer=0.0, v_x=20.0), LEVEL._replace(grade=0.1))
    moved = BODY["mass"] * BODY["cg_height"] / (BODY["front_axle_to_cg"] + BODY["rear_axle_to_cg"])
    np.testing.assert_allclose(at_rest.load_fl + at_rest.load_fr - speeding.load_fl - speeding.load_fr, 2.0 * moved)
    np.testing.assert_allclose(climbing.a_x, GRAVITY * np.sin(0.1), rtol=1e-12)
    front = BODY["mass"] * GRAVITY * np.cos(0.1) * BODY["rear_axle_to_cg"] / 2.7 - moved * GRAVITY * np.sin(0.1)
    np.testing.assert_allclose(climbing.load_fl + climbing.load_fr, front, rtol=1e-12)


def test_lagged_loads_settle_to_the_same_turn_as_quasi_static_ones():
    cars = [car_of(TwoTrack2DOF, load_transfer=t) for t in (vehicles.QuasiStatic(), vehicles.LaggedLoads(0.1))]
    steady, lagged = (drive(car, lambda t: inputs(steer=0.03, v_x=20.0), car.start(0.0, U), 6.0, 0.005) for car in cars)
    np.testing.assert_allclose(lagged.yaw_rate[-1], steady.yaw_rate[-1], rtol=1e-6)
    np.testing.assert_allclose(lagged.v_y[-1], steady.v_y[-1], rtol=1e-5)
    assert abs(lagged.yaw_rate[40] / steady.yaw_rate[40] - 1) > 1e-5


def test_measured_loads_take_their_accelerations_from_the_inputs():
    car = car_of(TwoTrack2DOF, load_transfer=vehicles.MeasuredLoads())
    assert car.inputs == ("steer", "v_x", "a_x", "a_y")
    out = car.outputs(0.0, state(car), inputs(steer=0.0, v_x=20.0, a_x=0.0, a_y=3.0))
    moved = BODY["mass"] * 3.0 * BODY["cg_height"] * BODY["rear_axle_to_cg"] / 2.7 / TRACKS["track_front"]
    np.testing.assert_allclose((out.load_fr - out.load_fl) / 2, moved, rtol=1e-12)


def test_an_asymmetric_tyre_makes_a_symmetric_car():
    car = car_of(TwoTrack2DOF, front=asymmetric(), rear=asymmetric())
    assert_symmetric(car, turning(car), U)
    straight, shown = evaluated(car, state(car), inputs(steer=0.0, v_x=22.0))
    np.testing.assert_allclose(straight, 0.0, atol=1e-12)
    assert abs(shown.F_y_fl) > 20.0


@pytest.mark.parametrize(
    "tyre",
    [tyres.Relaxed(brush(), sigma_y=0.4), tyres.LuGre(180.0, 180.0, 1.0, 0.8, 6.0)],
    ids=["relaxed", "lugre"],
)
def test_tyres_with_states_bring_them_and_start_settled(tyre):
    car = car_of(TwoTrack2DOF, front=tyre)
    names = [f"{corner}_{name}" for corner in ("fl", "fr") for name in tyre.state_names]
    assert car.state_type._fields == ("v_y", "yaw", "yaw_rate", *names)
    x = car.start(0.0, U, v_y=-0.3, yaw_rate=0.2)
    rates = car.derivatives(0.0, x, U)
    np.testing.assert_allclose([getattr(rates, name) for name in names], 0.0, atol=1e-12)
    moved = car.derivatives(0.0, x._replace(**{names[-1]: getattr(x, names[-1]) + 1e-3}), U)
    assert getattr(moved, names[-1]) < -1e-3
    assert_symmetric(car, x, U)


@pytest.mark.parametrize("speed", [0.0, -2.0])
def test_slopes_of_a_car_that_stands_or_slides_are_finite(speed):
    car = car_of(TwoTrack2DOF)
    assert_finite(car, turning(car), inputs(steer=0.1, v_x=speed))


def test_travelling_carries_it_along():
    car = vehicles.Travelling(car_of(TwoTrack2DOF))
    x = car.start(0.0, U, yaw=0.5, v_y=0.2)
    rates = car.derivatives(0.0, x, U)
    expected = 22 * np.cos(0.5) - 0.2 * np.sin(0.5), 22 * np.sin(0.5) + 0.2 * np.cos(0.5)
    np.testing.assert_allclose((rates.x, rates.y), expected, rtol=1e-12)
    close(
        car.vehicle.derivatives(0.0, car.vehicle.start(0.0, U, yaw=0.5, v_y=0.2), U), car.vehicle.state_type(*rates[2:])
    )


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("mass", 0.0, r"TwoTrack2DOF\.mass = 0\.0: must be positive"),
        ("track_rear", -1.5, r"TwoTrack2DOF\.track_rear = -1\.5"),
        ("cg_height", float("nan"), r"TwoTrack2DOF\.cg_height = nan"),
        ("front_roll_share", 1.2, r"TwoTrack2DOF\.front_roll_share = 1\.2: must be between 0 and 1"),
        ("rear", None, r"TwoTrack2DOF\.rear = None: must be a tyre"),
        ("crawl_speed", 0.0, r"TwoTrack2DOF\.crawl_speed = 0\.0"),
    ],
)
def test_bad_input_is_named(field, value, message):
    with pytest.raises(InputError, match=message):
        car_of(TwoTrack2DOF, **{field: value})
    with pytest.raises(InputError, match=r"unknown name\(s\) v_x"):
        car_of(TwoTrack2DOF).start(0.0, U, v_x=3.0)

"""Two tracks under torques: SevenDOF in gentle manoeuvres, grip shared by both directions, four motors, slopes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from four_wheel_cars import (
    BODY,
    SLOPES,
    TRACKS,
    assert_finite,
    assert_gradients,
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
from jaxveh.vehicles import GRAVITY, TwoTrack2DOF, TwoTrack3DOF
from jaxveh.vehicles.traction import saturate, within_grip

U = inputs(steer=0.04, drive_torque=400.0, brake_torque=0.0)
RADIUS = 0.32


def turning(car, **more):
    return state(car, **{"v_x": 22.0, "v_y": -0.4, "yaw": 0.3, "yaw_rate": 0.25, **more})


def test_a_gentle_manoeuvre_is_that_of_seven_degrees_of_freedom():
    # The torque balances the drag, so that the wheels' inertia, which this car lacks, has next to nothing to say.
    more = {"load_transfer": vehicles.LaggedLoads(0.1), "drag": 0.4}
    cars = car_of(TwoTrack3DOF, **more), car_of(vehicles.SevenDOF, **more)
    gentle = inputs(steer=0.0, drive_torque=0.4 * 20.0**2 * RADIUS, brake_torque=0.0)
    at = lambda t: gentle._replace(steer=0.015 * jnp.sin(2.0 * t))
    short, full = (drive(car, at, car.start(0.0, U, v_x=20.0), 4.0, 1e-3) for car in cars)
    for name in ("v_x", "v_y", "yaw", "yaw_rate"):
        found, expected = getattr(short, name), getattr(full, name)
        assert np.max(np.abs(found - expected)) < 0.01 * np.max(np.abs(expected)), name
    assert np.max(np.abs(full.yaw_rate)) > 0.08


def test_without_torques_it_is_the_car_at_a_given_speed():
    coasting = inputs(steer=0.04, drive_torque=0.0, brake_torque=0.0)
    car, given = car_of(TwoTrack3DOF, load_transfer=vehicles.QuasiStatic()), car_of(TwoTrack2DOF)
    x = turning(car)
    rates = car.derivatives(0.0, x, coasting)
    # The given speed's own acceleration, so that both shift the same load: none without torques.
    u = inputs(steer=0.04, v_x=22.0, a_x=0.0)
    np.testing.assert_allclose(rates[1:], given.derivatives(0.0, given.state_type(*x[1:]), u), rtol=1e-12)


def test_the_ellipse_holds_and_ends_at_a_tenth_of_the_lateral_force():
    limit, F_y0 = 4000.0, 2500.0
    wish = jnp.linspace(-9000.0, 9000.0, 401)
    found = within_grip(tyres.Forces(F_y=F_y0, M_z=-50.0), wish, limit)
    np.testing.assert_allclose((found.F_x / limit) ** 2 + (found.F_y / F_y0) ** 2, 1.0, rtol=1e-13)
    np.testing.assert_allclose(found.M_z / -50.0, found.F_y / F_y0, rtol=1e-13)
    np.testing.assert_allclose((found.F_y[0], found.F_y[-1]), 0.1 * F_y0, rtol=1e-12)
    gentle = np.abs(wish) < 0.89 * limit
    np.testing.assert_allclose(found.F_x[gentle], wish[gentle], rtol=1e-14)
    assert (np.diff(found.F_x) >= 0).all()


def test_saturation_has_no_kink_and_finite_slopes():
    wish = np.linspace(-1.5, 1.5, 3001)
    slope = np.asarray(jax.jit(jax.vmap(jax.grad(saturate)))(wish))
    assert (np.abs(np.diff(slope)) < 0.0051).all() and slope.min() == 0.0 and slope.max() == 1.0
    lateral = lambda w: within_grip(tyres.Forces(F_y=1.0), w, 1.0).F_y
    assert (np.abs(jax.jit(jax.vmap(jax.grad(lateral)))(wish)) < 4.0).all()
    lifted = jax.jit(jax.grad(lambda load: within_grip(tyres.Forces(F_y=0.0), 3000.0, load).F_x))(0.0)
    assert np.isfinite(lifted)


def test_straight_running_under_torque_drag_and_rolling_resistance():
    car = car_of(TwoTrack3DOF, drag=0.4, rolling_resistance=0.012)
    out = car.outputs(0.0, state(car, v_x=30.0), inputs(steer=0.0, drive_torque=500.0, brake_torque=0.0))
    weight = BODY["mass"] * GRAVITY
    np.testing.assert_allclose(out.a_x, (500.0 / RADIUS - 0.4 * 900.0 - 0.012 * weight) / BODY["mass"], rtol=1e-12)
    np.testing.assert_allclose(out.drive_power, 500.0 / RADIUS * 30.0, rtol=1e-12)
    backwards = car.outputs(0.0, state(car, v_x=-30.0), inputs(steer=0.0, drive_torque=0.0, brake_torque=0.0))
    np.testing.assert_allclose(backwards.a_x, (0.4 * 900.0 + 0.012 * weight) / BODY["mass"], rtol=1e-12)


def test_full_braking_takes_the_grip_of_the_road():
    car = car_of(TwoTrack3DOF, grip=0.9, load_transfer=vehicles.QuasiStatic())
    ground = LEVEL._replace(**{f"friction_{c}": 0.5 for c in ("fl", "fr", "rl", "rr")})
    out = car.outputs(0.0, state(car, v_x=20.0), inputs(steer=0.0, drive_torque=0.0, brake_torque=3e4), ground)
    np.testing.assert_allclose(out.a_x, -np.sqrt(0.99) * 0.45 * GRAVITY, rtol=1e-12)
    moved = BODY["mass"] * out.a_x * BODY["cg_height"] / 2.7
    static = BODY["mass"] * GRAVITY * BODY["rear_axle_to_cg"] / 2.7
    np.testing.assert_allclose(out.load_fl + out.load_fr, static - moved, rtol=1e-12)


def test_loads_settle_to_what_the_tyres_push_whatever_follows_them():
    # The air pushes at the height of the centre of gravity: at a steady speed the rear axle still carries more than at rest.
    torque = (0.4 * 45.0**2 + 0.012 * BODY["mass"] * GRAVITY) * RADIUS
    u = inputs(steer=0.0, drive_torque=torque, brake_torque=0.0)
    make = lambda transfer: car_of(TwoTrack3DOF, drag=0.4, rolling_resistance=0.012, load_transfer=transfer)
    quasi, lagged = make(vehicles.QuasiStatic()), make(vehicles.LaggedLoads(0.1))
    push = 0.4 * 45.0**2 / BODY["mass"]
    x = state(lagged, v_x=45.0, a_x_felt=push)
    rates, out = lagged.derivatives(0.0, x, u), lagged.outputs(0.0, x, u)
    np.testing.assert_allclose((rates.v_x, rates.a_x_felt), 0.0, atol=1e-12)
    moved = BODY["mass"] * push * BODY["cg_height"] / 2.7
    np.testing.assert_allclose(out.load_rl + out.load_rr, BODY["mass"] * GRAVITY * 1.15 / 2.7 + moved, rtol=1e-12)
    # Quasi-static loads take the torque for the push, rolling resistance included.
    settled = quasi.outputs(0.0, state(quasi, v_x=45.0), u)
    np.testing.assert_allclose(settled.load_rl, out.load_rl, rtol=0.01)


def test_on_two_frictions_it_turns_about_as_the_car_with_wheel_spins():
    # Loads of a steady turn, speed times yaw rate, which this is not, make the car spin round.
    ground = LEVEL._replace(friction_fr=0.2, friction_rr=0.2)
    braking = inputs(steer=0.0, drive_torque=0.0, brake_torque=0.4 * BODY["mass"] * GRAVITY * RADIUS)

    def heading(car):
        step = 1e-3
        half = lambda x, rates, h: jax.tree.map(lambda value, rate: value + h * rate, x, rates)

        def midpoint(x, _):
            between = half(x, car.derivatives(0.0, x, braking, ground), 0.5 * step)
            return half(x, car.derivatives(0.0, between, braking, ground), step), None

        return jax.lax.scan(midpoint, car.start(0.0, braking, v_x=25.0), length=2000)[0].yaw

    two_track, seven = (float(jax.jit(heading)(car_of(kind))) for kind in (TwoTrack3DOF, vehicles.SevenDOF))
    spun = float(jax.jit(heading)(car_of(TwoTrack3DOF, load_transfer=vehicles.QuasiStatic())))
    # 16 and 10 degrees: a wheel without spin cannot lock, and keeps a tenth of its lateral force.
    assert seven > 0.1 and abs(two_track - seven) < 0.1
    assert spun > 2.5 * seven


def test_motors_that_differ_turn_the_car():
    car = car_of(TwoTrack3DOF, drive=vehicles.FourMotors())
    assert car.inputs == ("steer", "torque_fl", "torque_fr", "torque_rl", "torque_rr")
    out = car.outputs(
        0.0, state(car, v_x=20.0), inputs(steer=0.0, torque_fl=-80.0, torque_fr=120.0, torque_rl=-50.0, torque_rr=150.0)
    )
    moment = (200.0 * TRACKS["track_front"] + 200.0 * TRACKS["track_rear"]) / (2 * RADIUS)
    np.testing.assert_allclose(out.yaw_acceleration, moment / BODY["yaw_inertia"], rtol=1e-12)
    np.testing.assert_allclose(out.a_x, 140.0 / RADIUS / BODY["mass"], rtol=1e-12)


def test_a_road_of_two_frictions_turns_a_braking_car_to_the_grip():
    car = car_of(TwoTrack3DOF)
    ground = LEVEL._replace(friction_fl=0.2, friction_rl=0.2)
    out = car.outputs(0.0, state(car, v_x=20.0), inputs(steer=0.0, drive_torque=0.0, brake_torque=3e4), ground)
    assert out.yaw_acceleration < -1.0


def test_on_a_slope_it_rolls_with_gravity_and_a_torque_holds_it():
    car, ground = car_of(TwoTrack3DOF), LEVEL._replace(grade=0.12)
    rest = inputs(steer=0.0, drive_torque=0.0, brake_torque=0.0)
    rates, shown = car.evaluate(0.0, state(car), rest, ground)
    np.testing.assert_allclose(rates.v_x, -GRAVITY * np.sin(0.12), rtol=1e-12)
    np.testing.assert_allclose(shown.a_x, 0.0, atol=1e-13)
    held = rest._replace(drive_torque=jnp.asarray(BODY["mass"] * GRAVITY * np.sin(0.12) * RADIUS))
    np.testing.assert_allclose(car.derivatives(0.0, state(car), held, ground).v_x, 0.0, atol=1e-12)


def test_brakes_bring_it_to_rest_and_keep_it_there():
    car = car_of(TwoTrack3DOF)
    u = inputs(steer=0.05, drive_torque=0.0, brake_torque=2000.0)
    x = drive(car, lambda t: u, car.start(0.0, u, v_x=10.0), 4.0, 2e-3)
    assert abs(x.v_x[-1]) < 1e-3 and abs(x.yaw_rate[-1]) < 1e-3 and x.yaw[-1] > 0.05


def test_an_asymmetric_tyre_makes_a_symmetric_car():
    car = car_of(TwoTrack3DOF, front=asymmetric(), rear=asymmetric())
    assert_symmetric(car, turning(car), U)
    straight, shown = evaluated(car, state(car, v_x=22.0), inputs(steer=0.0, drive_torque=0.0, brake_torque=0.0))
    np.testing.assert_allclose(straight, 0.0, atol=1e-12)
    assert abs(shown.F_y_fl) > 20.0


@pytest.mark.parametrize(
    "tyre", [tyres.Relaxed(brush(), sigma_y=0.4), tyres.LuGre(180.0, 180.0, 1.0, 0.8, 6.0)], ids=["relaxed", "lugre"]
)
def test_tyres_with_states_and_lagged_loads_bring_their_states(tyre):
    car = car_of(TwoTrack3DOF, rear=tyre, load_transfer=vehicles.LaggedLoads())
    names = [f"{corner}_{name}" for corner in ("rl", "rr") for name in tyre.state_names]
    assert car.state_type._fields == ("v_x", "v_y", "yaw", "yaw_rate", "a_x_felt", "a_y_felt", *names)
    x = car.start(0.0, U, v_x=22.0, v_y=-0.3, yaw_rate=0.2)
    rates = car.derivatives(0.0, x, U)
    np.testing.assert_allclose([getattr(rates, name) for name in names], 0.0, atol=1e-12)
    assert_symmetric(car, x._replace(a_y_felt=jnp.asarray(3.0)), U)


def test_gradients_beyond_the_grip_agree_with_differences():
    car = car_of(TwoTrack3DOF, drag=0.4, rolling_resistance=0.012)
    assert_gradients(car, turning(car), U._replace(drive_torque=jnp.asarray(-9000.0)))


@pytest.mark.parametrize("brake", [0.0, 1e5])
def test_slopes_of_a_braked_car_are_finite(brake):
    car = car_of(TwoTrack3DOF)
    u = inputs(steer=0.1, drive_torque=0.0, brake_torque=brake)
    for x in (state(car), turning(car)):
        assert_finite(car, x, u, SLOPES._replace(friction_rr=0.0))


def test_travelling_carries_it_along():
    car = vehicles.Travelling(car_of(TwoTrack3DOF))
    x = car.start(0.0, U, v_x=20.0)
    rates = car.derivatives(0.0, x, U)
    assert rates.x == 20.0 and rates.y == 0.0
    close(car.vehicle.derivatives(0.0, car.vehicle.start(0.0, U, v_x=20.0), U), car.vehicle.state_type(*rates[2:]))


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("grip", -1.0, r"TwoTrack3DOF\.grip = -1\.0: must be positive"),
        ("wheel_radius", 0.0, r"TwoTrack3DOF\.wheel_radius = 0\.0"),
        ("drag", float("inf"), r"TwoTrack3DOF\.drag = inf: must be finite"),
        ("front", 3.0, r"TwoTrack3DOF\.front = [0-9.]+: must be a tyre"),
    ],
)
def test_bad_input_is_named(field, value, message):
    with pytest.raises(InputError, match=message):
        car_of(TwoTrack3DOF, **{field: value})

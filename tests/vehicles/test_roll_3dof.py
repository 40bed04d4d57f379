"""The rolling body at a given speed: Lagrange's equations, steady roll, loads and their moments, symmetry, precision."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from four_wheel_cars import (
    BODY,
    ROLLING,
    SLOPES,
    TRACKS,
    assert_finite,
    assert_symmetric,
    asymmetric,
    brush,
    car_of,
    drive,
    evaluated,
    inputs,
    state,
)

from jaxveh import InputError, estimators, sensors, tyres, vehicles
from jaxveh._core.names import record
from jaxveh.roads import LEVEL
from jaxveh.sensors import OpticalSideslip, Position
from jaxveh.vehicles import GRAVITY, Roll3DOF, Roll4DOF, TwoTrack2DOF
from jaxveh.vehicles.rolling_body import roll_accelerations
from jaxveh.vehicles.wheels import gravity

U = inputs(steer=0.04, v_x=22.0)
M, M_S, M_U = BODY["mass"], ROLLING["sprung_mass"], BODY["mass"] - ROLLING["sprung_mass"]
H_U = 0.32
AXIS = (1.55 * ROLLING["roll_centre_front"] + 1.15 * ROLLING["roll_centre_rear"]) / 2.7
ARM = (M * BODY["cg_height"] - M_U * H_U) / M_S - AXIS
STIFFNESS = ROLLING["roll_stiffness_front"] + ROLLING["roll_stiffness_rear"]
LEVER = M_S / M * ARM
DAMPING = ROLLING["roll_damping_front"] + ROLLING["roll_damping_rear"]


def turning(car, **more):
    return state(car, **{"v_y": -0.4, "yaw": 0.3, "yaw_rate": 0.25, "roll": 0.06, "roll_rate": -0.2, **more})


def kinetic_energy(q, speed):
    """Two bodies in the world, q = (x, y, yaw, roll): the sprung one's centre of gravity moves with yaw and roll."""

    def place(q):
        side = -ARM * jnp.sin(q[3])
        return jnp.stack([q[0] - side * jnp.sin(q[2]), q[1] + side * jnp.cos(q[2]), ARM * jnp.cos(q[3])])

    sprung = jax.jvp(place, (q,), (speed,))[1]
    turn, roll = speed[2], speed[3]
    spins = BODY["yaw_inertia"] * turn**2 + ROLLING["roll_inertia"] * roll**2
    return (
        0.5 * M_U * (speed[0] ** 2 + speed[1] ** 2)
        + 0.5 * M_S * jnp.sum(sprung**2)
        + 0.5 * spins
        - ROLLING["roll_yaw_product"] * turn * roll
    )


@jax.jit
def lagrange(q, speed):
    """The mass matrix, and what the kinetic energy puts beside the forces."""
    by_speed = jax.grad(kinetic_energy, 1)
    drift = jax.jvp(lambda q: by_speed(q, speed), (q,), (speed,))[1]
    return jax.jacfwd(by_speed, 1)(q, speed), jax.grad(kinetic_energy)(q, speed) - drift


@pytest.mark.parametrize("seed", range(5))
def test_accelerations_are_those_of_lagranges_equations(seed):
    rng = np.random.default_rng(seed)
    roll, roll_rate, yaw, yaw_rate = 0.4 * rng.normal(size=4)
    v = 10 * rng.normal(size=2)
    X, Y, N = 5e3 * rng.normal(size=3)
    g = np.array([1.5, -2.0, -9.3])
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    q, speed = np.array([3.0, -2.0, yaw, roll]), np.array([*(turn @ v), yaw_rate, roll_rate])
    s, c = np.sin(roll), np.cos(roll)
    force = np.array(
        [
            *(turn @ (np.array([X, Y]) + M * g[:2])),
            N + M_S * ARM * s * g[0],
            -M_S * ARM * (g[1] * c + g[2] * s) - STIFFNESS * roll - DAMPING * roll_rate,
        ]
    )
    mass, pull = lagrange(q, speed)
    expected = np.linalg.solve(mass, force + pull)
    a_x, a_y = turn.T @ expected[:2] - g[:2]
    x = record("X", {"roll": jnp.asarray(roll), "roll_rate": roll_rate, "yaw_rate": yaw_rate})
    car = car_of(Roll3DOF)
    found = roll_accelerations(car, x, X, Y, N, g[2])
    np.testing.assert_allclose(found, (a_x, a_y, *expected[2:]), rtol=1e-10)


def leaning(kind):
    """A car of either kind in a turn on slopes: rates, outputs, and velocity and its rate of the point on the roll axis."""
    car = car_of(kind)
    if kind is Roll4DOF:
        x, u = turning(car, v_x=22.0), inputs(steer=0.04, drive_torque=400.0, brake_torque=0.0)
        rates, out = evaluated(car, x, u, SLOPES)
        return x, rates, out, (x.v_x, x.v_y), (rates.v_x, rates.v_y)
    x, u = turning(car), U._replace(v_x=jnp.asarray(22.0))
    rates, out = evaluated(car, x, u, SLOPES)
    # The speed that is given, and constant, is that of the centre of gravity.
    behind = lambda roll, yaw_rate: 22.0 - LEVER * jnp.sin(roll) * yaw_rate
    v_x, v_x_rate = jax.jvp(behind, (x.roll, x.yaw_rate), (rates.roll, rates.yaw_rate))
    return x, rates, out, (v_x, x.v_y), (v_x_rate, rates.v_y)


@pytest.mark.parametrize("kind", [Roll3DOF, Roll4DOF])
def test_speeds_and_accelerations_belong_to_the_centre_of_gravity(kind):
    """Against the way in the world of the two bodies' common centre, drawn with the rates of the states."""
    x, rates, out, speed, speed_rate = leaning(kind)
    turn = np.array([[np.cos(x.yaw), -np.sin(x.yaw)], [np.sin(x.yaw), np.cos(x.yaw)]])
    begins, bends = turn @ np.array(speed), turn @ (np.array(speed_rate) + x.yaw_rate * np.array([-speed[1], speed[0]]))

    def way(t):
        yaw = x.yaw + x.yaw_rate * t + rates.yaw_rate * t**2 / 2
        roll = x.roll + x.roll_rate * t + rates.roll_rate * t**2 / 2
        aside = -LEVER * jnp.sin(roll)
        return begins * t + bends * t**2 / 2 + aside * jnp.stack([-jnp.sin(yaw), jnp.cos(yaw)])

    moves = jax.jacfwd(way)
    velocity, acceleration = (turn.T @ np.asarray(v) for v in jax.jit(lambda t: (moves(t), jax.jacfwd(moves)(t)))(0.0))
    np.testing.assert_allclose((out.v_x, out.v_y), velocity, rtol=1e-10)
    np.testing.assert_allclose((out.a_x, out.a_y), acceleration - np.array(gravity(SLOPES)[:2]), rtol=1e-10)
    np.testing.assert_allclose(out.sideslip, np.arctan2(*velocity[::-1]), rtol=1e-10)
    assert abs(out.v_y - x.v_y) > 0.05


@pytest.mark.parametrize("kind", [Roll3DOF, Roll4DOF])
def test_an_optical_sensor_on_the_roll_axis_sees_the_speeds_of_the_axis(kind):
    _, _, out, speed, _ = leaning(kind)
    device = OpticalSideslip(position=Position(0.0, 0.0, -LEVER), rate=10.0)
    said = device.read(np.zeros(1), {name: jnp.stack([value]) for name, value in out._asdict().items()})
    np.testing.assert_allclose((said["v_x"][0], said["v_y"][0]), speed, rtol=1e-10)


def test_the_sideslip_that_estimates_report_is_the_cars():
    car, x = car_of(Roll3DOF), turning(car_of(Roll3DOF))
    found = estimators.state_space(car, sensors.esc(), report=("sideslip",)).report(0.0, x, U).sideslip
    np.testing.assert_allclose(found, car.outputs(0.0, x, U).sideslip, rtol=1e-12)


def test_small_motions_are_those_of_the_textbook():
    car = car_of(Roll3DOF, front=tyres.Linear(60e3), rear=tyres.Linear(66e3))
    v = 22.0

    def rates(z):
        x = car.state_type(z[0], jnp.zeros(()), z[1], z[2], z[3])
        found = car.derivatives(0.0, x, inputs(steer=0.0, v_x=v)._replace(steer=z[4]))
        return jnp.stack([found.v_y, found.yaw_rate, found.roll, found.roll_rate])

    found = np.asarray(jax.jit(jax.jacfwd(rates))(np.zeros(5)))
    a, b, C_f, C_r, S = 1.15, 1.55, 120e3, 132e3, M_S * ARM
    # Rows: lateral, yaw, roll angle, roll; columns: v_y, r, phi, p, steer.
    right = np.array(
        [
            [-(C_f + C_r) / v, -(a * C_f - b * C_r) / v - M * v, 0, 0, C_f],
            [-(a * C_f - b * C_r) / v, -(a**2 * C_f + b**2 * C_r) / v, 0, 0, a * C_f],
            [0, 0, 0, 1, 0],
            [0, S * v, S * GRAVITY - STIFFNESS, -DAMPING, 0],
        ]
    )
    I_xz = ROLLING["roll_yaw_product"]
    left = np.array(
        [
            [M, 0, 0, -S],
            [0, BODY["yaw_inertia"], 0, -I_xz],
            [0, 0, 1, 0],
            [-S, -I_xz, 0, ROLLING["roll_inertia"] + S * ARM],
        ]
    )
    np.testing.assert_allclose(found, np.linalg.solve(left, right), rtol=1e-9, atol=1e-9)


def steady_turn(car, steer, v):
    """The last of eight seconds at this steer (rad) and speed (m/s), with its outputs."""
    u = inputs(steer=steer, v_x=v)
    x = jax.tree.map(lambda leaf: leaf[-1], drive(car, lambda t: u, car.start(0.0, u), 8.0, 4e-3))
    rates, out = evaluated(car, x, u)
    assert all(abs(float(rate)) < 1e-6 for rate in (rates.yaw_rate, rates.roll_rate, rates.v_y, rates.roll))
    return out


def test_steady_roll_angle_by_hand():
    # Of second order in the roll angle (0.01 rad) and in h phi r / v (2e-5).
    out = steady_turn(car_of(Roll3DOF), 0.005, 25.0)
    per_a_y = M_S * ARM / (STIFFNESS - M_S * GRAVITY * ARM)
    np.testing.assert_allclose(out.roll / out.a_y, per_a_y, rtol=3e-4)
    assert out.roll > 0.005 and out.yaw_rate > 0


def test_the_loads_of_a_steady_turn_hold_the_weight_and_its_moment():
    out = steady_turn(car_of(Roll3DOF), 0.03, 25.0)
    loads = out.load_fl, out.load_fr, out.load_rl, out.load_rr
    np.testing.assert_allclose(sum(loads), M * GRAVITY, rtol=1e-13)
    found = 0.5 * TRACKS["track_front"] * (out.load_fr - out.load_fl)
    found += 0.5 * TRACKS["track_rear"] * (out.load_rr - out.load_rl)
    s, c = np.sin(out.roll), np.cos(out.roll)
    # The speed is that of the centre of gravity; what leans out is faster, what does not is slower.
    a_y = (25.0 - LEVER * s * out.yaw_rate) * out.yaw_rate
    sprung = a_y + ARM * s * out.yaw_rate**2
    moment = M_S * (sprung * (AXIS + ARM * c) + GRAVITY * ARM * s) + M_U * a_y * H_U
    # What the loads feel does not tell these apart, by h phi r / v = 3e-4 of the parts that do not come through the springs.
    np.testing.assert_allclose(found, moment, rtol=5e-5)
    assert a_y > 4.0 and sprung > 25.0 * out.yaw_rate


def test_a_stiff_body_rolls_like_a_rigid_car():
    stiff = {
        "roll_stiffness_front": 6e7,
        "roll_stiffness_rear": 4e7,
        "roll_damping_front": 2e5,
        "roll_damping_rear": 2e5,
    }
    direct = 1.55 / 2.7 * (M_S * ROLLING["roll_centre_front"] + M_U * H_U)
    share = (0.6 * M_S * ARM + direct) / (M * BODY["cg_height"])
    rolls = steady_turn(car_of(Roll3DOF, **stiff), 0.03, 20.0)
    rigid = car_of(TwoTrack2DOF, front_roll_share=share)
    u = inputs(steer=0.03, v_x=20.0)
    last = jax.tree.map(lambda leaf: leaf[-1], drive(rigid, lambda t: u, rigid.start(0.0, u), 8.0, 4e-3))
    out = rigid.outputs(0.0, last, u)
    # The stiff body still leans by 5e-5 rad.
    for name in ("yaw_rate", "v_y", "load_fl", "load_rr"):
        np.testing.assert_allclose(getattr(rolls, name), getattr(out, name), rtol=3e-4, err_msg=name)


def test_springs_and_dampers_load_the_wheels_before_any_force_does():
    car = car_of(Roll3DOF)
    straight = inputs(steer=0.0, v_x=22.0)
    rest, leaning = (car.outputs(0.0, state(car, **s), straight) for s in ({}, {"roll": 0.02, "roll_rate": 0.1}))
    front = (0.02 * ROLLING["roll_stiffness_front"] + 0.1 * ROLLING["roll_damping_front"]) / TRACKS["track_front"]
    rear = (0.02 * ROLLING["roll_stiffness_rear"] + 0.1 * ROLLING["roll_damping_rear"]) / TRACKS["track_rear"]
    np.testing.assert_allclose((leaning.load_fr - rest.load_fr, rest.load_fl - leaning.load_fl), front, rtol=1e-10)
    np.testing.assert_allclose((leaning.load_rr - rest.load_rr, rest.load_rl - leaning.load_rl), rear, rtol=1e-10)
    np.testing.assert_allclose(rest.load_fl, M * GRAVITY * 1.55 / 2.7 / 2, rtol=1e-12)


def test_a_lifted_wheel_leaves_the_axles_load_to_the_other():
    car = car_of(Roll3DOF)
    out = car.outputs(0.0, state(car, roll=0.4), inputs(steer=0.0, v_x=22.0))
    assert out.load_fl == out.load_rl == 0.0
    np.testing.assert_allclose(out.load_fr + out.load_rr, M * GRAVITY, rtol=1e-13)


def test_a_bank_pulls_the_body_to_its_lower_side():
    car = car_of(Roll3DOF)
    straight = inputs(steer=0.0, v_x=22.0)
    # The road holds the car (a force m g_y from the tyres) where it slips sideways; here it slides freely, and hangs free.
    slides = evaluated(car, state(car), straight, LEVEL._replace(bank=0.1))[0]
    np.testing.assert_allclose((slides.roll_rate, slides.v_y), (0.0, -GRAVITY * np.sin(0.1)), atol=1e-12)
    held = roll_accelerations(car, state(car), 0.0, M * GRAVITY * np.sin(0.1), 0.0, -GRAVITY * np.cos(0.1))
    assert held.roll > 0.5


def test_an_asymmetric_tyre_makes_a_symmetric_car():
    car = car_of(Roll3DOF, front=asymmetric(), rear=asymmetric())
    assert_symmetric(car, turning(car), U)


@pytest.mark.parametrize(
    "tyre", [tyres.Relaxed(brush(), sigma_y=0.4), tyres.LuGre(180.0, 180.0, 1.0, 0.8, 6.0)], ids=["relaxed", "lugre"]
)
def test_tyres_with_states_and_lagged_loads_bring_their_states(tyre):
    car = car_of(Roll3DOF, front=tyre, load_transfer=vehicles.LaggedLoads())
    names = [f"{corner}_{name}" for corner in ("fl", "fr") for name in tyre.state_names]
    body = ("v_y", "yaw", "yaw_rate", "roll", "roll_rate", "a_x_felt", "a_y_felt")
    assert car.state_type._fields == (*body, *names)
    x = car.start(0.0, U, v_y=-0.3, yaw_rate=0.2, roll=0.03)
    rates = car.derivatives(0.0, x, U)
    np.testing.assert_allclose([getattr(rates, name) for name in names], 0.0, atol=1e-12)
    np.testing.assert_allclose(rates.a_y_felt, car.outputs(0.0, x, U).a_y / 0.1, rtol=1e-12)


@pytest.mark.parametrize("speed", [0.0, -2.0])
def test_slopes_of_a_car_that_stands_or_slides_are_finite(speed):
    car = car_of(Roll3DOF)
    assert_finite(car, turning(car), inputs(steer=0.1, v_x=speed))


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("roll_inertia", 0.0, r"Roll3DOF\.roll_inertia = 0\.0: must be positive"),
        ("sprung_mass", 1500.0, r"Roll3DOF\.sprung_mass - Roll3DOF\.mass = 50\.0: must be at most 0"),
        ("roll_damping_rear", -1.0, r"Roll3DOF\.roll_damping_rear = -1\.0: must be at least 0"),
        ("roll_yaw_product", 2000.0, r"roll_yaw_product\^2 = .*must be positive"),
        ("roll_centre_front", 3.0, r"over the roll axis = -.*must be positive"),
        ("cg_height", 7.0, r"or the body falls over"),
        ("front", 3.0, r"Roll3DOF\.front = [0-9.]+: must be a tyre"),
    ],
)
def test_bad_input_is_named(field, value, message):
    with pytest.raises(InputError, match=message):
        car_of(Roll3DOF, **{field: value})

"""FourteenDOF: rest, symmetry, invariance, wheels in the air, standstill, slopes, precision, batches, gradients, bad input."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from fourteen_dof_cars import AllMoments, evaluate, held, inputs, lossless, make, moving, roll_out

from jaxveh import InputError, tyres
from jaxveh.roads import Ground
from jaxveh.vehicles import GRAVITY, FourMotors, Travelling
from jaxveh.vehicles.fourteen_dof.tyre_contact import axles
from jaxveh.vehicles.wheels import Wheels, wheel_names

OTHER_SIDE = {"fl": "fr", "fr": "fl", "rl": "rr", "rr": "rl"}
SMALL = 1e-9
"""Of accelerations that are meant to be zero, m/s^2 and rad/s^2: rounding in 10 000 N of load over a wheel's 40 kg."""


def wheels(values, prefix):
    return np.array([float(getattr(values, name)) for name in wheel_names(prefix)])


def test_static_loads_are_the_closed_form():
    car = make()
    shown = evaluate(car, car.start(0.0, inputs()), inputs())[1]
    a, b, m = 1.11, 1.57, 1370.0
    front, rear = GRAVITY * (0.5 * m * b / (a + b) + 38.0), GRAVITY * (0.5 * m * a / (a + b) + 42.0)
    np.testing.assert_allclose(wheels(shown, "load"), [front, front, rear, rear], rtol=1e-12)
    springs = [front - 38.0 * GRAVITY] * 2 + [rear - 42.0 * GRAVITY] * 2
    np.testing.assert_allclose(wheels(shown, "suspension_force"), springs, rtol=1e-12)


@pytest.mark.parametrize("v_x", [0.0, 20.0])
def test_nothing_moves_by_itself(v_x):
    car = make(drag=0.0, rolling_resistance=0.0)
    x = car.start(0.0, inputs(), v_x=v_x)
    rate, shown = evaluate(car, x, inputs())
    np.testing.assert_allclose(np.asarray(rate), 0.0, atol=SMALL)
    np.testing.assert_allclose([shown.a_x, shown.a_y, shown.a_z], [0.0, 0.0, GRAVITY], atol=SMALL)
    np.testing.assert_allclose(wheels(shown, "slip_ratio"), 0.0, atol=1e-14)


def test_it_stands_where_it_was_put():
    """Rest is stable: a car that is dropped comes back to it."""
    car = make()
    rest = car.start(0.0, inputs())
    states, _ = roll_out(car, car.start(0.0, inputs(), z=0.62, roll=0.03, pitch=0.02), held(inputs()))
    assert np.ptp(np.asarray(states.z)) > 0.03
    for name in ("z", "roll", "pitch", *wheel_names("travel")):
        np.testing.assert_allclose(getattr(states, name)[-1], getattr(rest, name), atol=1e-4)


def mirrored(values):
    """The same in the mirror of the car's x-z plane."""
    odd = ("v_y", "roll", "yaw", "roll_rate", "yaw_rate")
    flipped = {name: -v if name in odd else v for name, v in values._asdict().items()}
    for name in flipped:
        if name[-2:] in OTHER_SIDE:
            flipped[name] = getattr(values, name[:-2] + OTHER_SIDE[name[-2:]])
    return type(values)(**flipped)


def test_a_right_turn_is_a_left_turn_in_the_mirror():
    car = make(AllMoments(), toe_front=0.005, camber_rear=-0.02, ackermann=0.6)
    u, x = inputs(0.08, 300.0), moving(car)
    rate, _ = evaluate(car, x, u)
    image, _ = evaluate(car, mirrored(x), u._replace(steer=-u.steer))
    np.testing.assert_allclose(np.asarray(image), np.asarray(mirrored(rate)), rtol=1e-9, atol=1e-9)
    assert abs(float(rate.v_y)) > 1


def test_place_and_heading_change_nothing():
    car = make(AllMoments())
    u, x = inputs(0.05), moving(car)
    rate, shown = evaluate(car, x, u)
    turned, _ = evaluate(car, x._replace(yaw=x.yaw + 2.3), u)
    np.testing.assert_array_equal(np.asarray(turned), np.asarray(rate))
    placed = Travelling(car)
    at = placed.state_type(jnp.asarray(130.0), jnp.asarray(-40.0), *x)
    moved, there = evaluate(placed, at, u)
    np.testing.assert_allclose(np.asarray(moved[2:]), np.asarray(rate), rtol=1e-12, atol=1e-12)
    speed = np.hypot(moved.x, moved.y)
    np.testing.assert_allclose(speed, np.hypot(shown.v_x, shown.v_y), rtol=1e-12)
    assert float(there.x) == 130.0


def test_a_road_that_lies_higher_lifts_the_car_and_under_one_wheel_loads_that_wheel():
    car = make(AllMoments())
    u, x, names = inputs(0.05), moving(car, z=car.cg_height - 0.03, roll=0.01, pitch=-0.005), wheel_names("height")
    rate, shown = evaluate(car, x, u)
    assert (wheels(shown, "load") > 500.0).all()
    higher = Ground(**dict.fromkeys(names, jnp.asarray(0.03)))
    lifted, above = evaluate(car, x._replace(z=x.z + 0.03), u, higher)
    np.testing.assert_allclose(np.asarray(lifted), np.asarray(rate), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(wheels(above, "load"), wheels(shown, "load"), rtol=1e-9)
    for k, name in enumerate(names):
        _, found = evaluate(car, x, u, Ground(**{name: jnp.asarray(1e-3)}))
        more = wheels(found, "load") - wheels(shown, "load")
        np.testing.assert_allclose(
            more, np.where(np.arange(4) == k, 1e-3 * float(car.tyre_stiffness), 0.0), rtol=0.02, atol=1e-6
        )


def test_a_car_in_the_air_falls():
    """No load, no pull, no tyre force; the springs push body and wheels apart, and all together falls."""
    car = make(roll_centre_front=0.0, roll_centre_rear=0.0, pitch_slope_front=0.0, pitch_slope_rear=0.0)
    x = moving(car, roll=0.0, pitch=0.0, roll_rate=0.0, pitch_rate=0.0, yaw_rate=0.0, z=1.5)
    rate, shown = evaluate(car, x, inputs(0.1))
    for name in ("load", "F_x", "F_y", "M_z"):
        np.testing.assert_array_equal(wheels(shown, name), 0.0)
    masses = np.array([38.0, 38.0, 42.0, 42.0])
    # Level and not turning: the body's points go up by the body's acceleration and its angular ones.
    x_w, y_w = np.array([1.11, 1.11, -1.57, -1.57]), 0.5 * np.array([1.54, -1.54, 1.51, -1.51])
    ups = rate.v_z + rate.roll_rate * y_w - rate.pitch_rate * x_w + wheels(rate, "travel_rate")
    falls = 1370.0 * rate.v_z + np.sum(masses * ups)
    np.testing.assert_allclose(falls, -GRAVITY * (1370.0 + masses.sum()), rtol=1e-12)


def test_a_tyre_never_pulls():
    """Still pressed in, but leaving the road faster than it springs back."""
    car = make(tyre_damping=3000.0)
    x = car.start(0.0, inputs(), v_z=4.0)
    np.testing.assert_array_equal(wheels(evaluate(car, x, inputs())[1], "load"), 0.0)
    slow = evaluate(car, x._replace(v_z=jnp.asarray(0.1)), inputs())[1]
    rest = evaluate(car, x._replace(v_z=jnp.asarray(0.0)), inputs())[1]
    np.testing.assert_allclose(wheels(rest, "load") - wheels(slow, "load"), 300.0, rtol=1e-12)


@eqx.filter_value_and_grad
def size(given):
    """One number of all rates and outputs, and its slopes."""
    rate, shown = given[0].evaluate(0.0, given[1], given[2])
    return sum(jnp.sum(jnp.square(v)) for v in (*rate, *shown))


def test_values_and_gradients_are_finite():
    """Standing, in the air and with locked wheels, forwards and backwards: a batch, as it is not compiled."""
    car = make(tyres.Relaxed(tyres.Brush(8e4, 7e4), 0.4, 0.5), ackermann=0.3)
    u = inputs(0.0, 0.0, 500.0)
    cases = [{}, {"z": 1.2, "v_x": 10.0}, {"v_x": 10.0} | dict.fromkeys(wheel_names("omega"), 0.0)]
    forwards = [car.start(0.0, u, **values) for values in cases]
    states = [*forwards, *(x._replace(v_x=-x.v_x) for x in forwards)]
    xs = jax.tree.map(lambda *values: jnp.asarray(np.array(values, float)), *states)
    us = jax.tree.map(lambda value: jnp.asarray(np.full(len(states), value)), u)

    value, slopes = size((car, xs, us))
    assert np.isfinite(value)
    leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(slopes)]
    assert len(leaves) > 60 and all(np.isfinite(leaf).all() for leaf in leaves)


def test_ice_on_a_slope_pulls_along_it():
    """Without friction every mass falls along the slope alike, and no accelerometer in the plane sees it."""
    none = dict.fromkeys(("roll_centre_front", "roll_centre_rear", "pitch_slope_front", "pitch_slope_rear"), 0.0)
    car = lossless(**none)
    grade, bank = 0.11, -0.07
    for ground, name, along in (
        (Ground(grade=jnp.asarray(grade)), "v_x", np.sin(grade)),
        (Ground(bank=jnp.asarray(bank)), "v_y", np.sin(bank)),
    ):
        rate, shown = evaluate(car, car.start(0.0, inputs()), inputs(), ground)
        np.testing.assert_allclose(getattr(rate, name), -GRAVITY * along, rtol=1e-12)
        np.testing.assert_allclose([shown.a_x, shown.a_y], 0.0, atol=1e-12)


def test_a_car_rolls_down_a_slope():
    """dv/dt = -g sin(grade) m / (m + 4 J / r^2), once it has sunk and its wheels roll."""
    car = make(drag=0.0, rolling_resistance=0.0)
    grade = -0.06
    states, shown = roll_out(car, car.start(0.0, inputs(), v_x=5.0), held(inputs()), grade=grade)
    gained = (states.v_x[-1] - states.v_x[2000]) / 1.999
    mass = 1370.0 + 2 * (38.0 + 42.0)
    radius = float(jnp.mean(jnp.stack([5.0 / car.start(0.0, inputs(), v_x=5.0).omega_fl])))
    expected = -GRAVITY * np.sin(grade) * mass / (mass + 4 * 1.3 / radius**2)
    np.testing.assert_allclose(gained, expected, rtol=1e-3)
    # The accelerometer feels what the wheels' spin takes, and on the slope the axles' loads shift.
    assert 0 < -float(shown.a_x[-1]) < 0.05


def test_rolling_resistance_slows_in_both_directions():
    car = make(AllMoments(), drag=0.0)
    for v_x in (8.0, -8.0):
        rate, shown = evaluate(car, car.start(0.0, inputs(), v_x=v_x), inputs())
        assert np.all(wheels(rate, "omega") * v_x < 0)
        assert float(shown.tyre_dissipation) > 0


def test_ackermann_turns_all_wheels_about_one_point():
    car = make(ackermann=1.0)
    both = Wheels(jnp.asarray(0.25), jnp.asarray(0.25), 0.0, 0.0)
    found = axles(car, both)
    left, right = (np.arctan2(-e.x, e.y) for e in (found.fl, found.fr))
    np.testing.assert_allclose(1 / np.tan(right) - 1 / np.tan(left), 1.54 / (1.11 + 1.57), rtol=1e-12)
    parallel = axles(make(toe_front=0.01, camber_front=0.03), both)
    np.testing.assert_allclose([np.arctan2(-e.x, e.y) for e in (parallel.fl, parallel.fr)], [0.24, 0.26], rtol=1e-12)
    np.testing.assert_allclose([parallel.fl.z, parallel.fr.z], [-np.sin(0.03), np.sin(0.03)], rtol=1e-12)
    assert float(parallel.rl.x) == 0


def test_a_sensor_on_the_body_sees_a_wheel_turn_less_by_the_bodys_own_turning():
    straight = dict.fromkeys(("toe_front", "toe_rear", "camber_front", "camber_rear", "ackermann"), 0.0)
    car, steer, roll_rate, pitch_rate = make(**straight), 0.1, 0.4, 0.3
    x = car.start(0.0, inputs(), v_x=20.0)._replace(
        roll_rate=jnp.asarray(roll_rate), pitch_rate=jnp.asarray(pitch_rate)
    )
    shown = evaluate(car, x, inputs(steer=steer))[1]
    front = np.cos(steer) * pitch_rate - np.sin(steer) * roll_rate
    difference = wheels(shown, "omega") - wheels(shown, "omega_to_body")
    np.testing.assert_allclose(difference, [front, front, pitch_rate, pitch_rate], rtol=1e-12)


def test_a_batch_is_its_cars_one_by_one():
    car, n = make(AllMoments()), 3
    x = moving(car)
    xs = jax.tree.map(lambda v: v * jnp.linspace(0.9, 1.1, n), x)
    us = jax.tree.map(lambda v: v * jnp.linspace(0.5, 1.5, n), inputs(0.05, 300.0, 100.0))
    cars = eqx.tree_at(
        lambda c: (c.sprung_mass, c.roll_centre_rear), car, (jnp.linspace(1200.0, 1500.0, n), jnp.linspace(0, 0.2, n))
    )
    batch = evaluate(cars, xs, us)
    axis = jax.tree.map(lambda leaf: 0 if jnp.ndim(leaf) else None, eqx.filter(cars, eqx.is_array))
    mapped = eqx.filter_vmap(lambda c, x, u: c.evaluate(0.0, x, u), in_axes=(axis, 0, 0))(cars, xs, us)
    for i in range(n):
        pick = lambda tree, i=i: jax.tree.map(
            lambda leaf: leaf[i] if eqx.is_array(leaf) and jnp.ndim(leaf) else leaf, tree
        )
        one = evaluate(pick(cars), pick(xs), pick(us))
        for single, many, by_vmap in zip(*map(jax.tree.leaves, (one, batch, mapped)), strict=True):
            np.testing.assert_allclose(many[i], single, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(by_vmap[i], single, rtol=1e-9, atol=1e-9)


BAD = {
    "sprung_mass": (-1.0, "positive"),
    "spring_rear": (0.0, "positive"),
    "damper_front": (-5.0, "at least 0"),
    "anti_roll_rear": (-1.0, "at least 0"),
    "roll_yaw_product": (1200.0, "positive definite"),
    "tyre_stiffness": (5000.0, "static load"),
    "track_front": (np.nan, "positive"),
    "pitch_slope_front": (np.inf, "finite"),
    "crawl_speed": (0.0, "positive"),
    "front": (3.0, "must be a tyre"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_parameters_are_named(name):
    value, allowed = BAD[name]
    with pytest.raises(InputError, match=rf"FourteenDOF\.{name} = .*{allowed}"):
        make(**{name: value})


def test_unknown_states_are_named():
    with pytest.raises(InputError, match="heave"):
        make().start(0.0, inputs(), heave=0.1)


def test_its_inputs_are_its_drives():
    assert make().inputs == ("steer", "drive_torque", "brake_torque")
    assert make(drive=FourMotors()).inputs == ("steer", *wheel_names("torque"))

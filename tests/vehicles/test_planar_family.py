"""What holds for every vehicle without wheels that slip of their own: symmetry, standstill, precision, gradients, slopes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from planar_cars import MAKERS, made, point

from jaxveh import InputError
from jaxveh.roads import Ground

pytestmark = pytest.mark.product

ODD = (
    *(
        "v_y",
        "sideslip",
        "yaw",
        "course",
        "yaw_rate",
        "hitch_angle",
        "steer",
        "steer_rate",
        "yaw_acceleration",
        "a_y",
        "F_yf",
        "F_yr",
    ),
    *("slip_angle_front", "slip_angle_rear", "curvature", "hitch_rate", "trailer_yaw"),
)
"""What changes its sign in the mirror."""


def mirrored(values):
    return type(values)(*[-v if name in ODD else v for name, v in zip(values._fields, values, strict=True)])


@pytest.mark.parametrize("name", MAKERS)
def test_the_mirrored_car_turns_the_mirrored_way(name):
    vehicle = made(name)
    x, u = point(vehicle)
    ground = Ground(grade=jnp.asarray(0.03), bank=jnp.asarray(0.05))
    evaluate = jax.jit(lambda *arguments: vehicle.evaluate(0.0, *arguments))
    left = evaluate(x, u, ground)
    right = evaluate(mirrored(x), mirrored(u), ground._replace(bank=-ground.bank))
    for one, other in zip(left, right, strict=True):
        np.testing.assert_allclose(mirrored(other), np.broadcast_arrays(*one), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_values_and_gradients_are_finite_at_any_speed(name, dtype):
    """Reverse mode sums over all outputs, forward mode over all arguments: a NaN or an infinity survives either sum."""
    vehicle = made(name, dtype)

    @jax.jit
    @jax.vmap
    def everything(v_x):
        x, u = point(vehicle, dtype)
        x, u = (part._replace(v_x=v_x) if "v_x" in part._fields else part for part in (x, u))
        arguments = (vehicle, x, u)
        evaluate = lambda c, x, u: c.evaluate(0.0, x, u)
        values, tangents = jax.jvp(evaluate, arguments, jax.tree.map(jnp.ones_like, arguments))
        total = lambda *args: sum(jax.tree.leaves(evaluate(*args)))
        return values, tangents, jax.grad(total, (0, 1, 2))(*arguments)

    for leaf in jax.tree.leaves(everything(np.array([0.0, 1e-3, 0.1, 3.0, -3.0, 25.0], dtype))):
        assert leaf.dtype == dtype
        assert np.all(np.isfinite(leaf))


@pytest.mark.parametrize("name", MAKERS)
def test_a_car_at_rest_stays_at_rest(name):
    vehicle = made(name)
    x, u = point(vehicle, v_x=0.0, v_y=0.0, sideslip=0.0, yaw_rate=0.0, steer_rate=0.0, acceleration=0.0, v_x_rate=0.0)
    x, u = point(vehicle, **{**x._asdict(), **u._asdict(), "drive_torque": 0.0})
    rates = vehicle.derivatives(0.0, x, u)
    np.testing.assert_allclose([float(rate) for rate in rates], 0.0, atol=1e-15)


@pytest.mark.parametrize("name", MAKERS)
def test_gradients_equal_finite_differences(name):
    vehicle = made(name)
    leaves, tree = jax.tree.flatten((vehicle, *point(vehicle)))
    start = np.asarray([float(leaf) for leaf in leaves])

    # Values and gradients by one program.
    @jax.jit
    @jax.value_and_grad
    def mixed(values):
        c, x, u = jax.tree.unflatten(tree, list(values))
        return sum(weight * rate for weight, rate in enumerate(c.derivatives(0.0, x, u), 1))

    gradient = np.asarray(mixed(start)[1])
    for i, value in enumerate(start):
        step = 1e-5 * max(abs(float(value)), 0.1)
        up, down = (float(mixed(start + sign * step * np.eye(len(start))[i])[0]) for sign in (1, -1))
        np.testing.assert_allclose(gradient[i], (up - down) / (2 * step), rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("name", MAKERS)
def test_a_batch_equals_single_ones(name):
    vehicle = made(name)
    speeds = np.array([0.05, 2.0, 20.0])
    rates = jax.jit(lambda x, u: vehicle.derivatives(0.0, x, u))
    batch = rates(*point(vehicle, v_x=speeds))
    for i, v_x in enumerate(speeds):
        single = rates(*point(vehicle, v_x=v_x))
        np.testing.assert_allclose([np.broadcast_to(b, 3)[i] for b in batch], single, rtol=1e-12)


@pytest.mark.parametrize("name", MAKERS)
def test_motion_is_what_the_outputs_say_and_units_are_complete(name):
    vehicle = made(name)
    x, u = point(vehicle)
    moves, out = jax.jit(lambda x, u: (vehicle.motion(x, u), vehicle.outputs(0.0, x, u)))(x, u)
    for field in set(moves._fields) & set(out._fields):
        assert float(getattr(moves, field)) == float(getattr(out, field))
    assert {*x._fields, *u._fields, *out._fields} <= set(vehicle.units)


@pytest.mark.parametrize("name", MAKERS)
def test_start_is_straight_running_with_fields_replaced(name):
    vehicle = made(name)
    _, u = point(vehicle, steer=0.0)
    x = vehicle.start(0.0, u)
    assert all(float(value) == 0 for value in x)
    last = x._fields[-1]
    assert float(getattr(vehicle.start(0.0, u, **{last: 0.25}), last)) == 0.25
    with pytest.raises(InputError, match=r"unknown name\(s\) roll"):
        vehicle.start(0.0, u, roll=0.1)


@pytest.mark.parametrize("name", [name for name in MAKERS if name not in ("longitudinal",)])
def test_accelerometers_feel_a_bank(name):
    """On a bank a car that goes straight ahead feels gravity: up the bank, towards the left side that is higher."""
    vehicle = made(name)
    bank = 0.1
    x, u = point(vehicle, sideslip=0.0, v_y=0.0, yaw_rate=0.0, steer=0.0)
    level = vehicle.outputs(0.0, x, u)
    banked = vehicle.outputs(0.0, x, u, Ground(bank=jnp.asarray(bank)))
    rate = vehicle.derivatives(0.0, x, u, Ground(bank=jnp.asarray(bank)))
    if "F_yf" in banked._fields:
        # Without slip there is no force to feel: the car slides down.
        np.testing.assert_allclose([banked.a_y, level.a_y], 0.0, atol=1e-12)
        slides = rate.sideslip * 12.0 if "sideslip" in rate._fields else rate.v_y
        np.testing.assert_allclose(slides, -9.80665 * np.sin(bank), rtol=1e-12)
    else:
        np.testing.assert_allclose(banked.a_y, 9.80665 * np.sin(bank), rtol=1e-12)

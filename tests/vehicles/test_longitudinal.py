"""Speed on a grade: equilibria, coast-down, standstill."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from planar_cars import made, point

from jaxveh import InputError, vehicles
from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles import GRAVITY


def car(**more):
    return vehicles.Longitudinal(**{"mass": 1500.0, "wheel_radius": 0.31, "wheel_inertia": 1.1, **more})


def after(vehicle, v_x, seconds, ground=LEVEL, steps=4000, **torques):
    """The speed after some time at constant torques, by RK4."""
    _, u = point(vehicle, **{"drive_torque": 0.0, "brake_torque": 0.0, **torques})
    dt = seconds / steps
    rate = lambda v: vehicle.derivatives(0.0, vehicle.state_type(v), u, ground).v_x

    def step(v, _):
        k1 = rate(v)
        k2 = rate(v + 0.5 * dt * k1)
        k3 = rate(v + 0.5 * dt * k2)
        k4 = rate(v + dt * k3)
        return v + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4), None

    return float(jax.lax.scan(step, jnp.asarray(v_x), length=steps)[0])


def test_newton_balance_with_turning_wheels():
    vehicle = made("longitudinal")
    x, u = point(vehicle)
    ground = Ground(grade=jnp.asarray(0.05))
    out = vehicle.outputs(0.0, x, u, ground)
    pull = (300 - 120) / 0.31 - 0.012 * 1500 * GRAVITY * np.cos(0.05) - 0.4 * 144 - 1500 * GRAVITY * np.sin(0.05)
    np.testing.assert_allclose(out.v_x_rate, pull / (1500 + 4 * 1.1 / 0.31**2), rtol=1e-9)
    forces = out.drive_force + out.brake_force + out.rolling_force + out.air_force + out.grade_force
    np.testing.assert_allclose(forces, pull, rtol=1e-9)
    np.testing.assert_allclose(out.a_x, out.v_x_rate + GRAVITY * np.sin(0.05), rtol=1e-12)
    np.testing.assert_allclose(out.drive_power, 300 / 0.31 * 12.0, rtol=1e-12)
    assert float(out.grade) == 0.05


def test_coasting_down_in_the_air_alone_is_the_closed_form():
    """m dv/dt = -c v^2 gives v = v0 / (1 + c v0 t / m)."""
    vehicle = car(drag=0.6)
    expected = 40.0 / (1 + 0.6 * 40.0 * 60.0 / float(vehicle.moving_mass))
    np.testing.assert_allclose(after(vehicle, 40.0, 60.0), expected, rtol=1e-10)


def test_coasting_down_in_air_and_rolling_is_the_closed_form():
    """m dv/dt = -f - c v^2 gives v = V tan(atan(v0 / V) - sqrt(f c) t / m) with V = sqrt(f / c)."""
    vehicle = car(drag=0.6, rolling_resistance=0.012)
    f, c, m = 0.012 * 1500 * GRAVITY, 0.6, float(vehicle.moving_mass)
    V = np.sqrt(f / c)
    expected = V * np.tan(np.arctan(30.0 / V) - np.sqrt(f * c) * 60.0 / m)
    assert expected > 5.0
    np.testing.assert_allclose(after(vehicle, 30.0, 60.0), expected, rtol=1e-6)


@pytest.mark.parametrize("grade", [-0.08, 0.06])
def test_the_terminal_speed_on_a_grade_balances_air_and_gravity(grade):
    vehicle = car(drag=0.6)
    torque = 0.31 * (1500 * GRAVITY * np.sin(grade) + 0.6 * 20.0**2)
    ground = Ground(grade=jnp.asarray(grade))
    np.testing.assert_allclose(after(vehicle, 35.0, 3000.0, ground, drive_torque=torque), 20.0, rtol=1e-9)


def test_the_accelerometer_of_a_parked_car_shows_the_slope():
    vehicle = car()
    ground = Ground(grade=jnp.asarray(0.1))
    v_x = after(vehicle, 0.0, 60.0, ground, brake_torque=3000.0)
    # The brake holds where its smooth sign carries the slope's pull.
    share = 1500 * GRAVITY * np.sin(0.1) * 0.31 / 3000.0
    roots = np.roots([3.0, 0.0, -10.0, 0.0, 15.0, 8.0 * share])
    held = 15 / 16 * next(root.real for root in roots if abs(root.imag) < 1e-9 and -1.0 < root.real < 0.0)
    np.testing.assert_allclose(v_x, held, rtol=1e-9)
    x, u = point(vehicle, v_x=v_x, drive_torque=0.0, brake_torque=3000.0)
    np.testing.assert_allclose(vehicle.outputs(0.0, x, u, ground).a_x, GRAVITY * np.sin(0.1), rtol=1e-9)


def test_brakes_stop_the_car_and_do_not_turn_it_round():
    v_x = after(car(), 10.0, 20.0, brake_torque=3000.0)
    assert abs(v_x) < 1e-6


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("mass", -1.0, r"Longitudinal\.mass = -1\.0: must be positive"),
        ("wheel_radius", 0.0, r"Longitudinal\.wheel_radius = 0\.0"),
        ("drag", float("nan"), r"Longitudinal\.drag = nan: must be finite"),
    ],
)
def test_bad_parameters_raise(field, value, message):
    with pytest.raises(InputError, match=message):
        car(**{field: value})

"""Cars from standstill and backwards: every kind of tyre launches, holds a parked car, and trails the way that the car goes."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from four_wheel_cars import asymmetric, brush, car_of, drive, inputs, state

from jaxveh import tyres, vehicles
from jaxveh.roads import LEVEL
from jaxveh.vehicles.wheels import travel_direction

pytestmark = pytest.mark.product

LOAD = 3600.0

STATIC = {
    "Brush": brush,
    "MF-Tyre": lambda: tyres.typical_mf_tyre(LOAD),
    "MF-Tyre, shifted": asymmetric,
    "ellipse": lambda: tyres.FrictionEllipse(tyres.LongitudinalLaw(formula()), formula()),
}
DYNAMIC = {
    "Relaxed Brush": lambda: tyres.Relaxed(brush(), 0.2, 0.4),
    "Relaxed Brush, force": lambda: tyres.Relaxed(brush(), 0.2, 0.4, of="force"),
    "Relaxed MF-Tyre": lambda: tyres.Relaxed(tyres.typical_mf_tyre(LOAD)),
    "LuGre": lambda: tyres.LuGre(200.0, 150.0, 1.1, 0.8, 6.0),
}
HOLDING = ("Relaxed Brush", "LuGre")


def formula():
    return tyres.MagicFormula(B=10.0, C=1.4, D=LOAD, E=0.0, nominal_load=LOAD)


def seven(tyre, **more):
    return car_of(vehicles.SevenDOF, front=tyre, rear=tyre, **more)


def still(car, **values):
    """Standing on settled springs, tyres without deflections."""
    return state(car, **values)


def spinning(car, speed):
    return dict.fromkeys(("omega_fl", "omega_fr", "omega_rl", "omega_rr"), speed / float(car.wheel_radius))


U = inputs(steer=0.0, drive_torque=0.0, brake_torque=0.0)


@pytest.mark.parametrize("name", STATIC)
def test_wheels_that_spin_push_a_car_that_stands_and_a_sliding_car_is_slowed(name):
    car = seven(STATIC[name]())
    spun = car.evaluate(0.0, still(car, **spinning(car, 5.0)), U)[0]
    assert spun.v_x > 5.0 and spun.omega_fl < -100.0
    slid = car.evaluate(0.0, still(car, v_y=-1.0), U)[0]
    assert slid.v_y > 5.0
    parked = car.evaluate(0.0, still(car), U)[0]
    np.testing.assert_allclose(jax.tree.leaves(parked), 0.0, atol=1e-9)


@pytest.mark.parametrize("name", DYNAMIC)
def test_deflections_grow_as_the_tyres_slide_from_standstill(name):
    """A millisecond of sliding makes forces in its direction."""
    car = seven(DYNAMIC[name]())

    def after(moving):
        x = still(car, **moving)
        rates = car.evaluate(0.0, x, U)[0]
        grown = {n: 1e-3 * getattr(rates, n) for n in car.state_type._fields if n[:2] in ("fl", "fr", "rl", "rr")}
        return rates, car.evaluate(0.0, x._replace(**grown), U)[0]

    rates, spun = after(spinning(car, 5.0))
    assert spun.v_x > 0.02 and spun.omega_fl < -0.5
    slid = after({"v_y": -1.0})
    assert slid[1].v_y > 0.01
    if "force" not in name:
        # The sliding speed itself, of a wheel on the left.
        first, last = car.state_type._fields[-2:]
        np.testing.assert_allclose(getattr(rates, first), 5.0, rtol=1e-12)
        np.testing.assert_allclose(getattr(slid[0], last), -1.0, rtol=1e-12)


class OnABank(eqx.Module):
    """A car on a road that falls to the right by 10 %."""

    car: vehicles.SevenDOF

    def derivatives(self, t, x, u):
        return self.car.evaluate(t, x, u, LEVEL._replace(bank=jnp.asarray(0.1)))[0]


def driven(car, x, u, duration):
    return drive(car, lambda t: jax.tree.map(lambda leaf: leaf + 0.0 * t, u), x, duration, 1e-3)


@pytest.mark.parametrize("name", HOLDING)
def test_a_car_launches_and_reaches_what_its_torque_gives(name):
    car = seven(DYNAMIC[name](), wheel_inertia=1.0, wheel_radius=0.3)
    end = driven(car, still(car), U._replace(drive_torque=jnp.asarray(600.0)), 1.0).v_x[-1]
    # All of the torque, less what spins the wheels; the tyres' slip is small, and swings at first.
    np.testing.assert_allclose(end, 600.0 / 0.3 / (1450.0 + 4 * 1.0 / 0.3**2), rtol=0.01)


@pytest.mark.parametrize("name", HOLDING)
def test_a_parked_car_does_not_slide_down_a_bank(name):
    """It leans into its tyres by millimetres; sliding freely it would go half a metre in a second."""
    car = seven(DYNAMIC[name]())
    v_y = driven(OnABank(car), still(car), U, 1.0).v_y
    way = 1e-3 * np.cumsum(v_y)
    assert np.all(np.abs(way) < 0.02) and abs(way[-1]) > 1e-4
    assert np.max(np.abs(v_y)) < 0.1


def trailing(tyre, sign, steer=0.02):
    """A car that rolls freely at 6 m/s forwards or backwards, its front wheels turned."""
    car = seven(tyre)
    x = still(car, v_x=6.0 * sign, **spinning(car, 6.0 * sign * float(np.cos(steer))))
    return car.evaluate(0.0, x, U._replace(steer=jnp.asarray(steer)))[1]


def test_the_trail_of_a_brush_lies_on_the_other_side_in_reverse():
    """At small slip it is a third of the half length, behind the wheel's centre as the wheel goes."""
    tyre = tyres.Brush(90e3, 55e3, 1.0, half_length=0.06)
    for sign in (1.0, -1.0):
        out = trailing(tyre, sign, steer=1e-5)
        assert sign * out.F_y_fl > 0.1
        np.testing.assert_allclose(out.M_z_fl / out.F_y_fl, -sign * 0.02, rtol=1e-3)


@pytest.mark.parametrize("make", [brush, lambda: tyres.typical_mf_tyre(LOAD)])
def test_a_symmetric_car_turned_by_half_a_turn_moves_as_before(make):
    """What it does at -v_x with its ends exchanged is what it does at v_x."""
    middle = dict(front_axle_to_cg=1.3, rear_axle_to_cg=1.3, track_rear=1.52, load_transfer=vehicles.StaticLoads())
    car = seven(make(), **middle)
    turned = []
    for sign in (1.0, -1.0):
        speeds = [sign * 8.0 - 0.3 * y for y in (0.76, -0.76)]
        spins = dict(zip(("omega_fl", "omega_fr", "omega_rl", "omega_rr"), np.array(speeds * 2) / 0.32, strict=True))
        x = still(car, v_x=sign * 8.0, v_y=sign * 0.4, yaw_rate=0.3, **spins)
        turned.append(car.evaluate(0.0, x, U)[1])
    ahead, back = turned
    assert abs(float(ahead.M_z_fl)) > 10.0
    np.testing.assert_allclose(
        [back.yaw_acceleration, back.M_z_fl, back.M_z_rr],
        [ahead.yaw_acceleration, ahead.M_z_rr, ahead.M_z_fl],
        rtol=1e-9,
    )
    np.testing.assert_allclose([back.a_x, back.a_y], [-ahead.a_x, -ahead.a_y], rtol=1e-9)


def test_the_direction_goes_through_standstill_smoothly():
    tyre = tyres.Brush(180e3, 110e3, 1.0)
    car = car_of(vehicles.SingleTrack3DOF, front=tyre, rear=tyre)
    at = lambda v: car.evaluate(0.0, state(car, v_x=v, v_y=0.001 * v), U)[1]
    for v in (0.3, 0.6, 20.0):
        ahead, back = at(jnp.asarray(v)), at(jnp.asarray(-v))
        trail = 0.06 / 3 * travel_direction(jnp.asarray(v))
        np.testing.assert_allclose([ahead.M_zf / ahead.F_yf, back.M_zf / back.F_yf], [-trail, trail], rtol=1e-2)

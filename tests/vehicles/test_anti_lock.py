"""Anti-lock brakes: what they do at an instant, and that wheels do not lock."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from four_wheel_cars import car_of

from jaxveh import InputError, manoeuvres, roads, simulate, vehicles
from jaxveh._core.names import record

AT = ("fl", "fr", "rl", "rr")


def instant(slip, speed=20.0, share=0.7, wish=0.6, torque=2000.0):
    """The car, and rates and outputs of it with the front left wheel at a brake slip."""
    car = vehicles.AntiLock(car_of(vehicles.SevenDOF))
    u = record("Inputs", {name: jnp.asarray(0.0) for name in car.inputs})._replace(brake_torque=jnp.asarray(torque))
    x = car.start(jnp.asarray(0.0), u, v_x=jnp.asarray(speed))
    x = x._replace(
        omega_fl=x.omega_fl * (1.0 - slip), brake_share_fl=jnp.asarray(share), brake_wish_fl=jnp.asarray(wish)
    )
    return car, *car.evaluate(0.0, x, u)


def test_pressure_builds_up_below_the_slip_and_is_let_go_beyond_it():
    car, rates, outputs = instant(0.02)
    np.testing.assert_allclose(rates.brake_wish_fl, car.build * 0.4)
    np.testing.assert_allclose(rates.brake_share_fl, (0.6 - 0.7) / car.lag)
    front = 0.5 * float(car.vehicle.drive.front_brake) * 2000.0
    np.testing.assert_allclose([outputs.brake_torque_fl, outputs.brake_torque_fr], [0.7 * front, front])
    np.testing.assert_allclose(outputs.brake_torque, 2000.0 - 0.3 * front)
    car, rates, _ = instant(0.5)
    np.testing.assert_allclose(rates.brake_wish_fl, -car.release * 0.6)
    # In the middle of the two slips both half.
    car, rates, _ = instant(0.15)
    np.testing.assert_allclose(rates.brake_wish_fl, 0.5 * (car.build * 0.4 - car.release * 0.6), rtol=1e-6)
    # Crawling cars have no such system.
    car, rates, _ = instant(0.5, speed=1.4)
    np.testing.assert_allclose(rates.brake_wish_fl, car.build * 0.4)


def test_free_brakes_are_those_of_the_car():
    car = vehicles.AntiLock(car_of(vehicles.SevenDOF))
    u = record("Inputs", {name: jnp.asarray(0.0) for name in car.inputs})._replace(brake_torque=jnp.asarray(500.0))
    x = car.start(jnp.asarray(0.0), u, v_x=jnp.asarray(20.0))
    rates, outputs = car.evaluate(0.0, x, u)
    alone, same = car.vehicle.evaluate(0.0, car.vehicle.state_type(*x[:-8]), u)
    np.testing.assert_array_equal(jax.tree.leaves(rates)[:-8], jax.tree.leaves(alone))
    np.testing.assert_array_equal([getattr(outputs, name) for name in same._fields], jax.tree.leaves(same))
    np.testing.assert_allclose(jax.tree.leaves(rates)[-8:], 0.0)


def test_what_has_no_brakes_is_refused():
    with pytest.raises(
        InputError, match="AntiLock.vehicle = SingleTrack: must be a car with a drive and with wheel spin"
    ):
        vehicles.AntiLock(vehicles.passenger_car())
    with pytest.raises(InputError, match="AntiLock.slip_high = 0.1: must be above slip_low"):
        vehicles.AntiLock(car_of(vehicles.SevenDOF), slip_low=0.2, slip_high=0.1)


@pytest.mark.full
def test_wheels_do_not_lock_on_a_slippery_road():
    car = vehicles.named_car("sedan", "seven-dof")
    drive = manoeuvres.mu_jump_braking(
        25.0, 6.0, mass=float(car.mass), wheel_radius=float(car.wheel_radius), brake_at=0.5, duration=3.0
    )
    slips = {}
    off = vehicles.AntiLock(car, slip_low=2.0, slip_high=3.0)
    for label, one in (("locks", off), ("does not", vehicles.AntiLock(car))):
        log = simulate(one, drive, road=roads.Level(0.3), solver="explicit", max_step=0.001)
        late = np.asarray(log.time) > 1.5
        slips[label] = np.max([-np.asarray(log[f"true.slip_ratio_{at}"])[late] for at in AT])
        way = np.asarray(log["true.x"])[-1]
        slips[f"{label}, way"] = way
    assert slips["locks"] > 0.95 and slips["does not"] < 0.6
    assert slips["does not, way"] < slips["locks, way"] + 0.5

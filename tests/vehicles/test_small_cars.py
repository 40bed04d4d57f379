"""Speeds and times of small cars follow Froude's law; those of full-size cars are constants."""

import dataclasses
import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, manoeuvres, vehicles
from jaxveh.kit import record
from jaxveh.simulation.driven import with_pedals
from jaxveh.vehicles import kit

LENGTHS = ("front_axle_to_cg", "rear_axle_to_cg")
SIZES = (0.1, 0.3, 0.6)


def made(name, fidelity):
    try:
        return vehicles.named_car(name, fidelity)
    except InputError:
        return None  # the car lacks a number of the class


FIDELITIES = sorted(name for name, kind in kit.FIDELITIES.items() if issubclass(kind, kit.AbstractTwoAxle))
"""Those whose wheels slip."""


@functools.cache
def cars():
    """Cars by name and fidelity: made when a test asks, not when tests are collected."""
    every = {(name, fidelity): made(name, fidelity) for name in kit.CARS for fidelity in kit.FIDELITIES}
    return {key: car for key, car in every.items() if isinstance(car, kit.AbstractTwoAxle)}


def of_size(car, size):
    """The car with axles as far apart as those of a car of `size` times a wheelbase of 2 m."""
    factor = 2.0 * size / float(car.wheelbase)
    return dataclasses.replace(car, **{name: factor * getattr(car, name) for name in LENGTHS})


def test_every_car_and_fidelity_with_slips_is_here():
    assert {fidelity for _, fidelity in cars()} == {*FIDELITIES} and len(FIDELITIES) >= 9


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_slips_are_regularised_below_a_speed_that_scales_with_the_root_of_the_size(fidelity):
    for (name, own), car in cars().items():
        if own == fidelity:
            assert float(car.slip_floor) == 3.0, name
            for size in SIZES:
                np.testing.assert_allclose(of_size(car, size).slip_floor, 3.0 * np.sqrt(size), rtol=1e-12)
            assert dataclasses.replace(of_size(car, 0.1), crawl_speed=0.7).slip_floor == 0.7


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_rates_see_that_speed(fidelity):
    """A small car evaluated with its default is the one that is told the same crawl speed, and not the one of a full-size car."""
    car = of_size(next(car for (_, own), car in cars().items() if own == fidelity), 0.1)
    values = {"steer": 0.05, "v_x": 1.5}
    inputs = {name: values.get(name, 0.0) for name in car.inputs}
    u = record("Inputs", inputs)
    rates = lambda car: jnp.stack(
        [jnp.asarray(one, float) for one in jax.tree.leaves(car.evaluate(0.0, state(car, u), u)[0])]
    )
    own = rates(car)
    np.testing.assert_allclose(own, rates(dataclasses.replace(car, crawl_speed=3.0 * 0.1**0.5)), rtol=1e-9, atol=1e-9)
    assert not np.allclose(own, rates(dataclasses.replace(car, crawl_speed=3.0)), rtol=1e-3)


def state(car, u):
    x = car.start(0.0, u, **({"v_x": 1.5} if "v_x" in car.state_type._fields else {}))
    moved = {"v_y": 0.1, "sideslip": 0.06, "yaw_rate": 0.3}
    return x._replace(**{name: jnp.asarray(value) for name, value in moved.items() if name in x._fields})


def test_a_small_car_turns_as_the_closed_form_says():
    """At 1.2 m/s, where a floor of 3 m/s changed the steady sideslip of a 1:10 car by per cents."""
    a, b, mass = 0.16, 0.17, 3.5
    car = vehicles.LinearSingleTrack(
        mass=mass, yaw_inertia=0.05, front_axle_to_cg=a, rear_axle_to_cg=b, front_stiffness=60.0, rear_stiffness=70.0
    )
    assert float(car.slip_floor) < 1.25
    v, steer, (front, rear) = 1.25, 0.05, (60.0, 70.0)
    length = a + b
    gradient = mass * (b * rear - a * front) / (length * front * rear)
    yaw_rate = v * steer / (length + gradient * v * v)
    sideslip = b * yaw_rate / v - mass * a * v * yaw_rate / (length * rear)
    u = record("Inputs", {"steer": jnp.asarray(steer), "v_x": jnp.asarray(v)})
    rates, _ = car.evaluate(
        0.0, car.start(0.0, u)._replace(sideslip=jnp.asarray(sideslip), yaw_rate=jnp.asarray(yaw_rate)), u
    )
    np.testing.assert_allclose([rates.sideslip, rates.yaw_rate], 0.0, atol=1e-12)


def test_a_batch_of_cars_has_a_floor_for_each_and_its_slope():
    car = cars()["sedan", "linear"]
    at = lambda size: (
        of_size(car, 1.0).slip_floor
        if size is None
        else eqx.tree_at(lambda one: one.front_axle_to_cg, car, size - car.rear_axle_to_cg).slip_floor
    )
    sizes = jnp.asarray([0.5, 1.5, 2.5])
    np.testing.assert_allclose(jax.jit(jax.vmap(at))(sizes), 3.0 * np.sqrt(np.minimum(sizes / 2.0, 1.0)), rtol=1e-12)
    np.testing.assert_allclose(jax.grad(at)(1.5), 3.0 * 0.5 / np.sqrt(1.5 * 2.0), rtol=1e-9)


def test_the_driver_of_a_small_car_is_as_quick_as_the_car():
    straight = manoeuvres.step_steer(10.0, 0.01)
    for (name, fidelity), car in cars().items():
        if fidelity != "seven-dof":
            continue
        full = with_pedals(straight, car)
        assert (float(full.gain), float(full.integral_time)) == (1.0, 4.0), name
        for size in SIZES:
            small = with_pedals(straight, of_size(car, size))
            np.testing.assert_allclose([small.gain**-2, small.integral_time**2 / 16.0], size, rtol=1e-12)
    own = manoeuvres.SpeedControl(straight, 3.5, gain=2.0, integral_time=1.0, wheelbase=0.3)
    assert (float(own.gain), float(own.integral_time)) == (2.0, 1.0)
    with pytest.raises(InputError, match=r"SpeedControl: wheelbase = -0\.3"):
        manoeuvres.SpeedControl(straight, 3.5, wheelbase=-0.3)

"""A number that `eqx.tree_at` puts into a car or a model compiles nothing anew, and keeps the car's dtype."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxveh
from jaxveh import estimators, filters, manoeuvres, sensors, statespace, tyres, vehicles
from jaxveh._core.parameter import strong

KINDS = {
    "a number": lambda value: value,
    "a whole number": int,
    "a weak array": jnp.asarray,
    "a weak whole array": lambda value: jnp.asarray(int(value)),
    "a NumPy number": np.asarray,
}


def changed(car, value):
    return eqx.tree_at(lambda car: car.mass, car, value)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_number_is_what_the_class_makes_of_it(kind):
    car = vehicles.passenger_car()
    found = strong(changed(car, KINDS[kind](1500.0)))
    expected = changed(car, jnp.asarray(1500.0, jnp.float64))
    assert jax.tree.structure(found) == jax.tree.structure(expected)
    assert float(found.mass) == 1500.0 and found.mass.dtype == jnp.float64
    assert isinstance(found.mass, jax.Array) and not found.mass.weak_type


def test_a_car_without_them_is_the_same_object():
    car = vehicles.passenger_car()
    assert strong(car) is car


def test_a_car_in_float32_stays_one():
    car = changed(statespace.cast(vehicles.passenger_car(), np.float32), jnp.asarray(1500.0))
    assert car.mass.dtype == jnp.float64 and strong(car).mass.dtype == jnp.float32


def test_what_a_class_does_not_declare_is_left_alone():
    class Own(eqx.Module):
        brush: tyres.Brush
        chosen: float

    own = Own(eqx.tree_at(lambda t: t.friction, tyres.Brush(1e5, 1e5, 1.0), 0.9), 2.0)
    found = strong(own)
    assert type(found.chosen) is float and isinstance(found.brush.friction, jax.Array)


TRACED = []


class Counted(vehicles.SingleTrack):
    """A single track that notes when its equations are traced."""

    def evaluate(self, *arguments):
        TRACED.append(1)
        return super().evaluate(*arguments)


def test_drives_and_filters_are_compiled_once_for_all_of_them():
    device, steer, plain = sensors.esc(), manoeuvres.step_steer(25.0, 0.02, duration=1.3), vehicles.passenger_car()
    car = Counted(**{field.name: getattr(plain, field.name) for field in dataclasses.fields(plain) if field.init})

    def likelihoods(number):
        drive = jaxveh.simulate(changed(car, number(1500.0)), steer, device, dt=0.1)
        model = estimators.state_space(changed(car, number(1500.0)), device)
        assert isinstance(model.system.vehicle.mass, jax.Array) and not model.system.vehicle.mass.weak_type
        heavier = eqx.tree_at(lambda model: model.system.vehicle.mass, model, number(1600.0))
        return [jaxveh.run(filters.Extended(), one, drive).log_likelihood for one in (model, heavier)]

    def traced(number):
        TRACED.clear()
        return likelihoods(number), len(TRACED)

    # Names of outputs are asked of the equations each time a state space is made; more is asked by the first programs alone.
    exact = lambda value: jnp.asarray(value, jnp.float64)
    (expected, first), (_, again) = traced(exact), traced(exact)
    assert expected[0] != expected[1] and first > again + 3
    for number in KINDS.values():
        assert traced(number) == (expected, again)


def test_its_gradient_is_that_of_the_strong_one():
    device, steer, car = sensors.esc(), manoeuvres.step_steer(25.0, 0.02, duration=1.3), vehicles.passenger_car()
    last = lambda mass: jaxveh.simulate(changed(car, mass), steer, device, dt=0.1, throw=False)["true.yaw_rate"][-1]
    weak, exact = (jax.grad(last)(mass) for mass in (1500.0, jnp.asarray(1500.0, jnp.float64)))
    np.testing.assert_allclose(weak, exact, rtol=1e-12)
    assert abs(float(weak)) > 1e-7

"""Cars from a specification, and the linear baseline."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import vehicles
from jaxveh.io import AxleTyre, CarSpecification
from jaxveh.tyres import Contact, Linear
from jaxveh.vehicles import GRAVITY

SPORTS_CAR = {"mass": 982.0, "yaw_inertia": 1605.4, "front_axle_to_cg": 1.33, "rear_axle_to_cg": 1.07}


def specification(**more):
    stiffness = {"front_cornering_stiffness": 70e3, "rear_cornering_stiffness": 120e3}
    return CarSpecification(**{**SPORTS_CAR, **stiffness, **more})


def test_an_axle_from_its_stiffness_keeps_stiffness_and_is_generic_else():
    car = vehicles.from_specification(specification())
    for tyre, load, stiffness in zip((car.front, car.rear), car.static_loads(), (70e3, 120e3), strict=True):
        np.testing.assert_allclose(tyre.cornering_stiffness, stiffness, rtol=1e-12)
        np.testing.assert_allclose([tyre.D, tyre.nominal_load], load, rtol=1e-12)
        np.testing.assert_allclose(tyre.peak, load, rtol=1e-12)
    np.testing.assert_allclose(car.front.D, 982.0 * GRAVITY * 1.07 / 2.4, rtol=1e-12)
    assert car.inputs == ("steer", "v_x")
    assert car.steer_offset == 0


def test_coefficients_and_options_of_a_specification_are_taken_over():
    tyre = AxleTyre(B=10.0, C=1.3, D=8000.0, E=0.2, S_h=0.001, S_v=20.0, nominal_load=4000.0)
    car = vehicles.from_specification(specification(front=tyre, cg_height=0.5, steer_offset=0.004))
    taken = [float(getattr(car.front, name)) for name in ("B", "C", "D", "E", "S_h", "S_v", "nominal_load")]
    assert taken == [10.0, 1.3, 8000.0, 0.2, 0.001, 20.0, 4000.0]
    assert car.inputs == ("steer", "v_x", "a_x")
    assert float(car.cg_height) == 0.5


def test_the_channels_reading_in_straight_running_steers_nothing():
    car = vehicles.from_specification(specification(steer_offset=0.004))
    np.testing.assert_allclose(car.steer_offset + 0.004, 0.0, atol=1e-18)


@pytest.mark.parametrize("make", [vehicles.passenger_car, lambda: vehicles.from_specification(specification())])
def test_the_linear_car_has_the_same_slopes_at_the_static_loads(make):
    car = make()
    straight = vehicles.linear(car)
    for before, after, load in zip(
        (car.front, car.rear), (straight.front, straight.rear), car.static_loads(), strict=True
    ):
        assert isinstance(after, Linear)
        np.testing.assert_allclose(after.cornering_stiffness, before.cornering_stiffness, rtol=1e-12)
        small = Contact(slip_angle=jnp.asarray(1e-6), load=load)
        np.testing.assert_allclose(after.forces(small).F_y, before.forces(small).F_y, rtol=1e-6)
    assert straight.mass == car.mass
    again = vehicles.linear(straight)
    assert again.front.cornering_stiffness == straight.front.cornering_stiffness


def test_a_law_derived_from_the_linear_one_is_linear_in_the_linear_car():
    class Saturating(Linear):
        def forces(self, contact, state=None):
            forces = super().forces(contact, state)
            return forces._replace(F_y=5000.0 * jnp.tanh(2.0 * forces.F_y / 5000.0))

    car = dataclasses.replace(vehicles.from_specification(specification()), front=Saturating(70e3))
    straight = vehicles.linear(car)
    assert type(straight.front) is Linear
    np.testing.assert_allclose(straight.front.cornering_stiffness, 140e3)

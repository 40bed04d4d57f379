"""Linear tyres: stiffnesses, and what load transfer takes from them."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh.tyres import Contact, Linear, LinearWithLoad, cornering_stiffness


def test_a_linear_tyre_without_slip_stiffness_has_no_longitudinal_force():
    contact = Contact(slip_angle=0.1, slip_ratio=0.2)
    assert Linear(60e3).forces(contact).F_x == 0.0
    np.testing.assert_allclose(Linear(60e3, 80e3).forces(contact).F_x, 16e3, rtol=1e-14)
    np.testing.assert_allclose(Linear(60e3, 80e3).forces(contact).F_y, 6e3, rtol=1e-14)


@pytest.mark.parametrize("load", [100.0, 2500.0, 5000.0, 9000.0])
def test_the_stiffness_follows_the_load_as_the_magic_formulas(load):
    tyre = LinearWithLoad(60e3, 5000.0, 20.0)
    expected = 60e3 * math.sin(2 * math.atan(load / 5000.0))
    np.testing.assert_allclose(cornering_stiffness(tyre, Contact(load=jnp.asarray(load))), expected, rtol=1e-13)
    np.testing.assert_allclose(tyre.forces(Contact(slip_ratio=0.1, load=load)).F_x, 2.0 * load, rtol=1e-13)


def test_the_stiffness_is_greatest_at_the_peak_load():
    tyre = LinearWithLoad(60e3, 5000.0)
    forces = tyre.forces(Contact(slip_angle=1.0, load=np.linspace(0.0, 15e3, 301))).F_y
    assert np.argmax(forces) == 100 and float(forces[100]) == 60e3


def test_load_transfer_lowers_the_stiffness_of_an_axle():
    tyre = LinearWithLoad(60e3, 5000.0)
    stiffness = lambda load: tyre.forces(Contact(slip_angle=1.0, load=load)).F_y
    assert stiffness(2000.0) + stiffness(5000.0) < 2 * stiffness(3500.0)

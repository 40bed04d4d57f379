"""UniTire against its formula, and its one curve."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxveh.tyres import Contact, UniTire

K_X, K_Y, MU, F_Z = 80e3, 60e3, 0.8, 4000.0


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.floats(-1.0, 1.0), st.floats(-0.9, 2.0), st.floats(-2.0, 2.0))
def test_the_formula(alpha, kappa, E):
    phi_x, phi_y = K_X * kappa / (1 + kappa) / (MU * F_Z), K_Y * math.tan(alpha) / (1 + kappa) / (MU * F_Z)
    phi = math.hypot(phi_x, phi_y)
    force = MU * F_Z * -math.expm1(-phi - E * phi**2 - (E**2 + 1 / 12) * phi**3)
    expected = (force * phi_x / phi, force * phi_y / phi) if phi else (0.0, 0.0)
    forces = UniTire(K_X, K_Y, MU, E).forces(Contact(alpha, kappa, F_Z))
    np.testing.assert_allclose(forces[:2], expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("E", [-3.0, -0.5, 0.0, 0.5, 3.0])
def test_the_force_rises_to_friction_whatever_E(E):
    forces = np.asarray(UniTire(K_X, K_Y, MU, E).forces(Contact(np.linspace(0.0, 1.3, 2000), load=F_Z)).F_y)
    assert np.all(np.diff(forces) >= -1e-15 * MU * F_Z)  # the last bit, where nothing rises any more
    np.testing.assert_allclose(forces[-1], MU * F_Z, rtol=1e-12)


def test_one_curve_for_every_load_and_friction():
    tyre = UniTire(K_X, K_Y, MU, 0.3)
    one = tyre.forces(Contact(math.atan(0.03), load=F_Z)).F_y
    np.testing.assert_allclose(tyre.forces(Contact(math.atan(0.06), load=2 * F_Z)).F_y, 2 * one, rtol=1e-13)
    np.testing.assert_allclose(tyre.forces(Contact(math.atan(0.015), load=F_Z, friction=0.5)).F_y, one / 2, rtol=1e-13)


def test_stiffnesses_are_the_slopes_at_zero_and_curvature_is_half_of_one_less_2E():
    tyre = UniTire(K_X, K_Y, MU, 0.3)
    force = lambda kappa: tyre.forces(Contact(0.0, kappa / (1 - kappa), F_Z)).F_x
    np.testing.assert_allclose(jax.grad(force)(jnp.asarray(0.0)), K_X, rtol=1e-14)
    # 1 - exp(-phi - E phi^2) = phi - (1/2 - E) phi^2 + ...
    phi = 1e-4
    curve = float(force(jnp.asarray(phi * MU * F_Z / K_X))) / (MU * F_Z)
    np.testing.assert_allclose((phi - curve) / phi**2, 0.5 - 0.3, rtol=1e-3)

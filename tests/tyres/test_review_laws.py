"""The laws of the sideslip review, equations 4 to 7, against its formulas."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxveh.tyres import HSRI, Arctangent, Contact, Dugoff, Exponential, Parabolic

F_Z, MU = 4000.0, 0.8
SLIPS = st.floats(-0.9, 0.9)


def sign(x):
    return math.copysign(1.0, x) if x else 0.0


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(-0.6, 0.6), SLIPS)
def test_hsri_is_the_reviews_equation_4(alpha, kappa):
    k_lambda, k_alpha, brake = 80e3, 60e3, -kappa
    H = math.hypot(brake / (1 - brake) * k_lambda, math.tan(alpha) / (1 - brake) * k_alpha) / (MU * F_Z)
    part = 1 / H - 1 / (4 * H**2) if H > 0.5 else 1.0
    forces = HSRI(k_lambda, k_alpha, MU).forces(Contact(alpha, kappa, F_Z))
    np.testing.assert_allclose(forces.F_x, -brake / (1 - brake) * k_lambda * part, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(forces.F_y, math.tan(alpha) / (1 - brake) * k_alpha * part, rtol=1e-12, atol=1e-9)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(-1.2, 1.2), st.floats(-1.0, 1.0), st.floats(0.0, 9000.0))
def test_hsri_is_dugoff_without_fading(alpha, kappa, load):
    contact = Contact(jnp.asarray(alpha), jnp.asarray(kappa), jnp.asarray(load))
    hsri, dugoff = HSRI(80e3, 60e3, MU).forces(contact), Dugoff(80e3, 60e3, MU).forces(contact)
    np.testing.assert_allclose(hsri[:2], dugoff[:2], rtol=1e-12)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(-0.6, 0.6), SLIPS)
def test_parabolic_is_the_reviews_equation_5(alpha, kappa):
    k = 60e3
    forces = Parabolic(k, MU, 80e3).forces(Contact(alpha, kappa, F_Z))
    alone = k * alpha - k**2 / (4 * MU * F_Z) * alpha**2 * sign(alpha)
    alone = alone if abs(alpha) < 2 * MU * F_Z / k else MU * F_Z * sign(alpha)
    circle = math.sqrt(max(1 - (float(forces.F_x) / (MU * F_Z)) ** 2, 0.0))
    # The circle of a force rounded near its limit is known to the root of the rounding.
    np.testing.assert_allclose(forces.F_y, alone * circle, rtol=1e-9, atol=1e-4)
    np.testing.assert_allclose(Parabolic(k, MU).forces(Contact(alpha, kappa, F_Z)).F_y, alone, rtol=1e-12, atol=1e-9)


def test_parabolic_uses_all_friction_at_its_peak_and_the_locked_wheel_leaves_nothing_sideways():
    tyre = Parabolic(60e3, MU, 80e3)
    peak = 2 * MU * F_Z / 60e3
    np.testing.assert_allclose(tyre.forces(Contact(peak, load=F_Z)).F_y, MU * F_Z, rtol=1e-14)
    slope = jax.grad(lambda a: tyre.forces(Contact(a, load=F_Z)).F_y)
    np.testing.assert_allclose(slope(peak * (1 - 1e-9)), 0.0, atol=1e-3)
    assert tuple(tyre.forces(Contact(0.2, -1.0, F_Z))[:2]) == (-MU * F_Z, 0.0)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(-1.2, 1.2), SLIPS)
def test_exponential_is_the_reviews_equation_6(alpha, kappa):
    k = 15.0
    forces = Exponential(k, MU, 20.0).forces(Contact(alpha, kappa, F_Z))
    mu_s = MU * math.sqrt(F_Z**2 - (float(forces.F_x) / MU) ** 2) / F_Z
    expected = mu_s * F_Z * (1 - math.exp(-k * abs(alpha))) * sign(alpha)
    np.testing.assert_allclose(forces.F_y, expected, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(forces.F_x, MU * F_Z * (1 - math.exp(-20 * abs(kappa))) * sign(kappa), atol=1e-9)


def test_exponential_rises_with_its_stiffness_factor_in_both_directions():
    tyre = Exponential(15.0, MU, 20.0)
    slopes = jax.jacfwd(lambda x: jnp.stack(tyre.forces(Contact(x[0], x[1], F_Z))[:2]))(jnp.zeros(2))
    np.testing.assert_allclose(slopes, [[0, 20 * MU * F_Z], [15 * MU * F_Z, 0]], rtol=1e-14)


@pytest.mark.parametrize("alpha", [-0.3, 0.01, 0.1])
@pytest.mark.parametrize("load", [1000.0, 6000.0, 20e3])
def test_arctangent_is_the_reviews_equation_7(alpha, load):
    tyre = Arctangent(load_limit=20e3, stiffness_factor=12.0, reduction=0.7)
    expected = 0.7 * (1 - load / 20e3) * load * math.atan(12 * alpha)
    np.testing.assert_allclose(tyre.forces(Contact(alpha, load=load)).F_y, expected, rtol=1e-13, atol=1e-12)


def test_arctangent_is_greatest_at_half_its_load_limit_and_zero_beyond_it():
    tyre = Arctangent(load_limit=20e3, stiffness_factor=12.0)
    forces = tyre.forces(Contact(0.1, load=np.linspace(0.0, 30e3, 301))).F_y
    assert np.argmax(forces) == 100
    assert np.all(np.asarray(forces[200:]) == 0) and np.all(np.asarray(forces[1:200]) > 0)

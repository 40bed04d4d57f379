"""Fiala's tyre in the forms of ADAMS and of the model-adaptive paper, against their formulas."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxveh.tyres import Contact, Fiala, FialaADAMS, FialaPolynomial

C_X, C, F_Z = 80e3, 60e3, 4000.0


def adams(kappa, alpha, mu_0, mu_1, R_2):
    """The manual's branches, with the signs of this package."""
    slip = min(math.hypot(kappa, math.tan(alpha)), 1.0)
    limit = (mu_0 - (mu_0 - mu_1) * slip) * F_Z
    if abs(kappa) < limit / (2 * C_X):
        F_x = C_X * kappa
    else:
        F_x = math.copysign(limit - limit**2 / (4 * abs(kappa) * C_X), kappa)
    if abs(alpha) > math.atan(3 * limit / C):
        return F_x, math.copysign(limit, alpha), 0.0
    H = 1 - C * abs(math.tan(alpha)) / (3 * limit)
    F_y = math.copysign(limit * (1 - H**3), alpha)
    return F_x, F_y, -math.copysign(limit * 2 * R_2 * (1 - H) * H**3, alpha)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.floats(-1.5, 1.5), st.floats(-1.2, 1.2))
def test_the_form_of_adams_is_the_manuals(kappa, alpha):
    F_x, F_y, _, _, M_z = FialaADAMS(C_X, C, 0.9, 0.7, 0.12).forces(Contact(alpha, kappa, F_Z))
    np.testing.assert_allclose([F_x, F_y, M_z], adams(kappa, alpha, 0.9, 0.7, 0.12), rtol=1e-12, atol=1e-8)


def test_sliding_friction_is_reached_at_the_slip_one():
    tyre = FialaADAMS(C_X, C, 0.9, 0.7)
    for alpha in (math.atan(1.0), 1.2):
        np.testing.assert_allclose(tyre.forces(Contact(alpha, load=F_Z)).F_y, 0.7 * F_Z, rtol=1e-14)
    np.testing.assert_allclose(FialaADAMS(C_X, C, 0.9).forces(Contact(1.2, load=F_Z)).F_y, 0.9 * F_Z, rtol=1e-14)


def test_adams_and_the_classical_form_agree_on_lateral_force_alone():
    alpha = np.linspace(-0.4, 0.4, 41)
    classical = Fiala(C_X, C, 0.9, half_length=0.2).forces(Contact(alpha, load=F_Z))
    form = FialaADAMS(C_X, C, 0.9, half_width=0.1).forces(Contact(alpha, load=F_Z))
    np.testing.assert_allclose(form.F_y, classical.F_y, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(form.M_z, classical.M_z, rtol=1e-11, atol=1e-9)


def at(tyre, theta):
    """Forces over mu F_z at a normalised slip angle; the moment too."""
    alpha = math.atan(theta * float(tyre.friction) * F_Z / C)
    forces = tyre.forces(Contact(alpha, load=F_Z))
    return float(forces.F_y) / (float(tyre.friction) * F_Z), float(forces.M_z) / (float(tyre.friction) * F_Z)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("friction", [1.0, 0.6])
def test_the_printed_polynomials(sign, friction):
    tyre = FialaPolynomial(C_X, C, friction, trail=0.0317, contact_length=0.07, as_printed=True)
    for q in (0.1, 0.8, 1.5):
        F_y, M_z = at(tyre, sign * q)
        np.testing.assert_allclose(F_y, sign * (q - 0.0668 * q**2 - 0.1032 * q**3), rtol=1e-12)
        moment = 0.2749 * q - 0.0950 * q**2 - 0.0872 * q**3 + 0.0353 * q**4
        np.testing.assert_allclose(M_z, -sign * 0.07 * moment, rtol=1e-12)
    for q in (1.55, 2.5, 9.0):
        np.testing.assert_allclose(at(tyre, sign * q)[0], sign * 1.0063, rtol=1e-12)
    for q in (2.5, 9.0):
        np.testing.assert_allclose(at(tyre, sign * q)[1], -sign * 0.2258 * 0.0317 / (q - 0.32), rtol=1e-12)
    assert tyre.forces(Contact(0.0, 1.0, F_Z)).F_x == C_X


def test_the_errata_of_the_printed_polynomials():
    printed = FialaPolynomial(C_X, C, trail=0.0317, contact_length=0.07, as_printed=True)
    before, after = at(printed, 2 - 1e-9)[1], at(printed, 2 + 1e-9)[1]
    np.testing.assert_allclose(after / before, 1.64, atol=0.01)
    mended = FialaPolynomial(C_X, C, trail=0.0317)
    for edge in (1.54, (-0.1336 + math.sqrt(0.1336**2 + 4 * 0.3096)) / 0.6192, 2.0):
        np.testing.assert_allclose(at(mended, edge - 1e-9), at(mended, edge + 1e-9), rtol=1e-7)
    force, moment = at(mended, 1e-6)
    np.testing.assert_allclose(-moment / force, 0.0317, rtol=1e-5)  # e is the trail at zero slip
    np.testing.assert_allclose(at(mended, 5.0), at(printed, 5.0), rtol=2e-3)
    assert mended.forces(Contact(0.0, 1.0, F_Z)).F_x == F_Z


def test_the_polynomials_lie_above_fialas_law():
    theta = np.linspace(0.05, 3.0, 60)
    polynomial, law = FialaPolynomial(C_X, C), Fiala(C_X, C)
    forces = np.array([[at(polynomial, q)[0], at(law, q)[0]] for q in theta])
    above = forces[:, 0] - forces[:, 1]
    assert np.all(above > 0)
    np.testing.assert_allclose(np.max(above), 0.143, atol=0.001)  # at q = 1.3: they saturate at half of Fiala's slip

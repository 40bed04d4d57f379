"""The tyre of CommonRoad's vehicle models (commonroad-vehicle-models, `vehiclemodels.utils.tire_model`) against MF-Tyre 5.2.

CommonRoad takes PAC2002 (M. Althoff and G. Würsching, CommonRoad: Vehicle Models, 2020) without dependence on load and
without scaling factors, so `_ours` makes a tyre whose nominal load is the load. Axes are ISO 8855 with the slip angle of
ISO-W: its alpha is minus our slip angle; its longitudinal slip is positive when braking: minus our slip ratio. Angles stand
for tangents and sines, and no curvature is held at 1 (`angles=False, limits=False`). What is the same agrees to 1e-9 of the
load (measured: 2.2e-10, the 1e-6 that the book, and we, add to the denominators of B). What is not:

- Its S_Vx (N) is added inside the sine of the longitudinal force, as if it were an angle in rad.
- Its lateral shifts have the sign of the camber: none at camber zero, mirrored at negative camber (p_hy1, p_vy1).
- Its lateral force of combined slip takes the slip ratio positive when braking, where its longitudinal force turns it round: the
  lateral force that slip ratio adds is that of driving when braking.
"""

import dataclasses
import importlib

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import tyres
from jaxveh.tyres import mf_tyre

pytestmark = pytest.mark.peers

pytest.importorskip("vehiclemodels")
# Not skipped where the package is there but has changed.
model = importlib.import_module("vehiclemodels.utils.tire_model")
parameters = importlib.import_module("vehiclemodels.vehicle_parameters")

LOADS = (1500.0, 4000.0, 9000.0)
ALPHA = np.linspace(-0.3, 0.3, 41)
BRAKING = np.linspace(-0.9, 0.9, 37)
CAMBERS = (-0.12, 0.0, 0.05)
SHARE = 1e-9
"""Of the load."""


@pytest.fixture(scope="module")
def coefficients():
    """Theirs, with a friction that depends on camber along too, or it would go unseen."""
    return dataclasses.replace(parameters.setup_vehicle_parameters(2).tire, p_dx3=1.5)


def _ours(p, load, camber):
    """Their coefficients as MF-Tyre 5.2; p_cx1 is PCX1."""
    named = {name.replace("_", "").upper(): value for name, value in dataclasses.asdict(p).items()}
    named = {**named, "PHY1": named["PHY1"] * np.sign(camber), "PVY1": named["PVY1"] * np.sign(camber)}
    along = {name: value for name, value in named.items() if name[2] == "X"}
    across = {name: value for name, value in named.items() if name[2] == "Y"}
    return tyres.MFTyre(
        structure=mf_tyre.Structure(UNLOADED_RADIUS=0.3, FNOMIN=load),
        longitudinal=mf_tyre.LongitudinalCoefficients(**along),
        lateral=mf_tyre.LateralCoefficients(**across),
        aligning=mf_tyre.AligningCoefficients(),
        overturning=mf_tyre.OverturningCoefficients(),
        rolling=mf_tyre.RollingCoefficients(),
        scaling=mf_tyre.Scaling(),
        ranges=mf_tyre.Ranges(),
        version=52,
        limits=False,
        angles=False,
    )


@eqx.filter_jit
def _forces(tyre, slip_angle, slip_ratio, load, camber):
    found = tyre.forces(tyres.Contact(slip_angle=slip_angle, slip_ratio=slip_ratio, load=load, camber=camber))
    return found.F_x, found.F_y


def _our_forces(p, load, camber, slip_angle, slip_ratio):
    wide = lambda values: jnp.asarray(
        np.broadcast_to(values, np.broadcast_shapes(np.shape(slip_angle), np.shape(slip_ratio)))
    )
    found = _forces(_ours(p, load, camber), wide(slip_angle), wide(slip_ratio), jnp.asarray(load), jnp.asarray(camber))
    return [np.asarray(one) for one in found]


def _their_combined(p, load, camber):
    """F_x, F_y over braking slip (rows) and alpha."""

    def one(kappa, alpha):
        F0_y, mu_y = model.formula_lateral(alpha, camber, load, p)
        F0_x = model.formula_longitudinal(kappa, camber, load, p)
        return (
            model.formula_longitudinal_comb(kappa, alpha, F0_x, p),
            model.formula_lateral_comb(kappa, alpha, camber, mu_y, load, F0_y, p),
        )

    return np.vectorize(one)(BRAKING[:, None], ALPHA)


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("camber", CAMBERS)
def test_pure_lateral_force_is_equal(coefficients, load, camber):
    theirs = [model.formula_lateral(alpha, camber, load, coefficients)[0] for alpha in ALPHA]
    ours = _our_forces(coefficients, load, camber, -ALPHA, 0.0)[1]
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=SHARE * load)
    # Positive slip angle, positive force.
    assert ours[0] > 0.7 * load and ours[-1] < -0.7 * load


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("camber", CAMBERS)
def test_pure_longitudinal_force_is_equal_without_its_vertical_shift(coefficients, load, camber):
    p = dataclasses.replace(coefficients, p_vx1=0.0)
    theirs = [model.formula_longitudinal(slip, camber, load, p) for slip in BRAKING]
    ours = _our_forces(p, load, camber, 0.0, -BRAKING)[0]
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=SHARE * load)
    assert ours[0] > 0.7 * load and ours[-1] < -0.7 * load


@pytest.mark.parametrize("load", LOADS)
def test_its_vertical_shift_inside_the_sine_is_the_whole_difference(coefficients, load):
    p = coefficients
    theirs = np.array([model.formula_longitudinal(slip, 0.0, load, p) for slip in BRAKING])
    ours = _our_forces(p, load, 0.0, 0.0, -BRAKING)[0]
    D, S_Vx = p.p_dx1 * load, p.p_vx1 * load
    x = p.p_kx1 * load / (p.p_cx1 * D) * (p.p_hx1 - BRAKING)
    angle = p.p_cx1 * np.arctan(x - p.p_ex1 * (x - np.arctan(x)))
    explained = D * (np.sin(angle + S_Vx) - np.sin(angle)) - S_Vx
    np.testing.assert_allclose(theirs - ours, explained, rtol=0, atol=SHARE * load)
    # A hundredth of a newton becomes a few per cent of the peak.
    assert abs(S_Vx) < 0.1 and np.max(np.abs(explained)) > 0.8 * abs(S_Vx) * D > 0.01 * load


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("camber", CAMBERS)
def test_longitudinal_force_of_combined_slip_is_equal_without_its_vertical_shift(coefficients, load, camber):
    p = dataclasses.replace(coefficients, p_vx1=0.0)
    theirs, _ = _their_combined(p, load, camber)
    ours, _ = _our_forces(p, load, camber, -ALPHA, -BRAKING[:, None])
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=SHARE * load)


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("camber", CAMBERS)
def test_its_lateral_force_when_braking_is_that_of_driving(coefficients, load, camber):
    _, theirs = _their_combined(coefficients, load, camber)
    _, driving = _our_forces(coefficients, load, camber, -ALPHA, BRAKING[:, None])
    _, braking = _our_forces(coefficients, load, camber, -ALPHA, -BRAKING[:, None])
    np.testing.assert_allclose(driving, theirs, rtol=0, atol=SHARE * load)
    assert np.max(np.abs(braking - theirs)) > 0.01 * load


def test_its_vertical_and_horizontal_shifts_vanish_without_camber(coefficients):
    load, p = 4000.0, coefficients
    theirs = [model.formula_lateral(0.0, camber, load, p)[0] for camber in (-1e-12, 0.0, 1e-12)]
    # As the coefficients are meant the force at zero slip is that of a camber from above.
    meant = _our_forces(p, load, 1e-12, 0.0, 0.0)[1]
    np.testing.assert_allclose(theirs, [-meant, 0.0, meant], rtol=0, atol=SHARE * load)
    assert abs(meant) > 0.01 * load

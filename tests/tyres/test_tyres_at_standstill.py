"""Where a wheel stands, or rolls backwards: what the slips' own speed and the direction of travel do to every law."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import tyres
from jaxveh.tyres import Contact
from jaxveh.tyres.relaxed import SLIDES

SLOW = 1.2
"""m/s: what a vehicle's slips at standstill are relative to."""

SIGMA_X, SIGMA_Y = 0.2, 0.4

LUGRE = {
    "plain": lambda: tyres.LuGre(200.0, 150.0, 1.1, 0.8, 6.0),
    "damped": lambda: tyres.LuGre(200.0, 150.0, 1.1, 0.8, 6.0, 0.15, 0.2, 0.3, 1e-3, 0.5),
}


def tmeasy():
    along = tyres.TMeasyCurve(90e3, 0.11, 3300.0, 0.40, 3200.0), tyres.TMeasyCurve(160e3, 0.12, 6000.0, 0.45, 5700.0)
    across = tyres.TMeasyCurve(75e3, 0.16, 3100.0, 0.60, 3000.0), tyres.TMeasyCurve(120e3, 0.18, 5500.0, 0.70, 5400.0)
    trail = tyres.TMeasyTrail(0.035, 0.20, 0.45)
    return tyres.TMeasy(along[0], across[0], 3200.0, along[1], across[1], trail)


TRAILED = {
    "Brush": lambda: tyres.Brush(80e3, 60e3, 0.9),
    "Fiala": lambda: tyres.Fiala(80e3, 60e3, 0.9),
    "FialaADAMS": lambda: tyres.FialaADAMS(80e3, 60e3, 0.9),
    "FialaPolynomial": lambda: tyres.FialaPolynomial(80e3, 60e3, 0.9),
    "MFTyre": lambda: tyres.typical_mf_tyre(4000.0),
    "TMeasy": lambda: tmeasy(),
}


def contact(slip_angle=0.0, slip_ratio=0.0, speed=20.0, **more):
    number = lambda value: jnp.asarray(value, float)
    known = {"slip_angle": slip_angle, "slip_ratio": slip_ratio, "speed": speed, "load": 4000.0, **more}
    return Contact(**{name: number(value) for name, value in known.items()})


def standing(v_x=0.0, v_y=0.0):
    """A wheel at standstill whose contact point slides: `omega r` is v_x, and -v_y its speed to the left (m/s)."""
    return contact(np.arctan(v_y / SLOW), v_x / SLOW, speed=0.0, slip_speed=SLOW)


def relaxed(**more):
    return tyres.Relaxed(tyres.Brush(80e3, 60e3, 0.9), SIGMA_X, SIGMA_Y, **more)


def deflected(tyre, *values):
    return type(tyre.start(contact()))(*[jnp.asarray(value) for value in values])


@pytest.mark.parametrize("tyre", [relaxed(), *(make() for make in LUGRE.values())])
def test_a_deflection_holds_where_nothing_slides_and_takes_up_all_sliding(tyre):
    held = tyre.derivatives(standing(), deflected(tyre, 0.003, -0.002))
    np.testing.assert_array_equal(held, 0.0)
    taken = tyre.derivatives(standing(5.0, -1.0), deflected(tyre, 0.0, 0.0))
    np.testing.assert_allclose(taken, [5.0, -1.0], rtol=1e-12)
    assert np.all(np.isfinite(tyre.start(standing())))


def test_endless_sliding_ends_at_a_bounded_deflection():
    """Slow sliding at the slip `SLIDES` in the sliding's direction, faster sliding at the static law's slip."""
    tyre = relaxed()
    for v_x, v_y, end in ((0.03, -0.04, SLIDES * np.array([0.6, -0.8])), (3.0, -1.0, np.array([3.0, -1.0]) / SLOW)):
        at, there = standing(v_x, v_y), deflected(tyre, *(end * [SIGMA_X, SIGMA_Y]))
        np.testing.assert_allclose(tyre.derivatives(at, there), 0.0, atol=1e-12)
    # Never faster than the docstring's limit of the step says.
    pole = lambda at: jax.jacfwd(lambda u: tyre.derivatives(at, deflected(tyre, 0.0, 0.0)._replace(deflection_x=u))[0])
    np.testing.assert_allclose(pole(standing(3.0))(0.0), -SLOW / SIGMA_X, rtol=1e-12)
    np.testing.assert_allclose(pole(standing(0.03))(0.0), -0.03 / SLIDES / SIGMA_X, rtol=1e-12)


@pytest.mark.parametrize("tyre", [relaxed(), relaxed(of="force"), *(make() for make in LUGRE.values())])
def test_above_the_crawl_speed_the_slips_speed_changes_nothing(tyre):
    for slips in ((0.1, 0.05), (-0.4, 0.6), (0.0, -1.0)):
        plain, told = contact(*slips), contact(*slips, slip_speed=20.0, direction=1.0)
        state = jax.tree.map(lambda value: value + 0.001, tyre.start(plain))
        np.testing.assert_allclose(tyre.start(told), tyre.start(plain), rtol=1e-14)
        np.testing.assert_allclose(tyre.derivatives(told, state), tyre.derivatives(plain, state), rtol=1e-14)


def test_lagged_forces_rise_at_standstill():
    tyre = relaxed(of="force")
    rates = tyre.derivatives(standing(5.0), deflected(tyre, 0.0, 0.0))
    np.testing.assert_allclose(rates, [SLOW / SIGMA_X * tyre.tyre.forces(standing(5.0)).F_x, 0.0], rtol=1e-12)


@pytest.mark.parametrize("name", LUGRE)
def test_lugre_settles_where_it_stands_and_rolls_backwards_as_forwards(name):
    tyre = LUGRE[name]()
    for at in (standing(3.0, -1.0), standing(0.001, 0.0), contact(0.1, 0.2, 0.5, slip_speed=1.3, direction=-1.0)):
        settled = tyre.start(at)
        loss = tyre.derivatives(at, deflected(tyre, 0.0, 0.0))
        np.testing.assert_allclose(tyre.derivatives(at, settled), 0.0, atol=1e-12 * np.max(np.abs(loss)))
    # A wheel that spins in place: Stribeck's friction at its sliding speed, less what fresh bristles lack of it.
    sliding = tyre.forces(standing(3.0), tyre.start(standing(3.0))).F_x / 4000.0 - tyre.viscous * 3.0
    g = 0.8 + 0.3 * np.exp(-((3.0 / 6.0) ** tyre.exponent))
    p = 200.0 * float(tyre.contact_length) / g
    np.testing.assert_allclose(sliding, g * (1 - (1 - np.exp(-p)) / p), rtol=1e-12)
    # Turned by half a turn: what slid forwards slides backwards.
    forwards, backwards = contact(0.1, 0.2), contact(-0.1, -0.2, direction=-1.0)
    np.testing.assert_allclose(tyre.start(backwards), -np.array(tyre.start(forwards)), rtol=1e-12)


def test_mf_tyre_fades_no_slip_that_a_vehicle_has_regularised():
    tyre = tyres.typical_mf_tyre(4000.0)
    still, rolling = (
        tyre.forces(standing(1.0, 0.5)),
        tyre.forces(contact(np.arctan(0.5 / SLOW), 1.0 / SLOW, speed=SLOW)),
    )
    np.testing.assert_allclose([still.F_x, still.F_y], [rolling.F_x, rolling.F_y], rtol=1e-12)
    assert still.F_x > 2000.0
    # The reference evaluator's fading stays for all others, and for shifts.
    faded = tyre.forces(contact(0.4, 0.8, speed=0.0))
    np.testing.assert_array_equal([faded.F_x, faded.F_y], 0.0)
    shifted = eqx.tree_at(lambda t: (t.lateral.PVY1, t.longitudinal.PVX1), tyre, (jnp.asarray(0.1), jnp.asarray(0.1)))
    parked = shifted.forces(standing())
    np.testing.assert_array_equal([parked.F_x, parked.F_y], 0.0)


@pytest.mark.parametrize("name", TRAILED)
def test_the_aligning_moment_turns_round_with_the_direction_of_travel(name):
    tyre = TRAILED[name]()
    ahead, back = (tyre.forces(contact(0.04, 0.01, direction=sign)) for sign in (1.0, -1.0))
    assert ahead.M_z * ahead.F_y < -1e3
    np.testing.assert_allclose(back.M_z, -ahead.M_z, rtol=1e-12)
    np.testing.assert_array_equal([back.F_x, back.F_y], [ahead.F_x, ahead.F_y])


def test_the_residual_torque_turns_round_and_the_arm_of_the_longitudinal_force_does_not():
    plain = tyres.typical_mf_tyre(4000.0, radius=0.32)
    tyre = eqx.tree_at(lambda t: (t.aligning.QDZ6, t.aligning.SSZ1), plain, (jnp.asarray(0.01), jnp.asarray(0.05)))
    ahead, back = (tyre.outputs(contact(0.02, 0.03, direction=sign)) for sign in (1.0, -1.0))
    assert ahead.M_zr > 1.0
    np.testing.assert_allclose([back.M_zr, back.trail], [-ahead.M_zr, -ahead.trail], rtol=1e-12)
    np.testing.assert_allclose(ahead.M_z + back.M_z, 2 * 0.32 * 0.05 * ahead.F_x, rtol=1e-12)

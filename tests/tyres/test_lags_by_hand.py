"""Tyres with states beside their equations in NumPy, un-jitted: rates and forces at points that move, slide and stand."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import tyres
from jaxveh.tyres import Contact
from jaxveh.tyres.slip import length, practical, share, theoretical

SIGMA_X, SIGMA_Y = 0.3, 0.5
POINTS = {
    "rolls": (0.08, -0.05, 3500.0, 12.0, 12.0, 1.0),
    "slides": (-0.3, 0.4, 4200.0, 6.0, 6.0, 0.6),
    "crawls": (0.2, 0.15, 3000.0, 0.4, 1.0, 1.0),
    "crawls and hardly slides": (0.01, 0.02, 3000.0, 0.1, 1.0, 1.0),
    "stands and slides much": (0.6, 0.9, 3000.0, 0.0, 1.0, 1.0),
}
"""Lateral slip, slip ratio, load, speed, slip speed and friction."""


def brush():
    return tyres.Brush(80000.0, 60000.0, 0.9)


def contact_at(name, **more):
    lateral, ratio, load, speed, slip_speed, friction = POINTS[name]
    given = {
        "slip_angle": np.arctan(lateral), "lateral_slip": lateral, "slip_ratio": ratio, "load": load, "speed": speed,
        "slip_speed": slip_speed, "friction": friction,
    }  # fmt: skip
    return Contact(**{key: jnp.asarray(value) for key, value in (given | more).items()})


@pytest.mark.parametrize("name", POINTS)
def test_deflections_lag_over_the_way_and_decay_with_the_sliding_at_standstill(name):
    """du/dt = V s - max(|v|, min(V, |v_s| / 0.1)) u / sigma."""
    lateral, ratio, _, speed, slip_speed, _ = POINTS[name]
    tyre, at = tyres.Relaxed(brush(), SIGMA_X, SIGMA_Y), contact_at(name)
    state = tyre.start(at)._replace(deflection_x=jnp.asarray(0.02), deflection_y=jnp.asarray(-0.03))
    forgets = max(speed, min(slip_speed, slip_speed * np.hypot(ratio, lateral) / 0.1))
    rates = tyre.derivatives(at, state)
    np.testing.assert_allclose(rates.deflection_x, slip_speed * ratio - forgets * 0.02 / SIGMA_X, rtol=1e-12)
    np.testing.assert_allclose(rates.deflection_y, slip_speed * lateral + forgets * 0.03 / SIGMA_Y, rtol=1e-12)
    plain = tyre.derivatives(at._replace(slip_speed=None), state)
    np.testing.assert_allclose(plain.deflection_x, speed * (ratio - 0.02 / SIGMA_X), rtol=1e-12)
    # The law at the slips of the deflections; from the start on they are the contact's.
    slips = {"slip_ratio": 0.02 / SIGMA_X, "lateral_slip": -0.03 / SIGMA_Y, "slip_angle": np.arctan(-0.03 / SIGMA_Y)}
    np.testing.assert_allclose(tyre.forces(at, state), brush().forces(contact_at(name, **slips)), rtol=1e-12)
    np.testing.assert_allclose(tyre.forces(at, tyre.start(at)), brush().forces(at), rtol=1e-9)


@pytest.mark.parametrize("name", ["rolls", "crawls"])
def test_forces_lag_over_the_way_and_moments_do_not(name):
    """dF/dt = V (F_static - F) / sigma; a direction without a length has no lag."""
    slip_speed = POINTS[name][4]
    at = contact_at(name)
    static = brush().forces(at)
    both = tyres.Relaxed(brush(), SIGMA_X, SIGMA_Y, "force")
    state = both.start(at)._replace(F_x=jnp.asarray(300.0))
    rates = both.derivatives(at, state)
    np.testing.assert_allclose(rates.F_x, slip_speed * (static.F_x - 300.0) / SIGMA_X, rtol=1e-12)
    np.testing.assert_allclose(rates.F_y, 0.0, atol=1e-9)
    assert both.forces(at, state) == static._replace(F_x=state.F_x, F_y=state.F_y)
    across = tyres.Relaxed(brush(), None, SIGMA_Y)
    assert across.state_names == ("deflection_y",)
    np.testing.assert_allclose(across.forces(at, across.start(at)), static, rtol=1e-9)


@pytest.mark.parametrize("load", [4000.0, 30.0])
def test_mf_tyre_lags_over_its_own_lengths_but_not_less_than_25_mm_of_a_wheel_of_320_mm(load):
    tyre = tyres.typical_mf_tyre(4000.0)
    at = contact_at("rolls", load=load)
    own = tyre.outputs(at)
    lengths = [max(float(own.sigma_x), 0.025), max(float(own.sigma_y), 0.025)]
    assert (min(lengths) == 0.025) == (load < 100.0)
    found = tyres.Relaxed(tyre).start(at)
    np.testing.assert_allclose(found, [lengths[0] * -0.05, lengths[1] * 0.08], rtol=1e-12)


BRISTLES = {
    "stiffness_x": 180.0, "stiffness_y": 150.0, "static_friction": 1.1, "kinetic_friction": 0.8, "stribeck_speed": 5.0,
    "contact_length": 0.18, "damping_x": 0.6, "damping_y": 0.4, "viscous": 0.002, "exponent": 0.5,
}  # fmt: skip


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("name", POINTS)
def test_bristles_bend_as_the_lugre_equations_say(name, backwards):
    """dz_i/dt = v_ri - (c_i + kappa_i |omega r|) z_i, F_i = F_z (sigma_0i z_i + sigma_1i dz_i/dt + sigma_2 v_ri)."""
    lateral, ratio, load, speed, slip_speed, friction = POINTS[name]
    tyre = tyres.LuGre(**BRISTLES)
    at = contact_at(name, direction=-1.0 if backwards else 1.0)
    state = tyre.start(at)._replace(z_x=jnp.asarray(0.002), z_y=jnp.asarray(-0.001))
    rates, forces = tyre.derivatives(at, state), tyre.forces(at, state)
    v_r = slip_speed * np.array([ratio, lateral])
    rolls = abs((-speed if backwards else speed) + v_r[0])
    g = friction * (0.8 + 0.3 * np.exp(-((np.hypot(*v_r) / 5.0) ** 0.5)))
    for k, z in enumerate((0.002, -0.001)):
        sigma_0, sigma_1 = (180.0, 150.0)[k], (0.6, 0.4)[k]
        c = sigma_0 * np.hypot(*v_r) / g
        p = c * 0.18 / max(rolls, 1e-3 * slip_speed)
        gone = -np.expm1(-p)
        kappa = gone / (0.18 * (1 - gone / p))
        rate = v_r[k] - (c + kappa * rolls) * z
        np.testing.assert_allclose(rates[k], rate, rtol=1e-9)
        np.testing.assert_allclose(forces[k], load * (sigma_0 * z + sigma_1 * rate + 0.002 * v_r[k]), rtol=1e-9)
        # At the start nothing changes.
        np.testing.assert_allclose(tyre.start(at)[k], v_r[k] / (c + kappa * rolls), rtol=1e-9)


@pytest.mark.parametrize("p", [1e-12, 1e-3, 0.5, 0.999, 1.001, 8.0])
def test_bristles_that_are_replaced_count_twice_at_first_and_once_in_the_end(p):
    """(1 - e^-p) / (1 - (1 - e^-p) / p), in digits that its series keep where it is 0 / 0."""
    from jaxveh.tyres.lugre import _inflow

    gone = -np.expm1(-p)
    expected = 2.0 - p / 3.0 if p < 1e-2 else gone / (1 - gone / p)
    np.testing.assert_allclose(_inflow(jnp.asarray(p)), expected, rtol=1e-7 if p == 1e-3 else 1e-12)


def test_slips_of_a_contact_are_their_definitions():
    at = contact_at("slides")
    np.testing.assert_allclose(practical(at), (0.4, -0.3), rtol=1e-12)
    np.testing.assert_allclose(theoretical(at), (0.4 / 1.4, -0.3 / 1.4), rtol=1e-12)
    told = at._replace(lateral_slip=None, slip_angle=jnp.asarray(0.2))
    np.testing.assert_allclose(practical(told), (0.4, np.tan(0.2)), rtol=1e-12)
    # A locked wheel rolls with a thousandth of its speed.
    locked = told._replace(slip_ratio=jnp.asarray(-1.0))
    np.testing.assert_allclose(theoretical(locked), (-1000.0, 1000.0 * np.tan(0.2)), rtol=1e-12)
    np.testing.assert_allclose(length(3.0, 4.0), 5.0, rtol=1e-10)
    np.testing.assert_allclose(length(0.0, 0.0), 1e-5, rtol=1e-12)
    curve = lambda s: 2.0 + 3.0 * s + 0.5 * s**2
    np.testing.assert_allclose(share(curve, jnp.asarray(0.6), jnp.asarray(1.0)), 0.6 * 3.5, rtol=1e-12)
    np.testing.assert_allclose(share(curve, jnp.asarray(-0.6), jnp.asarray(1.0)), 0.6 * -2.5, rtol=1e-12)

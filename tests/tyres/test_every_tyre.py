"""What holds for every tyre of combined slip, each in turn."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shared_data import shared

from jaxveh import statespace, tyres
from jaxveh._core.errors import InputError
from jaxveh.tyres import Contact

LOAD = 4000.0


def mf_tyre():
    return tyres.from_property_file(shared("tyres") / "mfeval__PacejkaBook_Defaults.tir")


TYRES = {
    "Brush": lambda: tyres.Brush(80000.0, 60000.0, 0.9),
    "Dugoff": lambda: tyres.Dugoff(80000.0, 60000.0, 0.9),
    "Dugoff, fading": lambda: tyres.Dugoff(80000.0, 60000.0, 0.9, 0.01),
    "Fiala": lambda: tyres.Fiala(80000.0, 60000.0, 0.9),
    "MF-Tyre": mf_tyre,
    "MF-Tyre, mirrored": lambda: tyres.Mirrored(mf_tyre()),
}
SYMMETRIC = [name for name in TYRES if not name.startswith("MF-Tyre")]


@pytest.fixture(params=TYRES)
def tyre(request):
    return TYRES[request.param]()


def contact(slip_angle=0.0, slip_ratio=0.0, load=LOAD, dtype=jnp.float64):
    number = lambda value: jnp.asarray(value, dtype)
    return Contact(number(slip_angle), number(slip_ratio), number(load), number(0.0), number(1.0), number(20.0))


@jax.jit
def vector(tyre, at):
    forces = tyre.forces(at)
    return jnp.stack([jnp.asarray(value, at.load.dtype) for value in forces])


@jax.jit
def forward(tyre, at):
    """The forces' change when every coefficient and every input changes by one."""
    ones = jax.tree.map(jnp.ones_like, (tyre, at))
    return jax.jvp(vector, (tyre, at), ones)[1]


backward = jax.jit(jax.grad(lambda tyre, at: jnp.sum(vector(tyre, at)), argnums=(0, 1)))
slopes = jax.jit(jax.jacfwd(lambda x, tyre: vector(tyre, contact(*x))))


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
@pytest.mark.parametrize("point", [(0.0, 0.0), (0.1, 0.0), (0.0, 0.1), (0.0, -1.0), (0.2, -1.0), (1.2, 2.0)])
@pytest.mark.parametrize("load", [LOAD, 0.0, -100.0])
def test_values_and_gradients_are_finite(tyre, point, load, dtype):
    tyre = statespace.cast(tyre, dtype)
    at = contact(*point, load, dtype)
    value = vector(tyre, at)
    assert value.dtype == dtype and np.isfinite(value).all()
    assert np.isfinite(forward(tyre, at)).all()
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(backward(tyre, at)))


def test_forces_vanish_with_the_load(tyre):
    assert np.all(np.abs(vector(tyre, contact(0.2, 0.1, 0.0))[:2]) == 0.0)
    small, whole = vector(tyre, contact(0.2, 0.1, 1.0)), vector(tyre, contact(0.2, 0.1))
    assert np.hypot(*small[:2]) < 1e-3 * np.hypot(*whole[:2])


def test_signs_are_those_of_the_package(tyre):
    assert tyre.forces(contact(0.03)).F_y > 0 > tyre.forces(contact(-0.03)).F_y
    assert tyre.forces(contact(0.0, 0.03)).F_x > 0 > tyre.forces(contact(0.0, -0.03)).F_x
    # The trail turns the wheel towards its course.
    assert float(tyre.forces(contact(0.03)).M_z) <= 0


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(-1.2, 1.2), st.floats(-1.0, 1.0), st.floats(0.0, 9000.0), st.sampled_from(SYMMETRIC))
def test_friction_bounds_the_force_and_a_mirror_turns_it(angle, ratio, load, name):
    tyre = TYRES[name]()
    F_x, F_y, _, _, M_z = vector(tyre, contact(angle, ratio, load))
    room = np.sqrt(1.0 + 0.01) if name == "Fiala" else 1.0  # what Fiala leaves sideways at full braking
    assert np.hypot(F_x, F_y) <= 0.9 * load * room * (1 + 1e-12)
    mirrored = vector(tyre, contact(-angle, ratio, load))
    np.testing.assert_allclose(mirrored, [F_x, -F_y, 0, 0, -M_z], atol=1e-9)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(500.0, 9000.0), st.sampled_from(sorted(TYRES)))
def test_gradients_equal_differences(angle, ratio, load, name):
    tyre = TYRES[name]()
    x, steps, scale = np.array([angle, ratio, load]), np.array([1e-7, 1e-7, 1e-3]), np.array([1e5, 1e5, 1.0])
    here = vector(tyre, contact(*x))
    ahead = np.stack([vector(tyre, contact(*(x + h))) for h in np.diag(steps)], axis=1)
    behind = np.stack([vector(tyre, contact(*(x - h))) for h in np.diag(steps)], axis=1)
    sides = [(ahead - here[:, None]) / steps, (here[:, None] - behind) / steps, (ahead - behind) / (2 * steps)]
    exact = slopes(jnp.asarray(x), tyre)
    # At a kink (the limit of friction) the derivative is that of one side.
    error = np.min([np.abs(exact - side) / scale for side in sides], axis=0)
    assert np.max(error) < 2e-5


@pytest.mark.parametrize("name", ["Brush", "Dugoff", "Fiala"])
def test_stiffnesses_are_the_slopes_at_zero(name):
    tyre = TYRES[name]()
    np.testing.assert_allclose(tyres.cornering_stiffness(tyre, contact()), 60000.0)
    slope = jax.grad(lambda k: tyre.forces(contact()._replace(slip_ratio=k)).F_x)(jnp.asarray(0.0))
    np.testing.assert_allclose(slope, 80000.0)


def test_fiala_without_longitudinal_force_is_the_brush():
    brush, fiala = TYRES["Brush"](), TYRES["Fiala"]()
    for angle in (0.01, 0.1, 0.17, 0.3):
        np.testing.assert_allclose(vector(fiala, contact(angle)), vector(brush, contact(angle)), rtol=1e-12)


@pytest.mark.parametrize("name", ["Brush", "Dugoff", "Fiala"])
def test_bad_parameters_are_named(name):
    kind = getattr(tyres, name)
    with pytest.raises(InputError, match=f"{name}.cornering_stiffness = -1"):
        kind(80000.0, -1.0)
    with pytest.raises(InputError, match="contact.load = None"):
        kind(80000.0, 60000.0).forces(Contact(slip_angle=0.1))


def test_fading_lowers_the_friction_and_needs_a_speed():
    steady, fading = TYRES["Dugoff"](), TYRES["Dugoff, fading"]()
    # 20 m/s times tan(0.5) of sliding, a hundredth a m/s.
    share = fading.forces(contact(0.5)).F_y / steady.forces(contact(0.5)).F_y
    assert 1 - 0.01 * 20 * np.tan(0.5) < share < 0.92
    with pytest.raises(InputError, match="contact.speed = None"):
        fading.forces(Contact(slip_angle=0.1, load=LOAD))

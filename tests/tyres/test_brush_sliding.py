"""Where sliding bristles of the brush tyre go, against bristles one by one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import tyres
from jaxveh._core.errors import InputError
from jaxveh.tyres import Contact

LOAD, MU, A = 4000.0, 0.9, 0.06
POINTS = [(0.02, 0.01), (0.05, -0.03), (-0.08, 0.05), (0.1, -0.1), (-0.4, 0.3)]


def brush(along, across, slides):
    return tyres.Brush(along, across, MU, A, slides=slides)


@jax.jit
def forces(tyre, slip_angle, slip_ratio):
    found = tyre.forces(Contact(slip_angle=slip_angle, slip_ratio=slip_ratio, load=jnp.asarray(LOAD)))
    return jnp.stack([found.F_x, found.F_y, found.M_z])


def bristles(along, across, slides, slip_angle, slip_ratio, count=20000):
    """F_x, F_y and M_z of bristles that are carried from the contact's front edge to its rear, each with its pressure."""
    sigma = np.array([slip_ratio, np.tan(slip_angle)]) / (1 + slip_ratio)
    way = (np.arange(count) + 0.5) / count * 2 * A
    pressure = 3 * LOAD / (4 * A**3) * way * (2 * A - way)
    # A bristle's stiffness over the contact's length is that of the tyre at small slip.
    held = np.array([along, across]) / (2 * A**2) * sigma
    sliding = np.cumsum(np.linalg.norm(held) * way > MU * pressure) > 0
    direction = sigma if slides == "against velocity" else held
    friction = MU * pressure[:, None] * direction / np.linalg.norm(direction)
    each = np.where(sliding[:, None], friction, held * way[:, None]) * 2 * A / count
    return np.array([*each.sum(axis=0), ((A - way) * each[:, 1]).sum()])


@pytest.mark.parametrize("slides", ["along deflection", "against velocity"])
@pytest.mark.parametrize("stiffnesses", [(80e3, 60e3), (50e3, 120e3)])
def test_forces_and_moment_are_those_of_the_bristles(stiffnesses, slides):
    for point in POINTS:
        found = forces(brush(*stiffnesses, slides), *map(jnp.asarray, point))
        expected = bristles(*stiffnesses, slides, *point)
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("point", POINTS)
def test_both_are_one_where_the_stiffnesses_are(point):
    deflection, velocity = (forces(brush(7e4, 7e4, slides), *map(jnp.asarray, point)) for slides in tyres.brush.SLIDES)
    np.testing.assert_allclose(velocity, deflection, rtol=1e-9, atol=1e-9)


def test_full_sliding_is_coulombs_law_against_the_velocity():
    F_x, F_y, M_z = forces(brush(80e3, 40e3, "against velocity"), jnp.asarray(0.5), jnp.asarray(-0.4))
    sigma = np.array([-0.4, np.tan(0.5)])
    np.testing.assert_allclose([F_x, F_y], MU * LOAD * sigma / np.linalg.norm(sigma), rtol=1e-12)
    assert float(M_z) == 0.0


def test_how_far_the_forms_are_apart():
    """What the docstring says: 11 % of mu F_z in each direction at a ratio of 4/3, 26 % at 2."""
    angle, ratio = jnp.meshgrid(jnp.linspace(-0.6, 0.6, 121), jnp.linspace(-0.6, 0.6, 121))
    for share, apart in ((4 / 3, 0.11), (2.0, 0.26)):
        deflection, velocity = (forces(brush(6e4 * share, 6e4, slides), angle, ratio) for slides in tyres.brush.SLIDES)
        most = np.abs(np.asarray(deflection - velocity))[:2].max(axis=(1, 2)) / (MU * LOAD)
        np.testing.assert_allclose(most, apart, atol=0.005)


def test_an_unknown_way_of_sliding_is_named():
    with pytest.raises(InputError, match=r"Brush\.slides = 'sideways': must be one of 'along deflection'"):
        brush(8e4, 6e4, "sideways")

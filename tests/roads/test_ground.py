"""The ground under a car: each wheel's friction, slopes that turn with the car."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import roads

WHEELS = ((1.2, 0.8), (1.2, -0.8), (-1.5, 0.8), (-1.5, -0.8))
SLOPED = roads.Profile([0.0, 1.0], grade=0.1, bank=0.04)


def friction(ground):
    return np.array(ground[:4])


def test_split_mu_is_felt_by_each_side():
    road = roads.SplitMu(1.0, 0.3)
    np.testing.assert_allclose(friction(roads.under(road, 5.0, 0.0, 0.0, WHEELS)), [1.0, 0.3, 1.0, 0.3])
    np.testing.assert_allclose(friction(roads.under(road, 5.0, 2.0, 0.0, WHEELS)), 1.0)
    # Backwards, the car's left wheels stand on the right.
    np.testing.assert_allclose(friction(roads.under(road, 5.0, 0.0, np.pi, WHEELS)), [0.3, 1.0, 0.3, 1.0])
    # Across, to the left, the front axle stands on the left.
    np.testing.assert_allclose(friction(roads.under(road, 5.0, 0.0, np.pi / 2, WHEELS)), [1.0, 1.0, 0.3, 0.3])


def test_a_jump_is_felt_by_the_front_axle_first():
    road = roads.MuJump(1.0, 0.4, 10.0, 0.2)
    np.testing.assert_allclose(friction(roads.under(road, 10.0, 0.0, 0.0, WHEELS)), [0.4, 0.4, 1.0, 1.0])


@pytest.mark.parametrize(
    ("yaw", "grade", "bank"),
    [(0.0, 0.1, 0.04), (np.pi, -0.1, -0.04), (np.pi / 2, 0.04, -0.1), (-np.pi / 2, -0.04, 0.1), (2 * np.pi, 0.1, 0.04)],
)
def test_slopes_turn_with_the_car(yaw, grade, bank):
    """Backwards (pi) what was uphill is downhill and the higher side is the other one."""
    ground = roads.under(SLOPED, 3.0, 0.0, yaw, WHEELS)
    np.testing.assert_allclose([ground.grade, ground.bank], [grade, bank], atol=1e-15)


def test_the_steepest_slope_is_the_same_from_every_side():
    yaw = np.linspace(-7.0, 7.0, 57)
    ground = roads.under(SLOPED, np.zeros(57), np.zeros(57), yaw, WHEELS)
    steepest = np.hypot(np.tan(0.1), np.tan(0.04))
    np.testing.assert_allclose(np.hypot(np.tan(ground.grade), np.tan(ground.bank)), steepest, rtol=1e-13)
    facing = np.arctan2(np.tan(0.04), np.tan(0.1))
    uphill = roads.under(SLOPED, 0.0, 0.0, facing, WHEELS)
    np.testing.assert_allclose([np.tan(uphill.grade), uphill.bank], [steepest, 0.0], atol=1e-15)


def test_level_ground_is_the_default():
    assert roads.under(roads.Level(), 1.0, 2.0, 3.0, WHEELS) == roads.LEVEL


def test_jit_vmap_gradient_and_precision():
    road = roads.Combined(roads.SplitMu(1.0, 0.3, 1.0), roads.Hill(3.0))
    x, y, yaw = np.linspace(0.0, 90.0, 7), np.linspace(-1.0, 1.0, 7), np.linspace(0.0, 6.0, 7)
    ground = lambda x, y, yaw: jnp.stack(roads.under(road, x, y, yaw, WHEELS))
    together, mapped = jax.jit(lambda *at: (ground(*at), jax.vmap(ground, out_axes=1)(*at)))(x, y, yaw)
    np.testing.assert_allclose(mapped, together, rtol=1e-12, atol=1e-14)
    each = [ground(*at) for at in zip(x.tolist(), y.tolist(), yaw.tolist(), strict=True)]
    np.testing.assert_allclose(np.stack(each, axis=1), together, rtol=1e-12, atol=1e-14)
    slope = jax.jit(jax.jacfwd(ground, argnums=2))(30.0, 0.1, 0.3)
    up, down = (np.asarray(ground(30.0, 0.1, 0.3 + step)) for step in (1e-6, -1e-6))
    np.testing.assert_allclose(slope, (up - down) / 2e-6, atol=1e-8)
    single = [value.astype(np.float32) for value in (x, y, yaw)]
    small = jax.tree.map(lambda leaf: np.float32(leaf), road)
    found = jax.jit(lambda road, *at: roads.under(road, *at, WHEELS))(small, *single)
    assert {leaf.dtype for leaf in found} == {jnp.dtype(jnp.float32)}

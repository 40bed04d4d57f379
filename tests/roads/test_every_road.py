"""What holds for every road, each in turn: a new one is a line in `ROADS` that says what varies."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from families import left_out

from jaxveh import roads, statespace

pytestmark = pytest.mark.product

KEY = jax.random.key(4)


class Line(NamedTuple):
    """A road, whether anything varies with s and y, and how many derivatives of it are continuous."""

    make: Callable[[], roads.AbstractRoad]
    along: bool = False
    across: bool = False
    smooth: int = 1


def profile(interpolation):
    return roads.Profile([0.0, 40.0, 90.0], [1.0, 0.3, 0.6], [0.0, 0.08, -0.02], 0.02, interpolation=interpolation)


ROADS = {
    "Banked": Line(lambda: roads.Banked(0.1, 10.0, 40.0), along=True, smooth=2),
    "Combined": Line(lambda: roads.Combined(roads.SplitMu(1.0, 0.3), roads.Hill(3.0)), along=True, across=True),
    "Hill": Line(lambda: roads.Hill(3.0, 10.0, 40.0, 10.0, 30.0), along=True),
    "Level": Line(lambda: roads.Level(0.8), smooth=2),
    "MuJump": Line(lambda: roads.MuJump(1.0, 0.3, 40.0, 5.0), along=True, smooth=2),
    "Profile": Line(lambda: profile("smooth"), along=True),
    "Profile, linear": Line(lambda: profile("linear"), along=True, smooth=0),
    "RandomRoad": Line(
        lambda: roads.RandomRoad(
            roads.gauss_markov(0.03, 100.0, KEY), roads.band(0.02, 200.0, 50.0, KEY), roads.gauss_markov(0.2, 50.0, KEY)
        ),
        along=True,
        smooth=2,
    ),
    "SplitMu": Line(lambda: roads.SplitMu(1.0, 0.3, 0.4), across=True, smooth=2),
    **{f"named {name}": Line(entry.make, along=None, across=None) for name, entry in roads.ROADS.items()},
}  # fmt: skip


def test_every_road_of_the_package_is_here():
    assert not left_out("roads", roads.AbstractRoad, [line.make() for line in ROADS.values()], {})


@pytest.fixture(params=ROADS)
def line(request):
    return ROADS[request.param]


@pytest.fixture
def road(line):
    return line.make()


def stacked(road, s, y):
    return jnp.stack(road.at(s, y))


S, Y = np.linspace(-20.3, 149.7, 86), np.linspace(-2.0, 2.0, 86)


def test_values_are_those_of_a_road(road):
    surface = road.at(S, Y)
    assert all(np.shape(leaf) == (86,) and np.isfinite(leaf).all() for leaf in surface)
    assert (surface.friction > 0).all()
    assert (np.abs(surface.grade) < np.pi / 2).all() and (np.abs(surface.bank) < np.pi / 2).all()


@pytest.mark.parametrize("name", [name for name, line in ROADS.items() if line.along is not None])
def test_what_varies_is_as_stated(name):
    line = ROADS[name]
    road = line.make()
    along, across = np.ptp(stacked(road, S, 0.0), axis=1), np.ptp(stacked(road, 0.0, Y), axis=1)
    assert np.any(along > 1e-3) == line.along and np.any(across > 1e-3) == line.across


def test_scalars_arrays_jit_and_vmap_agree(road):
    whole = stacked(road, S, Y)
    np.testing.assert_allclose(jax.jit(stacked)(road, S, Y), whole, rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(jax.vmap(road.at)(jnp.asarray(S), jnp.asarray(Y)), whole, rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(
        stacked(road, 30.0, 0.5), stacked(road, np.array([30.0]), np.array([0.5]))[:, 0], rtol=1e-12
    )
    assert stacked(road, S[:, None], Y[:3]).shape == (3, 86, 3)


def test_roads_in_a_batch(road):
    arrays, rest = eqx.partition(road, eqx.is_array)
    batch = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), arrays)
    both = jax.vmap(lambda arrays: stacked(eqx.combine(arrays, rest), S, Y))(batch)
    np.testing.assert_allclose(both[1], stacked(road, S, Y), rtol=1e-11, atol=1e-13)


def test_derivatives_are_finite_and_continuous_as_stated(line, road):
    for direction in (0, 1):

        def value(r, direction=direction):
            return stacked(road, *((r, 0.05) if direction == 0 else (35.0, r)))

        for order in range(line.smooth + 1):
            if order:
                value = jax.jacfwd(value)
            ends = (-20.0, 150.0) if direction == 0 else (-2.0, 2.0)
            jumps = [
                np.max(np.abs(np.diff(jax.jit(jax.vmap(value))(jnp.linspace(*ends, n)), axis=0))) for n in (2001, 8001)
            ]
            assert np.isfinite(jumps).all()
            assert jumps[1] <= 0.35 * jumps[0] + 1e-12


def test_parameters_have_the_gradients_of_differences(road):
    leaves, rest = eqx.partition(road, eqx.is_inexact_array)
    leaves, treedef = jax.tree.flatten(leaves)
    weights = jnp.array([1.0, 10.0, 7.0])

    def total(leaves):
        return jnp.sum(weights @ stacked(eqx.combine(jax.tree.unflatten(treedef, leaves), rest), S, Y))

    for number, gradient in enumerate(jax.grad(total)(leaves)):
        up, down = ([v + (i == number) * step for i, v in enumerate(leaves)] for step in (1e-6, -1e-6))
        np.testing.assert_allclose(jnp.sum(gradient), (total(up) - total(down)) / 2e-6, rtol=1e-5, atol=1e-6)


def test_precision_stays(road):
    single = statespace.cast(road, jnp.float32)
    surface = single.at(jnp.asarray(S, jnp.float32), jnp.asarray(Y, jnp.float32))
    assert {leaf.dtype for leaf in surface} == {jnp.dtype(jnp.float32)}
    np.testing.assert_allclose(jnp.stack(surface), stacked(road, S, Y), atol=3e-5)

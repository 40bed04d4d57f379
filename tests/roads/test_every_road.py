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
    "Rough": Line(lambda: roads.rough("D", KEY, shortest=5.0, count=20), along=True, across=True, smooth=2),
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


@eqx.filter_jit
def seen(road, s, y):
    """`stacked`, compiled as one: operation by operation each takes a program of its own."""
    return stacked(road, s, y)


S, Y = np.linspace(-20.3, 149.7, 86), np.linspace(-2.0, 2.0, 86)


def test_values_are_those_of_a_road(road):
    surface = roads.Surface(*np.asarray(seen(road, S, Y)))
    assert all(np.shape(leaf) == (86,) and np.isfinite(leaf).all() for leaf in surface)
    assert (surface.friction > 0).all()
    assert (np.abs(surface.grade) < np.pi / 2).all() and (np.abs(surface.bank) < np.pi / 2).all()


@pytest.mark.parametrize("name", [name for name, line in ROADS.items() if line.along is not None])
def test_what_varies_is_as_stated(name):
    line = ROADS[name]
    road = line.make()
    along, across = np.ptp(seen(road, S, 0 * S), axis=1), np.ptp(seen(road, 0 * Y, Y), axis=1)
    assert np.any(along > 1e-3) == line.along and np.any(across > 1e-3) == line.across


def test_scalars_arrays_jit_and_vmap_agree(road):
    whole = stacked(road, S, Y)
    np.testing.assert_allclose(seen(road, S, Y), whole, rtol=1e-11, atol=1e-13)
    mapped = jax.jit(lambda road, s, y: jax.vmap(road.at)(s, y))(road, S, Y)
    np.testing.assert_allclose(mapped, whole, rtol=1e-11, atol=1e-13)
    # As many as above, so that no operation is compiled anew.
    same = np.asarray(stacked(road, np.full(86, 30.0), np.full(86, 0.5)))
    np.testing.assert_allclose(np.broadcast_to(stacked(road, 30.0, 0.5), (86, 4)).T, same, rtol=1e-12)
    assert jax.eval_shape(stacked, road, S[:, None], Y[:3]).shape == (4, 86, 3)


def test_roads_in_a_batch(road):
    arrays, rest = eqx.partition(road, eqx.is_array)
    batch = jax.tree.map(lambda leaf: np.stack([leaf, leaf]), arrays)
    both = jax.jit(jax.vmap(lambda arrays: stacked(eqx.combine(arrays, rest), S, Y)))(batch)
    np.testing.assert_allclose(np.asarray(both)[1], seen(road, S, Y), rtol=1e-11, atol=1e-13)


def test_derivatives_are_finite_and_continuous_as_stated(line, road):
    along, across = (lambda s: stacked(road, s, 0.05)), (lambda y: stacked(road, 35.0, y))

    def derivatives(value, r):
        """Values and as many derivatives as are continuous."""
        found = []
        for _ in range(line.smooth + 1):
            found.append(jax.vmap(value)(r))
            value = jax.jacfwd(value)
        return found

    # All of them by one program, and the coarse steps are every fourth of the fine ones.
    everything = jax.jit(lambda s, y: derivatives(along, s) + derivatives(across, y))
    for values in everything(np.linspace(-20.0, 150.0, 8001), np.linspace(-2.0, 2.0, 8001)):
        jumps = [np.max(np.abs(np.diff(np.asarray(values)[::stride], axis=0))) for stride in (4, 1)]
        assert np.isfinite(jumps).all()
        assert jumps[1] <= 0.35 * jumps[0] + 1e-12


def test_parameters_have_the_gradients_of_differences(road):
    leaves, rest = eqx.partition(road, eqx.is_inexact_array)
    leaves, treedef = jax.tree.flatten(leaves)
    weights = np.array([1.0, 10.0, 7.0, 20.0])

    # Values and gradients by one program.
    @jax.jit
    @jax.value_and_grad
    def total(leaves):
        return jnp.sum(weights @ stacked(eqx.combine(jax.tree.unflatten(treedef, leaves), rest), S, Y))

    for number, gradient in enumerate(total(leaves)[1]):
        up, down = ([v + (i == number) * step for i, v in enumerate(leaves)] for step in (1e-6, -1e-6))
        np.testing.assert_allclose(np.sum(gradient), (total(up)[0] - total(down)[0]) / 2e-6, rtol=1e-5, atol=1e-6)


def test_precision_stays(road):
    single = statespace.cast(road, jnp.float32)
    surface = eqx.filter_jit(lambda road, s, y: road.at(s, y))(single, np.float32(S), np.float32(Y))
    assert {leaf.dtype for leaf in surface} == {jnp.dtype(jnp.float32)}
    np.testing.assert_allclose(np.stack(surface), seen(road, S, Y), atol=3e-5)

"""Equal steps of a diffrax solver: against a closed form, against diffeqsolve, in batches, in gradients."""

import functools
import sys
from typing import NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import simulation, statespace
from jaxveh._core.errors import InputError

pytestmark = pytest.mark.product


class Spring(NamedTuple):
    place: object
    speed: object


def rates(t, x, stiffness):
    return Spring(x.speed, -stiffness * x.place + 0.0 * t)


START = Spring(jnp.asarray(1.0), jnp.asarray(0.0))


@pytest.mark.parametrize("solver", [None, statespace.RolledRK4(), statespace.Heun(), diffrax.Tsit5()])
def test_an_oscillator_swings(solver):
    x = simulation.fixed_steps(rates, START, 4.0, rows=20, step=1e-3, steps_a_row=50, solver=solver)
    t = 0.05 * np.arange(21)
    assert x.place.shape == (21,)
    np.testing.assert_allclose(x.place, np.cos(2 * t), atol=2e-6)
    np.testing.assert_allclose(x.speed, -2 * np.sin(2 * t), atol=4e-6)


def test_time_reaches_the_rates():
    x = simulation.fixed_steps(
        lambda t, x, args: 3 * t**2, jnp.asarray(8.0), rows=4, step=0.25, steps_a_row=2, start=2.0
    )
    np.testing.assert_allclose(x, (2 + 0.5 * np.arange(5)) ** 3, rtol=1e-14)


def test_it_is_diffeqsolve():
    expected = jax.jit(lambda start: diffrax.diffeqsolve(
        diffrax.ODETerm(rates), statespace.RK4(), 0.0, 1.0, None, start, 4.0,
        saveat=diffrax.SaveAt(t0=True, steps=True), max_steps=10,
        stepsize_controller=diffrax.StepTo(ts=jnp.asarray(np.linspace(0.0, 1.0, 11))),
    ).ys)(START)  # fmt: skip
    x = simulation.fixed_steps(rates, START, 4.0, rows=10, step=0.1)
    np.testing.assert_allclose(x.place, np.asarray(expected.place)[:11], rtol=1e-12, atol=1e-14)


def test_a_batch_is_its_runs():
    stiffness = jnp.asarray(np.array([1.0, 4.0, 9.0]))
    wide = jax.tree.map(lambda leaf: jnp.asarray(np.full(3, leaf)), START)
    whole = simulation.fixed_steps(rates, wide, stiffness, rows=3, step=0.01, steps_a_row=4)
    mapped = jax.vmap(lambda k: simulation.fixed_steps(rates, START, k, rows=3, step=0.01, steps_a_row=4), out_axes=1)
    np.testing.assert_allclose(whole.place, jax.jit(mapped)(stiffness).place, rtol=1e-14)


@pytest.mark.parametrize("barriers", [True, False])
@pytest.mark.parametrize("runs", [5, 6, 7])  # the last block of 3 has two runs, three, one
def test_blocks_are_the_whole_batch(runs, barriers, monkeypatch):
    # The module; its name in the package is the function's.
    monkeypatch.setattr(sys.modules[simulation.fixed_steps.__module__], "barriers_hold", lambda: barriers)
    shapes = []

    def seen(t, x, args):
        stiffness, scale = args
        shapes.append(x.place.shape)
        return rates(t, x, stiffness * scale)

    stiffness, scale = np.linspace(1.0, 9.0, runs), jnp.asarray(1.1)
    start = Spring(jnp.asarray(np.linspace(-1.0, 1.0, runs)), jnp.asarray(np.zeros(runs)))

    # The states, and the slopes of a number of them, by one program.
    @functools.partial(jax.jit, static_argnums=1)
    def run(stiffness, block):
        def size(stiffness):
            given = dict(rows=3, step=0.01, steps_a_row=4, block=block)
            x = simulation.fixed_steps(seen, start, (stiffness, scale), **given)
            return jnp.sum(x.speed[-1] ** 2), x

        (_, x), slope = jax.value_and_grad(size, has_aux=True)(stiffness)
        return x, slope

    whole, slope = run(stiffness, None)
    shapes.clear()
    cut, slope_cut = run(stiffness, 3)
    assert set(shapes) == {(3,) if barriers else (runs,)}
    assert cut.place.shape == (4, runs)
    for a, b in zip(cut, whole, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(slope_cut, slope, rtol=1e-12)


def test_blocks_as_long_as_the_batch_and_of_one_run_change_nothing():
    for start in (START, jax.tree.map(lambda leaf: leaf[None], START)):
        expected, x = (simulation.fixed_steps(rates, start, 4.0, rows=2, step=0.01, block=b) for b in (None, 1))
        np.testing.assert_array_equal(x.place, expected.place)


def test_blocks_need_one_number_a_run():
    for wrong in (Spring(jnp.ones((2, 3)), jnp.ones((2, 3))), Spring(jnp.ones(3), jnp.ones(()))):
        with pytest.raises(InputError, match="x0: shapes"):
            simulation.fixed_steps(rates, wrong, 4.0, rows=2, step=0.1, block=2)


@pytest.mark.parametrize("solver", [statespace.RK4(), statespace.RolledRK4(), diffrax.Tsit5()])
def test_gradients_are_those_of_the_closed_form(solver):
    place = lambda k: simulation.fixed_steps(rates, START, k, rows=5, step=0.01, steps_a_row=20, solver=solver).place[
        -1
    ]
    expected = -np.sin(2.0) / 4  # d cos(sqrt(k) t) / dk at t = 1, k = 4
    reverse, forward = jax.jit(lambda k: (jax.grad(place)(k), jax.jacfwd(place)(k)))(4.0)
    np.testing.assert_allclose(reverse, expected, rtol=1e-7)
    np.testing.assert_allclose(forward, expected, rtol=1e-7)


def test_single_precision_stays_single():
    start = jax.tree.map(lambda leaf: leaf.astype(jnp.float32), START)
    x = simulation.fixed_steps(rates, start, jnp.float32(4.0), rows=3, step=0.01)
    assert x.place.dtype == x.speed.dtype == jnp.float32


@pytest.mark.parametrize("wrong", [{"rows": 0}, {"step": 0.0}, {"step": -1.0}, {"steps_a_row": 0}, {"block": 0}])
def test_wrong_numbers_are_named(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        simulation.fixed_steps(rates, START, 4.0, **{"rows": 2, "step": 0.1, **wrong})

"""What holds for every manoeuvre without eyes, each in turn: a new one is a line in `MANOEUVRES` that says what it does."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import Recording, manoeuvres
from jaxveh.manoeuvres import AbstractManoeuvre
from jaxveh.statespace import cast

pytestmark = pytest.mark.product

KEY = jax.random.key(3)


class Line(NamedTuple):
    """A manoeuvre of 25 m/s and 0.12 rad, and what it does.

    `steady`: the speed is held. `peak`: the greatest steer over 0.12 (None: random). `pedals`: there are torques.
    `smooth`: how many derivatives are continuous.
    """

    make: Callable[[], AbstractManoeuvre]
    steady: bool = True
    peak: float | None = 1.0
    pedals: bool = False
    smooth: int = 2


def recorded():
    time = np.linspace(0.0, 4.0, 41)
    return Recording(time, {"steer": 0.12 * np.sin(np.pi / 2 * time), "v_x": np.full(41, 25.0)})


MANOEUVRES = {
    "braking in a turn": Line(lambda: manoeuvres.braking_in_a_turn(25.0, 0.12), steady=False, pedals=True),
    "cruise": Line(lambda: manoeuvres.cruise(25.0, KEY, duration=30.0), steady=False, peak=0.0, pedals=True),
    "double lane change": Line(lambda: manoeuvres.double_lane_change(25.0, 0.12)),
    "mu jump braking": Line(lambda: manoeuvres.mu_jump_braking(25.0), steady=False, peak=0.0, pedals=True),
    "ramp steer": Line(lambda: manoeuvres.ramp_steer(25.0, 0.12)),
    "random steering": Line(lambda: manoeuvres.random_steering(25.0, 0.12, KEY), peak=None),
    "replay": Line(lambda: manoeuvres.replay(recorded()), smooth=0),
    "sine with dwell": Line(lambda: manoeuvres.sine_with_dwell(25.0, 0.12)),
    "slalom": Line(lambda: manoeuvres.slalom(25.0, 0.12)),
    "step steer": Line(lambda: manoeuvres.step_steer(25.0, 0.12)),
    "swept sine": Line(lambda: manoeuvres.swept_sine(25.0, 0.12, 0.2, 2.0, 20.0)),
}


@pytest.fixture(params=MANOEUVRES)
def line(request):
    return MANOEUVRES[request.param]


@pytest.fixture
def manoeuvre(line):
    return line.make()


@eqx.filter_jit
def inputs(manoeuvre, t):
    """Compiled as one: operation by operation each takes a program of its own."""
    return manoeuvre.inputs(t)


def stacked(manoeuvre, t):
    return jnp.stack(manoeuvre.inputs(t))


def times(manoeuvre, count):
    return np.linspace(0.0, manoeuvre.duration, count)


def test_it_starts_straight_at_its_speed_and_keeps_its_amplitude(line, manoeuvre):
    u = inputs(manoeuvre, times(manoeuvre, 4001))
    assert abs(u.steer[0]) < 1e-15
    if line.peak is not None:
        np.testing.assert_allclose(np.max(np.abs(u.steer)), 0.12 * line.peak, rtol=0.01)
        assert np.max(np.abs(u.steer)) <= 0.12 * line.peak * (1 + 1e-12)
    assert (u.v_x >= 0).all() and np.all(u.v_x == 25.0) == line.steady
    if hasattr(u, "v_x_rate"):
        assert np.all(u.v_x_rate == 0.0) == line.steady


def test_pedals_push_and_never_pull(line, manoeuvre):
    u = inputs(manoeuvre, times(manoeuvre, 4001))
    assert hasattr(u, "drive_torque") == hasattr(u, "brake_torque") == line.pedals
    if line.pedals:
        assert (u.drive_torque >= 0).all() and (u.brake_torque >= 0).all()
        assert np.max(u.brake_torque) > 10


def test_the_rate_is_the_speed_s_slope(manoeuvre):
    t = times(manoeuvre, 501)
    found = inputs(manoeuvre, t)
    if not hasattr(found, "v_x_rate"):
        pytest.skip("its inputs have no rate")
    slope = jax.jit(jax.vmap(jax.grad(lambda t: manoeuvre.inputs(t).v_x)))(t)
    np.testing.assert_allclose(found.v_x_rate, slope, atol=1e-12)


def test_derivatives_are_continuous(line, manoeuvre):
    """Jumps would show as differences that do not shrink with the step."""
    curve = lambda t: stacked(manoeuvre, t)
    for _ in range(line.smooth):
        curve = jax.jacfwd(curve)
    values = np.asarray(jax.jit(jax.vmap(curve))(times(manoeuvre, 80_001)))
    jumps = [np.max(np.abs(np.diff(values[::stride], axis=0)), axis=0) for stride in (4, 1)]
    assert np.isfinite(jumps).all()
    assert (jumps[1] <= 0.3 * jumps[0] + 1e-9).all()


def test_precision_stays(manoeuvre):
    single = cast(manoeuvre, np.float32)
    t = times(manoeuvre, 1001)
    u = inputs(single, t.astype(np.float32))
    assert {leaf.dtype for leaf in u} == {np.dtype(np.float32)}
    exact = np.stack(inputs(manoeuvre, t))
    scale = np.max(np.abs(exact), axis=1, keepdims=True) + 1e-9
    np.testing.assert_allclose(np.stack(u) / scale, exact / scale, atol=1e-4)


def test_scalars_arrays_jit_and_vmap_agree(manoeuvre):
    t = times(manoeuvre, 41)
    whole = stacked(manoeuvre, t)
    np.testing.assert_allclose(jax.jit(stacked)(manoeuvre, t), whole, rtol=1e-10, atol=1e-12)
    each = jax.jit(jax.vmap(stacked, (None, 0), 1))(manoeuvre, t)
    np.testing.assert_allclose(each, whole, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(jax.jit(stacked)(manoeuvre, float(t[17])), whole[:, 17], rtol=1e-10, atol=1e-12)


def test_parameters_have_the_gradients_of_differences(manoeuvre):
    leaves, rest = eqx.partition(manoeuvre, eqx.is_inexact_array)
    leaves, treedef = jax.tree.flatten(leaves)
    t = 0.0123 + 0.97 * times(manoeuvre, 37)

    @jax.jit
    @jax.value_and_grad
    def total(leaves):
        inputs = stacked(eqx.combine(jax.tree.unflatten(treedef, leaves), rest), t)
        return jnp.sum(np.sin(np.arange(37.0)) * inputs)

    for number, gradient in enumerate(total(leaves)[1]):
        up, down = ([v + (i == number) * step for i, v in enumerate(leaves)] for step in (1e-6, -1e-6))
        np.testing.assert_allclose(np.sum(gradient), (total(up)[0] - total(down)[0]) / 2e-6, rtol=1e-5, atol=1e-5)

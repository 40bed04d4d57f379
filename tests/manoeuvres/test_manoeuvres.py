"""Lane change, step, sweep and replay: shapes, rows, bad input."""

import equinox as eqx
import jax
import numpy as np
import pytest

from jaxveh import InputError, Recording, manoeuvres
from jaxveh.statespace import cast

ROWS = 1024
"""Instants that a program looks at: one serves every list of them that is no longer."""


@eqx.filter_jit
def inputs(manoeuvre, t):
    return manoeuvre.inputs(t)


def steer(manoeuvre, t):
    t = np.asarray(t, float)
    rows = np.zeros(max(ROWS, t.size))
    rows[: t.size] = t.ravel()
    return np.asarray(inputs(manoeuvre, rows).steer)[: t.size].reshape(t.shape)


def test_double_lane_change_is_a_sine_period_and_its_mirror():
    m = manoeuvres.double_lane_change(25.0, 0.12, start=0.5, period=2.0, pause=1.0, duration=7.0)
    np.testing.assert_allclose(steer(m, [1.0, 2.0, 4.0, 5.0]), [0.12, -0.12, -0.12, 0.12], rtol=1e-12)
    np.testing.assert_allclose(steer(m, [0.2, 2.5, 3.0, 3.5, 6.0, 7.0]), 0.0, atol=1e-15)
    t = np.linspace(0.0, 7.0, 701)
    np.testing.assert_allclose(np.trapezoid(steer(m, t), t), 0.0, atol=1e-12)
    centre = 3.0
    np.testing.assert_allclose(steer(m, centre + t[:300]), steer(m, centre - t[:300]), atol=1e-14)


def test_step_steer_ramps_within_its_ramp():
    m = manoeuvres.step_steer(25.0, 0.2, ramp=0.2, start=1.0, duration=7.0)
    np.testing.assert_allclose(steer(m, [0.999, 1.1, 1.2, 7.0]), [0.0, 0.1, 0.2, 0.2], rtol=1e-12)


def test_swept_sine_sweeps_its_frequencies():
    m = manoeuvres.swept_sine(25.0, 0.1, from_frequency=0.5, to_frequency=2.5, duration=20.0)
    crossings = np.count_nonzero(np.diff(np.sign(steer(m, np.linspace(0.003, 19.997, 20_000)))))
    assert crossings == 2 * 0.5 * (0.5 + 2.5) * 20.0 - 1
    rates = jax.jit(jax.vmap(jax.grad(lambda t: m.inputs(t).steer)))
    for t, frequency in ((5.0, 1.0), (15.0, 2.0)):
        near = np.linspace(t - 0.6, t + 0.6, 2001)
        np.testing.assert_allclose(np.max(np.abs(rates(near))), 0.1 * 2 * np.pi * frequency, rtol=0.07)


def recording(**channels):
    time = np.array([100.0, 100.01, 100.03, 100.04])
    default = {"steer": np.array([0.0, 0.1, 0.3, 0.2]), "v_x": np.array([20.0, 20.0, 21.0, 22.0])}
    return Recording(time, {**default, **channels})


def test_replay_is_linear_between_rows_and_held_at_the_ends():
    m = manoeuvres.replay(recording())
    np.testing.assert_allclose(m.duration, 0.04, rtol=1e-12)
    t = [0.0, 0.005, 0.02, 0.03, 0.035, 0.04, 9.0, -1.0]
    u = jax.tree.map(np.asarray, inputs(m, np.asarray(t)))
    np.testing.assert_allclose(u.steer, [0.0, 0.05, 0.2, 0.3, 0.25, 0.2, 0.2, 0.0], atol=1e-12)
    np.testing.assert_allclose(u.v_x[:3], [20.0, 20.0, 20.5], rtol=1e-12)
    assert u._fields == ("steer", "v_x")


def test_replay_takes_a_recorded_acceleration_along():
    m = manoeuvres.replay(recording(a_x=np.array([0.0, 1.0, 2.0, 3.0])))
    np.testing.assert_allclose(m.inputs(0.005).a_x, 0.5, rtol=1e-9)


def test_replay_of_a_late_log_keeps_its_steps_in_float32():
    log = recording()
    m = manoeuvres.replay(Recording(log.time + 1e6, cast(log.channels, np.float32)))
    assert m.time.dtype == np.float32
    np.testing.assert_allclose(m.time, [0.0, 0.01, 0.03, 0.04], rtol=1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: manoeuvres.double_lane_change(25.0, 7.0), r"steer = 7\.0: must be within a quarter turn.*not degrees"),
        (lambda: manoeuvres.double_lane_change(-1.0, 0.1), r"speed = -1\.0: must be between 0 and 150 m/s"),
        (lambda: manoeuvres.double_lane_change(25.0, 0.1, duration=5.0), r"duration = 5\.0: must be at least start"),
        (lambda: manoeuvres.step_steer(25.0, 0.1, ramp=0.0), r"ramp = 0\.0: must be positive"),
        (lambda: manoeuvres.step_steer(25.0, 0.1, start=6.9), r"duration = 7\.0: must be at least start \+ ramp"),
        (lambda: manoeuvres.swept_sine(25.0, 0.1, -0.5, 2.0), r"from_frequency = -0\.5"),
        (lambda: manoeuvres.swept_sine(25.0, 0.1, duration=0.5), r"edge = 0\.5: must be at most half the duration"),
        (lambda: manoeuvres.step_steer(float("nan"), 0.1), r"speed = nan: must be between 0 and 150 m/s"),
        (lambda: manoeuvres.replay(recording(steer=np.array([0.0, np.nan, 0, 0]))), r"steer = nan at t = 100\.01 s"),
        (lambda: manoeuvres.replay(recording().without("v_x")), r"unknown name\(s\) v_x"),
        (lambda: manoeuvres.replay(recording().rows(slice(0, 1))), r"has 1 row"),
    ],
)
def test_bad_input_raises_by_name_value_and_range(make, message):
    with pytest.raises(InputError, match=message):
        make()

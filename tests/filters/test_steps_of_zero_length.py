"""Two rows at one instant: a step of zero length adds no noise, and its derivatives are finite, for every filter.

The filters and the programs are those of `test_every_filter.py`; there the process noise is correlated.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import kalman
from test_every_filter import FILTERS, KEYS, NAMES, batch, batch_of_values, batch_with_gradients, linear, names

from jaxveh import estimators, sensors, vehicles
from jaxveh import statespace as ss

TWICE = ((3, 4), (12, 13), (13, 14))
"""Rows that come at the same time: after one with measurements, and three in a row."""


class Rows(dict):
    """The columns of a recording, whose times may repeat."""

    time = None


def doubled():
    """The model and its recordings, with some rows at the time of the one before."""
    model, rows = batch("straight")
    t = np.array(rows.t)
    for before, after in TWICE:
        t[:, after] = t[:, before]
    return model, rows._replace(t=jnp.asarray(t))


def exact(rows, i, process):
    """The answer in NumPy."""
    columns = Rows({name: np.asarray(values[i]) for name, values in {**rows.y._asdict(), **rows.u._asdict()}.items()})
    columns.time = np.asarray(rows.t[i])
    law = ss.MultivariateGaussian(("y0", "y1"), np.diag(np.square([0.4, 0.3])))
    model = eqx.tree_at(lambda m: (m.measurement_noise, m.process_noise.law), linear(), (law, process))
    return kalman(model, columns)


def check(name, rows, found, process):
    value, estimate = found
    assert not np.asarray(estimate.result).any()
    for leaf in jax.tree.leaves((value, estimate.mean, estimate.std)):
        assert np.isfinite(leaf).all()
    for i in range(2):
        answer = exact(rows, i, process)
        if FILTERS[name].exact:
            np.testing.assert_allclose(value[i], answer["log_likelihood"].sum(), rtol=1e-9)
        if FILTERS[name].exact and not FILTERS[name].late:
            np.testing.assert_allclose(np.stack(estimate.mean)[:, i].T, answer["mean"], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", names("straight"))
def test_correlated_process_noise(name):
    model, rows = doubled()
    if FILTERS[name].differentiable:
        found, gradient = batch_with_gradients(FILTERS[name].make(), model, rows, KEYS)
        for leaf in jax.tree.leaves(gradient):
            assert np.isfinite(leaf).all()
    else:
        found = batch_of_values(FILTERS[name].make(), model, rows, KEYS)
    check(name, rows, found, model.process_noise.law)


@pytest.mark.parametrize("name", names("float32"))
def test_independent_process_noise(name):
    model, rows = doubled()
    std = {"x0": 0.6, "x1": 0.5, "x2": 0.7}
    model = eqx.tree_at(lambda m: m.process_noise, model, ss.Continuous(ss.Gaussian(std)))
    found = batch_of_values(FILTERS[name].make(), model, rows, KEYS)
    check(name, rows, found, ss.MultivariateGaussian(NAMES, np.diag(np.square([*std.values()]))))


@pytest.mark.parametrize("path", ["held", "linear"])
def test_a_step_of_zero_length_moves_nothing_whatever_the_path_of_the_inputs(path):
    """Two devices that report at one instant, in a live loop."""
    model = estimators.state_space(vehicles.passenger_car(), sensors.esc(), input_path=path)
    before, after = ({"steer": steer, "v_x": 20.0} for steer in (0.01, 0.02))
    x, (u0, u1) = model.prior.mean, (model.row(1.0, u, {}).u for u in (before, after))
    x = x._replace(v_y=jnp.asarray(0.1), yaw_rate=jnp.asarray(0.2))
    move = lambda x, u0, u1: model.transition(1.0, 1.0, x, model.step_inputs(1.0, 1.0, u0, u1))
    moved, back = jax.vjp(move, x, u0, u1)
    np.testing.assert_array_equal(jnp.stack(moved), jnp.stack(x))
    by_state, *by_inputs = back(jax.tree.map(jnp.ones_like, moved))
    np.testing.assert_array_equal(jnp.stack(by_state), 1.0)
    assert not any(np.any(leaf) for leaf in jax.tree.leaves(by_inputs))


CORRELATED = ss.MultivariateGaussian(("a", "b"), np.array([[2.0, 0.5], [0.5, 1.0]]))
LAWS = {
    "independent": ss.Continuous(ss.Gaussian({"a": 0.5, "b": 2.0})),
    "correlated": ss.Continuous(CORRELATED),
    "both": ss.Continuous(ss.Independent((CORRELATED, ss.Gaussian({"c": 0.5})))),
    "with that of one step": ss.process.Together((ss.Continuous(CORRELATED), ss.Discrete(ss.Gaussian({"c": 0.5})))),
}


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("dt", [0.0, 0.04])
def test_every_law_over_a_step(name, dt):
    """Its factor is one of its covariance; over a step of zero length draws are zero, and derivatives finite."""
    noise = LAWS[name]

    def numbers(noise, dt):
        law = noise.over(dt)
        return law.factor(), law.covariance(), law.sample(jax.random.key(0), (5,))

    factor, covariance, drawn = jax.jit(numbers)(noise, dt)
    np.testing.assert_allclose(factor @ factor.T, covariance, atol=1e-15)
    for field, one in drawn.items():
        assert (np.asarray(one) != 0).all() == (dt > 0 or (field == "c" and name == "with that of one step"))
    total = lambda noise, dt: sum(jnp.sum(leaf) for leaf in jax.tree.leaves(numbers(noise, dt)))
    for leaf in jax.tree.leaves(jax.jit(jax.grad(total, (0, 1)))(noise, dt)):
        assert np.isfinite(leaf).all()

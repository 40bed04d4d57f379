"""What holds for every observer, each in turn: a new one is a line in `OBSERVERS`.

Each observer and model are one program: the estimate of a batch of two recordings with irregular steps, missing channels and rows
without any measurement, and the gradient of its squares with respect to the model's and the observer's numbers.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from families import left_out
from observer_systems import Swing, Theta, drive, mass, pendulum, regression, see_curve, without

from jaxveh import Parameters, filters, observers
from jaxveh import statespace as ss

pytestmark = pytest.mark.product

DT, ROWS = 0.05, 60
SILENT = slice(30, 33)


class Line(NamedTuple):
    """An observer of a model, the models that it is for, and what it makes of them first."""

    make: Callable[[Any], observers.AbstractObserver]
    models: tuple[str, ...] = ("mass", "pendulum")
    prepare: Callable[[Any], Any] = lambda model: model


def gain(model):
    poles = [-3.0, -4.0, -5.0, -6.0][: len(model.states)]
    return observers.place_poles(model, poles, dt=DT)


def switching(model):
    size = 0.02 * np.eye(len(model.states), len(model.channels))
    return observers.SlidingMode(gain(model), size, np.full(len(model.channels), 0.05))


def first(model):
    return model.system["stiffness" if "stiffness" in model.system else "pull"]


def without_parameter(model):
    return mass(6.0) if "stiffness" in model.states else pendulum(11.0)


def adaptive(model, **options):
    name = model.states[-1]
    return observers.Adaptive(gain(without_parameter(model)), {name: 20.0}, **options)


def pushed(model):
    return ss.with_disturbances(model, {model.states[1]: 1.0})


def with_first(model):
    return ss.with_parameters(model, first, prior=0.3)


LEAST_SQUARES = ("line", "curve")
OBSERVERS = {
    "Luenberger": Line(lambda model: observers.Luenberger(gain(model))),
    "sliding mode": Line(switching),
    "extended state": Line(lambda model: observers.extended_state(model, 4.0, dt=DT), prepare=pushed),
    "adaptive": Line(adaptive, prepare=with_first),
    "adaptive, safe": Line(
        lambda model: adaptive(model, bounds={model.states[-1]: (1.0, 20.0)}, leakage=0.01, dead_zone=0.1),
        ("pendulum",),
        with_first,
    ),
    "least squares": Line(lambda model: observers.RecursiveLeastSquares(0.98), LEAST_SQUARES),
    "least squares, several": Line(lambda model: observers.RecursiveLeastSquares([0.95, 1.0]), ("line",)),
    "least squares, separate": Line(
        lambda model: observers.RecursiveLeastSquares([0.95, 1.0], reset=1e3, separate=True), ("curve",)
    ),
}
STARTS = {
    "mass": lambda: (mass(6.0), (0.8, -0.5)),
    "pendulum": lambda: (pendulum(11.0), Swing(1.2, -0.4)),
    "line": lambda: (regression(), Theta(2.0, -1.0)),
    "curve": lambda: (regression(see_curve, spread=1.0), Theta(0.7, -1.0)),
}


def test_every_observer_of_the_package_is_here():
    start = lambda name, line: STARTS[line.models[0]]()[0]
    prepared = lambda name, line: line.prepare(start(name, line)) if line.prepare else start(name, line)
    made = [line.make(prepared(name, line)) for name, line in OBSERVERS.items()]
    assert not left_out("observers", observers.AbstractObserver, made, {})


@pytest.mark.parametrize("name", [name for name, line in OBSERVERS.items() if line.prepare is with_first])
def test_parameters_are_found_as_in_the_car(name):
    observer, model, rows, _ = batch(name, OBSERVERS[name].models[0])
    found = eqx.filter_eval_shape(filters.scan, observer, model, jax.tree.map(lambda leaf: leaf[0], rows))
    (parameter,) = model.chosen.parameters
    for one in (found.parameters, found.parameters_std):
        assert isinstance(one, Parameters) and one[parameter.name].shape == (ROWS,) and len(one) == 1


FULL = (("adaptive", "pendulum"), ("least squares", "curve"), ("least squares, several", "line"))
"""What another line says as well."""


def case(name, model, full=False):
    return pytest.param(name, model, marks=pytest.mark.full if full or (name, model) in FULL else [])


CASES = [case(name, model) for name, line in OBSERVERS.items() for model in line.models]
# On its second model these say nothing new.
LIVE = [case(name, OBSERVERS[name].models[0]) for name in ("Luenberger", "adaptive", "least squares")]
"""A memory of each kind."""
FIRST = [case(name, model, model != line.models[0]) for name, line in OBSERVERS.items() for model in line.models]


@functools.cache
def recording(model_name, seed):
    model, start = STARTS[model_name]()
    rng = np.random.default_rng(seed)
    time = 10.0 + np.cumsum(rng.uniform(0.5 * DT, 1.5 * DT, ROWS))
    inputs = {name: 2.0 * np.sin(3.0 * time + i) + rng.normal(size=ROWS) for i, name in enumerate(model.inputs)}
    # The truth differs from the prior's mean in its state, and in what the adaptive ones estimate.
    truth = {"mass": mass(4.5), "pendulum": pendulum(9.0)}.get(model_name, model)
    states, found = drive(truth, start, time, inputs)
    found = without(found, SILENT, model.channels)
    return states, without(found, slice(10, 50, 4), model.channels[:1])


@functools.cache
def batch(name, model_name, dtype=np.float64):
    line = OBSERVERS[name]
    model = line.prepare(STARTS[model_name]()[0])
    truths, drives = zip(*[recording(model_name, seed) for seed in (1, 2)], strict=True)
    rows = jax.tree.map(lambda *leaves: np.stack(leaves), *[model.rows(drive) for drive in drives])
    rows = jax.tree.map(lambda leaf: leaf.astype(dtype), rows._replace(t=rows.t - rows.t[:, :1]))
    return line.make(model), ss.cast(model, dtype), rows, np.stack(truths)


@eqx.filter_jit
def whole(observer, model, rows):
    leaves, rest = eqx.partition((observer, model), eqx.is_inexact_array)

    def total(leaves, rows):
        observer, model = eqx.combine(leaves, rest)
        estimate = ss.scan(observer, model, rows)
        return sum(jnp.sum(jnp.square(value)) for value in estimate.mean), estimate

    return jax.vmap(jax.value_and_grad(total, has_aux=True), in_axes=(None, 0))(leaves, rows)


@functools.cache
def found(name, model_name):
    observer, model, rows, _ = batch(name, model_name)
    return jax.tree.map(np.asarray, whole(observer, model, rows))


@pytest.mark.parametrize(("name", "model_name"), CASES)
def test_it_succeeds_with_finite_gradients(name, model_name):
    batch(name, model_name)[0].check(batch(name, model_name)[1])
    (_, estimate), gradient = found(name, model_name)
    assert not np.asarray(estimate.result).any()
    for leaf in jax.tree.leaves((estimate.mean, gradient)):
        assert np.isfinite(leaf).all()
    assert np.isnan(np.stack(estimate.std)).all() and np.isnan(estimate.log_likelihood).all()
    assert np.isnan(np.stack(estimate.info.innovation)[:, :, SILENT]).all()


@pytest.mark.parametrize(("name", "model_name"), CASES)
def test_it_is_nearer_the_truth_than_the_model_alone(name, model_name):
    (_, estimate), _ = found(name, model_name)
    *_, truth = batch(name, model_name)
    model = STARTS[model_name]()[0]
    alone = observers.Luenberger(np.zeros((len(model.states), len(model.channels))))
    for i in range(2):
        open_loop = ss.run(alone, model, recording(model_name, i + 1)[1]).mean
        error = lambda mean, truth=truth[i]: np.sqrt(
            np.mean([np.square(np.asarray(getattr(mean, s)) - truth[:, k])[45:] for k, s in enumerate(model.states)])
        )
        assert error(jax.tree.map(lambda leaf, i=i: leaf[i], estimate.mean)) < 0.5 * error(open_loop)


@pytest.mark.parametrize(("name", "model_name"), CASES)
def test_rows_without_measurements_leave_the_model_to_itself(name, model_name):
    if name == "adaptive, safe":
        pytest.skip("leakage acts whether or not anything is measured")
    (_, estimate), _ = found(name, model_name)
    _, model, rows, _ = batch(name, model_name)
    at = lambda tree, k: jax.tree.map(lambda leaf: leaf[0, k], tree)
    for k in range(SILENT.start, SILENT.stop):
        before, row = at(rows, k - 1), at(rows, k)
        state = type(model.prior.mean)(*at(estimate.mean, k - 1))
        expected = model.transition(before.t, row.t, state, before.u)
        np.testing.assert_allclose(at(estimate.mean, k), expected, rtol=1e-12)


@pytest.mark.parametrize(("name", "model_name"), CASES)
def test_its_gradient_is_that_of_differences(name, model_name):
    _, gradient = found(name, model_name)
    observer, model, rows, _ = batch(name, model_name)
    leaves, rest = eqx.partition((observer, model), eqx.is_inexact_array)
    rng = np.random.default_rng(5)
    flat, tree = jax.tree.flatten(leaves)
    flat = [np.asarray(leaf) for leaf in flat]
    steps = [rng.uniform(0.2, 1.0, leaf.shape) * 0.1 * np.abs(leaf) for leaf in flat]
    h, values = 1e-5, []
    for sign in (1, -1):
        moved = [jnp.asarray(leaf + sign * h * s) for leaf, s in zip(flat, steps, strict=True)]
        moved = jax.tree.unflatten(tree, moved)
        values.append(whole(*eqx.combine(moved, rest), rows)[0][0])
    slope = sum(
        np.sum(g * s, axis=tuple(range(1, g.ndim))) for g, s in zip(jax.tree.leaves(gradient), steps, strict=True)
    )
    np.testing.assert_allclose(slope, (values[0] - values[1]) / (2 * h), rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize(("name", "model_name"), LIVE)
def test_a_live_loop_gives_the_scan_s_answer(name, model_name):
    (_, estimate), _ = found(name, model_name)
    observer, model, rows, _ = batch(name, model_name)
    row = lambda k: jax.tree.map(lambda leaf: leaf[0, k], rows)
    init, step = eqx.filter_jit(observer.init), eqx.filter_jit(observer.step)
    belief, _ = init(model, row(0))
    for k in range(1, 40):
        belief, _ = step(model, belief, row(k))
    np.testing.assert_allclose(belief.moments(model)[0], [leaf[0, 39] for leaf in estimate.mean], rtol=1e-11)


@pytest.mark.parametrize(("name", "model_name"), FIRST)
def test_float32_stays_float32_and_says_the_same(name, model_name):
    (_, estimate), _ = found(name, model_name)
    observer, model, rows, _ = batch(name, model_name, np.float32)
    # The observer's own numbers stay as they were given, in float64: the model's precision rules.
    one = jax.tree.map(lambda leaf: leaf[0], rows)
    single = ss.scan(observer, model, one)
    assert {leaf.dtype for leaf in single.mean} == {np.dtype("float32")}
    assert not np.asarray(single.result).any()
    np.testing.assert_allclose(np.stack(single.mean), np.stack(estimate.mean)[:, 0], atol=2e-3)

"""Methods smoothed by all rows: an exact answer where there is one, and every method that can be, from `estimators.__all__`."""

import inspect
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import method_logs
import numpy as np
import pytest
from test_every_method import QUANTITIES, made, stacked
from test_grade import slippery

import jaxveh
from jaxveh import InputError, Recording, estimators, filters, statespace
from jaxveh._core.names import record
from jaxveh.estimators import kit
from jaxveh.estimators.following import smooth_rows
from jaxveh.estimators.sequential import Belief, innovation, predict, update

SMOOTHABLE = [
    (quantity, name)
    for quantity, module in QUANTITIES.items()
    for name in module.METHODS
    if isinstance(made(quantity, name), kit.AbstractSmoothable)
]
ONE_OF_EACH = list({type(made(*one)): one for one in reversed(SMOOTHABLE)}.values())
"""Quantity and name of one method of each kind: bank and roll have the same, as grade and mass have."""

each_kind = pytest.mark.parametrize(("quantity", "name"), ONE_OF_EACH)

A, Q, R = np.array([[1.0, 0.1], [-0.2, 0.9]]), np.diag([0.01, 0.04]), 0.3
TIME, START = np.arange(40.0), np.diag([1.0, 2.0])


class Memory(NamedTuple):
    belief: Belief


class Linear(kit.AbstractSmoothable):
    """Two states, of which the first is measured."""

    needs = (kit.Need("y", "m", optional=True),)

    def first(self, t, values):
        memory = Memory(self._seen(Belief(jnp.zeros(2), jnp.asarray(START)), values))
        return memory, self.say(memory)

    def next(self, memory, t, values):
        memory = Memory(self._seen(self.ahead(memory, t, values), values))
        return memory, self.say(memory)

    def ahead(self, memory, t, values):
        return predict(memory.belief, lambda x: jnp.asarray(A) @ x, jnp.asarray(Q))

    def say(self, memory):
        mean, covariance = memory.belief
        names = ("p", "q")
        stds = jnp.sqrt(jnp.diagonal(covariance))
        return kit.answer(dict(zip(names, mean, strict=True)), dict(zip(names, stds, strict=True)))

    def _seen(self, belief, values):
        return update(belief, innovation(belief, lambda x: x[0], values["y"], jnp.asarray(R)))


def test_of_a_linear_method_it_is_the_exact_answer():
    y = np.where(np.arange(40) % 7 == 3, np.nan, np.sin(TIME))
    recording = Recording(TIME, {"y": y}, {"y": "m"})
    model = statespace.StateSpace(
        transition=lambda s, t0, t1, x, u: type(x)(*(jnp.asarray(A) @ jnp.stack(x))),
        observation=lambda s, t, x, u: record("Y", {"y": x.p}),
        process_noise=statespace.Discrete(statespace.Gaussian({"p": 0.1, "q": 0.2})),
        measurement_noise=statespace.Gaussian({"y": np.sqrt(R)}),
        prior=statespace.Prior(record("X", {"p": 0.0, "q": 0.0}), {"p": 1.0, "q": np.sqrt(2.0)}),
    )
    exact = filters.smooth(filters.Kalman(), model, recording)
    found = kit.follow("test", Linear(), recording, smoothed=True)
    for name in ("p", "q"):
        np.testing.assert_allclose(found[name], exact[name], rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(getattr(found.std, name), getattr(exact.std, name), rtol=1e-9)


def test_rows_after_a_jump_that_the_model_does_not_know_do_not_spoil_those_before_it():
    """As after a spin: until there the answer is that of the rows until there, or nearer."""
    rng = np.random.default_rng(1)
    true = np.where(TIME < 20.0, 0.0, 60.0)
    y = true + np.sqrt(R) * rng.normal(size=TIME.size)
    live, smoothed = (
        kit.follow("test", Linear(), Recording(TIME, {"y": y}, {"y": "m"}), smoothed=one) for one in (False, True)
    )
    before = slice(0, 20)
    error = lambda found: np.sqrt(np.mean(np.square(found["p"][before] - true[before])))
    assert error(smoothed) < 1.2 * error(live) < 1.0
    assert (np.abs(smoothed["p"][before]) < 4.0 * np.asarray(smoothed.std.p)[before]).all()


def test_every_quantity_with_such_a_method_smooths_and_the_others_say_that_they_do_not():
    assert {quantity for quantity, _ in SMOOTHABLE} == {
        quantity
        for quantity, module in QUANTITIES.items()
        if quantity != "sideslip" and "smoothed" in inspect.signature(module.estimate).parameters
    }
    # The message names the recommended method.
    assert {(quantity, QUANTITIES[quantity].RECOMMENDED) for quantity, _ in SMOOTHABLE} <= set(SMOOTHABLE)
    needs = made("bank", "tseng").needs
    with pytest.raises(InputError, match="bank: smoothed: .* looks back only.* the recommended"):
        estimators.bank.estimate(method_logs.CAR, method_logs.log(needs), method="tseng", smoothed=True)


@each_kind
def test_it_is_finite_whatever_the_log_lacks_and_ends_as_the_method_does(quantity, name):
    method = made(quantity, name)
    logs = method_logs.variants(method.needs)
    time, values = stacked(logs, method.needs)
    smoothed, live = (jax.vmap(lambda v, f=f: f(method, time, v))(values) for f in (smooth_rows, kit.follow_rows))
    for k, variant in enumerate(logs):
        of = lambda part, field, k=k: np.asarray(getattr(part, field)[k])
        for field in live.mean._fields:
            mean, std, known = (of(part, field) for part in smoothed[:3])
            assert np.isfinite(mean).all() and (std[known] >= 0.0).all(), (variant, field)
            np.testing.assert_allclose(mean[-1], of(live.mean, field)[-1], rtol=1e-9, atol=1e-12)
            np.testing.assert_allclose(std[-1], of(live.std, field)[-1], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(("quantity", "name"), [one for one in SMOOTHABLE if one[0] in ("bank", "grade", "roll")])
def test_it_is_nearer_to_the_truth(quantity, name):
    module, method = QUANTITIES[quantity], made(quantity, name)
    log, truth = method_logs.log(method.needs), method_logs.channels()
    if quantity == "grade":  # it needs more than a few seconds to tell a grade from an offset
        log, true = slippery(method.needs, "nothing")
        truth = {"grade": true}
    live, smoothed = (module.estimate(method_logs.CAR, log, method=name, smoothed=one) for one in (False, True))
    shown = next(iter(module.SHOWN))
    error = lambda one: np.sqrt(np.mean((np.asarray(one[shown]) - truth[shown]) ** 2))
    assert error(smoothed) < 0.8 * error(live)


@each_kind
def test_in_float32_it_is_near_and_its_gradients_are_finite(quantity, name):
    method = made(quantity, name)
    time, values = stacked({"gaps": method_logs.variants(method.needs)["gaps"]}, method.needs)
    values = jax.tree.map(lambda leaf: leaf[0], values)
    numbers, rest = eqx.partition(method, eqx.is_inexact_array)
    shown = QUANTITIES[quantity].SHOWN

    def said(numbers, values):
        found = smooth_rows(eqx.combine(numbers, rest), time.astype(values[method.needs[0].channel].dtype), values)
        return found, sum(jnp.mean(getattr(found.mean, field)) for field in shown)

    found, _ = jax.jit(said)(numbers, values)
    slopes = jax.jit(jax.grad(lambda *given: said(*given)[1], argnums=(0, 1)))(numbers, values)
    assert all(np.isfinite(slope).all() for slope in jax.tree.leaves(slopes))
    single = jaxveh.cast((numbers, values), jnp.float32)
    near, _ = jax.jit(said)(*single)
    for field in shown:
        one, other = np.asarray(getattr(near.mean, field)), np.asarray(getattr(found.mean, field))
        assert one.dtype == np.float32
        assert np.quantile(np.abs(one - other), 0.9) < 5e-3 * max(np.abs(other).max(), 1e-2), field


def test_two_rows_and_one_are_enough():
    needs = made("grade", "filter").needs
    for rows in (1, 2):
        log = method_logs.log(needs).rows(slice(0, rows))
        found = estimators.grade.estimate(method_logs.CAR, log, smoothed=True)
        assert np.isfinite(found["grade"]).all() and len(found["grade"]) == rows

"""Every method of every quantity keeps the contract of `estimators.method`: from what `estimators.__all__` lists."""

import dataclasses
import functools
import inspect
import pickle
from types import ModuleType

import equinox as eqx
import jax
import jax.numpy as jnp
import method_logs
import numpy as np
import pytest

import jaxveh
from jaxveh import InputError, Recording, estimators, filters
from jaxveh.estimators import kit

QUANTITIES = {
    name: module
    for name in estimators.__all__
    if isinstance(module := getattr(estimators, name), ModuleType) and hasattr(module, "METHODS")
}
every_quantity = pytest.mark.parametrize("quantity", QUANTITIES)
QUICK = {"sideslip": ("integration", "steady_steer", "roll_compensated")}
"""Of the quantities whose methods take minutes to compile, those that the default run looks at; the others are left to the full
run."""


def case(quantity, name):
    later = quantity in QUICK and name not in QUICK[quantity]
    return pytest.param(quantity, name, marks=[pytest.mark.full] if later else [])


every = pytest.mark.parametrize(
    ("quantity", "name"), [case(quantity, name) for quantity, module in QUANTITIES.items() for name in module.METHODS]
)

a_sixth = pytest.mark.product
"""Of ninety methods each test has a sixth by default; `-m full` has them all."""


def draws(method):
    """Whether a filter in it draws random numbers: one key draws others in another precision, and jumps where others are
    chosen."""
    is_filter = lambda node: isinstance(node, filters.AbstractFilter)
    return any(is_filter(node) and node.needs_key for node in jax.tree.leaves(method, is_leaf=is_filter))


@functools.cache
def made(quantity, name, car=method_logs.CAR):
    return QUANTITIES[quantity].METHODS[name].make(car)


def stacked(logs, needs, dtype=float):
    """Time (T,) and the channels' values, (L, T) each."""
    time = jnp.asarray(next(iter(logs.values())).time, dtype)
    return time, {n.channel: jnp.stack([jnp.asarray(log[n.channel], dtype) for log in logs.values()]) for n in needs}


def total_of(module, rest, time):
    """A number that depends on all that a method shows in all rows, as a function of its numbers and of the rows; `rest`: the
    method without its numbers."""

    def total(numbers, values):
        said = kit.follow_rows(eqx.combine(numbers, rest), time, values)
        shown = [getattr(said.mean, field) for field in module.SHOWN]
        return sum(jnp.mean(jnp.where(jnp.isfinite(one), one, 0.0) * jnp.cos(time)) for one in shown)

    return total


@every_quantity
def test_the_functions_of_a_quantity_say_in_which_units_and_are_found_by_a_pickle(quantity):
    module = QUANTITIES[quantity]
    for function in (module.estimate, module.live):
        assert pickle.loads(pickle.dumps(function)) is function
        # The sideslip's, whose calibration is another estimator, have texts of their own.
        said = (f"`{field}` ({unit})" in function.__doc__ for field, unit in module.SHOWN.items())
        assert quantity == "sideslip" or all(said)


@every_quantity
def test_a_quantity_says_what_it_shows_and_recommends_a_method(quantity):
    module = QUANTITIES[quantity]
    assert module.RECOMMENDED in module.METHODS and quantity == module.NAME
    assert module.SHOWN and all(isinstance(unit, str) and unit for unit in module.SHOWN.values())
    for function, first in (("estimate", ["source", "recording"]), ("live", ["source"])):
        found = inspect.signature(getattr(module, function)).parameters
        assert [p.name for p in found.values() if p.kind is p.POSITIONAL_OR_KEYWORD] == first
        assert "method" in found and getattr(module, function).__doc__
    for one in module.METHODS.values():
        assert one.help and one.source and isinstance(one, estimators.MethodOfCar)
    needs = made(quantity, module.RECOMMENDED).needs
    guess = module.do_nothing(method_logs.CAR, method_logs.log(needs))
    assert set(guess) == set(module.SHOWN)
    assert all(np.shape(values) == (method_logs.ROWS,) for values in guess.values())


@every
def test_what_it_lacks_is_named(quantity, name):
    module, method = QUANTITIES[quantity], made(quantity, name)
    log = method_logs.log(method.needs)
    required = [need for need in method.needs if not need.optional]
    assert required, "a method reads something"
    for need in required:
        with pytest.raises(InputError, match=f"{quantity}: {need.channel} .* is missing from the log"):
            module.estimate(method_logs.CAR, log.without(need.channel), method=name)
        with pytest.raises(InputError, match=f"{quantity}: channel {need.channel} is in furlong"):
            module.estimate(method_logs.CAR, log.replace(units={need.channel: "furlong"}), method=name)
        endless = np.array(log[need.channel])
        endless[5] = np.inf
        with pytest.raises(InputError, match=f"{quantity}: channel {need.channel} is infinite at t = 0.1 s"):
            module.estimate(method_logs.CAR, log.replace(**{need.channel: endless}), method=name)
    with pytest.raises(InputError, match=rf"{quantity}: method = 'nothing'"):
        module.estimate(method_logs.CAR, log, method="nothing")


@a_sixth
@every
def test_an_answer_is_finite_or_not_known_whatever_the_log_lacks(quantity, name):
    module, method = QUANTITIES[quantity], made(quantity, name)
    logs = method_logs.variants(method.needs)
    time, values = stacked(logs, method.needs)
    said = jax.vmap(lambda values: kit.follow_rows(method, time, values))(values)
    assert set(module.SHOWN) <= set(said.mean._fields) == set(said.std._fields) == set(said.known._fields)
    for k, variant in enumerate(logs):
        one = jax.tree.map(lambda leaf, k=k: np.asarray(leaf[k]), said)
        for field in said.mean._fields:
            mean, std, known = (getattr(part, field) for part in one[:3])
            assert known.dtype == bool and np.isfinite(mean[known]).all(), (variant, field)
            assert np.isfinite(mean).all() or (one.result[~np.isfinite(mean)] > 0).all(), (variant, field)
            claimed = ~np.isnan(std)
            assert (std[claimed & known] >= 0.0).all(), (variant, field)
    # A batch says what each says alone.
    alone = module.estimate(method_logs.CAR, logs["gaps"], method=name)
    k = list(logs).index("gaps")
    for field in said.mean._fields:
        np.testing.assert_allclose(alone[field], getattr(said.mean, field)[k], rtol=1e-6, atol=1e-9, err_msg=field)
        np.testing.assert_array_equal(getattr(alone.known, field), getattr(said.known, field)[k], err_msg=field)
    # What is known at all is known somewhere on an ordinary drive that has everything, or says why not in its help.
    plain = list(logs).index("plain")
    known = any(np.asarray(getattr(said.known, field))[plain].any() for field in module.SHOWN)
    assert known or "known only" in module.METHODS[name].help


READ_STEER = [
    case(quantity, name)
    for quantity, module in QUANTITIES.items()
    for name in module.METHODS
    if "steer" in {need.channel for need in made(quantity, name).needs}
]


@a_sixth
@pytest.mark.parametrize(("quantity", "name"), READ_STEER)
def test_the_offset_of_the_steer_in_the_car_s_file_is_taken_out(quantity, name):
    module, log = QUANTITIES[quantity], method_logs.log(made(quantity, name).needs)
    log = log.rows(slice(0, 100))
    right, off = (dataclasses.replace(method_logs.CAR, steer_offset=offset) for offset in (0.0, 0.01))
    found = module.estimate(off, log.replace(steer=np.asarray(log["steer"]) + 0.01), method=name)
    same = module.estimate(right, log, method=name)
    for field in module.SHOWN:
        np.testing.assert_allclose(found[field], same[field], rtol=1e-6, atol=2e-6, err_msg=field)


@a_sixth
@every
def test_live_says_what_it_says_of_a_log_and_is_compiled_once(quantity, name):
    module, method = QUANTITIES[quantity], made(quantity, name)
    log = method_logs.variants(method.needs)["gaps"].rows(slice(0, 90))
    found = module.estimate(method_logs.CAR, log, method=name)
    live, answers, compiled = module.live(method_logs.CAR, method=name), [], []
    # A measurement that is missing need not be given.
    rows = [
        (float(log.time[k]), {n: float(log[n][k]) for n in log.names if not np.isnan(log[n][k])})
        for k in range(len(log))
    ]
    memory, said = live.init(*rows[0])
    answers.append(said)
    jax.monitoring.register_event_duration_secs_listener(
        lambda event, *_, **__: compiled.append(event) if event.endswith("backend_compile_duration") else None
    )
    for k, row in enumerate(rows[1:]):
        memory, said = live.step(memory, *row)
        answers.append(said)
        if k == 1:
            before = len(compiled)
    assert len(compiled) == before
    for what in ("mean", "std"):
        for field in found.mean._fields:
            beside = np.array([getattr(getattr(one, what), field) for one in answers])
            there = np.asarray(getattr(getattr(found, what), field))
            np.testing.assert_allclose(beside, there, rtol=1e-8, atol=1e-10, err_msg=field)
    for field in found.known._fields:
        np.testing.assert_array_equal([getattr(one.known, field) for one in answers], getattr(found.known, field))


@a_sixth
@every
def test_float32_is_float32_throughout_and_near(quantity, name):
    method = made(quantity, name)
    single = jaxveh.cast(method, jnp.float32)
    logs = {"plain": method_logs.log(method.needs)}
    time, values = stacked(logs, method.needs)
    one = lambda values: jax.tree.map(lambda leaf: leaf[0], values)
    expected = kit.follow_rows(method, time, one(values))
    few = jax.tree.map(lambda leaf: leaf.astype(jnp.float32), one(values))
    found = kit.follow_rows(single, time.astype(jnp.float32), few)
    for field in found.mean._fields:
        mean, there = np.asarray(getattr(found.mean, field)), np.asarray(getattr(expected.mean, field))
        assert mean.dtype == getattr(found.std, field).dtype == np.float32
        known = np.asarray(getattr(expected.known, field)) & np.asarray(getattr(found.known, field))
        if not known.any():
            continue
        near = np.quantile(np.abs(mean - there)[known], 0.9)
        # Of one belief other numbers are drawn in another precision: as many of them are as near.
        share = 2e-2 if draws(method) else 2e-3
        assert near <= share * max(np.abs(there[known]).max(), 1e-2), field


@a_sixth
@every
def test_gradients_with_respect_to_its_numbers_and_its_rows_are_finite_and_right(quantity, name):
    module, method = QUANTITIES[quantity], made(quantity, name)
    logs = method_logs.variants(method.needs)
    time, values = stacked({name: logs[name] for name in ("gaps", "standing")}, method.needs)
    values = jax.tree.map(lambda leaf: leaf[:, :120], values)
    numbers, rest = eqx.partition(method, eqx.is_inexact_array)
    total = total_of(module, rest, time[:120])
    # One program for the slopes and for the differences: compiling takes longer than the slopes that nobody asks for.
    with_slopes = jax.jit(jax.vmap(jax.value_and_grad(total, argnums=(0, 1)), in_axes=(None, 0)))
    (here, _), slopes = with_slopes(numbers, values)
    for slope in jax.tree.leaves(slopes):
        assert np.isfinite(slope).all()
    leaves, structure = jax.tree.flatten(numbers)
    for k, leaf in enumerate(leaves):
        # Of what draws, the value itself jumps where other particles are chosen.
        if leaf.ndim or np.isinf(leaf) or draws(method):
            continue
        found = float(jax.tree.leaves(slopes[0])[k][0])

        def misses(share, k=k, leaf=leaf, found=found):
            """By how much the slope and a difference over this share of the number differ, over the tolerance."""
            step = share * max(abs(float(leaf)), 1e-3)
            ahead, behind = (
                jax.tree.unflatten(structure, [*leaves[:k], leaf + d, *leaves[k + 1 :]]) for d in (step, -step)
            )
            difference = float(with_slopes(ahead, values)[0][0] - with_slopes(behind, values)[0][0]) / (2.0 * step)
            # A total of thousands (kg m^2) has no more digits in its difference than this.
            rounding = 0.5 * np.finfo(float).eps * abs(float(here)) / step
            tolerance = 1e-4 * (abs(found) + 1e-2) + rounding + 2e-3 * abs(difference)
            return abs(found - difference) / tolerance

        # Where a filter amplifies its rounding, a longer difference is the better one.
        assert misses(1e-5) <= 1.0 or misses(1e-4) <= 1.0, (k, found)


@every
def test_another_car_is_another_set_of_numbers_and_no_other_program(quantity, name):
    one, other = made(quantity, name), made(quantity, name, method_logs.another_car())
    assert jax.tree.structure(eqx.filter(one, eqx.is_array)) == jax.tree.structure(eqx.filter(other, eqx.is_array))
    assert eqx.tree_equal(eqx.partition(one, eqx.is_array)[1], eqx.partition(other, eqx.is_array)[1])


@every_quantity
def test_a_method_of_ones_own_is_a_source_and_another_thing_is_refused(quantity):
    module = QUANTITIES[quantity]
    method = made(quantity, module.RECOMMENDED)
    log = method_logs.log(method.needs).rows(slice(0, 50))
    # By name: a quantity with a calibrated estimator of its own has that where none is given.
    named = module.RECOMMENDED
    found, expected = module.estimate(method, log), module.estimate(method_logs.CAR, log, method=named)
    for a, b in zip(found.mean, expected.mean, strict=True):
        np.testing.assert_array_equal(a, b)
    with pytest.raises(InputError, match=f"{quantity}: source = dict: must be"):
        module.estimate({}, log, method=named)
    with pytest.raises(InputError, match="are missing from the log|is missing from the log"):
        module.estimate(method, Recording(log.time, {}))


class Steady(estimators.AbstractMethod):
    """A method of one's own: the yaw rate as it is measured."""

    @property
    def needs(self):
        return (kit.Need("yaw_rate", "rad/s"),)

    def first(self, t, values):
        return None, kit.answer({"turning": values["yaw_rate"]})

    def next(self, memory, t, values):
        return self.first(t, values)


def quantity_of_ones_own(**changed):
    own = ModuleType("own")
    own.NAME, own.METHODS = "own", {"steady": estimators.MethodOfCar(lambda car: Steady(), "as measured", "ours")}
    choose = lambda source, method: kit.method_of("own", own.METHODS, source, method)
    own.estimate = lambda source, recording, *, method="steady": kit.follow("own", choose(source, method), recording)
    vars(own).update(changed)
    return own


def test_a_quantity_of_ones_own_is_compared_and_what_it_lacks_is_named():
    log = method_logs.log(Steady().needs)
    found = estimators.compare(method_logs.CAR, log, quantity_of_ones_own())
    np.testing.assert_array_equal(found.answers["steady"]["turning"], log["yaw_rate"])
    made = estimators.MethodOfCar(lambda car: Steady, "its class", "ours")
    for wrong, message in (
        ({"METHODS": {"steady": Steady()}}, r"own: METHODS\['steady'\] = Steady: must be of the kind MethodOfCar"),
        ({"METHODS": {"steady": Steady}}, r"own: METHODS\['steady'\] = .*: must be of the kind MethodOfCar"),
        ({"METHODS": {"steady": made}}, r"METHODS\['steady'\]\.make\(car\) = .*: must be of the kind Method\."),
    ):
        with pytest.raises(InputError, match=message):
            estimators.compare(method_logs.CAR, log, quantity_of_ones_own(**wrong), ["steady"])
    for name in ("NAME", "METHODS", "estimate"):
        own = quantity_of_ones_own()
        delattr(own, name)
        with pytest.raises(InputError, match=f"compare: quantity = .*; it has no {name}"):
            estimators.compare(method_logs.CAR, log, own)

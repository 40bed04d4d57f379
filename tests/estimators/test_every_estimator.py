"""Every estimator keeps the contract of `estimators.contract`: its names, early errors, and live what it is on a log."""

import dataclasses
import functools
import inspect
import re
from types import ModuleType, SimpleNamespace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import test_mass_and_grade
import test_sideslip
from families import wanting

from jaxveh import InputError, Parameters, Recording, estimators, filters, fitting, vehicles
from jaxveh._core.parameter import pick, put, resolve
from jaxveh.estimators import kit
from jaxveh.estimators.coarse_log import coarse

FULL = pytest.mark.full


class Case(NamedTuple):
    """A log that an estimator can read; its car as a file, and as the vehicle that the estimator is about; `options` of its
    `model` other than their defaults."""

    log: Recording
    car: Any
    vehicle: Any
    options: dict


def of_sideslip():
    file = test_sideslip.CAR
    return Case(test_sideslip.log(2100), file, estimators.sideslip.car_of(file), {"a_y_delay": 0.21})


def of_mass_and_grade():
    known = {"wheel_radius": 0.3, "drag": 0.4, "rolling_resistance": 0.012}
    file = dataclasses.replace(test_sideslip.CAR, mass=1100.0, **known)
    log, options = test_mass_and_grade.drive()[0].rows(slice(0, 400)), {"a_x": 0.05, "grade_rate_walk": None}
    return Case(log, file, vehicles.Longitudinal(1100.0, **known), {**options, "input_path": "held"})


CASES = {"sideslip": of_sideslip, "mass_and_grade": of_mass_and_grade}
SLOW = ("sideslip",)
"""To be fitted: by the full run."""
SHORT = 120
"""Rows of a log of which only the filter's answer is looked at."""


@functools.cache
def case_of(name):
    return CASES[name]()


def likelihood_of_sideslip(source):
    """Of the log as its calibration reads it, which is not what the filter is given row by row."""
    case, one = case_of("sideslip"), estimators.sideslip
    model = source.model if isinstance(source, estimators.Calibration) else one.model(source)
    log = coarse(case.log, case.car.wheelbase)
    return filters.run(filters.Extended(), model, log).log_likelihood


LIKELIHOODS = {"sideslip": likelihood_of_sideslip}
"""Of those that calibrate on other rows than they estimate."""


every = pytest.mark.parametrize("name", CASES)


def estimator(name):
    return getattr(estimators, name)


def required(name):
    return [need for need in estimator(name).needs if not need.optional]


@every
def test_the_car_of_a_file_is_the_one_that_its_model_has(name):
    case, one = case_of(name), estimator(name)
    car = one.car_of(case.car)
    assert one.car_of(car) is car
    of_file, of_car = jax.tree.leaves(one.model(case.car)), jax.tree.leaves(one.model(car))
    for a, b in zip(of_file, of_car, strict=True):
        np.testing.assert_array_equal(a, b)


def test_every_module_of_the_room_that_calibrates_has_a_case_here():
    modules = {name for name in estimators.__all__ if isinstance(getattr(estimators, name), ModuleType)}
    assert not wanting({name for name in modules if hasattr(estimator(name), "calibrate")}, set(CASES), {})
    others = {name for name in modules - set(CASES) - {"kit", "learned"} if not hasattr(estimator(name), "METHODS")}
    assert not [f"{name}: give it `calibrate` (estimators/contract.py) or `METHODS` (method.py)" for name in others]
    assert all(name == estimator(name).NAME for name in modules - {"kit", "learned"})


def parameters(function):
    """Names of the arguments: those in order, those by name alone; and which have no default."""
    found = inspect.signature(function).parameters.values()
    by_place = [p.name for p in found if p.kind is p.POSITIONAL_OR_KEYWORD]
    by_name = [p.name for p in found if p.kind is p.KEYWORD_ONLY]
    return by_place, by_name, [p.name for p in found if p.default is p.empty and p.kind is not p.VAR_KEYWORD]


@every
def test_the_five_names_have_the_same_arguments(name):
    one = estimator(name)
    by_place, by_name, needed = parameters(one.estimate)
    assert (by_place, by_name[:2], needed) == (["source", "recording"], ["filter", "key"], ["source", "recording"])
    by_place, by_name, needed = parameters(one.live)
    assert (by_place, by_name[:2], needed) == (["source"], ["filter", "key"], ["source"])
    # A quantity that has methods beside the calibrated estimator takes the name of one.
    assert by_name[2:] == (["method"] if hasattr(one, "METHODS") else [])
    by_place, by_name, needed = parameters(one.calibrate)
    assert (by_place, needed, by_name[:2]) == (["car", "recording"], ["car", "recording"], ["filter", "progress"])
    by_place, _, needed = parameters(one.model)
    assert by_place == needed == ["car"]
    for function, answer in (
        ("model", "StateSpace"),
        ("calibrate", "Calibration"),
        ("estimate", "Estimate"),
        ("live", "Live"),
    ):
        # A smoother's, too.
        assert answer in inspect.signature(getattr(one, function)).return_annotation.split(" | ")
        assert getattr(one, function).__doc__
    assert one.needs and all(isinstance(need, kit.Need) for need in one.needs)


@every
def test_what_it_needs_is_what_its_model_reads(name):
    live = estimator(name).live(case_of(name).car)
    model, cleaning = live.model, live.cleaning
    needs = {need.channel: need for need in estimator(name).needs}
    throughout = {channel for channel, need in needs.items() if need.throughout}
    if cleaning.channels:
        assert (set(needs), throughout) == (set(cleaning.channels), set(cleaning.inputs))
        return
    assert {need.channel for need in required(name)} == {*model.inputs, *model.channels}
    assert throughout == set(model.inputs)


@every
def test_what_is_missing_is_named_with_what_there_is(name):
    one, case = estimator(name), case_of(name)
    for need in required(name):
        less = case.log.without(need.channel)
        there = ", ".join(less.names)
        less = less.replace(**{"true.v_y": np.zeros(len(less.time))})
        message = (
            rf"{name}: {need.channel} \({need.unit.replace('^', '.')}\) is missing from the log; it has: {there}\."
        )
        for call in (lambda less=less: one.estimate(case.car, less), lambda less=less: one.calibrate(case.car, less)):
            with pytest.raises(InputError, match=message):
                call()
    empty = Recording(case.log.time, {})
    with pytest.raises(InputError, match=r"are missing from the log; it has: no channel\."):
        one.estimate(case.car, empty)


@every
def test_another_unit_and_a_gap_in_an_input_are_named(name):
    one, case = estimator(name), case_of(name)
    for need in required(name):
        with pytest.raises(InputError, match=f"{name}: channel {need.channel} is in furlong: must be in"):
            one.estimate(case.car, case.log.replace(units={need.channel: "furlong"}))
        values = np.array(case.log[need.channel])
        values[7] = np.nan
        if need.throughout:
            with pytest.raises(InputError, match=rf"input channel {need.channel} is NaN in 1 rows, .*recording\.fill"):
                one.estimate(case.car, case.log.replace(**{need.channel: values}))


@every
def test_an_optional_channel_is_asked_for_by_a_model_that_reads_it(name):
    one, case = estimator(name), case_of(name)
    for need in one.needs:
        if need.optional and need.channel in inspect.signature(one.model).parameters:
            model = one.model(case.car, **{need.channel: 0.05})
            assert need.channel in model.channels
            less = case.log.without(need.channel).rows(slice(0, SHORT))
            one.estimate(case.car, less)
            with pytest.raises(InputError, match=f"{need.channel} .* is missing from the log"):
                one.estimate(model, less)
        elif need.optional:
            one.estimate(case.car, case.log.without(need.channel).rows(slice(0, SHORT)))


def same(found, expected):
    for what in ("mean", "std"):
        for a, b in zip(getattr(found, what), getattr(expected, what), strict=True):
            np.testing.assert_array_equal(a, b)


def fit_that_is_sure(one, model):
    chosen = resolve(model, one.chosen_parameters)
    z = jnp.stack([p.domain.inverse(value) for p, value in zip(chosen, pick(model, chosen), strict=True)])
    return SimpleNamespace(model=model, chosen=chosen, unconstrained=z, covariance=1e-12 * jnp.eye(len(z)))


@every
def test_a_file_a_vehicle_a_model_and_a_calibration_are_sources(name):
    one, case = estimator(name), case_of(name)
    log, model = case.log.rows(slice(0, SHORT)), one.model(case.car)
    same(one.estimate(case.vehicle, log), one.estimate(case.car, log))
    expected = one.estimate(model, log)
    told = estimators.Calibration(name, fit_that_is_sure(one, model), (estimators.Span(0.0, 1.0),))
    for source in (case.car, told):
        found = one.estimate(source, log)
        for a, b in zip(found.mean, expected.mean, strict=True):
            # The mean over an ensemble that says one thing has its own rounding.
            np.testing.assert_allclose(a, b, rtol=1e-13)
        # A file and a calibration may say that they are not sure.
        assert all(np.all(np.asarray(a) >= 0.999 * np.asarray(b)) for a, b in zip(found.std, expected.std, strict=True))
    other = estimators.Calibration("another", SimpleNamespace(model=model), (estimators.Span(0.0, 1.0),))
    for call in (lambda: one.estimate(other, log), lambda: one.live(other)):
        with pytest.raises(InputError, match=f"{name}: the calibration was made by another: must be made by {name}"):
            call()


def rows_of(log, count):
    return [(float(log.time[k]), {name: float(log[name][k]) for name in log.names}) for k in range(count)]


def live_answers(live, rows):
    belief, answer = live.init(*rows[0])
    answers = [answer]
    for row in rows[1:]:
        belief, answer = live.step(belief, *row)
        answers.append(answer)
    return answers


@pytest.mark.parametrize("with_key", [False, pytest.param(True, marks=FULL)], ids=["its own filter", "particles"])
@every
def test_live_says_what_it_says_of_a_log(name, with_key):
    """States bit for bit; what is computed of them for the report to rounding, since a scan fuses it otherwise."""
    one, case, count = estimator(name), case_of(name), SHORT
    options = {"filter": filters.ParticleFilter(64), "key": jax.random.key(3)} if with_key else {}
    log = spoilt(case.log, [need for need in one.needs if need.channel in case.log])
    # By all rows it knows more than a row at a time.
    causal = {"smoothed": False} if "smoothed" in parameters(one.estimate)[1] else {}
    found = one.estimate(case.car, log.rows(slice(0, count)), **options, **causal)
    answers = live_answers(one.live(case.car, **options), rows_of(log, count))
    states = one.model(case.car).states
    for what in ("mean", "std"):
        for field in getattr(found, what)._fields:
            beside = np.array([getattr(getattr(answer, what), field) for answer in answers])
            there = np.asarray(getattr(getattr(found, what), field))
            if field in states and field != "mass":  # a state as its logarithm
                np.testing.assert_array_equal(beside, there, err_msg=field)
            np.testing.assert_allclose(beside, there, rtol=1e-9, err_msg=field)
    np.testing.assert_array_equal([answer.info.log_likelihood for answer in answers], found.info.log_likelihood)


def spoilt(log, needs):
    """A jump of every input for some rows, measurements that are missing, and some that are repeated."""
    rng, changed = np.random.default_rng(4), {}
    for need in needs:
        values = np.array(log[need.channel])
        if need.throughout:
            values[50:54] = values[50:54] + 0.3
            values[60:] += 0.02 * rng.normal(size=values[60:].size)
        else:
            values[20:23] = np.nan
            values[31] = values[30]
        changed[need.channel] = values
    return log.replace(**changed)


@every
def test_a_row_without_a_measurement_is_one_of_a_missing_one_and_one_without_an_input_is_refused(name):
    one, case = estimator(name), case_of(name)
    rows, live = rows_of(case.log, 3), one.live(case.car)
    there = [need for need in one.needs if need.channel in case.log]
    inputs = [need.channel for need in there if need.throughout]
    measured = [need.channel for need in there if not need.throughout]
    blank = [rows[0], (rows[1][0], rows[1][1] | dict.fromkeys(measured, np.nan)), rows[2]]
    without = [rows[0], (rows[1][0], {channel: rows[1][1][channel] for channel in inputs}), rows[2]]
    for a, b in zip(live_answers(live, blank), live_answers(live, without), strict=True):
        same(a, b)
    belief, _ = live.init(*rows[0])
    for channel in inputs:
        less = {name: value for name, value in rows[1][1].items() if name != channel}
        with pytest.raises(InputError, match=rf"no value for the input\(s\) {channel}"):
            live.step(belief, rows[1][0], less)


def test_a_live_step_is_compiled_once():
    traced = []

    class Counting(kit.AsItIs):
        def next(self, memory, t, values):
            traced.append(t)
            return None, values

    case = case_of("mass_and_grade")
    live = estimators.Live(filters.Unscented(), estimators.mass_and_grade.model(case.car), Counting())
    rows = rows_of(case.log, 6)
    live_answers(live, rows[:2])
    first = len(traced)
    live_answers(live, rows)
    assert len(traced) == first > 0


@every
def test_a_span_that_is_too_short_is_refused(name):
    with pytest.raises(InputError, match=rf"{name}: calibration span of [\d.]+ s .*: must be at least \d+ s, with"):
        estimator(name).calibrate(case_of(name).car, case_of(name).log.rows(slice(0, 100)))


@pytest.mark.parametrize("name", [pytest.param(n, marks=FULL) if n in SLOW else n for n in CASES])
def test_a_calibration_explains_its_span_better_says_what_it_fitted_and_can_be_kept(name, tmp_path):
    one, case, told = estimator(name), case_of(name), []
    found = one.calibrate(case.car, case.log, progress=lambda done, total, stage: told.append(done / total))
    assert isinstance(found, estimators.Calibration) and found.estimator == name
    assert found.spans == (estimators.Span(float(case.log.time[0]), float(case.log.time[-1])),)
    assert told and 0.0 <= min(told) <= max(told) <= 1.0
    for entry in found.summary().values():
        assert np.isfinite(entry["value"]) and entry["std"] > 0.0 and entry["unit"]
    likelihood = LIKELIHOODS.get(name, lambda source: one.estimate(source, case.log).log_likelihood)
    assert likelihood(found) > likelihood(case.car) + 1.0
    path = tmp_path / "calibration.toml"
    estimators.write_calibration(found.with_log_names('a "strange" name.csv'), path)
    kept = estimators.read_calibration(path)
    assert kept.spans == (found.spans[0]._replace(log='a "strange" name.csv'),)
    assert kept.told == found.told
    same(one.estimate(kept, case.log), one.estimate(found, case.log))
    np.testing.assert_array_equal(np.tril(kept.fit.covariance), np.tril(found.fit.covariance))
    np.testing.assert_array_equal(kept.fit.parameters_std.array(), found.fit.parameters_std.array())
    assert (int(kept.fit.result), int(kept.fit.steps)) == (int(found.fit.result), int(found.fit.steps))
    with pytest.raises(InputError, match="exists already"):
        estimators.write_calibration(found, path)


def calibration_of(one, case):
    """What a fit of a model with options would give, one per cent beside its start."""
    start = one.model(case.car, **case.options)
    chosen = resolve(start, one.chosen_parameters)
    values = [jnp.asarray(1.01 * value) for value in pick(start, chosen)]
    z = jnp.stack([p.domain.inverse(v) for p, v in zip(chosen, values, strict=True)])
    by_name = Parameters({p.name: v for p, v in zip(chosen, values, strict=True)})
    spread = jnp.eye(len(z)) + 0.1
    fit = fitting.Fit(by_name, by_name, z, spread, z[0], jnp.int32(3), jnp.int32(5), put(start, chosen, values), chosen)
    told = kit.start_of(case.car, case.options)
    return estimators.Calibration(one.NAME, fit, (estimators.Span(1.0, 2.0),), 0.05, ((None, 0.4), (0.05, 0.3)), told)


@every
def test_what_a_calibration_started_from_is_kept_options_included(name, tmp_path):
    one, case = estimator(name), case_of(name)
    made = calibration_of(one, case)
    chosen, fit = made.fit.chosen, made.fit
    by_name, spread, values = fit.parameters, fit.covariance, list(fit.parameters.values())
    path = tmp_path / "calibration.toml"
    estimators.write_calibration(made, path)
    kept = estimators.read_calibration(path)
    for a, b in zip(jax.tree.leaves(kept), jax.tree.leaves(made), strict=True):
        np.testing.assert_array_equal(a, b)
    assert (kept.told, kept.weight, kept.validation) == (made.told, made.weight, made.validation)
    assert jax.tree.structure(kept.model) == jax.tree.structure(made.model)
    for wrong in (spread - 2.0, spread.at[-1, 0].set(jnp.nan), spread.at[-1, -1].set(jnp.inf)):
        bad = dataclasses.replace(made, fit=dataclasses.replace(fit, covariance=wrong))
        estimators.write_calibration(bad, path, overwrite=True)
        with pytest.raises(
            InputError, match=r"calibration.toml: \[covariance\]: is not positive definite: edited, or lost in"
        ):
            estimators.read_calibration(path)
    for p, value in zip(chosen, values, strict=True):
        for wrong in (np.nan, -3.0 * value - 1.0, 1e9):
            one_wrong = Parameters({**by_name, p.name: jnp.asarray(wrong)})
            bad = dataclasses.replace(made, fit=dataclasses.replace(fit, parameters=one_wrong))
            estimators.write_calibration(bad, path, overwrite=True)
            with pytest.raises(InputError, match=re.escape(f'toml: [parameters."{p.name}"]: value = ')):
                estimators.read_calibration(path)
    for other in (kit.start_of(case.vehicle), kit.start_of(case.car, {"a_x": jnp.ones(())})):
        with pytest.raises(InputError, match="did not start from a car's file"):
            estimators.write_calibration(dataclasses.replace(made, told=other), tmp_path / "never.toml")


def test_a_calibration_of_one_s_own_estimator_is_read_by_its_module(tmp_path):
    own, other = ModuleType("own"), ModuleType("other")
    for module in (own, other):
        vars(module).update(vars(estimators.mass_and_grade), NAME=module.__name__)
    file = dataclasses.replace(test_sideslip.CAR, wheel_radius=0.3)
    made = calibration_of(own, SimpleNamespace(car=file, options={"a_x": 0.05}))
    path = tmp_path / "calibration.toml"
    made.save(path)
    for kept in (estimators.read_calibration(path, estimator=own), estimators.Calibration.load(path, estimator=own)):
        assert kept.estimator == "own" and kept.told == made.told
        for a, b in zip(jax.tree.leaves(kept), jax.tree.leaves(made), strict=True):
            np.testing.assert_array_equal(a, b)
    for given, message in (
        (None, r"no estimator 'own'; .* If it is your own, give its module: read_calibration\(path, estimator=own\)"),
        (other, "toml: the calibration is of own: must be of other, the estimator that was given"),
        ("own", "estimator = 'own': must be an object with NAME, .* Give the module"),
    ):
        with pytest.raises(InputError, match=message):
            estimators.read_calibration(path, estimator=given)


@every
def test_no_log_and_a_short_one_among_several_are_named(name):
    one, case = estimator(name), case_of(name)
    with pytest.raises(InputError, match="no log to calibrate on"):
        one.calibrate(case.car, [])
    with pytest.raises(InputError, match=f"{name}: calibration span 2 of"):
        one.calibrate(case.car, [case.log, case.log.rows(slice(0, 50))])

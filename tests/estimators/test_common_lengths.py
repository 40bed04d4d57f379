"""Logs of similar length share a program: the second compiles nothing, and no number depends on what only fills up a log.

The quantities are those that `estimators.__all__` lists."""

import equinox as eqx
import jax
import jax.numpy as jnp
import method_logs
import numpy as np
import pytest
from test_every_method import QUANTITIES, every_quantity, made

from jaxveh import Recording, estimators, filters, statespace
from jaxveh._core.lengths import common_length
from jaxveh.estimators import cleaning, kit

SHORTER = 290
assert common_length(SHORTER) == common_length(method_logs.ROWS) > method_logs.ROWS


def drive(rows, needs, start=0):
    """So many rows of the drive with the channels of `needs`."""
    made = method_logs.channels(rows=start + rows + 3)
    at = slice(start, start + rows)
    return Recording(made["time"][at], {need.channel: made[need.channel][at] for need in needs})


class Compiled:
    """Counts the programs that are compiled."""

    def __init__(self):
        self.programs = 0
        jax.monitoring.register_event_duration_secs_listener(self.hear)

    def hear(self, event, duration, **more):
        self.programs += event.endswith("backend_compile_duration")

    def during(self, work):
        before = self.programs
        work()
        return self.programs - before


@pytest.fixture(scope="module")
def compiled():
    return Compiled()


def ways_of(module):
    """The ways in which a quantity is estimated: looking back only and, where this can be, from all rows."""
    ways = {"live": lambda log: module.estimate(method_logs.CAR, log, method=module.RECOMMENDED)}
    if isinstance(made(module.NAME, module.RECOMMENDED), kit.AbstractSmoothable):
        ways["smoothed"] = lambda log: module.estimate(method_logs.CAR, log, smoothed=True)
    return ways | {"nothing": lambda log: module.do_nothing(method_logs.CAR, log)}


@every_quantity
def test_a_second_log_of_similar_length_compiles_nothing(quantity, compiled):
    module = QUANTITIES[quantity]
    needs = made(quantity, module.RECOMMENDED).needs
    for name, way in ways_of(module).items():
        way(drive(method_logs.ROWS, needs))
        assert compiled.during(lambda way=way: way(drive(SHORTER, needs, start=7))) == 0, name


@pytest.mark.thorough
def test_neither_does_a_second_calibration_and_the_estimate_with_its_bands(compiled):
    sideslip = estimators.sideslip

    def work(rows, start):
        log = drive(rows, sideslip.needs, start)
        calibration = sideslip.calibrate(method_logs.CAR, log)
        sources = (calibration, method_logs.CAR, sideslip.model(method_logs.CAR))
        found = [sideslip.estimate(source, log) for source in sources]
        found += [sideslip.estimate(method_logs.CAR, log, smoothed=False)]
        assert all(len(estimate.mean.sideslip) == rows for estimate in found)

    work(method_logs.ROWS, 0)
    assert compiled.during(lambda: work(SHORTER, 7)) == 0


def test_a_log_without_an_optional_channel_compiles_nothing_either(compiled):
    needs = [need for need in estimators.sideslip.needs if need.channel != "a_x"]
    cleaning.clean(drive(method_logs.ROWS, needs))
    assert compiled.during(lambda: cleaning.clean(drive(SHORTER, needs, 7))) == 0


@every_quantity
def test_the_answers_are_those_of_the_rows_alone(quantity):
    """The same program without the rows that fill up: to the last bit looking back, smoothed to rounding. The last rows are wild,
    so that copies of them would show."""
    module = QUANTITIES[quantity]
    method = made(quantity, module.RECOMMENDED)
    log = drive(SHORTER, method.needs)
    wild = {name: np.append(np.asarray(log[name])[:-2], np.asarray(log[name])[-2:] * 3.0 + 0.5) for name in log.names}
    log = log.replace(**{name: wild[name] for name in wild if name not in ("v_x", "speed")})
    values = {need.channel: jnp.asarray(log[need.channel]) for need in method.needs}
    time = jnp.asarray(log.time)
    for found, wanted in zip(
        jax.tree.leaves(kit.follow(quantity, method, log)),
        jax.tree.leaves((log.time, *kit.follow_rows(method, time, values))),
        strict=True,
    ):
        np.testing.assert_array_equal(found, wanted)
    if isinstance(method, kit.AbstractSmoothable):
        found, wanted = kit.follow(quantity, method, log, smoothed=True), kit.smooth_rows(method, time, values)
        for one, other in zip(jax.tree.leaves((found.mean, found.std)), jax.tree.leaves(wanted[:2]), strict=True):
            np.testing.assert_allclose(one, other, 1e-9, 1e-12)
        np.testing.assert_array_equal(found.result, wanted.result)


def test_an_estimate_without_smoothing_is_that_of_the_filter():
    """Its means and the belief after the last row, to the last bit; the likelihood is a sum of more rows."""
    sideslip = estimators.sideslip
    log, model = drive(SHORTER, sideslip.needs), sideslip.model(method_logs.CAR)
    wanted = filters.run(filters.Extended(), model, cleaning.clean(log, cleaning.RearAxleCleaning(2.7)))
    found = sideslip.estimate(method_logs.CAR, log, smoothed=False)
    for name in ("time", "mean", "info", "log_likelihood", "result", "failed_at", "belief"):
        one, other = (jax.tree.leaves(getattr(estimate, name)) for estimate in (found, wanted))
        assert len(one) == len(other) > 0, name
        for a, b in zip(one, other, strict=True):
            np.testing.assert_allclose(a, b, 1e-12 if name == "log_likelihood" else 0.0, err_msg=name)


def test_an_estimate_of_a_common_length_has_the_rows_of_its_own():
    sideslip = estimators.sideslip
    model = sideslip.model(method_logs.CAR)
    rows = model.rows(cleaning.clean(drive(SHORTER, sideslip.needs), cleaning.RearAxleCleaning(2.7)))
    found = statespace.kit.of_common_length(filters.kit.rauch_tung_striebel, rows, filters.Extended(), model)
    for estimate in (found, found.filtered):
        parts = [getattr(estimate, name) for name in ("time", *estimate.by_row)]
        assert {leaf.shape for leaf in jax.tree.leaves(parts)} == {(SHORTER,)}


def test_wild_values_are_those_of_the_rows_alone():
    """The median change of a channel decides what is wild at first: here a_y stays the same in a little less than half of its
    rows, and jumps in the others as a sound one would not."""
    rng = np.random.default_rng(4)
    log = drive(SHORTER, estimators.sideslip.needs)
    rough = np.asarray(log["a_y"]) + 4.0 * rng.normal(size=SHORTER)
    log = log.replace(a_y=np.where(np.arange(SHORTER) > 0.52 * SHORTER, 1.0, rough))
    names = ("v_x", "yaw_rate", "a_y")
    rows = tuple(jnp.asarray(one) for one in (np.asarray(log.time) - log.time[0], *[np.asarray(log[n]) for n in names]))
    wanted = cleaning._good(rows, jnp.asarray(cleaning.USUAL_WHEELBASE / 2.7))
    found = cleaning.without_wild_values(log, 2.7)
    assert (np.abs(np.diff(rough[:20])) > cleaning.A_Y_STEP).any() and np.isfinite(wanted[1][:20]).any()
    for name, values in zip(names[1:], wanted, strict=True):
        np.testing.assert_array_equal(found[name], values)


@pytest.mark.parametrize("rows", [1, 2, 3])
@every_quantity
def test_the_shortest_logs_have_answers_too(quantity, rows):
    module = QUANTITIES[quantity]
    method = made(quantity, module.RECOMMENDED)
    for smoothed in {False, isinstance(method, kit.AbstractSmoothable)}:
        said = kit.follow(quantity, method, drive(rows, method.needs), smoothed=smoothed)
        assert all(np.shape(leaf) == (rows,) for leaf in jax.tree.leaves(said))


def test_a_log_that_stands_in_a_jitted_function_is_estimated_there():
    """Nothing of it is traced, but all that is computed from it is."""
    method, sideslip = made("bank", estimators.bank.RECOMMENDED), estimators.sideslip
    log, few, model = drive(40, method.needs), drive(40, sideslip.needs), sideslip.model(method_logs.CAR)
    clean = cleaning.clean(few, cleaning.RearAxleCleaning(2.7))
    moved = Recording(jnp.asarray(clean.time), {name: jnp.asarray(clean[name]) for name in clean.names})
    ways = {
        "rows": lambda: kit.follow("bank", method, log).mean,
        "smoothed": lambda: kit.follow("bank", method, log, smoothed=True).mean,
        "cleaning": lambda: dict(cleaning.clean(few).channels),
        "smoother": lambda: filters.smooth(filters.Extended(), model, clean).mean,
        "arrays of jax": lambda: filters.smooth(filters.Extended(), model, moved).mean,
    }
    for name, way in ways.items():
        found = jax.eval_shape(lambda scale, way=way: [scale * one for one in jax.tree.leaves(way())], jnp.ones(()))
        assert {one.shape for one in found} == {(40,)}, name


@pytest.mark.whole
def test_what_is_traced_is_not_filled_up():
    """Inside jit, batches and gradients, whose programs are of one length anyway; nothing is compiled here."""
    method, sideslip = made("bank", estimators.bank.RECOMMENDED), estimators.sideslip
    log, few = drive(SHORTER, method.needs), drive(SHORTER, sideslip.needs)
    model = sideslip.model(method_logs.CAR)
    clean = cleaning.clean(few, cleaning.RearAxleCleaning(2.7))
    numbers, rest = eqx.partition(method, eqx.is_inexact_array)
    stiffer = lambda scale: eqx.tree_at(lambda m: m.system.stiffness, model, scale * model.system.stiffness)
    ways = {
        "rows": (lambda a_y: kit.follow("bank", method, log.replace(a_y=a_y)).mean, log["a_y"]),
        "smoothed": (lambda a_y: kit.follow("bank", method, log.replace(a_y=a_y), smoothed=True).mean, log["a_y"]),
        "numbers": (lambda numbers: kit.follow("bank", eqx.combine(numbers, rest), log).mean, numbers),
        "cleaning": (lambda a_y: dict(cleaning.clean(few.replace(a_y=a_y)).channels), few["a_y"]),
        "smoother": (lambda scale: filters.smooth(filters.Extended(), stiffer(scale), clean).mean, jnp.ones(())),
        "estimate": (lambda scale: sideslip.estimate(stiffer(scale), few).mean, jnp.ones(())),
    }
    for name, (way, at) in ways.items():
        found = jax.eval_shape(way, at)
        assert {leaf.shape for leaf in jax.tree.leaves(found)} == {(SHORTER,)}, name
        jax.eval_shape(jax.grad(lambda at, way=way: sum(jnp.nansum(leaf) for leaf in jax.tree.leaves(way(at)))), at)

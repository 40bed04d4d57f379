"""A log that is noisier than a method expects: the spread of what the recommended method of each quantity says grows with it.

The quantities are those that `estimators.__all__` lists."""

import jax
import jax.numpy as jnp
import method_logs
import numpy as np
import pytest
from banked_drives import file_of, follow_all
from test_every_method import QUANTITIES, made, stacked
from winding_roads import heard_of

from jaxveh.estimators import kit, misfit
from jaxveh.estimators.sequential import Belief, Measurement, correct_by_each

TIMES = 8.0
"""The noise that is added, over that of a production car's sensors."""

USUAL = {"m/s^2": 0.05, "rad/s": 0.002, "m/s": 0.05, "rad": 0.002, "N m": 10.0}
"""Standard deviations of the noise of its sensors, by unit."""

EXACT = ("steer", "steering_wheel")
"""Encoders are never noisy."""

OWN_WAY = {
    "sideslip": "its bands contain the noises of the calibration",
    "friction": "its misfit is tested with it, with drives that excite it",
    "geometry": "gated regressions that take minutes",
    "stiffness": "the course's noise makes it unknown, which is tested below",
    "mass": "noise in the torques makes it unknown, which is tested below",
}
"""Quantities of which the first test does not ask for a wider spread."""


def noisier(values, needs, times):
    """The channels with white noise in all but the encoders'."""
    rng, noisy = np.random.default_rng(3), dict(values)
    for need in needs:
        if need.channel in noisy and need.channel not in EXACT:
            noise = times * USUAL.get(need.unit, 0.0) * rng.normal(size=np.shape(noisy[need.channel]))
            noisy[need.channel] = noisy[need.channel] + noise
    return noisy


@pytest.mark.parametrize("quantity", [name for name in QUANTITIES if name not in OWN_WAY])
def test_the_spread_of_a_noisier_log_is_wider(quantity):
    module = QUANTITIES[quantity]
    method = made(quantity, module.RECOMMENDED)
    time, values = stacked({"plain": method_logs.log(method.needs)}, method.needs)
    values = {name: value[0] for name, value in values.items()}
    usual = kit.follow_rows(method, time, values)
    noisy = {name: jnp.asarray(value) for name, value in noisier(values, method.needs, TIMES).items()}
    found = kit.follow_rows(method, time, noisy)
    end = slice(method_logs.ROWS // 2, None)
    for name in module.SHOWN:
        before, after = (np.mean(getattr(one.std, name)[end]) for one in (usual, found))
        assert np.isfinite(before) and after > 1.05 * before, name


NOTHING_LEARNT = {
    "sideslip": "its bands contain the noises of the calibration",
    "geometry": "regressions over minutes, whose residuals are their noise",
}
"""Quantities whose recommended method has no misfit."""


def largest_misfit(method, time, values):
    """The largest ratio of variances in a method's memory after all rows."""
    take = lambda rows: (time[rows], {name: value[rows] for name, value in values.items()})

    @jax.jit
    def last():
        memory, _ = method.first(*take(0))
        memory, _ = jax.lax.scan(lambda memory, row: (method.next(memory, *row)[0], None), memory, take(slice(1, None)))
        is_misfit = lambda node: isinstance(node, misfit.Misfit)
        found = [node for node in jax.tree.leaves(memory, is_leaf=is_misfit) if is_misfit(node)]
        return jnp.max(jnp.concatenate([one.times for one in found]))

    return float(last())


@pytest.mark.parametrize("quantity", [name for name in QUANTITIES if name not in NOTHING_LEARNT])
def test_a_method_learns_that_its_log_is_noisier(quantity, monkeypatch):
    method = made(quantity, QUANTITIES[quantity].RECOMMENDED)
    time, values = stacked({"plain": method_logs.log(method.needs)}, method.needs)
    noisy = noisier({name: value[0] for name, value in values.items()}, method.needs, TIMES)
    noisy = {name: jnp.asarray(value) for name, value in noisy.items()}
    assert largest_misfit(method, time, noisy) > 10.0
    # Where no innovation counts for more than was expected, nothing is learnt.
    monkeypatch.setattr(misfit, "OUTLIER", 1.0)
    assert largest_misfit(method, time, noisy) <= misfit.CAUTION


def scores(module, car, times):
    """By name: the share of rows that are known, and their errors over their standard deviations, on simulated drives."""
    make, told = module.METHODS[module.RECOMMENDED].make, file_of(car)
    cases, truths, _, time = heard_of((car,), (0, 1), 40.0, True)
    needs = make(told).needs
    heard = [one | {"steer": one["steering_wheel"] / 16.0} for _, one in cases]
    said = follow_all(lambda car: make(file_of(car)), [(car, noisier(one, needs, times)) for one in heard], time)
    late, found = time > 10.0, {}
    for name in module.SHOWN:
        true = [truth_of(one, name, told) for one in truths]
        if true[0] is not None:
            mean, std, known = (getattr(part, name)[:, late] for part in (said.mean, said.std, said.known))
            there = known & np.isfinite(std)
            found[name] = there.mean(), (np.abs(mean - np.stack(true)[:, late]) / std)[there]
    return found


def truth_of(drive, name, car):
    """The truth of a quantity, None where the simulation has none."""
    named = {"roll": drive["horizon_roll"], "roll_rate": None, "sideslip": np.arctan2(drive["v_y"], drive["v_x"])}
    if name in named or name in drive:
        return named.get(name, drive.get(name))
    number = getattr(car, name, None)
    return None if number is None else np.full(drive["v_x"].shape, number)


@pytest.mark.full
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_known_values_of_a_noisier_log_are_within_their_spread(quantity):
    for times in (0.0, TIMES):
        for name, (known, errors) in scores(QUANTITIES[quantity], "passenger_car", times).items():
            assert known == 0.0 or np.quantile(errors, 0.95) < 3.3, (name, times)
            # Without a torque or a course that is worth its noise, mass and stiffness are not known.
            assert known > 0.5 or times > 0.0 or quantity in OWN_WAY, name


def learnt_of(noise, assumed, rows=3000, gap=1):
    """The misfit of one measurement of a constant, every `gap` rows of 0.01 s, and the last belief."""
    rng, state = np.random.default_rng(0), misfit.no_misfit(1, 0.0)
    belief = Belief(jnp.zeros(1), 100.0 * jnp.eye(1))
    one = type("State", (tuple,), {"__new__": lambda cls, *values: tuple.__new__(cls, values)})

    def step(carry, row):
        belief, state = carry
        value, here = row
        measured = Measurement(lambda x: value - x[0], jnp.asarray(assumed**2), here)
        return correct_by_each(belief, (measured,), state, jnp.asarray(0.01), one), None

    rows = jnp.asarray(noise * rng.normal(size=rows)), jnp.arange(rows) % gap == 0
    (belief, state), _ = jax.lax.scan(step, (belief, state), rows)
    return float(state.times[0]), belief


@pytest.mark.parametrize("gap", [1, 20])
def test_a_misfit_is_the_ratio_of_the_variances_and_the_belief_s_is_right(gap):
    times, belief = learnt_of(4.0, 0.5, gap=gap)
    assert 0.6 * 64.0 < times < 1.4 * 64.0
    assert abs(belief.mean[0]) < 3.0 * np.sqrt(belief.covariance[0, 0])
    count = 3000 / gap
    assert 0.5 < belief.covariance[0, 0] / (16.0 / count) < 1.5
    # Never below one, but for the caution of the first rows: a quiet log is not a reason to trust the model more.
    times, belief = learnt_of(0.1, 0.5, gap=gap)
    np.testing.assert_allclose([times, belief.covariance[0, 0] * count / 0.25], 1.0, rtol=0.05)


def test_roughness_is_the_variance_of_white_noise_and_not_of_motion():

    t, rng = 0.01 * np.arange(2000), np.random.default_rng(1)
    motion = 4.0 * np.sin(2.0 * np.pi * 0.7 * t)

    def of(values):
        step = lambda rough, value: (misfit.learn_roughness(rough, value, 0.01), None)
        return float(
            jax.lax.scan(step, misfit.no_roughness(jnp.asarray(values[0])), jnp.asarray(values[1:]))[0].variance
        )

    assert of(motion) < 1e-4
    noisy = motion + 0.3 * rng.normal(size=t.size)
    assert 0.7 < of(noisy) / 0.09 < 1.3
    # A missing measurement changes nothing.
    assert 0.7 < of(np.where(np.arange(t.size) % 7 == 3, np.nan, noisy)) / 0.09 < 1.4

"""`--fill`: gaps of any place and length in the inputs, drawn at random, against NumPy's interpolation."""

import dataclasses
import re

import numpy as np
import pytest

from jaxveh import InputError, Recording, estimators, vehicles
from jaxveh.cli import blanking
from jaxveh.cli.quantity_options import FILLED, QUANTITIES, inputs_of

ROWS = 50
TIME = 0.1 * np.arange(ROWS)


def log_with(missing):
    values = np.where(missing, np.nan, 20.0 + np.sin(TIME))
    plain = np.zeros(ROWS)
    return Recording(TIME, {"v_x": values, "yaw_rate": plain, "steer": values, "a_x": plain}, {}, "")


@pytest.mark.parametrize("seed", range(30))
def test_short_gaps_are_filled_and_long_ones_told(seed):
    draw = np.random.default_rng(seed)
    missing = np.zeros(ROWS, bool)
    for _ in range(draw.integers(1, 4)):
        begin = draw.choice([0, ROWS - 3, draw.integers(ROWS)])
        missing[begin : begin + draw.integers(1, 6)] = True
    drive, reach = log_with(missing), draw.uniform(0.15, 0.75)
    known = np.flatnonzero(~missing)
    expected = np.interp(TIME, TIME[known], np.asarray(drive["v_x"])[known])
    before = np.array([TIME[known[known <= k][-1]] if (known <= k).any() else -np.inf for k in range(ROWS)])
    after = np.array([TIME[known[known >= k][0]] if (known >= k).any() else np.inf for k in range(ROWS)])
    # At the ends the one sample that there is must be near.
    gap = np.where(np.isfinite(before) & np.isfinite(after), after - before, np.minimum(TIME - before, after - TIME))
    if (gap > reach).any():
        with pytest.raises(InputError, match=rf"is NaN in {int((gap > reach).sum())} rows.*raise --fill"):
            blanking.fill_gaps(drive, reach)
        return
    filled = blanking.fill_gaps(drive, reach)
    for name in ("v_x", "steer"):
        np.testing.assert_allclose(filled[name], expected, rtol=1e-12)
    assert np.array_equal(np.asarray(filled["v_x"])[known], np.asarray(drive["v_x"])[known])


def test_without_the_option_a_gap_stays_an_error():
    missing = np.arange(ROWS) == ROWS - 1
    with pytest.raises(InputError, match=r"v_x is NaN in 1 rows, first at t = 4\.9 s.*add --fill 0\.101 to fill them"):
        blanking.fill_gaps(log_with(missing), None)
    assert np.isfinite(np.asarray(blanking.fill_gaps(log_with(missing), 0.2)["v_x"])).all()


@pytest.mark.parametrize("seed", range(10))
def test_the_length_that_the_message_names_is_enough(seed):
    draw = np.random.default_rng(seed)
    missing = np.zeros(ROWS, bool)
    for _ in range(3):
        begin = draw.integers(ROWS)
        missing[begin : begin + draw.integers(1, 12)] = True
    drive = log_with(missing)
    for given in (None, 0.05):
        with pytest.raises(InputError, match="--fill") as told:
            blanking.fill_gaps(drive, given)
        named = re.search(r"--fill (?:to )?([0-9.]+) ", str(told.value))
        assert named is not None and (given is None) == ("add --fill" in str(told.value))
        assert np.isfinite(np.asarray(blanking.fill_gaps(drive, float(named[1]))["v_x"])).all()
        with pytest.raises(InputError, match="raise --fill"):
            blanking.fill_gaps(drive, float(named[1]) - 0.01)


def test_a_channel_without_any_value_cannot_be_filled():
    for given in (None, 1.0):
        with pytest.raises(InputError, match="v_x has no value in any row: map another column"):
            blanking.fill_gaps(log_with(np.ones(ROWS, bool)), given)


def check_named_fill_is_enough(quantity, method, needs, channel):
    """Whether what the message names as `--fill` fills a gap in the channel."""
    values = 20.0 + np.sin(TIME)
    gap = np.where((np.arange(ROWS) > 20) & (np.arange(ROWS) < 27), np.nan, values)
    log = Recording(TIME, {need.channel: gap if need.channel == channel else values for need in needs})
    with pytest.raises(InputError, match="NaN in 6 rows") as told:
        estimators.kit.check_needs("the method", needs, log)
    named = re.search(r"Fill it with --fill ([0-9.]+[0-9])\.$", blanking.with_fill_option(str(told.value)))
    assert named is not None, told.value
    for name in inputs_of((quantity,), (method,), estimators.kit.FULL_CAR):
        if name in log:
            log = blanking.fill_short(log, name, float(named[1]))
    estimators.kit.check_needs("the method", needs, log)


def test_the_option_that_a_method_names_fills_what_it_needs_in_every_row():
    throughout = set()
    for quantity, module in QUANTITIES.items():
        for method, one in module.METHODS.items():
            needs = one.make(estimators.kit.FULL_CAR).needs
            for channel in (need.channel for need in needs if need.throughout):
                check_named_fill_is_enough(quantity, method, needs, channel)
                throughout.add(channel)
    assert {"v_x", "steer"} <= throughout


def test_without_methods_the_recommended_ones_are_filled():
    every = inputs_of(tuple(QUANTITIES), None, estimators.kit.FULL_CAR)
    assert set(FILLED) <= set(every)
    for name, module in QUANTITIES.items():
        assert set(inputs_of((name,), (module.RECOMMENDED,), estimators.kit.FULL_CAR)) <= set(every)


@pytest.mark.parametrize("steering", vehicles.kit.STEERINGS)
def test_the_angles_of_steered_rear_wheels_are_read_seen_and_filled(steering):
    ratio = {"rear_steer_ratio": -0.2} if steering == "four-wheel" else {}
    plain = dataclasses.replace(estimators.kit.FULL_CAR, **dict.fromkeys(("rear_steer_ratio", "rear_steer_ratio_fast")))
    car = dataclasses.replace(plain, steering=steering, **ratio)
    read = set(blanking.read_for(car))
    needs = {need.channel for need in estimators.sideslip.METHODS["rear_axle"].make(car).needs} - {"steering_wheel"}
    assert needs <= read <= set(blanking.SEEN)
    angles = needs & {"steer", *blanking.REAR_ANGLES}
    assert bool(angles) == (not car.steers_front_alone) and angles <= set(FILLED)
    missing = np.arange(ROWS) % 3 == 1
    log = log_with(np.zeros(ROWS, bool)).replace(**{name: np.where(missing, np.nan, 0.1) for name in angles})
    filled = blanking.fill_gaps(log, 0.3)
    assert all(np.isfinite(np.asarray(filled[name])[:-1]).all() for name in angles)


@pytest.mark.parametrize("names", [("omega_fl",), ("omega_rl", "omega_rr"), ("a_x",)])
def test_a_log_with_rotations_alone_says_how_they_are_speeds(names):
    log = Recording(np.arange(5.0), {name: np.ones(5) for name in ("yaw_rate", *names)})
    with pytest.raises(InputError, match="the log has no v_x") as told:
        blanking.fill_gaps(log, None)
    assert ("as wheel_speed_fl, with scale" in str(told.value)) == names[0].startswith("omega")

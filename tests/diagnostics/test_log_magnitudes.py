"""The check of a log looks at the magnitude of every known channel, and compares angles with their rates."""

import re

import numpy as np
import pytest

from jaxveh import Recording, io
from jaxveh.diagnostics import check_log
from jaxveh.diagnostics.log_magnitudes import LIMITS, UNLIMITED, UNSIGNED
from jaxveh.diagnostics.log_rates import RATES

STEP = 0.02
TIME = np.arange(3000) * STEP


def told(channels, time=TIME):
    return [one for one in check_log(Recording(time, channels)) if one.severity not in ("ok", "note")]


def about(found, severity, channel, pattern):
    return [
        one for one in found if (one.severity, one.channel) == (severity, channel) and re.search(pattern, one.message)
    ]


def test_every_known_channel_has_a_limit_or_is_known_to_have_none():
    assert sorted([*LIMITS, *UNLIMITED]) == sorted(io.CANONICAL)
    assert set(UNSIGNED) <= set(LIMITS)


@pytest.mark.parametrize("name", LIMITS)
def test_twice_the_limit_is_found_and_a_tenth_is_not(name):
    wave = np.abs(np.sin(TIME)) + 1e-3 * np.sin(40 * TIME)
    limit = LIMITS[name]
    large = told({name: 2.0 * limit.size * wave})
    assert about(large, "error" if limit.sure else "warning", name, "too much for .* it looks like"), large
    if name != "a_z":  # a tenth of its limit is gravity
        assert not [one for one in told({name: 0.1 * limit.size * wave}) if "reaches" in one.message]


@pytest.mark.parametrize("name", LIMITS)
@pytest.mark.parametrize("value", [-9999.0, 65535.0, 1e30])
def test_a_value_that_stands_for_none_is_found(name, value):
    limit = LIMITS[name]
    value = value * max(1.0, 1e-3 * limit.size)
    sound = 0.2 * limit.size * (np.abs(np.sin(TIME)) + 1e-3 * np.sin(40 * TIME))
    missing = np.where(np.arange(TIME.size) % 50 == 7, value, sound)
    (found,) = about(told({name: missing}), "error" if limit.sure else "warning", name, "does that stand for no value")
    assert found.values["placeholder"] == value and found.values["count"] == TIME.size // 50


@pytest.mark.parametrize("name", UNSIGNED)
def test_a_magnitude_below_zero_is_found_but_not_an_offset_of_the_sensor(name):
    wave = 0.5 * LIMITS[name].size * (1.0 + np.sin(TIME))
    (found,) = about(told({name: wave - 0.2 * LIMITS[name].size}), "warning", name, "is negative in .* is a magnitude")
    assert found.values["least"] == pytest.approx(-0.2 * LIMITS[name].size, rel=1e-3)
    assert not about(told({name: wave - 0.01 * wave.max()}), "warning", name, "is negative")


def test_a_brake_pressure_in_bar():
    pressed = np.clip(np.sin(TIME), 0.0, None)
    assert about(told({"brake_pressure": 80.0 * pressed}), "warning", "brake_pressure", "looks like kPa, bar or MPa")
    for size in (8e6, 2e4, 0.0):
        assert not told({"brake_pressure": size * pressed})


@pytest.mark.parametrize(
    ("factor", "pattern"),
    [(-1.0, "z is up"), (1 / 9.81, "looks like g"), (1.0, None), (0.0, None)],
)
def test_gravity_of_a_vertical_accelerometer(factor, pattern):
    noise = np.random.default_rng(0).normal(size=TIME.size)
    found = told({"a_z": factor * 9.81 + noise * max(abs(factor), 0.1)})
    assert bool(found) == (pattern is not None)
    assert pattern is None or about(found, "warning", "a_z", pattern)


def motion(seed):
    """An angle of several turns and its rate, the rate with a sensor's noise and offset, the angle in every fifth row."""
    rng = np.random.default_rng(seed)
    rate = np.zeros(TIME.size)
    for frequency in rng.uniform(0.2, 1.5, 3):
        rate += rng.uniform(0.02, 0.1) * np.sin(frequency * TIME + rng.uniform(0, 6))
    angle = np.cumsum(rate) * STEP
    rate = rate + 0.01 * rng.normal(size=TIME.size) + 0.01
    angle[np.arange(TIME.size) % 5 != seed % 5] = np.nan
    return angle, rate


@pytest.mark.parametrize("name", RATES)
@pytest.mark.parametrize("seed", range(3))
def test_an_angle_is_compared_with_its_rate(name, seed):
    angle, rate = motion(seed)
    rate_name = RATES[name]
    both = lambda scale, of_rate=1.0: told({name: scale * angle, rate_name: of_rate * rate, "v_x": 20.0 + np.sin(TIME)})
    assert not both(1.0)
    assert about(both(-1.0), "error", name, f"changes by -.* times {rate_name}.* wrong sign")
    if name == "z":
        assert about(both(0.3048**-1), "warning", name, "wrong unit or scale")
    else:
        assert about(both(180 / np.pi), "error", name, f"{name} looks like degrees\\.")
        assert about(both(1.0, 180 / np.pi), "error", rate_name, f"{rate_name} looks like degrees per second")


@pytest.mark.parametrize("scale", [1.0, -1.0, 180 / np.pi, -180 / np.pi])
@pytest.mark.parametrize("low", [0.0, -0.5])
def test_a_wrapped_heading_is_no_fault_and_a_clockwise_one_is(scale, low):
    """A compass starts at north again after each turn: 0 to 360, or -180 to 180 degrees."""
    angle, rate = motion(5)
    turned = angle + 0.3 * TIME
    turn = 2 * np.pi * abs(scale)
    wrapped = (scale * turned / turn - low) % 1.0 * turn + low * turn
    found = told({"heading": wrapped, "yaw_rate": rate + 0.3, "v_x": 20.0 + np.sin(TIME)})
    found = [one for one in found if "yaw_rate" in one.message]
    if scale == 1.0:
        assert not found
    else:
        pattern = "a compass counts clockwise" if scale < 0 else "looks like degrees"
        assert about(found, "error", "heading", pattern), found


def test_a_direction_over_ground_is_not_compared_where_the_car_stands():
    angle, rate = motion(6)
    lost = np.where(TIME < 30.0, np.random.default_rng(1).uniform(-3, 3, TIME.size), angle)
    v_x = np.where(TIME < 30.0, 0.0, 20.0 + np.sin(TIME))
    rate = np.where(TIME < 30.0, 0.001, rate)
    assert not about(told({"course": lost, "yaw_rate": rate, "v_x": v_x}), "error", "course", "")


@pytest.mark.parametrize(("moving", "count"), [(0.05, 0), (60.0, 1)])
def test_a_sideslip_angle_is_judged_while_the_car_moves(moving, count):
    """An optical sensor shows any angle at standstill; degrees in motion are an error as before."""
    stands = (TIME > 20.0) & (TIME < 40.0)
    sideslip = np.where(stands, np.random.default_rng(2).uniform(-3, 3, TIME.size), moving * np.sin(TIME))
    found = told({"sideslip": sideslip, "v_x": np.where(stands, 0.0, 20.0 + np.sin(TIME))})
    assert len(about(found, "error", "sideslip", "looks like degrees")) == count, found
    assert about(told({"sideslip": sideslip}), "error", "sideslip", "looks like degrees")

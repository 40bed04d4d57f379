"""The check of a log finds each planted fault, and finds nothing in a sound log."""

import dataclasses
import re

import numpy as np
import pytest
from shared_data import shared

from jaxveh import Recording, io
from jaxveh.diagnostics import SEVERITIES, check_log
from jaxveh.diagnostics.log_delays import _correlations, delay

CAR = io.CarSpecification(1500.0, 2600.0, 1.2, 1.5, 90e3, 120e3)
STEP = 0.01


def drive(seconds=60.0, noise=1.0, swing=6.0):
    """A linear single track in fine Euler steps on a wavy course with straights and changing speed, and its sensors."""
    m, I_z, a, b, C_f, C_r = 1500.0, 2600.0, 1.2, 1.5, 90e3, 120e3
    fine = 10
    time = np.arange(round(seconds / STEP) * fine) * STEP / fine
    v_x = 20 + swing * np.sin(0.25 * time)
    steer = 0.025 * np.sin(2 * time) * np.sin(0.3 * time) + 0.02 * np.sin(0.7 * time + 1) * (np.sin(0.1 * time) > 0)
    states = np.zeros((time.size, 2))
    v_y = r = 0.0
    for k, (angle, speed) in enumerate(zip(steer.tolist(), v_x.tolist(), strict=True)):
        states[k] = v_y, r
        F_f, F_r = C_f * (angle - (v_y + a * r) / speed), -C_r * (v_y - b * r) / speed
        v_y += STEP / fine * ((F_f + F_r) / m - speed * r)
        r += STEP / fine * (a * F_f - b * F_r) / I_z
    v_y, r = states.T
    a_y = np.gradient(v_y, time) + v_x * r
    a_x = np.gradient(v_x, time) - v_y * r
    rng = np.random.default_rng(11)
    channels = {}
    for name, values, spread in (
        ("steer", steer, 1e-4),
        ("v_x", v_x, 0.01),
        ("v_y", v_y, 0.005),
        ("yaw_rate", r, 0.002),
        ("a_x", a_x, 0.1),
        ("a_y", a_y, 0.1),
    ):
        channels[name] = values[::fine] + noise * spread * rng.normal(size=values[::fine].size)
    return time[::fine].copy(), channels


@pytest.fixture(scope="module")
def sound():
    return drive()


def findings(time, channels, car=CAR):
    return check_log(Recording(time, channels), car=car)


def matching(found, severity, channel, pattern):
    return [
        finding
        for finding in found
        if finding.severity == severity and finding.channel == channel and re.search(pattern, finding.message)
    ]


def plant(sound, **changes):
    """The sound log with channels replaced by functions of themselves."""
    time, channels = sound
    return time, {**channels, **{name: change(channels[name].copy()) for name, change in changes.items()}}


def at(rows, value):
    def change(values):
        values[rows] = value
        return values

    return change


def late(seconds):
    time = np.arange(6000) * STEP
    return lambda values: np.interp(time - seconds, time, values)


FAULTS = {
    "steer sign": ({"steer": np.negative}, "error", "steer", "opposite .* steer has the wrong sign"),
    "yaw rate sign": ({"yaw_rate": np.negative}, "error", "yaw_rate", "opposite .* yaw_rate has the wrong sign"),
    "a_y sign": ({"a_y": np.negative}, "error", "a_y", "has the wrong sign"),
    "a_x sign": ({"a_x": np.negative}, "error", "a_x", "a_x has the wrong sign"),
    "v_y sign": ({"v_y": np.negative}, "error", "v_y", "v_y has the wrong sign"),
    "yaw rate in deg/s, small": ({"yaw_rate": np.rad2deg}, "error", "yaw_rate", "looks like deg/s"),
    "a_y in g": ({"a_y": lambda v: v / 9.81}, "error", "a_y", "a_y looks like g"),
    "a_x in g": ({"a_x": lambda v: v / 9.81}, "error", "a_x", "a_x looks like g"),
    "v_x in km/h": ({"v_x": lambda v: v * 3.6}, "error", "v_x", "v_x looks like km/h"),
    "v_x in mph": ({"v_x": lambda v: v / 0.44704}, "error", "v_x", "v_x looks like mph"),
    "a_y of odd scale": ({"a_y": lambda v: v * 1.7}, "warning", "a_y", "wrong unit or scale"),
    "a_y biased": ({"a_y": lambda v: v + 0.8}, "warning", "a_y", "a bias of 0.8"),
    "steer in degrees": (
        {"steer": np.rad2deg},
        "error",
        "steer",
        r"needs in gentle turns: it looks like degrees\. Set",
    ),
    "steer of the wheel": (
        {"steer": lambda v: 15 * v},
        "error",
        "steer",
        "steering wheel's angle, with a ratio of about 1[456]",
    ),
    "steer unrelated": (
        {"steer": lambda v: 0.02 * np.random.default_rng(0).normal(size=v.size)},
        "note",
        "steer",
        "little to do with yaw_rate",
    ),
    "infinite": ({"a_x": at([5, 9], np.inf)}, "error", "a_x", r"2 infinite sample\(s\), the first at 0.05 s"),
    "silent": ({"a_x": at(slice(None), np.nan)}, "error", "a_x", "no finite sample at all"),
    "dropouts": ({"a_x": at(slice(100, 180), np.nan)}, "warning", "a_x", r"1 gap\(s\), the longest 0.81 s at 0.99 s"),
    "held samples": ({"a_x": lambda v: np.repeat(v[::4], 4)}, "note", "a_x", "repeats 75% .* about 25 Hz"),
    "frozen": (
        {"a_y": at(slice(100, 300), 1.25)},
        "warning",
        "a_y",
        r"stays constant 1 time\(s\) .*the longest 1.99 s at 1 s",
    ),
    "constant": ({"a_x": at(slice(None), 0.0)}, "note", "a_x", "is constant at 0"),
    "dead yaw rate": (
        {"yaw_rate": at(slice(None), 0.02)},
        "error",
        "yaw_rate",
        "is constant at 0.02 while a_y shows turns",
    ),
    "dead a_y": ({"a_y": at(slice(None), -0.1)}, "error", "a_y", "is constant at -0.1 while yaw_rate shows turns"),
    "coarse": ({"steer": lambda v: np.round(v / 0.002) * 0.002}, "note", "steer", "is quantised in steps of 0.002"),
    "spike": ({"yaw_rate": at(2000, 0.9)}, "warning", "yaw_rate", r"1 spike\(s\), the largest 0.9 at 20 s"),
    "spike to zero": ({"v_x": at([700, 701], 0.0)}, "warning", "v_x", r"2 spike\(s\), the largest 0 at 7 s"),
    "a_y late": ({"a_y": late(0.05)}, "warning", "a_y", r"comes (49|50|51) ms \(.*\) after"),
    "a_y early": ({"a_y": late(-0.045)}, "warning", "a_y", r"comes 4[3-7] ms \(.*\) before"),
    "a_x late": ({"a_x": late(0.15)}, "warning", "a_x", r"comes 1[3-7]. ms \(.*\) after"),
    "yaw rate late": (
        {"yaw_rate": late(0.12)},
        "warning",
        "yaw_rate",
        r"comes 1[12]. ms \(.*\) after the prediction of the car's",
    ),
    "steering offset": ({"steer": lambda v: v + np.deg2rad(0.5)}, "warning", "steer", r"shows \+0.(49|50|51) degrees"),
    "too much grip": ({"a_y": lambda v: 5 * v}, "warning", "a_y", "more than tyres carry"),
}


def test_a_sound_log_is_clean(sound):
    found = findings(*sound)
    assert [finding for finding in found if finding.severity != "ok"] == []
    assert len(found) > 20
    assert {finding.channel for finding in found} >= {"time", "steer", "v_x", "yaw_rate", "a_x", "a_y"}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_found(sound, fault):
    changes, severity, channel, pattern = FAULTS[fault]
    found = findings(*plant(sound, **changes))
    assert matching(found, severity, channel, pattern), "\n".join(map(str, found))
    assert not matching(findings(*sound), severity, channel, pattern)


def test_severities_and_values(sound):
    timeless = plant(sound, a_y=lambda values: np.random.default_rng(3).normal(size=values.size))
    for finding in findings(*timeless) + findings(*plant(sound, steer=np.negative)):
        assert finding.severity in SEVERITIES
        assert finding.message.endswith((".", "?"))
        assert all(np.isfinite(value) for value in finding.values.values())


def test_gaps_jitter_and_slow_channels(sound):
    time, channels = sound
    keep = np.r_[0:1000, 1100:6000]
    found = findings(time[keep], {name: values[keep] for name, values in channels.items()})
    (gap,) = matching(found, "warning", "time", r"1 gap\(s\), the longest 1.01 s at 9.99 s")
    assert gap.values["longest"] == pytest.approx(1.01)
    regular = [finding for finding in found if "is sampled" in finding.message]
    assert [finding.severity for finding in regular] == ["ok"]
    uneven = time + np.random.default_rng(2).uniform(0, 0.004, time.size)
    assert matching(findings(uneven, channels), "note", "time", "unevenly")
    slow = channels["v_x"].copy()
    slow[np.arange(slow.size) % 10 != 0] = np.nan
    found = findings(time, {**channels, "v_x": slow})
    assert matching(found, "ok", "v_x", r"is sampled every 100 ms, 10 Hz \(missing in 90% of the log's rows\)")
    assert not [finding for finding in found if finding.severity in ("warning", "error")]


def test_magnitudes_alone():
    time = np.arange(500) * STEP
    wave = np.sin(time)
    for name, size, likely in (
        ("yaw_rate", 30.0, "deg/s"),
        ("steer", 5.0, "degrees, or the angle of the steering wheel"),
    ):
        assert matching(findings(time, {name: size * wave}), "error", name, f"looks like {likely}")
        assert matching(findings(time, {name: 0.1 * wave}), "ok", name, r"reaches 0\.(1|09)")


def test_a_constant_channel_of_a_straight_drive_is_no_error(sound):
    """Nor one of a car that stands while it is loaded; a sensor of another rate is compared at the times of both."""
    time, channels = sound
    noise = np.random.default_rng(5).normal(size=time.size)
    for name, other, size in (("yaw_rate", "a_y", 0.15), ("a_y", "yaw_rate", 0.005)):
        straight = {**channels, name: 0 * time, other: size * noise}
        standing = {**channels, name: 0 * time, "v_x": 0 * time}
        for quiet in (straight, standing):
            assert not matching(findings(time, quiet), "error", name, "shows turns")
        slow = {
            **channels,
            name: np.where(np.arange(time.size) % 2, 0.0, np.nan),
            "v_x": np.where(np.arange(time.size) % 7, np.nan, channels["v_x"]),
        }
        assert matching(findings(time, slow), "error", name, f"is constant at 0 while {other} shows turns")


def test_smooth_held_and_digital_channels_are_no_faults(sound):
    time, quiet = drive(20.0, noise=0.0)
    assert not [finding for finding in findings(time, quiet) if finding.severity in ("warning", "error")]
    slow = findings(*plant(sound, v_y=lambda values: np.repeat(values[::150], 150)))
    assert matching(slow, "note", "v_y", "repeats 99%")
    assert not matching(slow, "warning", "v_y", "stays constant")
    digital = findings(*plant(sound, yaw_rate=lambda values: np.repeat(np.round(values[::4] / 2e-4) * 2e-4, 4)))
    assert matching(digital, "note", "yaw_rate", "repeats 7[56]%")
    assert not matching(digital, "note", "yaw_rate", "steps of")


def test_turning_slows_without_brakes():
    time, channels = drive(noise=0.0, swing=0.0)
    found = findings(time, channels)
    (line,) = matching(found, "ok", "a_x", "times dv_x/dt")
    assert line.values["slope"] == pytest.approx(1.0, abs=0.15)
    assert matching(found, "ok", "a_x", "ms .* after|before dv_x/dt")


def test_rasters_that_never_share_a_row():
    time, channels = drive(20.0)
    odd = np.arange(time.size) % 2 == 1
    merged = {name: np.where(odd == (name in ("v_x", "steer")), values, np.nan) for name, values in channels.items()}
    found = findings(time, merged)
    assert not [finding for finding in found if finding.severity in ("warning", "error")]
    assert matching(found, "ok", "a_y", r"ms \(.*\) (after|before)")


def test_without_a_car_and_without_v_y(sound):
    time, channels = sound
    few = {name: values for name, values in channels.items() if name != "v_y"}
    found = findings(time, few, None)
    assert matching(found, "note", "a_y", "Without v_y or a car")
    assert matching(found, "note", "yaw_rate", "Without a car, this includes its own response")
    assert not [finding for finding in found if finding.severity in ("warning", "error")]
    known = findings(time, few)
    assert matching(known, "ok", "a_y", "the prediction of the car's linear model from yaw_rate")
    late_a_y = {**few, "a_y": late(0.1)(few["a_y"])}
    assert matching(
        findings(time, late_a_y),
        "warning",
        "a_y",
        r"comes (9.|10.) ms \(.*\) after the prediction of the car.* only if you know",
    )
    in_degrees = {**few, "steer": np.rad2deg(few["steer"])}
    found = findings(time, in_degrees, None)
    assert matching(found, "error", "steer", r"of 2.7 m needs in gentle turns: it looks like degrees\.")
    assert not [finding for finding in found if "runs straight" in finding.message]


def test_a_steering_wheel_is_looked_at_by_the_cars_ratio(sound):
    time, channels = sound
    turned = {name: values for name, values in channels.items() if name != "steer"}
    turned["steering_wheel"] = 16.0 * channels["steer"]
    of_steer = lambda found: [(one.severity, one.channel, one.message) for one in found if "steer" in one.channel]
    told = dataclasses.replace(CAR, steering_ratio=16.0)
    assert set(of_steer(findings(*sound, told))) <= set(of_steer(findings(time, turned, told)))
    assert of_steer(findings(*sound)) and not [one for one in of_steer(findings(time, turned)) if one[1] == "steer"]


def test_an_offset_that_the_car_tells_of(sound):
    told = dataclasses.replace(CAR, steer_offset=np.deg2rad(0.5))
    shifted = plant(sound, steer=lambda values: values + np.deg2rad(0.5))
    assert matching(findings(*shifted, told), "ok", "steer", r"the car file has \+0.50")
    assert matching(findings(*sound, told), "warning", "steer", r"the car file has \+0.50")


def test_understeer_of_another_car(sound):
    other = dataclasses.replace(CAR, front_cornering_stiffness=45e3)
    assert matching(findings(*sound, other), "warning", "steer", r"understeer gradient .* Check stiffnesses")
    (right,) = matching(findings(*sound), "ok", "steer", "understeer gradient")
    assert right.values["measured"] == pytest.approx(right.values["expected"], abs=2e-5)


@pytest.mark.parametrize("late", [0.05, 0.1, 0.15])
@pytest.mark.parametrize("faster", [0.5, 1.0, 1.5])
def test_tight_and_quickly_steered_turns_show_no_understeer_that_is_not_there(late, faster):
    """Junctions: the car turns in slowly and leaves `faster` (m/s^2), and its yaw rate comes `late` (s) after the steer."""
    time, _ = drive()
    part = time % 10.0
    v_x = 5.0 + faster * np.minimum(part, 10.0 - part)
    side = np.where((time // 10.0) % 2 == 0, 0.1, -0.1)
    steer = side * np.where(part < 4.0, np.sin(np.pi * part / 4.0) ** 2, 0.0)
    yaw_rate = v_x * np.interp(time - late, time, steer) / (2.7 + 0.0037 * v_x**2)
    found = findings(time, {"v_x": v_x, "steer": steer, "yaw_rate": yaw_rate, "a_y": v_x * yaw_rate})
    (understeer,) = matching(found, "ok", "steer", "understeer gradient")
    assert understeer.values["measured"] == pytest.approx(0.0037, abs=7e-4)


def test_a_file_that_oversteers_is_no_reference_for_a_delay(sound):
    other = dataclasses.replace(CAR, front_cornering_stiffness=120e3, rear_cornering_stiffness=80e3)
    assert not matching(findings(*sound, other), "warning", "yaw_rate", "ms")
    assert matching(findings(*sound, other), "note", "yaw_rate", "file oversteers|no clear delay")


@pytest.mark.parametrize(("front", "rear"), [(1.3, 0.7), (0.7, 1.3), (1.6, 0.6)])
def test_a_file_with_wrong_stiffnesses_is_not_taken_for_a_wrong_scale_of_the_steer(sound, front, rear):
    """With the first and the last the file's car oversteers, so that at speed it needs no steer, or one to the other side."""
    other = dataclasses.replace(
        CAR,
        front_cornering_stiffness=front * CAR.front_cornering_stiffness,
        rear_cornering_stiffness=rear * CAR.rear_cornering_stiffness,
    )
    # On a motorway the steer is mostly understeer.
    time = np.arange(6000) * STEP
    yaw_rate = 2.0 / 35.0 * np.sin(0.5 * time)
    steer = (2.7 / 35.0 + 0.0037 * 35.0) * yaw_rate
    fast = time, {"v_x": np.full(6000, 35.0), "steer": steer, "yaw_rate": yaw_rate, "a_y": 35.0 * yaw_rate}
    for log in (sound, fast):
        found = findings(*log, other)
        assert not [one for one in found if one.severity == "error"], found
    # A scale that is wrong still is.
    assert matching(findings(*plant(sound, steer=np.rad2deg), other), "error", "steer", "looks like degrees")


def test_a_car_that_countersteers_has_no_steer_of_the_wrong_sign(sound):
    """Half of the time it slides, and is steered against its turn."""
    time, channels = sound
    hard = 12.0 * np.sin(0.9 * time) / channels["v_x"]
    slides = (time > 15.0) & (np.abs(hard * channels["v_x"]) > 3.2)
    slid = {
        **channels,
        "yaw_rate": np.where(slides, hard, channels["yaw_rate"]),
        "steer": np.where(slides, -hard, channels["steer"]),
    }
    found = findings(time, slid)
    assert matching(found, "note", "steer", "but not in gentle turns: a car that slides")
    assert not matching(found, "error", "steer", "wrong sign")


def test_a_car_that_drives_in_bends_has_no_late_a_x_for_want_of_v_y():
    """Slow, tight bends: a_x contains v_y yaw_rate."""
    time, _ = drive(swing=1.0)
    v_x, bend = 5.0 + 0.3 * np.sin(0.25 * time), 0.12 * np.sin(0.4 * time)
    yaw_rate = v_x * bend
    v_y = CAR.rear_axle_to_cg * yaw_rate
    a_x = np.gradient(v_x, time) - v_y * yaw_rate
    log = {
        "v_x": v_x,
        "yaw_rate": yaw_rate,
        "a_x": a_x,
        "a_y": np.gradient(v_y, time) + v_x * yaw_rate,
        "steer": 2.7 * bend,
    }
    (found,) = [
        one for one in findings(time, log) if one.channel == "a_x" and "dv_x/dt" in one.message and "ms" in one.message
    ]
    assert found.severity == "ok" and abs(found.values["seconds"]) < 0.01


def test_only_gentle_turns_tell_of_understeer(sound):
    hard = np.abs(sound[1]["v_x"] * sound[1]["yaw_rate"]) > 2.9
    found = findings(*plant(sound, steer=lambda values: np.where(hard, 1.5 * values, values)))
    (gentle,) = matching(found, "ok", "steer", "understeer gradient")
    assert gentle.values["measured"] == pytest.approx(gentle.values["expected"], abs=6e-4)


def test_a_car_file_in_wrong_units(sound):
    per_degree = dataclasses.replace(CAR, front_cornering_stiffness=90e3 * np.pi / 180)
    found = findings(*sound, per_degree)
    assert matching(found, "warning", "front_cornering_stiffness", "N/deg instead of N/rad")
    assert matching(found, "ok", "rear_cornering_stiffness", "times the axle's load")
    heavy = dataclasses.replace(CAR, yaw_inertia=26000.0)
    assert matching(findings(*sound, heavy), "warning", "yaw_inertia", "cars have 0.4 to 2")


def test_bias_at_standstill(sound):
    time, channels = sound
    standing = {name: np.r_[np.random.default_rng(5).normal(size=500) * 1e-4, v] for name, v in channels.items()}
    longer = np.arange(time.size + 500) * STEP
    assert matching(findings(longer, standing), "ok", "yaw_rate", "at standstill")
    standing["yaw_rate"] = standing["yaw_rate"] + 0.02
    assert matching(findings(longer, standing), "warning", "yaw_rate", r"shows \+0.02 rad/s at standstill")


def test_delay_is_finer_than_a_sample():
    time = np.arange(3000) * STEP
    wave = sum(np.sin(w * time + w) for w in (0.7, 1.9, 3.1, 5.3))
    for seconds in (0.0, 0.0337, -0.0712, 0.2):
        shifted = sum(np.sin(w * (time - seconds) + w) for w in (0.7, 1.9, 3.1, 5.3))
        found = delay(wave, shifted, STEP)
        assert found.seconds == pytest.approx(seconds, abs=1e-3)
        assert found.correlation > 0.999
        assert found.error < 1e-3
    assert np.isnan(delay(wave, np.zeros_like(wave), STEP).seconds)
    assert np.isnan(delay(time, np.zeros_like(wave), STEP).seconds)


def test_correlations_over_what_both_know():
    rng = np.random.default_rng(4)
    reference, signal = rng.normal([[5.0], [-3.0]], 1.0, (2, 200))
    reference[rng.random(200) < 0.2] = signal[rng.random(200) < 0.3] = np.nan
    found = _correlations(reference, signal, 7)
    for lag in range(-7, 8):
        pairs = np.array([(reference[k], signal[k + lag]) for k in range(200) if 0 <= k + lag < 200])
        pairs = pairs[np.isfinite(pairs).all(axis=1)]
        assert found[lag + 7] == pytest.approx(np.corrcoef(pairs.T)[0, 1], abs=1e-12)


def test_the_error_of_a_delay_is_honest():
    time, rng = np.arange(3000) * STEP, np.random.default_rng(1)
    wave = np.sin(0.5 * time) + 0.3 * np.sin(1.3 * time)
    blocks = [np.repeat(rng.normal(size=150), 20) for _ in range(200)]  # noise that lasts `ALIKE_ROWS`
    found = [delay(wave, np.interp(time - 0.05, time, wave) + 0.3 * noise, STEP) for noise in blocks]
    scores = np.array([(one.seconds - 0.05) / one.error for one in found])
    assert 0.7 < np.std(scores) < 1.4
    assert abs(np.mean(scores)) < 0.3


def test_short_and_poor_logs_give_findings_not_failures():
    assert matching(findings([0.0], {"v_x": [1.0]}), "error", "time", "has only 1 sample")
    short = {name: values[:30] for name, values in drive(1.0)[1].items()}
    assert matching(findings(np.arange(30) * STEP, short), "note", "steer", "are not checked")
    assert findings([0.0, 1.0], {"pressure": [1.0, 2.0]})
    assert findings(np.arange(50.0), {"v_x": np.zeros(50), "yaw_rate": np.zeros(50), "a_y": np.zeros(50)})


def test_a_delay_within_its_own_error_is_no_fault(sound):
    noise = np.random.default_rng(0).normal(scale=3.0, size=6000)
    found = findings(*plant(sound, a_x=lambda values: values + noise))
    (timed,) = matching(found, "ok", "a_x", "ms .* (after|before) dv_x/dt")
    assert 0.3 < abs(timed.values["seconds"]) < 2 * timed.values["error"]


def test_truth_is_not_looked_at(sound):
    time, channels = sound
    channels = {**channels, "true.v_y": np.full(time.size, np.inf)}
    assert [finding for finding in findings(time, channels) if finding.severity != "ok"] == []


def test_the_shared_log():
    recording = io.read_recording(shared("ferrari_250lm_100hz.csv"))
    found = check_log(recording, car=io.read_car(shared("ferrari_250lm.toml")))
    assert not [finding for finding in found if finding.severity == "error"]
    assert matching(found, "warning", "steer", r"1 spike\(s\), the largest 0.1356 at 207.27 s")
    assert matching(found, "note", "yaw_rate", "repeats 12% of its samples")
    assert matching(found, "ok", "steer", r"shows -0.09 degrees")
    assert matching(found, "ok", "a_y", r"comes . ms \(.*\) after v_x yaw_rate")
    assert {finding.channel for finding in found if finding.severity == "warning"} == {
        "steer",
        "steer_left",
        "steer_right",
    }


def test_wheel_speeds_say_what_unit_the_speed_has(sound):
    time, channels = sound
    wheels = {f"wheel_speed_{at}": channels["v_x"] * 1.01 for at in ("fl", "fr", "rl", "rr")}
    assert matching(findings(time, {**channels, **wheels}), "ok", "v_x", r"the wheels' speeds are 1\.01 times v_x")
    fast = {**channels, **wheels, "v_x": 3.6 * channels["v_x"]}
    assert matching(
        findings(time, fast), "error", "v_x", r"the wheels' speeds are 0\.281 times v_x: v_x looks like km/h"
    )
    spins = {name: values / 0.31 for name, values in wheels.items()}
    assert matching(findings(time, {**channels, **spins}), "warning", "v_x", "the wheels in rad/s or km/h")
    # What the wheels confirm is not made wrong by an acceleration of another scale.
    odd = findings(time, {**channels, **wheels, "a_y": channels["a_y"] / 3.6})
    assert matching(odd, "warning", "a_y", r"is 0\.2\d+ times v_x yaw_rate .*, but the wheels confirm v_x")
    assert not matching(odd, "error", "v_x", "")


def test_a_small_car_is_compared_at_its_own_speeds(sound):
    time, channels = sound
    small = dataclasses.replace(CAR, front_axle_to_cg=0.12, rear_axle_to_cg=0.15)
    slow = {**channels, "v_x": 0.15 * channels["v_x"], "a_y": -0.15 * channels["a_y"]}
    assert matching(findings(time, slow, small), "error", "a_y", "wrong sign")
    assert not matching(findings(time, slow), "error", "a_y", "wrong sign")


def test_pedals_and_cars_that_stand_raise_no_alarm(sound):
    time, channels = sound
    pedal = np.where(np.sin(0.4 * time) > 0, np.abs(np.sin(3 * time)), 0.0)
    found = findings(time, {**channels, "throttle": pedal, "wheel_speed_fl": channels["v_x"] * (time > 20)})
    for channel in ("throttle", "wheel_speed_fl"):
        assert matching(found, "note", channel, "stays constant")
        assert not matching(found, "warning", channel, "")
    dropped = np.abs(np.sin(3 * time))
    dropped[1000] = 9.0
    found = findings(time, {**channels, "throttle": dropped, "oil": dropped})
    assert matching(found, "note", "throttle", "spike") and not matching(found, "warning", "throttle", "")
    assert matching(found, "warning", "oil", "spike")
    parked = {name: np.where(time < 5, 0.0, values) for name, values in channels.items()}
    assert not matching(findings(time, parked), "warning", "yaw_rate", "stays constant")
    moving = {**channels, "yaw_rate": np.where(time < 5, 0.0, channels["yaw_rate"])}
    assert matching(findings(time, moving), "warning", "yaw_rate", "stays constant")


def test_time_in_milliseconds_is_an_error(sound):
    time, channels = sound
    assert matching(findings(1e3 * time, channels), "error", "time", "looks like milliseconds")


CLOCKS = {"nanoseconds": 1e9, "microseconds": 1e6, "milliseconds": 1e3, "hours": 1 / 3600, "days": 1 / 86400}
# A step of 1 may be a second, and one of 28 microseconds is that of a logger of vibrations.
DOUBTFUL = {("milliseconds", 1000.0), ("hours", 10.0)}


@pytest.mark.parametrize("unit", CLOCKS)
def test_a_clock_in_another_unit_is_named(unit):
    for rate in (10.0, 50.0, 100.0, 250.0, 1000.0):
        time = CLOCKS[unit] * np.arange(200) / rate
        found = findings(time, {"v_x": 20 + np.sin(np.arange(200))})
        told = matching(
            found, "error", "time", f"it looks like {unit if unit.endswith('seconds') else 'hours or days'}"
        )
        assert bool(told) == ((unit, rate) not in DOUBTFUL), (unit, rate)


@pytest.mark.parametrize("rate", [0.6, 1.0, 2.0, 5.0, 10.0, 1000.0])
def test_steps_too_long_to_see_the_motion_ask_for_the_unit(rate):
    """A count of rows, milliseconds at 1 kHz, or a logger of a fleet; a slow channel of a quicker log is not meant."""
    time, speed = np.arange(200) / rate, 20 + np.sin(np.arange(200))
    told = matching(findings(time, {"v_x": speed}), "warning", "time", "does it count rows")
    assert bool(told) == (rate <= 2.0)
    fine, seldom = np.arange(4000) / (20 * rate), np.where(np.arange(4000) % 20 == 0, np.repeat(speed, 20), np.nan)
    assert not matching(
        findings(fine, {"v_x": np.repeat(speed, 20), "x": seldom}), "warning", "x", "does it count rows"
    )


@pytest.mark.parametrize("rate", [1.0, 10.0, 1000.0, 20_000.0])
def test_a_clock_in_seconds_is_no_fault(rate):
    time = np.arange(200) / rate
    assert not matching(findings(time, {"v_x": 20 + np.sin(np.arange(200))}), "error", "time", "looks like")


SPELLINGS = {
    "v_x": ("V_x", "vx", "Vx", "V X"),
    "yaw_rate": ("YawRate", "yawrate", "Yaw Rate"),
    "a_y": ("ay", "Ay", "A_Y"),
}


@pytest.mark.parametrize("name", SPELLINGS)
def test_names_that_look_like_known_ones_are_told_of(sound, name):
    time, channels = sound
    for spelling in SPELLINGS[name]:
        other = {spelling if one == name else one: values for one, values in channels.items()}
        assert matching(findings(time, other), "warning", spelling, f"is not used: the name of this channel is {name}")
    # Beside the channel itself it is another one.
    both = findings(time, {**channels, spelling: channels[name]})
    assert not matching(both, "warning", spelling, "is not used")


def test_a_log_without_any_known_name(sound):
    time, channels = sound
    strange = {f"signal {k}": values for k, values in enumerate(channels.values())}
    assert matching(findings(time, strange, None), "warning", "names", "none of the log's channels has a known name")


def test_a_slope_that_is_loosely_followed_is_no_unit(sound):
    """A channel that is zero half of the time has a third of the slope, as km/h would have for m/s."""
    time, channels = plant(sound)
    a_y = np.array(channels["a_y"])
    for begin in range(0, len(a_y), 1200):
        a_y[begin : begin + 660] = 0.0
    found = findings(time, {**channels, "a_y": a_y})
    loose = [one for one in found if one.channel == "a_y" and "follows it loosely" in one.message]
    assert not [one for one in found if "looks like mph" in one.message or "looks like km/h" in one.message]
    assert [one.severity for one in loose] == ["warning"]
    mph = findings(time, {**channels, "v_x": np.asarray(channels["v_x"]) / 0.44704})
    assert matching(mph, "error", "v_x", "looks like mph")


def spun(a_y_rate):
    """a_y and v_x yaw_rate of a car that slides, from the rate of its lateral speed."""
    time = np.arange(0.0, 40.0, STEP)
    turn = 20.0 * np.sin(0.8 * time)
    slides = np.clip((time - 10.0) / 2.0, 0.0, 1.0)
    return time, turn, turn - slides * a_y_rate(time, turn)


@pytest.mark.parametrize(
    "a_y_rate",
    [lambda t, turn: 0.6 * turn + 4.0, lambda t, turn: 0.55 * turn, lambda t, turn: 1.4 * turn],
    ids=["one turn", "slalom", "against the turn"],
)
def test_a_car_that_slides_has_no_wrong_unit_or_sign(a_y_rate):
    """The first 9 s are driven gently; then v_x yaw_rate turns the car further than the tyres' force."""
    time, turn, a_y = spun(a_y_rate)
    gently = np.where(time < 9.0, 0.12, 1.0)
    rng = np.random.default_rng(2)
    noisy = lambda values, std: values + std * rng.normal(size=time.size)
    channels = {
        "v_x": np.full(time.size, 20.0),
        "yaw_rate": noisy(gently * turn / 20.0, 1e-3),
        "a_y": noisy(gently * a_y, 0.05),
    }
    found = findings(time, channels, None)
    assert not [one for one in found if one.severity == "error"], found
    for wrong in ({"v_x": channels["v_x"] / 0.44704}, {"a_y": -channels["a_y"]}):
        gentle = {name: values[: time.searchsorted(9.0)] for name, values in (channels | wrong).items()}
        assert [one for one in findings(time[: time.searchsorted(9.0)], gentle, None) if one.severity == "error"]

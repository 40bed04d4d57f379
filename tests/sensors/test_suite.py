"""Suites: union of instants, alignment, delays, one key for all, ready-made cars."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from sensor_truth import truth

from jaxveh import InputError, Recording, sensors
from jaxveh.sensors import GNSS, IMU, Dropout, OpticalSideslip, Renamed, Signal, SteeringAngle, Suite, WheelSpeeds
from jaxveh.sensors.suite import device_keys

pytestmark = pytest.mark.product

KEY = jax.random.key(11)
STEER = SteeringAngle(rate=10.0, delay=0.05)
SIDE = IMU(dict.fromkeys(("a_x", "a_y"), Signal(noise=0.1)), rate=4.0, phase=0.1)


def drive(times, dtype=jnp.float64):
    """The truth of a car that neither rolls nor pitches on a level road."""
    return {n: v for n, v in truth(times, dtype).items() if n not in (*IMU(rate=1.0).may_use, "steering_wheel")}


def record(suite, duration=1.0, key=KEY, dtype=jnp.float64):
    times = suite.look_times(duration)
    return suite.record(times, drive(times, dtype), duration, key)


def test_instants_are_the_union_of_all_devices():
    suite = Suite((STEER, SIDE))
    spoken = [0, 0.1, 0.2, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 1.0]
    np.testing.assert_allclose(suite.sample_times(1.0), spoken, atol=1e-12)
    looked = [0, 0.05, 0.1, 0.15, 0.25, 0.35, 0.45, 0.55, 0.6, 0.65, 0.75, 0.85, 0.95]
    np.testing.assert_allclose(suite.look_times(1.0), looked, atol=1e-12)


def test_instants_that_differ_by_rounding_are_one():
    """A third of a second is not a number; 3 Hz and 30 Hz meet where 10 / 30 and 1 / 3 + 1e-12 do."""
    suite = Suite((SteeringAngle(rate=3.0, phase=1e-12), IMU(rate=30.0)))
    assert suite.sample_times(10.0).size == 301
    assert np.isfinite(record(suite, 10.0).channels["steer"]).sum() == 31


def test_each_channel_says_the_truth_of_its_delay_ago_and_nothing_between():
    found = record(Suite((STEER, SIDE)), key=None)
    at = lambda t: drive(np.maximum(t, 0.0))
    speaks = np.isin(np.round(found.times, 9), np.round(np.arange(11) / 10, 9))
    np.testing.assert_array_equal(np.isfinite(found.channels["steer"]), speaks)
    np.testing.assert_allclose(found.channels["steer"][speaks], at(found.times[speaks] - 0.05)["steer"], rtol=1e-12)
    side = np.isfinite(found.channels["a_y"])
    np.testing.assert_allclose(found.times[side], [0.1, 0.35, 0.6, 0.85], rtol=1e-12)
    np.testing.assert_allclose(found.channels["a_y"][side], at(found.times[side])["a_y"], rtol=1e-12)
    assert found.units == {"steer": "rad", "a_x": "m/s^2", "a_y": "m/s^2"}
    assert list(found.channels) == ["steer", "a_x", "a_y"]


def test_a_device_is_read_as_it_would_be_alone():
    suite = Suite((STEER, SIDE))
    found = record(suite)
    alone = SIDE.read(SIDE.sample_times(1.0), drive(SIDE.look_times(1.0)), device_keys(suite.devices, KEY)[1])
    for name in ("a_x", "a_y"):
        np.testing.assert_allclose(found.channels[name][np.isfinite(found.channels[name])], alone[name], rtol=1e-12)


def test_the_truth_may_have_more_instants_than_are_looked_at():
    suite = Suite((STEER, SIDE))
    fine = np.union1d(suite.look_times(1.0), np.linspace(0, 1.3, 77))
    found, expected = suite.record(fine, drive(fine), 1.0, KEY), record(suite)
    for name in suite.channels:
        np.testing.assert_array_equal(found.channels[name], expected.channels[name])


def test_two_equal_devices_have_noise_of_their_own():
    noisy = SteeringAngle(Signal(noise=0.1), rate=10.0)
    found = record(Suite((noisy, Renamed(noisy, {"steer": "second"}))))
    assert not np.any(found.channels["steer"] == found.channels["second"])


def heard(devices, name):
    """What the suite of these devices says of a channel, where it says something."""
    value = record(Suite(devices)).channels[name]
    return np.asarray(value[np.isfinite(value)])


@pytest.mark.parametrize(
    "others",
    [
        lambda side: (STEER, side),
        lambda side: (side, GNSS(0.1, rate=5.0), STEER),
        lambda side: (Dropout(side, "a_x", probability=0.5), STEER),
        lambda side: (IMU({"a_x": Signal(), **side.signals, "yaw_rate": Signal(noise=0.1)}, rate=4.0, phase=0.1),),
    ],
    ids=["before", "after", "fault", "channel"],
)
def test_other_devices_channels_and_faults_leave_a_devices_noise_as_it_is(others):
    side = IMU({"a_y": Signal(noise=0.1)}, rate=4.0, phase=0.1)
    several = others(IMU(dict.fromkeys(("a_x", "a_y"), Signal(noise=0.1)), rate=4.0, phase=0.1))
    np.testing.assert_array_equal(heard((side,), "a_y"), heard(several, "a_y"))


def test_a_wheel_more_leaves_the_noise_of_the_others():
    wheels = lambda *names: WheelSpeeds(dict.fromkeys(names, Signal(noise=0.1)), tooth_error=0.05, rate=20.0)
    alone = heard((wheels("omega_rl"),), "omega_rl")
    np.testing.assert_allclose(heard((wheels("omega_fl", "omega_rl", "omega_rr"),), "omega_rl"), alone, rtol=1e-12)


def test_no_devices_key_is_one_that_the_caller_may_fold():
    keys = np.array([jax.random.key_data(key) for key in device_keys((STEER, SIDE, SIDE, GNSS(rate=5.0)), KEY)])
    folded = np.array([jax.random.key_data(jax.random.fold_in(KEY, number)) for number in range(20)])
    assert not (keys[:, None] == folded).all(axis=-1).any()
    assert len(np.unique(keys, axis=0)) == 4


def test_keys_by_name_are_the_same_without_64_bits(float32):
    assert all(jax.random.key_data(key).dtype == np.uint32 for key in device_keys((STEER, SIDE), KEY))


def test_a_table_becomes_a_recording():
    found = record(Suite((STEER, SIDE)))
    recording = Recording(found.times, found.channels, found.units, "test")
    assert recording.unit("a_x") == "m/s^2" and len(recording) == found.times.size


def test_float32_truth_gives_float32_channels():
    found = record(Suite((STEER, SIDE)), dtype=jnp.float32)
    assert all(value.dtype == jnp.float32 for value in found.channels.values())


def test_a_table_may_be_jitted_and_batched_over_keys():
    suite = Suite((STEER, SIDE))
    times = suite.look_times(1.0)
    outputs = drive(times)
    channels = lambda key, outputs: suite.record(times, outputs, 1.0, key).channels
    batch = jax.jit(jax.vmap(channels, in_axes=(0, None)))(jax.random.split(KEY, 3), outputs)
    single = channels(jax.random.split(KEY, 3)[2], outputs)
    for name in suite.channels:
        np.testing.assert_allclose(batch[name][2], single[name], rtol=1e-9)
    assert np.ptp(batch["a_y"][:, 1]) > 0 and np.ptp(batch["steer"][:, 0]) == 0


def test_a_table_may_be_differentiated():
    suite = Suite((STEER, SIDE))
    times = suite.look_times(1.0)

    def total(bias):
        changed = eqx.tree_at(lambda s: s.devices[1].signals["a_y"].bias, suite, bias)
        return jnp.nansum(changed.record(times, drive(times), 1.0, KEY).channels["a_y"] ** 2)

    # Values and gradients by one program.
    both, bias, step = jax.jit(jax.value_and_grad(total)), 0.2, 1e-5
    expected = (float(both(bias + step)[0]) - float(both(bias - step)[0])) / (2 * step)
    np.testing.assert_allclose(both(bias)[1], expected, rtol=1e-7)


def test_a_device_that_never_speaks_is_silent():
    suite = Suite((STEER, GNSS(rate=5.0, phase=3.0)))
    found = record(suite)
    assert np.isnan(found.channels["speed"]).all() and np.isfinite(found.channels["steer"]).all()
    assert found.channels["speed"].shape == found.times.shape


class Outputs(NamedTuple):
    steer: jnp.ndarray


def test_outputs_may_be_a_named_tuple():
    times = STEER.look_times(1.0)
    found = Suite(STEER).record(np.unique(times), Outputs(jnp.asarray(np.unique(times))), 1.0)
    np.testing.assert_allclose(found.channels["steer"], times, rtol=1e-12)


@pytest.mark.parametrize(
    ("make", "options"),
    [
        (sensors.production_car, {}),
        (sensors.production_car, {"wheel_radius": 0.3, "steering_ratio": 16.0}),
        (sensors.proving_ground_car, {"wheel_radius": 0.3}),
    ],
)
def test_ready_made_cars_speak(make, options):
    suite = make(**options)
    found = record(suite, 2.0)
    clean = record(suite, 2.0, None)
    assert ("wheel_speed_rl" in suite.channels) == ("wheel_radius" in options)
    assert ("steering_wheel" in suite.channels) == ("steering_ratio" in options)
    for name, value in found.channels.items():
        heard = np.isfinite(value)
        assert heard.sum() >= 10 and found.units[name]
        assert np.max(np.abs(np.asarray(value - clean.channels[name])[heard])) < 2.0


def test_a_production_car_without_extras_suits_a_single_track():
    suite = sensors.production_car(gnss=False)
    assert set(suite.needs) == {"a_x", "a_y", "yaw_rate", "yaw_acceleration", "steer"}
    assert "roll" in suite.may_use and not set(suite.may_use) & set(suite.needs)


def bad_times(times):
    return Suite(STEER).record(times, {"steer": jnp.zeros(np.shape(times))}, 1.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Suite(()), "Suite: no device"),
        (lambda: Suite((STEER, 3)), "device 1 = 3: must be a device"),
        (
            lambda: Suite((OpticalSideslip(rate=1.0), OpticalSideslip("v_y", rate=1.0))),
            r'both have v_y: every channel needs a name of its own\. Rename one: Renamed\(OpticalSideslip\(\.\.\.\), \{"v_y"',
        ),
        (
            lambda: Suite(SIDE).record([0.0, 1.0], {"a_x": jnp.zeros(2), "a_y": jnp.zeros(2)}, 1.0),
            "IMU needs yaw_rate, yaw_acceleration, which this car does not have; there are: a_x, a_y",
        ),
        (lambda: bad_times(np.linspace(0, 1, 11)), r"SteeringAngle measures at t = 0\.05 s, which is not among the 11"),
        (
            lambda: bad_times([0.0, 0.05, 0.15]),
            r"measures at t = 0\.25 s, .*from 0 to 0\.15 s\. Save the car's outputs",
        ),
        (lambda: bad_times([0.0, 0.0]), r"truth_times of shape \(2,\): must be \(N,\), finite and strictly"),
        (lambda: bad_times([0.0, np.nan]), "finite and strictly increasing"),
        (
            lambda: Suite(STEER).record([0.0, 1.0], {"steer": jnp.zeros(3)}, 1.0),
            r"steer has shape \(3,\), truth_times has \(2,\)",
        ),
        (
            lambda: Suite(SIDE).record([0.0], drive(np.zeros(1)), 0.05),
            r"no device sends a sample within the duration = 0\.05",
        ),
        (lambda: jax.jit(bad_times)(jnp.arange(3.0)), "truth_times is traced"),
    ],
)
def test_bad_input_raises_by_name_value_and_range(make, message):
    with pytest.raises(InputError, match=message):
        make()

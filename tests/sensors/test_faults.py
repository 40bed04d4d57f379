"""Faults: exactly what they say, where they say, and nothing else."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from sensor_truth import truth

from jaxveh import InputError
from jaxveh.sensors import IMU, BiasStep, Dropout, Renamed, Signal, Spikes, Stuck

NOISY = IMU(dict.fromkeys(("a_x", "a_y", "yaw_rate"), Signal(noise=0.1)), rate=100.0)
KEY = jax.random.key(7)


def heard(device, key=KEY, duration=2.0):
    times = device.sample_times(duration)
    said = device.read(times, truth(device.look_times(duration)), key)
    return times, {name: np.asarray(value) for name, value in said.items()}


@pytest.fixture(scope="module")
def healthy():
    """What it says without a fault."""
    return heard(NOISY)[1]


def changes(device, key=KEY, duration=2.0):
    """What a fault adds to each channel of the same drive with the same noise."""
    _, sound = heard(NOISY, key, duration)
    return {name: value - sound[name] for name, value in heard(device, key, duration)[1].items()}


def test_a_step_begins_at_its_time_in_its_channel_alone():
    found = changes(BiasStep(NOISY, "a_y", at=0.3, size=0.5))
    np.testing.assert_allclose(found["a_y"], np.where(np.arange(201) >= 30, 0.5, 0.0), atol=1e-12)
    assert not found["a_x"].any() and not found["yaw_rate"].any()


def test_a_stuck_channel_says_its_last_value(healthy):
    said = heard(Stuck(NOISY, ("a_x", "yaw_rate"), 0.5, 0.8))[1]
    for name in ("a_x", "yaw_rate"):
        np.testing.assert_array_equal(said[name][50:80], healthy[name][49])
        np.testing.assert_array_equal(np.delete(said[name], slice(50, 80)), np.delete(healthy[name], slice(50, 80)))
    np.testing.assert_array_equal(said["a_y"], healthy["a_y"])


def test_a_channel_that_is_stuck_from_the_start_says_its_first_value(healthy):
    said = heard(Stuck(NOISY, "a_x", 0.0))[1]
    np.testing.assert_array_equal(said["a_x"], healthy["a_x"][0])


def test_spikes_come_as_often_and_as_large_as_they_should():
    found = changes(Spikes(NOISY, ("a_x", "a_y"), 0.1, 3.0), duration=200.0)
    for name in ("a_x", "a_y"):
        hit = np.abs(found[name]) > 1e-9
        np.testing.assert_allclose(np.abs(found[name][hit]), 3.0, rtol=1e-9)
        assert abs(hit.mean() - 0.1) < 4 * np.sqrt(0.09 / 20001)
        assert abs(np.mean(found[name][hit] > 0) - 0.5) < 4 * 0.5 / np.sqrt(hit.sum())
    both = (np.abs(found["a_x"]) > 1e-9) & (np.abs(found["a_y"]) > 1e-9)
    assert abs(both.mean() - 0.01) < 4 * np.sqrt(0.01 / 20001)
    assert not found["yaw_rate"].any()


def test_spikes_of_a_channel_stay_where_they_are_with_another_channel_in_the_device():
    alone = Spikes(IMU("a_y", rate=100.0), "a_y", 0.3, 1.0)
    several = Spikes(IMU(("a_x", "a_y"), rate=100.0), ("a_x", "a_y"), 0.3, 1.0)
    np.testing.assert_array_equal(heard(alone)[1]["a_y"], heard(several)[1]["a_y"])


def test_faults_around_faults_draw_numbers_of_their_own():
    twice = Spikes(Renamed(Spikes(NOISY, "a_x", 0.3, 1.0), {}), "a_x", 0.3, 10.0)
    found = changes(twice)["a_x"]
    kinds = {-11, -10, -9, -1, 0, 1, 9, 10, 11}
    assert {int(value) for value in np.unique(np.round(found))} == kinds


def test_dropouts_are_silent_in_their_spans(healthy):
    said = heard(Dropout(NOISY, "a_x", spans=((0.5, 0.6), (1.9, np.inf))))[1]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(said["a_x"])), [*range(50, 60), *range(190, 201)])
    kept = np.isfinite(said["a_x"])
    np.testing.assert_array_equal(said["a_x"][kept], healthy["a_x"][kept])
    np.testing.assert_array_equal(said["a_y"], healthy["a_y"])


def test_a_lost_message_takes_all_its_channels():
    said = heard(Dropout(NOISY, probability=0.2), duration=200.0)[1]
    lost = np.isnan(said["a_x"])
    assert abs(lost.mean() - 0.2) < 4 * np.sqrt(0.16 / 20001)
    for value in said.values():
        np.testing.assert_array_equal(np.isnan(value), lost)


def test_without_a_key_random_faults_do_not_come():
    quiet = heard(NOISY, None)[1]
    for device in (Spikes(NOISY, "a_x", 1.0, 3.0), Dropout(NOISY, "a_x", probability=1.0)):
        np.testing.assert_array_equal(heard(device, None)[1]["a_x"], quiet["a_x"])


def test_onsets_and_sizes_may_be_batched_and_differentiated(healthy):
    times, outputs = NOISY.sample_times(2.0), truth(NOISY.look_times(2.0))
    one = lambda at, size: BiasStep(NOISY, "a_y", at, size).read(times, outputs, KEY)["a_y"]
    batch = np.asarray(jax.jit(jax.vmap(one))(np.array([0.3, 1.5]), np.array([0.5, -2.0])))
    np.testing.assert_allclose(batch[1] - healthy["a_y"], np.where(np.arange(201) >= 150, -2.0, 0.0), atol=1e-12)
    slope = jax.jit(jax.grad(lambda size: jnp.sum(one(jnp.asarray(0.3), size))))(0.5)
    np.testing.assert_allclose(slope, 171.0, rtol=1e-12)


def test_a_renamed_device_says_the_same_under_other_names(healthy):
    device = Renamed(NOISY, {"a_x": "second_a_x"})
    assert device.channels == ("second_a_x", "a_y", "yaw_rate") and device.units["second_a_x"] == "m/s^2"
    np.testing.assert_array_equal(heard(device)[1]["second_a_x"], healthy["a_x"])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: BiasStep(NOISY, "a_z", 1.0, 1.0), r"BiasStep\.channel: unknown name\(s\) a_z; there are: a_x, a_y"),
        (lambda: BiasStep(NOISY, "a_x", np.nan, 1.0), r"BiasStep\.at = nan: must be finite"),
        (lambda: BiasStep("imu", "a_x", 1.0, 1.0), r"BiasStep\.device = 'imu': must be a device"),
        (lambda: Stuck(NOISY, "a_x", 2.0, 1.0), r"Stuck\.end = 1\.0: must be after start = 2\.0"),
        (lambda: Spikes(NOISY, "a_x", 1.5, 1.0), r"Spikes\.probability = 1\.5: must be between 0 and 1"),
        (lambda: Spikes(NOISY, "a_x", 0.5, 0.0), r"Spikes\.size = 0\.0: must be positive"),
        (lambda: Dropout(NOISY, spans=(2.0, 1.0)), r"Dropout\.spans = \(2\.0, 1\.0\): must be pairs"),
        (lambda: Dropout(NOISY, probability=-0.1), r"Dropout\.probability = -0\.1: must be between"),
        (lambda: Dropout(NOISY), "neither spans nor a probability"),
        (lambda: Renamed(NOISY, {"v_x": "speed"}), r"Renamed\.names: unknown name\(s\) v_x"),
        (lambda: Renamed(NOISY, {"a_x": "a_y"}), "gives two channels the same name: a_y, a_y, yaw_rate"),
    ],
)
def test_bad_input_raises_by_name_value_and_range(make, message):
    with pytest.raises(InputError, match=message):
        make()

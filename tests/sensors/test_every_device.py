"""What holds for every device, each in turn: a new one is a line in `DEVICES`."""

import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from families import left_out
from sensor_truth import truth

from jaxveh import InputError, sensors, statespace
from jaxveh.sensors import Alignment, LowPass, Position, Signal

pytestmark = pytest.mark.product

SMOOTH = Signal(noise=0.02, bias=0.01, scale=0.01, drift=0.01, drift_time=5.0)
ROUND = Signal(noise=0.02, bias=0.01, saturation=400.0, quantisation=0.005)
SPOT = Position(0.7, -0.4, 0.3)


class Device(NamedTuple):
    """How to make one, and a number of it on which what it says depends smoothly."""

    make: Callable[..., sensors.AbstractDevice]
    number: Callable[[Any], Any]


def imu(**clock):
    axes = {"a_y": SMOOTH, "a_z": Signal(), "roll_rate": Signal(), "yaw_rate": ROUND}
    return sensors.IMU(axes, SPOT, Alignment(0.02, -0.03, 0.05), LowPass(15.0), **clock)


def wheels(**clock):
    signals = {"wheel_speed_fl": ROUND, "omega_rr": SMOOTH, "wheel_speed_rl": SMOOTH}
    return sensors.WheelSpeeds(signals, radius=0.3, lowest=0.3, tooth_error=0.01, **clock)


def gnss(**clock):
    return sensors.GNSS(0.05, 0.03, 1.0, SMOOTH, SPOT, outage_rate=0.1, outage_length=0.5, outages=(1.0, 1.4), **clock)


def camera(**clock):
    return sensors.LaneCamera(
        dict.fromkeys(("lane_offset", "lane_heading"), SMOOTH), SPOT, 0.3, 2.0, 300.0, 5.0, 0.5, 0.2, **clock
    )


def optical(**clock):
    return sensors.OpticalSideslip(dict.fromkeys(("v_x", "v_y", "sideslip"), SMOOTH), SPOT, 0.5, **clock)


def light(**clock):
    """A device that compiles fast, for those that wrap one."""
    axes = {"a_x": Signal(bias=0.1), "a_y": Signal(noise=0.02), "a_z": Signal(), "yaw_rate": Signal(noise=0.01)}
    return sensors.IMU(axes, **clock)


def faulty(**clock):
    device = sensors.BiasStep(light(**clock), "a_x", 0.5, 0.3)
    device = sensors.Stuck(device, ("a_y", "a_z"), 0.7, 0.9)
    return sensors.Dropout(sensors.Spikes(device, "yaw_rate", 0.2, 0.5), probability=0.1)


DEVICES = {
    "IMU": Device(imu, lambda d: d.signals["a_y"].bias),
    "IMU, ideal": Device(sensors.IMU, lambda d: d.position.x),
    "WheelSpeeds": Device(wheels, lambda d: d.signals["omega_rr"].bias),
    "WheelSpeeds, M": Device(
        lambda **c: sensors.WheelSpeeds("omega_fl", method="M", **c), lambda d: d.signals["omega_fl"].bias
    ),
    "SteeringAngle": Device(lambda **c: sensors.SteeringAngle(SMOOTH, 0.02, **c), lambda d: d.backlash),
    "SteeringAngle, ratio": Device(
        lambda **c: sensors.SteeringAngle(SMOOTH, None, 15.0, "steering_wheel", **c), lambda d: d.ratio
    ),
    "GNSS": Device(gnss, lambda d: d.along),
    "GNSS, two antennas": Device(lambda **c: sensors.GNSS(0.05, heading=SMOOTH, **c), lambda d: d.heading.bias),
    "GNSS, vertical speed": Device(lambda **c: sensors.GNSS(0.05, climb=SMOOTH, **c), lambda d: d.climb.bias),
    "LaneCamera": Device(camera, lambda d: d.position.x),
    "OpticalSideslip": Device(optical, lambda d: d.position.x),
    "BrakeTorque": Device(lambda **c: sensors.BrakeTorque({"brake_torque": SMOOTH}, 0.1, **c), lambda d: d.lag),
    "MotorTorque": Device(
        lambda **c: sensors.MotorTorque({"drive_torque": SMOOTH, "torque_rl": ROUND}, 0.05, **c),
        lambda d: d.signals["drive_torque"].scale,
    ),
    "faulty": Device(faulty, lambda d: d.device.device.device.size),
    "Renamed": Device(
        lambda **c: sensors.Renamed(light(**c), {"a_x": "second"}), lambda d: d.device.signals["a_x"].bias
    ),
}


def test_every_device_of_the_package_is_here():
    made = [one.make(rate=50.0, delay=0.013, phase=0.004) for one in DEVICES.values()]
    assert not left_out("sensors", sensors.AbstractDevice, made, {})


@pytest.fixture(params=DEVICES)
def entry(request):
    return DEVICES[request.param]


@pytest.fixture
def device(entry):
    return entry.make(rate=50.0, delay=0.013, phase=0.004)


@eqx.filter_jit
def read(device, times, outputs, key):
    return device.read(times, outputs, key)


def heard(device, key=None, duration=2.0, dtype=jnp.float64):
    return read(device, device.sample_times(duration), truth(device.look_times(duration), dtype), key)


def same(first, second):
    return all(np.array_equal(first[name], second[name], equal_nan=True) for name in first)


def total(said):
    """A sum in which no two samples count alike."""
    weigh = lambda value: jnp.where(jnp.isnan(value), 0.0, value) * np.linspace(1.0, 2.0, value.shape[0])
    return sum(jnp.sum(weigh(value)) for value in said.values())


@eqx.filter_jit
def slopes(device, times, outputs, key):
    """The total, and its derivatives with respect to the device's numbers and the outputs."""
    return eqx.filter_value_and_grad(lambda pair: total(pair[0].read(times, pair[1], key)))((device, outputs))


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_it_says_its_channels_in_the_outputs_dtype(device, dtype):
    said = heard(device, jax.random.key(0), dtype=dtype)
    assert set(said) == set(device.channels) == set(device.units)
    for value in said.values():
        assert value.dtype == dtype and value.shape == device.sample_times(2.0).shape
        assert np.isfinite(value).mean() > 0.5 and not np.isinf(value).any()


def test_it_runs_without_64_bits(entry, float32):
    device = entry.make(rate=50.0)
    assert all(value.dtype == jnp.float32 for value in heard(device, jax.random.key(0), dtype=jnp.float32).values())


@pytest.mark.full
def test_float32_readings_are_near_those_of_float64(device):
    exact, rough = heard(device), heard(statespace.cast(device, jnp.float32), dtype=jnp.float32)
    for name in device.channels:
        # A number next to a step may be rounded to the other side, an edge may fall into the next period.
        near = np.isclose(exact[name], rough[name], rtol=1e-4, atol=1e-4, equal_nan=True)
        assert near.mean() > 0.95


def test_keys_decide_on_all_that_is_random(device):
    first, again, other = (heard(device, jax.random.key(seed)) for seed in (0, 0, 1))
    assert same(first, again)
    silent = heard(device)
    assert same(silent, heard(device))
    ideal = device.channels == ("a_x", "a_y", "yaw_rate")
    assert ideal == same(first, other) == same(first, silent)


def test_channels_have_noise_of_their_own(device):
    loud, quiet = heard(device, jax.random.key(0)), heard(device)
    noises = [np.asarray(loud[name]) - np.asarray(quiet[name]) for name in device.channels]
    for first, second in itertools.combinations([noise for noise in noises if np.nansum(noise**2) > 0], 2):
        rows = np.isfinite(first) & np.isfinite(second)
        assert not np.allclose(first[rows], second[rows])


def test_jit_and_vmap_over_keys_change_nothing(device):
    times, outputs = device.sample_times(2.0), truth(device.look_times(2.0))
    keys = jax.random.split(jax.random.key(3), 4)
    batch = jax.jit(jax.vmap(lambda key: device.read(times, outputs, key)))(keys)
    for place in (0, 3):
        single = read(device, times, outputs, keys[place])
        for name in device.channels:
            np.testing.assert_allclose(np.asarray(batch[name])[place], single[name], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("standing", [False, True])
def test_gradients_are_finite(device, standing):
    times, outputs = device.sample_times(2.0), truth(device.look_times(2.0))
    outputs = jax.tree.map(jnp.zeros_like, outputs) if standing else outputs
    leaves = jax.tree.leaves(slopes(device, times, outputs, jax.random.key(0))[1])
    assert leaves and all(np.isfinite(leaf).all() for leaf in leaves)


def test_a_gradient_equals_the_difference(entry, device):
    times, outputs = device.sample_times(2.0), truth(device.look_times(2.0))
    both = lambda x: slopes(eqx.tree_at(entry.number, device, x), times, outputs, jax.random.key(0))
    value = lambda x: float(both(x)[0])
    x, step = entry.number(device), 1e-5
    expected = (value(x + step) - value(x - step)) / (2 * step)
    assert abs(expected) > 1e-3
    slope = entry.number(both(x)[1][0])
    np.testing.assert_allclose(slope, expected, rtol=1e-5)


def test_an_output_that_the_car_lacks_is_named(device):
    for name in device.needs:
        outputs = truth(device.look_times(1.0))
        del outputs[name]
        with pytest.raises(InputError, match=rf"needs {name}, which this car does not have; there are: .*bank"):
            device.read(device.sample_times(1.0), outputs)


def test_outputs_that_it_may_use_may_be_missing(device):
    outputs = {name: value for name, value in truth(device.look_times(2.0)).items() if name in device.needs}
    assert all(np.isfinite(value).any() for value in read(device, device.sample_times(2.0), outputs, None).values())


def test_outputs_of_another_length_are_refused(device):
    with pytest.raises(InputError, match=r"has shape \(51,\), times has \(50,\)"):
        device.read(device.sample_times(1.0), truth(np.linspace(0, 1, 51)))


def test_one_sample_is_enough(device):
    one = lambda outputs, key: device.read(device.sample_times(0.01), outputs, key)
    # Traced and not run.
    said = jax.eval_shape(one, truth(device.look_times(0.01)), jax.random.key(0))
    assert all(value.shape == (1,) for value in said.values())


def test_the_clock_is_the_devices(entry):
    device = entry.make(rate=8.0, delay=0.3, phase=0.1)
    assert (device.rate, device.delay, device.phase) == (8.0, 0.3, 0.1)
    np.testing.assert_allclose(device.sample_times(0.6), [0.1, 0.225, 0.35, 0.475, 0.6], rtol=1e-15)
    np.testing.assert_allclose(device.look_times(0.6), [0.0, 0.0, 0.05, 0.175, 0.3], atol=1e-15)
    assert device.sample_times(0.05).shape == (0,)


@pytest.mark.parametrize(
    ("clock", "message"),
    [
        ({"rate": 0.0}, r"rate = 0\.0: must be positive"),
        ({"rate": -1.0}, r"rate = -1\.0: must be positive"),
        ({"rate": np.nan}, "rate = nan: must be positive"),
        ({"rate": 5.0, "delay": -0.1}, r"delay = -0\.1: must be at least 0"),
        ({"rate": 5.0, "delay": np.inf}, "delay = inf: must be finite"),
        ({"rate": 5.0, "phase": -0.1}, r"phase = -0\.1: must be at least 0"),
    ],
)
def test_a_bad_clock_is_refused(entry, clock, message):
    with pytest.raises(InputError, match=message):
        entry.make(**clock)


def test_a_bad_duration_is_refused(device):
    for bad in (-1.0, np.inf):
        with pytest.raises(InputError, match=f"duration = {bad}"):
            device.sample_times(bad)

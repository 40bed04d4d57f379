"""The ready-made cars and devices have the numbers that their descriptions name, and sets by name are those sets."""

import math

import numpy as np
import pytest

from jaxveh import InputError, sensors, vehicles
from jaxveh._core.names import record
from jaxveh.sensors import esc
from jaxveh.sensors.named import DEVICES, named_devices
from jaxveh.vehicles import GRAVITY

DEGREE, KMH = math.pi / 180, 1 / 3.6


def by_kind(suite):
    """The devices by the name of their class."""
    return {type(device).__name__: device for device in suite.devices}


def told(part, **expected):
    """Whether a part has these numbers, and no other that is told."""
    for name, value in expected.items():
        np.testing.assert_allclose(getattr(part, name), value, rtol=1e-12, err_msg=name)
    others = {"noise", "drift", "drift_time", "saturation", "quantisation"} - set(expected)
    assert all(getattr(part, name, None) is None for name in others)
    assert all(float(getattr(part, name, 0.0)) == 0.0 for name in {"bias", "scale"} - set(expected))


def test_a_production_car_has_the_numbers_of_its_description():
    parts = by_kind(sensors.production_car(0.31, steering_ratio=15.0))
    inertial, wheels, receiver = parts["IMU"], parts["WheelSpeeds"], parts["GNSS"]
    slow = {"drift_time": 600.0}
    for name in ("a_x", "a_y"):
        told(
            inertial.signals[name], noise=0.05, bias=0.1, drift=2e-3, **slow, saturation=4.2 * GRAVITY,
            quantisation=1.274e-4 * GRAVITY,
        )  # fmt: skip
    told(
        inertial.signals["yaw_rate"], noise=0.1 * DEGREE, bias=0.2 * DEGREE, drift=0.01 * DEGREE, **slow,
        saturation=163 * DEGREE, quantisation=0.005 * DEGREE,
    )  # fmt: skip
    assert (float(inertial.low_pass.cutoff_hz), inertial.low_pass.order) == (15.0, 2)
    assert (inertial.rate, inertial.delay) == (100.0, 0.01)
    assert (wheels.teeth, wheels.method, wheels.below, wheels.rate, wheels.delay) == (48, "M/T", "zero", 50.0, 0.02)
    told(wheels, radius=0.31, lowest=KMH, tooth_error=0.01)
    scales = [float(signal.scale) for signal in wheels.signals.values()]
    assert max(map(abs, scales)) == 0.005 and len(set(scales)) == 4
    for signal in wheels.signals.values():
        told(signal, scale=float(signal.scale), quantisation=KMH / 64)
    told(receiver, along=0.05, across=0.05, lowest=1.0)
    told(receiver.climb, noise=0.1)
    assert (receiver.rate, receiver.delay, receiver.position) == (5.0, 0.15, None)


@pytest.mark.parametrize("ratio", [None, 15.0])
def test_a_steering_angle_has_half_a_degree_of_offset_and_one_of_play_at_the_wheel(ratio):
    """Without a ratio the numbers are those of the steering wheel over 16."""
    device = by_kind(sensors.production_car(steering_ratio=ratio))["SteeringAngle"]
    unit = DEGREE if ratio else DEGREE / 16
    (signal,) = device.signals.values() if hasattr(device, "signals") else (device.signal,)
    told(signal, bias=0.5 * unit, saturation=780 * unit, quantisation=0.1 * unit)
    np.testing.assert_allclose(device.backlash, unit, rtol=1e-12)
    assert device.rate == 100.0
    assert tuple(device.channels) == (("steering_wheel",) if ratio else ("steer",))


def test_a_car_on_the_proving_ground_has_the_numbers_of_its_description():
    parts = by_kind(sensors.proving_ground_car(0.31, optical_position=(2.0, 0.1, -0.2)))
    inertial, optical, receiver = parts["IMU"], parts["OpticalSideslip"], parts["GNSS"]
    for name in ("a_x", "a_y", "a_z"):
        told(inertial.signals[name], noise=0.01, bias=0.005, scale=1e-3, drift=1e-4, saturation=10 * GRAVITY)
    for name in ("roll_rate", "pitch_rate", "yaw_rate"):
        told(
            inertial.signals[name], noise=0.02 * DEGREE, bias=0.01 * DEGREE, scale=1e-3, drift=1e-3 * DEGREE,
            saturation=300 * DEGREE,
        )  # fmt: skip
    assert (float(inertial.low_pass.cutoff_hz), inertial.rate, inertial.delay) == (40.0, 100.0, 0.002)
    for name in ("v_x", "v_y"):
        told(optical.signals[name], noise=0.05, scale=2e-3)
    assert [float(getattr(optical.position, axis)) for axis in "xyz"] == [2.0, 0.1, -0.2]
    assert (float(optical.lowest), optical.rate, optical.delay) == (0.3, 250.0, 0.006)
    ahead = by_kind(sensors.proving_ground_car())["OpticalSideslip"].position
    assert [float(getattr(ahead, axis)) for axis in "xyz"] == [2.2, 0.0, 0.0]
    told(receiver, along=0.02, across=0.02, lowest=0.3)
    told(receiver.position, noise=0.02)
    assert (receiver.rate, receiver.delay, receiver.climb) == (20.0, 0.02, None)
    assert "WheelSpeeds" in parts and "WheelSpeeds" not in by_kind(sensors.proving_ground_car())


def test_sets_by_name_are_those_of_the_car():
    """A car whose wheels do not spin has no wheel speeds to count."""
    single, spinning = vehicles.passenger_car(), vehicles.named_car("compact_car", "seven-dof")
    assert named_devices("none", single) is None
    assert named_devices("esc", single).channels == esc().channels
    noisy = named_devices("esc", single, {"yaw_rate": 0.25})
    assert noisy.channels == ("yaw_rate",) and float(noisy.noise.std.yaw_rate) == 0.25
    for name in ("production", "proving-ground"):
        assert "WheelSpeeds" not in by_kind(named_devices(name, single))
        radius = by_kind(named_devices(name, spinning))["WheelSpeeds"].radius
        assert float(radius) == float(spinning.wheel_radius)
    assert "OpticalSideslip" in by_kind(named_devices("proving-ground", single))
    assert "OpticalSideslip" not in by_kind(named_devices("production", single))
    assert {name: one.takes_noise for name, one in DEVICES.items() if one.takes_noise} == {"esc": True}
    with pytest.raises(InputError, match="production"):
        named_devices("prodution", single)


def test_a_vehicle_without_sensors_is_the_vehicle():
    car = vehicles.passenger_car()
    alone = sensors.Instrumented(car)
    u = record("Inputs", {"steer": np.asarray(0.02), "v_x": np.asarray(20.0)})
    assert (alone.channels, alone.state_type, alone.inputs) == ((), car.state_type, car.inputs)
    x = alone.start(0.0, u)
    assert x == car.start(0.0, u) and alone.observation(0.0, x, u) is None
    np.testing.assert_array_equal(alone.outputs(0.0, x, u), car.outputs(0.0, x, u))
    np.testing.assert_array_equal(alone.derivatives(0.0, x, u), car.derivatives(0.0, x, u))
    assert sensors.Instrumented(car, esc()).channels == esc().channels

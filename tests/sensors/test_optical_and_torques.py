"""The optical sensor and the torques that control units say."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError
from jaxveh.sensors import BrakeTorque, MotorTorque, OpticalSideslip, Position, Signal


def heard(device, key=None, **outputs):
    outputs = {name: jnp.asarray(value, jnp.float64) for name, value in outputs.items()}
    n = len(next(iter(outputs.values())))
    said = device.read(np.arange(n) / device.rate, outputs, key)
    return {name: np.asarray(value) for name, value in said.items()}


def test_the_optical_sensor_says_the_velocity_of_its_own_place():
    device = OpticalSideslip(("v_x", "v_y", "sideslip"), Position(2.0, 0.5, -0.3), rate=100.0)
    said = heard(device, v_x=[20.0], v_y=[-0.6], yaw_rate=[0.4])
    v_x, v_y = 20.0 - 0.4 * 0.5, -0.6 + 0.4 * 2.0
    np.testing.assert_allclose([*said.values()], [[v_x], [v_y], [np.arctan2(v_y, v_x)]], rtol=1e-12)


def test_a_low_sensor_swings_with_the_roll():
    """Below the centre of gravity a body that rolls up on the left moves to the left: omega x r."""
    device = OpticalSideslip("v_y", Position(z=-0.5), rate=100.0)
    said = heard(device, v_x=[20.0], v_y=[0.0], yaw_rate=[0.0], roll_rate=[0.2])
    np.testing.assert_allclose(said["v_y"], 0.1, rtol=1e-12)


def test_the_optical_sensor_is_silent_at_low_speed():
    speeds = [0.2, 0.29, 0.31, 5.0]
    said = heard(OpticalSideslip(lowest=0.3, rate=100.0), v_x=speeds, v_y=np.zeros(4), yaw_rate=np.zeros(4))
    np.testing.assert_array_equal(np.isnan(said["v_x"]), [True, True, False, False])
    np.testing.assert_array_equal(said["v_x"][2:], speeds[2:])


def test_the_optical_sensors_noise_has_its_spread():
    device = OpticalSideslip({"v_y": Signal(noise=0.05)}, rate=100.0)
    said = heard(device, jax.random.key(0), v_x=np.full(20000, 20.0), v_y=np.zeros(20000), yaw_rate=np.zeros(20000))
    np.testing.assert_allclose(said["v_y"].std(), 0.05, rtol=0.03)


@pytest.mark.parametrize(("kind", "channel"), [(BrakeTorque, "brake_torque"), (MotorTorque, "drive_torque")])
def test_a_torque_lags_by_its_first_order_and_has_its_gain(kind, channel):
    device = kind({channel: Signal(scale=0.1)}, lag=0.2, rate=100.0)
    t = np.arange(300) / 100.0
    said = heard(device, **{channel: 500.0 * t})
    np.testing.assert_allclose(said[channel], 1.1 * 500 * (t - 0.2 * -np.expm1(-t / 0.2)), rtol=1e-9, atol=1e-9)
    assert device.units == {channel: "N*m"}


def test_a_brake_never_drives_and_a_motor_may_brake():
    torque = np.array([-100.0, 0.0, 100.0])
    said = heard(BrakeTorque({"brake_torque_fl": Signal(bias=-50.0)}, rate=10.0), brake_torque_fl=torque)
    np.testing.assert_array_equal(said["brake_torque_fl"], [0.0, 0.0, 50.0])
    said = heard(MotorTorque({"torque_rr": Signal(bias=-50.0)}, rate=10.0), torque_rr=torque)
    np.testing.assert_array_equal(said["torque_rr"], [-150.0, -50.0, 50.0])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: OpticalSideslip("speed", rate=1.0), r"unknown name\(s\) speed; there are: v_x, v_y, sideslip"),
        (lambda: OpticalSideslip(lowest=-1.0, rate=1.0), r"lowest = -1\.0: must be positive"),
        (lambda: OpticalSideslip(position=0.0, rate=1.0), r"OpticalSideslip\.position = 0\.0: must be a Position"),
        (lambda: BrakeTorque("drive_torque", rate=1.0), r"BrakeTorque\.signals: unknown name\(s\) drive_torque"),
        (lambda: BrakeTorque(lag=0.0, rate=1.0), r"BrakeTorque\.lag = 0\.0: must be positive"),
        (lambda: MotorTorque("brake_torque", rate=1.0), r"MotorTorque\.signals: unknown name\(s\) brake_torque"),
        (lambda: MotorTorque(lag=-1.0, rate=1.0), r"MotorTorque\.lag = -1\.0: must be positive"),
    ],
)
def test_bad_input_raises_by_name_value_and_range(make, message):
    with pytest.raises(InputError, match=message):
        make()

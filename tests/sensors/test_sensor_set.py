"""Sensor sets and instrumented vehicles: positions, noises, states of the low-pass, bad input."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, sensors, vehicles
from jaxveh.sensors import Instrumented, LowPass
from jaxveh.vehicles import GRAVITY, SingleTrackState


class Outputs(NamedTuple):
    a_x: Any = 1.0
    a_y: Any = 2.0
    yaw_rate: Any = 0.5
    yaw_acceleration: Any = 3.0


class Inputs(NamedTuple):
    steer: Any
    v_x: Any


def inputs(steer=0.05, v_x=25.0):
    return Inputs(jnp.asarray(steer), jnp.asarray(v_x))


def test_a_sensor_off_the_centre_feels_the_rigid_bodys_acceleration():
    """Against the second derivative of the sensor's path, in the body's axes."""
    x_s, y_s = 0.7, -0.4
    felt = sensors.esc(a_x=0.1, position=(x_s, y_s, 0.3)).feel(Outputs())

    def path(t):
        yaw = 0.5 * t + 1.5 * t**2  # yaw rate 0.5 and acceleration 3 at t = 0, where the body's axes are the world's
        return jnp.stack(
            [0.5 * t**2 + x_s * jnp.cos(yaw) - y_s * jnp.sin(yaw), t**2 + x_s * jnp.sin(yaw) + y_s * jnp.cos(yaw)]
        )

    expected = jax.jit(jax.jacfwd(jax.jacfwd(path)))(0.0)
    np.testing.assert_allclose([felt.a_x, felt.a_y], expected, rtol=1e-12)
    assert felt.yaw_rate == 0.5


class Leaning(NamedTuple):
    a_x: Any = 1.0
    a_y: Any = 2.0
    yaw_rate: Any = 0.5
    yaw_acceleration: Any = 3.0
    roll: Any = 0.06
    roll_rate: Any = -0.4
    roll_acceleration: Any = 5.0


def test_on_a_car_that_rolls_sensors_lean_with_the_body_and_their_height_counts():
    """Against the second derivative of the sensor's path in space and its rotation, with the body's centre at a height of 0."""
    at, outputs = np.array([0.7, -0.4, 0.5]), Leaning(*[jnp.asarray(value) for value in Leaning()])

    def turn(t):
        yaw, roll = 0.5 * t + 1.5 * t**2, 0.06 - 0.4 * t + 2.5 * t**2
        c, s, cr, sr = jnp.cos(yaw), jnp.sin(yaw), jnp.cos(roll), jnp.sin(roll)
        return jnp.array([[c, -s * cr, s * sr], [s, c * cr, -c * sr], [0.0, sr, cr]])

    path = lambda t: jnp.stack([0.5 * t**2, t**2, 0.5 * GRAVITY * t**2]) + turn(t) @ at
    expected = jax.jit(lambda t: turn(t).T @ jax.jacfwd(jax.jacfwd(path))(t))(0.0)
    felt = sensors.esc(a_x=0.1, position=tuple(at)).feel(outputs)
    np.testing.assert_allclose([felt.a_x, felt.a_y], expected[:2], rtol=1e-12)
    np.testing.assert_allclose(felt.yaw_rate, 0.5 * np.cos(0.06), rtol=1e-12)
    assert felt.a_y > 2.0 + 0.9 * GRAVITY * 0.06 - 5.0 * 0.5


def test_the_default_set_measures_yaw_rate_and_lateral_acceleration():
    device = sensors.esc()
    assert device.channels == ("yaw_rate", "a_y")
    np.testing.assert_allclose(device.noise.std, (0.005, 0.1))
    assert device.filter_names == ()
    assert device.measure(Outputs()) == device.feel(Outputs()) == (0.5, 2.0)


def test_low_passed_sensors_report_their_filters():
    device = sensors.esc(low_pass=LowPass(20.0))
    names = ("yaw_rate_filtered", "yaw_rate_filtered_rate", "a_y_filtered", "a_y_filtered_rate")
    assert device.filter_names == names
    outputs = jax.tree.map(jnp.asarray, Outputs())
    state = device.start(outputs)
    assert device.measure(outputs, state) == (0.5, 2.0)
    np.testing.assert_allclose(device.derivatives(state, outputs), 0.0, atol=1e-12)
    rates = device.derivatives(state._replace(a_y_filtered=jnp.asarray(1.0)), outputs)
    np.testing.assert_allclose(rates.a_y_filtered_rate, (2 * np.pi * 20) ** 2, rtol=1e-12)
    assert rates.yaw_rate_filtered_rate == 0


def test_instrumented_vehicle_is_the_vehicle_followed_by_its_filters():
    car = vehicles.passenger_car()
    plain = Instrumented(car, sensors.esc())
    assert plain.state_type is SingleTrackState
    whole = Instrumented(car, sensors.esc(low_pass=LowPass(20.0)))
    assert whole.state_type._fields[:4] == ("v_y", "yaw", "yaw_rate", "yaw_rate_filtered")
    assert whole.inputs == car.inputs
    x = whole.start(0.0, inputs(), v_y=0.2, yaw_rate=0.3)
    own, filters = whole.split(x)
    np.testing.assert_allclose(whole.derivatives(0.0, x, inputs())[:3], car.derivatives(0.0, own, inputs()), rtol=1e-12)
    outputs = car.outputs(0.0, own, inputs())
    np.testing.assert_allclose(filters.a_y_filtered, outputs.a_y, rtol=1e-12)
    assert whole.observation(0.0, x, inputs()) == (x.yaw_rate_filtered, x.a_y_filtered)
    np.testing.assert_allclose(plain.observation(0.0, own, inputs()), (outputs.yaw_rate, outputs.a_y), rtol=1e-12)


def test_instrumented_batches_are_elementwise():
    whole = Instrumented(vehicles.passenger_car(), sensors.esc(low_pass=LowPass(20.0), position=(0.2, 0.1, 0.0)))
    batch = whole.state_type(*[np.linspace(-0.5, 0.5, 6) + 0.1 * i for i in range(len(whole.state_type._fields))])
    rates = jax.jit(Instrumented.derivatives)(whole, 0.0, batch, inputs())
    single = whole.derivatives(0.0, jax.tree.map(lambda leaf: leaf[2], batch), inputs())
    np.testing.assert_allclose([np.asarray(leaf)[2] for leaf in rates], single, rtol=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sensors.esc(a_y=0.0), r"standard deviation of a_y = 0\.0: must be positive"),
        (lambda: sensors.esc(yaw_rate=-0.1), r"standard deviation of yaw_rate = -0\.1"),
        (lambda: sensors.esc(None, None), "no channel is fitted"),
        (lambda: sensors.esc(position=(0.0, 0.0)), r"position = \(0\.0, 0\.0\): must be \(x, y, z\)"),
        (lambda: sensors.esc(position=(np.inf, 0.0, 0.0)), r"Position\.x = inf: must be finite"),
        (lambda: sensors.esc(low_pass=20.0), r"SensorSet\.low_pass = 20\.0: must be a LowPass"),
        (lambda: sensors.esc(v_y=0.1).feel(Outputs()), r"does not have: unknown name\(s\) v_y"),
        (lambda: sensors.esc(low_pass=LowPass()).measure(Outputs()), "give its states"),
    ],
)
def test_bad_input_raises_by_name_value_and_range(make, message):
    with pytest.raises(InputError, match=message):
        make()

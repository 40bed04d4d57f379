"""The steering angle: offset, ratio, the loop that a play makes."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError
from jaxveh.sensors import Signal, SteeringAngle
from jaxveh.sensors.steering_angle import play

# Up to 1, down to -1 and up again, in steps of a hundredth.
LOOP = np.concatenate([np.linspace(0, 1, 101), np.linspace(0.99, -1, 200), np.linspace(-0.99, 1, 200)])


def test_the_play_makes_a_loop_of_its_width():
    said = np.asarray(play(jnp.asarray(LOOP), jnp.asarray(0.2)))
    rising, falling, again = said[:101], said[100:301], said[300:]
    # It stays in the middle at first, then follows by half the width; after each turn it waits for the whole width.
    np.testing.assert_allclose(rising, np.maximum(LOOP[:101] - 0.1, 0.0), atol=1e-12)
    np.testing.assert_allclose(falling, np.minimum(LOOP[100:301] + 0.1, 0.9), atol=1e-12)
    np.testing.assert_allclose(again, np.maximum(LOOP[300:] - 0.1, -0.9), atol=1e-12)


def test_the_loops_area_is_its_width_times_its_height():
    said = np.asarray(play(jnp.asarray(LOOP), jnp.asarray(0.2)))
    closed = slice(100, None)
    area = np.sum(0.5 * (LOOP[closed][1:] + LOOP[closed][:-1]) * np.diff(said[closed]))
    np.testing.assert_allclose(abs(area), 0.2 * 1.8, rtol=1e-9)


def test_small_motion_is_swallowed():
    small = 0.09 * jnp.sin(jnp.linspace(0, 20, 200))
    np.testing.assert_array_equal(play(small, jnp.asarray(0.2)), 0.0)


def heard(device):
    outputs = {"steer": jnp.asarray(LOOP), "steering_wheel": jnp.asarray(16.5 * LOOP)}
    (said,) = device.read(np.arange(len(LOOP)) / device.rate, outputs).values()
    return np.asarray(said)


def test_offset_and_steps():
    said = heard(SteeringAngle(Signal(bias=0.053, quantisation=0.02), rate=100.0))
    np.testing.assert_allclose(said, 0.02 * np.round((LOOP + 0.053) / 0.02), atol=1e-12)


def test_the_steering_wheel_is_the_cars_or_made_of_a_ratio():
    own = SteeringAngle(channel="steering_wheel", rate=100.0)
    made = SteeringAngle(channel="steering_wheel", ratio=15.0, rate=100.0)
    assert own.needs == ("steering_wheel",) and made.needs == ("steer",)
    np.testing.assert_allclose(heard(own), 16.5 * LOOP, rtol=1e-12)
    np.testing.assert_allclose(heard(made), 15.0 * LOOP, rtol=1e-12)


def test_the_play_is_in_the_channels_angle():
    said = heard(SteeringAngle(channel="steering_wheel", ratio=15.0, backlash=3.0, rate=100.0))
    np.testing.assert_allclose(said[:101], np.maximum(15 * LOOP[:101] - 1.5, 0.0), atol=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: SteeringAngle(channel="angle", rate=1.0),
            "channel = 'angle': must be one of 'steer', 'steering_wheel'",
        ),
        (lambda: SteeringAngle(ratio=15.0, rate=1.0), r"ratio = 15\.0: only the channel steering_wheel"),
        (lambda: SteeringAngle(channel="steering_wheel", ratio=-1.0, rate=1.0), r"ratio = -1\.0: must be positive"),
        (lambda: SteeringAngle(backlash=0.0, rate=1.0), r"backlash = 0\.0: must be positive"),
        (lambda: SteeringAngle(0.1, rate=1.0), r"SteeringAngle\.signal = 0\.1: must be a Signal"),
    ],
)
def test_bad_input_raises_by_name_value_and_range(make, message):
    with pytest.raises(InputError, match=message):
        make()

"""Satellite navigation: the antenna's velocity and place, noise along and across, outages, standstill."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError
from jaxveh.sensors import GNSS, Position, Signal

STATE = {"v_x": 19.0, "v_y": -2.0, "yaw": 2.8, "yaw_rate": 0.7, "x": 100.0, "y": -50.0}


def heard(device, n=21, key=None, **state):
    outputs = {name: jnp.asarray(np.full(n, value)) for name, value in (STATE | state).items()}
    said = device.read(np.arange(n) / device.rate, outputs, key)
    return {name: np.asarray(value) for name, value in said.items()}


def test_an_ideal_receiver_says_speed_and_course_of_the_centre():
    said = heard(GNSS(rate=5.0))
    assert tuple(said) == ("speed", "course")
    np.testing.assert_allclose(said["speed"], np.hypot(19.0, 2.0), rtol=1e-12)
    np.testing.assert_allclose(said["course"], 2.8 + np.arctan2(-2.0, 19.0), rtol=1e-12)


def test_courses_are_wrapped():
    for turns in (-3, 4):
        said = heard(GNSS(rate=5.0), yaw=2.8 + 2 * np.pi * turns)
        np.testing.assert_allclose(said["course"], 2.8 + np.arctan2(-2.0, 19.0), rtol=1e-9)
    np.testing.assert_allclose(
        heard(GNSS(rate=5.0), yaw=3.5)["course"], 3.5 - 2 * np.pi + np.arctan2(-2, 19), rtol=1e-9
    )


def test_the_antenna_moves_with_the_rolling_body():
    """Place and velocity against the path of the antenna, differentiated."""
    arm = np.array([-1.0, 0.4, 1.2])
    motion = {"roll_rate": 0.3, "pitch_rate": -0.2, "roll": 0.1, "pitch": 0.05}

    @jax.jit
    def path(t):
        yaw, pitch, roll = 2.8 + 0.7 * t, 0.05 - 0.2 * t, 0.1 + 0.3 * t
        z = lambda a: jnp.array([[jnp.cos(a), -jnp.sin(a), 0], [jnp.sin(a), jnp.cos(a), 0], [0, 0, 1]])
        y = lambda a: jnp.array([[jnp.cos(a), 0, jnp.sin(a)], [0, 1, 0], [-jnp.sin(a), 0, jnp.cos(a)]])
        x = lambda a: jnp.array([[1, 0, 0], [0, jnp.cos(a), -jnp.sin(a)], [0, jnp.sin(a), jnp.cos(a)]])
        start = jnp.array([100.0, -50.0, 0.0]) + t * (z(2.8) @ jnp.array([19.0, -2.0, 0.0]))
        return start + z(yaw) @ y(pitch) @ x(roll) @ arm

    place, velocity = jax.jvp(path, (0.0,), (1.0,))
    said = heard(GNSS(position=Signal(), antenna=Position(*arm), rate=5.0), **motion)
    np.testing.assert_allclose([said["x"][0], said["y"][0]], place[:2], rtol=1e-12)
    np.testing.assert_allclose(said["speed"][0], np.hypot(*velocity[:2]), rtol=1e-12)
    np.testing.assert_allclose(said["course"][0], np.arctan2(velocity[1], velocity[0]), rtol=1e-12)


def test_noise_along_and_across_spreads_speed_and_course():
    said = heard(GNSS(along=0.1, across=0.3, rate=5.0), 20000, jax.random.key(0))
    true = np.hypot(19.0, 2.0)
    np.testing.assert_allclose(said["speed"].std(), 0.1, rtol=0.03)
    np.testing.assert_allclose(said["course"].std(), 0.3 / true, rtol=0.03)
    # Noise across lengthens the velocity in the mean.
    np.testing.assert_allclose(said["speed"].mean() - true, 0.3**2 / (2 * true), atol=4 * 0.1 / np.sqrt(20000))


def test_the_position_has_errors_of_its_own_in_each_direction():
    said = heard(GNSS(position=Signal(noise=0.5, bias=1.0), rate=5.0), 20000, jax.random.key(0))
    for name in ("x", "y"):
        np.testing.assert_allclose(said[name].mean(), STATE[name] + 1.0, atol=4 * 0.5 / np.sqrt(20000))
        np.testing.assert_allclose(said[name].std(), 0.5, rtol=0.03)
    assert abs(np.corrcoef(said["x"], said["y"])[0, 1]) < 4 / np.sqrt(20000)


def test_a_slow_car_has_no_course():
    slow = heard(GNSS(lowest=1.0, rate=5.0), v_x=0.5, v_y=0.0)
    assert np.isnan(slow["course"]).all() and (slow["speed"] == 0.5).all()
    assert np.isfinite(heard(GNSS(lowest=1.0, rate=5.0), v_x=1.5)["course"]).all()


def test_nothing_is_said_in_outages():
    said = heard(GNSS(outages=((1.0, 2.0), (3.0, 3.4)), position=Signal(), rate=5.0))
    silent = [5, 6, 7, 8, 9, 15, 16]
    for value in said.values():
        np.testing.assert_array_equal(np.flatnonzero(np.isnan(value)), silent)


def test_random_outages_come_with_the_key_and_take_all_channels():
    device = GNSS(outage_rate=0.2, outage_length=2.0, position=Signal(), rate=5.0)
    said = heard(device, 20000, jax.random.key(1))
    np.testing.assert_allclose(np.isnan(said["speed"]).mean(), 0.2 / (0.2 + 0.5), rtol=0.15)
    for value in said.values():
        np.testing.assert_array_equal(np.isnan(value), np.isnan(said["speed"]))
    assert not np.isnan(heard(device, 20000)["speed"]).any()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: GNSS(along=-0.1, rate=5.0), r"GNSS\.along = -0\.1: must be positive"),
        (lambda: GNSS(across=0.0, rate=5.0), r"GNSS\.across = 0\.0: must be positive"),
        (lambda: GNSS(lowest=0.0, rate=5.0), r"GNSS\.lowest = 0\.0: must be positive"),
        (lambda: GNSS(outages=(2.0, 1.0), rate=5.0), r"GNSS\.outages = \(2\.0, 1\.0\): must be pairs"),
        (lambda: GNSS(outage_rate=0.1, rate=5.0), "outage_length = None: give both or neither"),
        (lambda: GNSS(position=0.5, rate=5.0), r"GNSS\.position = 0\.5: must be a Signal"),
        (lambda: GNSS(antenna=(0, 0, 0), rate=5.0), r"GNSS\.antenna = \(0, 0, 0\): must be a Position"),
    ],
)
def test_bad_input_raises_by_name_value_and_range(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_the_vertical_speed_is_that_of_the_road_and_nothing_without_one():
    uphill = heard(GNSS(climb=Signal(), rate=5.0), grade=0.1, bank=0.0)
    np.testing.assert_allclose(uphill["climb_rate"], 19.0 * np.sin(0.1), rtol=1e-12)
    across = heard(GNSS(climb=Signal(), rate=5.0), grade=0.0, bank=0.2)
    np.testing.assert_allclose(across["climb_rate"], -2.0 * np.sin(0.2), rtol=1e-12)
    assert (heard(GNSS(climb=Signal(), rate=5.0))["climb_rate"] == 0.0).all()
    assert "climb_rate" not in heard(GNSS(rate=5.0))
    noisy = heard(GNSS(climb=Signal(noise=0.1), rate=5.0), 20000, jax.random.key(1), grade=0.1)
    np.testing.assert_allclose(noisy["climb_rate"].std(), 0.1, rtol=0.03)
    with pytest.raises(InputError, match=r"GNSS.climb = 0.1: must be a Signal"):
        GNSS(climb=0.1, rate=5.0)

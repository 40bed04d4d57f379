"""The inertial unit against the motion of a rigid body: lever arms, gravity, misalignment, low-pass."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Recording
from jaxveh.sensors import IMU, Alignment, LowPass, Position, Signal, low_pass
from jaxveh.vehicles.base import GRAVITY

SIX = ("a_x", "a_y", "a_z", "roll_rate", "pitch_rate", "yaw_rate")
PLANAR = {"a_x": 1.0, "a_y": 2.0, "yaw_rate": 0.5, "yaw_acceleration": 3.0}


def rows(values):
    return {name: jnp.asarray(np.full(3, value)) for name, value in values.items()}


def read(imu, values):
    said = imu.read(np.arange(3) / imu.rate, rows(values))
    return {name: float(value[1]) for name, value in said.items()}


def about(axis, angle):
    c, s = jnp.cos(angle), jnp.sin(angle)
    one, zero = jnp.ones_like(c), jnp.zeros_like(c)
    return {
        "x": jnp.stack([jnp.stack([one, zero, zero]), jnp.stack([zero, c, -s]), jnp.stack([zero, s, c])]),
        "y": jnp.stack([jnp.stack([c, zero, s]), jnp.stack([zero, one, zero]), jnp.stack([-s, zero, c])]),
        "z": jnp.stack([jnp.stack([c, -s, zero]), jnp.stack([s, c, zero]), jnp.stack([zero, zero, one])]),
    }[axis]


def angles(t):
    """Yaw, pitch and roll of a violent motion."""
    return jnp.stack([0.4 + 0.9 * t + jnp.sin(t), 0.3 * jnp.sin(2 * t + 0.4), 0.4 * jnp.cos(3 * t)])


def turn(t):
    """From the body's axes to the world's."""
    yaw, pitch, roll = angles(t)
    return about("z", yaw) @ about("y", pitch) @ about("x", roll)


def centre(t):
    return jnp.stack([20 * t + jnp.sin(3 * t), 4 * jnp.cos(2 * t), 0.1 * jnp.sin(5 * t)])


@jax.jit
def motion(t, place, misalignment):
    """The outputs of the violent motion, and the specific force and angular rate of a box, all by differentiation."""
    second = lambda path: jax.jacfwd(jax.jacfwd(path))(t)
    gravity = jnp.array([0.0, 0.0, GRAVITY])
    yaw, *stance = angles(t)
    outputs = dict(zip(("a_x", "a_y", "a_z"), about("z", yaw).T @ (second(centre) + gravity), strict=True))
    outputs |= dict(zip(("pitch", "roll"), stance, strict=True))
    outputs |= dict(zip(("yaw_rate", "pitch_rate", "roll_rate"), jax.jacfwd(angles)(t), strict=True))
    outputs |= dict(zip(("yaw_acceleration", "pitch_acceleration", "roll_acceleration"), second(angles), strict=True))
    roll, pitch, yaw = misalignment
    box = about("z", yaw) @ about("y", pitch) @ about("x", roll)
    felt = box.T @ turn(t).T @ (second(lambda t: centre(t) + turn(t) @ place) + gravity)
    spin = turn(t).T @ jax.jacfwd(turn)(t)
    return outputs, felt, box.T @ jnp.array([spin[2, 1], spin[0, 2], spin[1, 0]])


@pytest.mark.parametrize("t", [0.0, 0.7, 1.9])
def test_a_box_anywhere_on_the_body_feels_the_rigid_bodys_motion(t):
    """Against second derivatives of the box's path in space and the derivative of its rotation."""
    place, misalignment = np.array([0.7, -0.4, 0.5]), (0.1, -0.2, 0.3)
    outputs, felt, rates = motion(t, place, misalignment)
    roll, pitch, yaw = misalignment
    said = read(IMU(SIX, Position(*place), Alignment(roll, pitch, yaw), rate=100.0), outputs)
    np.testing.assert_allclose([said[name] for name in SIX], [*felt, *rates], rtol=1e-9)


def test_a_planar_car_gives_centripetal_and_tangential_terms():
    said = read(IMU(position=Position(0.7, -0.4, 0.9), rate=100.0), PLANAR)
    expected = {"a_x": 1.0 + 3.0 * 0.4 - 0.25 * 0.7, "a_y": 2.0 + 3.0 * 0.7 + 0.25 * 0.4, "yaw_rate": 0.5}
    assert said == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("roll", "pitch"), [(0.1, 0.0), (0.0, 0.08), (0.1, -0.08)])
def test_gravity_comes_through_roll_and_pitch(roll, pitch):
    """At rest: the left side up shows gravity to the left, the nose down backwards."""
    outputs = dict.fromkeys(PLANAR, 0.0) | {"roll": roll, "pitch": pitch}
    said = read(IMU(("a_x", "a_y", "a_z"), rate=100.0), outputs)
    expected = [-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)]
    np.testing.assert_allclose(list(said.values()), GRAVITY * np.array(expected), rtol=1e-12, atol=1e-12)


def test_a_flat_car_presses_on_a_slope_with_the_gravity_normal_to_it():
    rest = dict.fromkeys(PLANAR, 0.0)
    imu = IMU(("a_z",), rate=100.0)
    assert read(imu, rest)["a_z"] == pytest.approx(GRAVITY, rel=1e-12)
    assert read(imu, rest | {"grade": 0.1})["a_z"] == pytest.approx(GRAVITY * np.cos(0.1), rel=1e-12)
    assert read(imu, rest | {"bank": -0.2})["a_z"] == pytest.approx(GRAVITY * np.cos(0.2), rel=1e-12)
    assert read(imu, rest | {"bank": -0.2, "a_z": 9.0})["a_z"] == 9.0


def test_gyroscopes_leave_out_that_the_road_turns():
    """Roads are quasi-static: a bank that rises along the way is no roll rate."""
    imu = IMU(("roll_rate", "pitch_rate"), rate=100.0)
    said = imu.read(np.arange(3) / 100.0, rows(PLANAR) | {"bank": jnp.asarray(np.linspace(0.0, 0.05, 3))})
    assert all((np.asarray(value) == 0).all() for value in said.values())


def test_a_box_turned_by_a_right_angle_confuses_its_axes():
    said = read(IMU(alignment=Alignment(yaw=np.pi / 2), rate=100.0), PLANAR)
    np.testing.assert_allclose([said["a_x"], said["a_y"]], [2.0, -1.0], rtol=1e-12)


def test_each_channel_has_errors_of_its_own():
    imu = IMU({"yaw_rate": Signal(bias=0.1), "a_y": Signal(scale=0.5)}, rate=100.0)
    assert imu.channels == ("a_y", "yaw_rate") and imu.units == {"a_y": "m/s^2", "yaw_rate": "rad/s"}
    assert read(imu, PLANAR) == pytest.approx({"a_y": 3.0, "yaw_rate": 0.6}, rel=1e-12)


def test_the_low_pass_is_that_of_recordings():
    times = np.arange(200) / 100.0
    wave = {name: np.sin(5 * times + place) for place, name in enumerate(PLANAR)}
    said = jax.jit(lambda wave: IMU(low_pass=LowPass(8.0), rate=100.0).read(times, wave))(wave)
    expected = low_pass(Recording(times, wave), ("a_x", "a_y", "yaw_rate"), 8.0)
    for name, value in said.items():
        np.testing.assert_allclose(value, expected[name], rtol=1e-9, atol=1e-12)
        assert np.max(np.abs(value - wave[name])) > 0.1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: IMU(("a_x", "speed"), rate=1.0), r"IMU\.signals: unknown name\(s\) speed; there are: a_x, a_y, a_z"),
        (lambda: IMU({}, rate=1.0), r"IMU\.signals is empty: name at least one channel; there are: a_x"),
        (lambda: IMU({"a_x": 0.1}, rate=1.0), r"IMU\.signals: a_x = 0\.1: must be a Signal"),
        (lambda: IMU(3, rate=1.0), "signals = 3: must be a mapping"),
        (lambda: IMU(position=(0, 0, 0), rate=1.0), r"IMU\.position = \(0, 0, 0\): must be a Position"),
        (lambda: IMU(alignment=0.1, rate=1.0), r"IMU\.alignment = 0\.1: must be an Alignment"),
        (lambda: IMU(low_pass=20.0, rate=1.0), r"IMU\.low_pass = 20\.0: must be a LowPass"),
        (lambda: Alignment(yaw=np.nan), r"Alignment\.yaw = nan: must be finite"),
    ],
)
def test_bad_input_raises_by_name_value_and_range(make, message):
    with pytest.raises(InputError, match=message):
        make()

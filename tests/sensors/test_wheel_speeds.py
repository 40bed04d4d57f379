"""Wheel speeds: whole edges, timed edges, standstill, radii."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError
from jaxveh.sensors import Signal, WheelSpeeds

RATE, TEETH = 50.0, 48
PITCH = 2 * np.pi / TEETH


ROWS = 400
"""Of what a test hears at least: operations on as many rows are compiled once."""


def spin(device, omega, key=None):
    """What is said of one wheel's spins (n,), rad/s; the last one goes on, as what comes later is not known before."""
    n, omega = len(omega), np.pad(np.asarray(omega, float), (0, max(ROWS - len(omega), 0)), mode="edge")
    said = device.read(np.arange(len(omega)) / RATE, dict.fromkeys(device.needs, jnp.asarray(omega)), key)
    return np.asarray(said[device.channels[0]])[:n]


def ring(**options):
    return WheelSpeeds("omega_fl", teeth=TEETH, rate=RATE, **options)


def test_counted_edges_are_those_that_have_passed():
    """From the middle between two edges on, against the angle's closed form; the first period is taken as steady."""
    t = np.arange(200) / RATE
    omega = 30 + 15 * t
    said = spin(ring(method="M"), omega)
    angle = np.concatenate([[0.0], 30 * t + 7.5 * t**2 + 30 / RATE])
    edges = np.floor(angle / PITCH + 0.5)
    np.testing.assert_allclose(said, np.diff(edges) * PITCH * RATE, rtol=1e-12)
    assert np.max(np.abs(said - omega)) > 0.5


def test_counted_speeds_are_multiples_and_right_in_the_mean():
    n = 20000
    said = spin(ring(method="M"), np.full(n, 41.3), jax.random.key(0))
    step = PITCH * RATE
    np.testing.assert_allclose(said / step, np.round(said / step), atol=1e-9)
    assert len(np.unique(np.round(said / step))) == 2
    # All but the first and the last part of a pitch have been counted.
    np.testing.assert_allclose(said.mean(), 41.3, atol=step / n)


def test_where_a_wheel_starts_is_random_and_another_for_each():
    device = WheelSpeeds(("omega_fl", "omega_fr"), method="M", rate=RATE)
    omega = jnp.asarray(np.full(ROWS, 41.3))
    said = device.read(np.arange(ROWS) / RATE, {"omega_fl": omega, "omega_fr": omega}, jax.random.key(0))
    assert not np.array_equal(said["omega_fl"], said["omega_fr"])


@pytest.mark.parametrize("omega", [7.0, 41.3, 180.0])
def test_timed_edges_are_exact_at_constant_speed(omega):
    said = spin(ring(), np.full(300, omega), jax.random.key(0))
    np.testing.assert_allclose(said, omega, rtol=1e-9)


def test_timed_edges_follow_an_acceleration_half_a_period_late():
    t = np.arange(400) / RATE
    omega = 30 + 8 * t
    said = spin(ring(), omega)
    # The mean over the time between the edges: at least half a period late, less than one and a half.
    late = (omega - said)[1:] / 8
    assert np.all((late > 0) & (late < 1.5 / RATE + PITCH / 30))
    np.testing.assert_allclose(late.mean(), 0.5 / RATE, rtol=0.2)


def test_a_wheel_that_stops_is_held_as_long_as_no_slower_speed_is_certain():
    """The last edge is at t = 0 or before; after it, the speed can be at most one pitch over the time since."""
    omega = np.concatenate([np.full(100, 20.0), np.zeros(100)])
    said = spin(ring(), omega)
    # The mean spin of the period in which it stops is half of it, hence half an interval more.
    since = 0.5 / RATE + np.arange(99) / RATE
    assert np.all(said[101:] <= np.minimum(20.0, PITCH / since[: len(said[101:])]) + 1e-9)
    assert np.all(np.diff(said[101:]) <= 0) and said[-1] == pytest.approx(PITCH / since[-1], rel=0.02)
    assert said[101] > 1.0


def test_a_wheel_that_stands_from_the_start_says_nearly_nothing():
    assert np.all(spin(ring(), np.zeros(50)) == 0)
    assert np.all(spin(ring(method="M"), np.zeros(50)) == 0)


def test_tooth_errors_spread_the_timed_speeds():
    """Two edges, each wrong by 1 % of a pitch, over the way of one period."""
    omega, error = 60.0, 0.01
    said = spin(ring(tooth_error=error), np.full(20000, omega), jax.random.key(1))
    teeth = omega / PITCH / RATE
    np.testing.assert_allclose(said.std() / omega, np.sqrt(2) * error / teeth, rtol=0.05)
    np.testing.assert_allclose(said.mean(), omega, rtol=1e-4)


@pytest.mark.parametrize("error", [0.03, 0.1])
def test_tooth_errors_of_wheels_at_any_speed_stay_errors_of_a_pitch(error):
    """From standstill to 200 rad/s: never negative, and the angle that was said is the wheel's, to within some pitches."""
    rng = np.random.default_rng(0)
    t = np.arange(ROWS) / RATE
    for seed, top in enumerate((0.01, 0.1, 0.5, 2.0, 10.0, 200.0)):
        omega = top * np.abs(np.sin(rng.uniform(0.1, 2.0) * t)) * rng.uniform(0.5, 1.0)
        said = spin(ring(tooth_error=error), omega, jax.random.key(seed))
        assert np.all(np.isfinite(said)) and np.all(said >= 0.0), top
        # The ways between two edges differ from the pitch by the two edges' errors, each of at most five deviations.
        assert np.all(said <= max(omega.max(), PITCH * RATE * (top > 2.0)) * (1 + 10 * error) + PITCH / t[-1]), top


def test_a_slow_wheel_has_the_tooth_errors_of_a_quick_one():
    """An edge in 40 periods: the time from edge to edge is right within a period, and spreads by two edges' errors."""
    error, omega = 0.05, PITCH * RATE / 40
    said = spin(ring(tooth_error=error), np.full(40_000, omega), jax.random.key(1))
    timed = said[1:][np.diff(said) != 0]
    np.testing.assert_allclose(np.mean(omega / timed), 1.0, rtol=0.02)
    assert 0.5 * np.sqrt(2) * error < np.std(omega / timed) < 1.5 * np.sqrt(2) * error


def test_the_lowest_speed_and_what_is_said_below():
    omega = np.concatenate([np.full(50, 6.0), np.full(50, 3.0)])
    zero, nothing = spin(ring(lowest=4.0), omega), spin(ring(lowest=4.0, below="nan"), omega)
    np.testing.assert_allclose(zero[:50], 6.0, rtol=1e-9)
    assert np.all(zero[54:] == 0) and np.all(np.isnan(nothing[54:]))
    np.testing.assert_array_equal(nothing[:50], zero[:50])


def test_the_direction_is_known_only_to_signed_sensors():
    for method in ("M", "M/T"):
        back = np.full(50, -40.0)
        np.testing.assert_array_equal(spin(ring(method=method), back), spin(ring(method=method), -back))
        np.testing.assert_array_equal(spin(ring(method=method, signed=True), back), -spin(ring(method=method), -back))


def test_speeds_are_those_of_the_stored_radius_with_its_error():
    device = WheelSpeeds({"wheel_speed_fl": Signal(scale=0.01)}, radius=0.3, rate=RATE)
    assert device.needs == ("omega_fl",) and device.units == {"wheel_speed_fl": "m/s"}
    np.testing.assert_allclose(spin(device, np.full(20, 50.0)), 0.3 * 50 * 1.01, rtol=1e-9)


def test_a_sensor_on_a_pitching_body_counts_what_turns_against_it():
    spins = {"omega_fl": 65.0, "omega_to_body_fl": 64.7}
    said = ring().read(np.arange(ROWS) / RATE, {name: jnp.asarray(np.full(ROWS, v)) for name, v in spins.items()})
    np.testing.assert_allclose(said["omega_fl"], 64.7, rtol=1e-9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: WheelSpeeds("omega_fl", teeth=0, rate=1.0), "teeth = 0: must be a whole number"),
        (lambda: WheelSpeeds("omega_fl", teeth=2.5, rate=1.0), r"teeth = 2\.5: must be a whole number"),
        (lambda: WheelSpeeds("omega_xx", rate=1.0), r"unknown name\(s\) omega_xx; there are: wheel_speed_fl"),
        (lambda: WheelSpeeds(rate=1.0), r"radius = None: speeds in m/s need the radius"),
        (lambda: ring(radius=-0.3), r"radius = -0\.3: must be positive"),
        (lambda: ring(lowest=0.0), r"lowest = 0\.0: must be positive"),
        (lambda: ring(method="T"), r"method = 'T': must be one of 'M', 'M/T'"),
        (lambda: ring(below="hold"), r"below = 'hold': must be one of 'zero', 'nan'"),
        (lambda: ring(tooth_error=0.2), r"tooth_error = 0\.2: must be at most 0\.1"),
    ],
)
def test_bad_input_raises_by_name_value_and_range(make, message):
    with pytest.raises(InputError, match=message):
        make()

"""Manoeuvres of the standards: their times, amplitudes and spectra, bad input."""

import equinox as eqx
import jax
import numpy as np
import pytest

from jaxveh import InputError, manoeuvres

KEY = jax.random.key(5)


ROWS = 512
"""Instants that a program looks at: one serves every list of them that is no longer."""


@eqx.filter_jit
def inputs(manoeuvre, t):
    """Compiled as one: operation by operation each takes a program of its own."""
    return manoeuvre.inputs(t)


def steer(manoeuvre, t):
    t = np.asarray(t, float)
    rows = np.zeros(max(ROWS, t.size))
    rows[: t.size] = t.ravel()
    return np.asarray(inputs(manoeuvre, rows).steer)[: t.size].reshape(t.shape)


def test_sine_with_dwell_is_a_sine_whose_second_peak_is_held():
    m = manoeuvres.sine_with_dwell(22.2, 0.1)
    period = 1 / 0.7
    np.testing.assert_allclose(steer(m, 1 + np.array([0.25, 0.5]) * period), [0.1, 0.0], atol=1e-15)
    third = 1 + 0.75 * period
    held = np.linspace(third + 0.025, third + 0.5 - 0.025, 101)
    np.testing.assert_allclose(steer(m, held), -0.1, rtol=1e-14)
    # The edges' other halves, within the peak's flat top.
    np.testing.assert_allclose(steer(m, [third, third + 0.5]), -0.1, rtol=2e-4)
    assert (steer(m, [third - 0.04, third + 0.54]) > -0.0995).all()
    # The last quarter comes after the dwell, and then nothing.
    np.testing.assert_allclose(steer(m, third + 0.5 + 0.125 * period), -0.1 * np.sqrt(0.5), rtol=1e-12)
    np.testing.assert_allclose(steer(m, [0.0, 0.97, third + 0.53 + 0.25 * period, 6.0]), 0.0, atol=1e-15)


def test_sine_with_dwell_is_the_plain_sine_within_its_edges():
    m = manoeuvres.sine_with_dwell(22.2, 0.1, frequency=0.5, dwell=0.3)
    t = np.linspace(1.03, 2.45, 201)
    np.testing.assert_allclose(steer(m, t), 0.1 * np.sin(2 * np.pi * 0.5 * (t - 1)), atol=1e-15)


def test_ramp_steer_grows_at_a_constant_rate():
    m = manoeuvres.ramp_steer(22.2, 0.1, rise=10.0, start=1.0)
    np.testing.assert_allclose(
        steer(m, [0.5, 2.0, 6.0, 10.5, 11.5, 13.0]), [0, 0.01, 0.05, 0.095, 0.1, 0.1], atol=1e-15
    )
    assert m.duration == 13.25


def test_slalom_is_as_many_periods_as_it_says():
    m = manoeuvres.slalom(15.0, 0.05, frequency=0.5, periods=3.0, start=1.0)
    t = np.linspace(1.2, 6.8, 401)
    np.testing.assert_allclose(steer(m, t), 0.05 * np.sin(np.pi * (t - 1)), atol=1e-14)
    np.testing.assert_allclose(steer(m, [0.5, 7.2, 8.0]), 0.0, atol=1e-15)


def test_random_steering_has_its_spread_and_its_band():
    m = manoeuvres.random_steering(20.0, 0.05, KEY, lowest=0.2, highest=2.0, duration=400.0)
    t = np.arange(2.0, 398.0, 0.05)
    wave = steer(m, t)
    np.testing.assert_allclose(np.std(wave), 0.05, rtol=0.05)
    power, frequency = np.abs(np.fft.rfft(wave * np.hanning(len(t)))) ** 2, np.fft.rfftfreq(len(t), 0.05)
    inside = (frequency > 0.19) & (frequency < 2.01)
    assert power[inside].sum() > 0.999 * power.sum()
    thirds = [power[(frequency > a) & (frequency <= a + 0.6)].sum() for a in (0.2, 0.8, 1.4)]
    np.testing.assert_allclose(thirds, power.sum() / 3, rtol=0.1)


def test_random_steering_has_its_spread_over_keys():
    draw = lambda key: manoeuvres.random_steering(20.0, 0.05, key).inputs(33.3).steer
    drawn = jax.jit(lambda key: jax.vmap(draw)(jax.random.split(key, 3000)))(KEY)
    np.testing.assert_allclose(np.std(drawn), 0.05, rtol=4 / np.sqrt(6000))


def test_braking_in_a_turn_holds_the_steer_and_brakes_to_a_stop():
    m = manoeuvres.braking_in_a_turn(20.0, 0.1, 5.0, brake_at=3.0, drive_torque=80.0)
    u = jax.tree.map(np.asarray, inputs(m, np.array([0.4, 2.0, 3.15, 3.3, 5.15, 9.0])))
    np.testing.assert_allclose(u.steer, [0, 0.1, 0.1, 0.1, 0.1, 0.1], atol=1e-15)
    np.testing.assert_allclose(u.v_x[[0, 1, 3, 4, 5]], [20, 20, 20 - 5 * 0.15, 10, 0], atol=1e-12)
    np.testing.assert_allclose(u.v_x_rate, [0, 0, -2.5, -5, -5, 0], atol=1e-12)
    full = 1500 * 0.3 * 5
    np.testing.assert_allclose(u.brake_torque, [0, 0, full / 2, full, full, full], atol=1e-9)
    np.testing.assert_allclose(u.drive_torque, [80, 80, 40, 0, 0, 0], atol=1e-12)


def test_mu_jump_braking_is_straight():
    u = inputs(manoeuvres.mu_jump_braking(20.0, 6.0, mass=1000.0, wheel_radius=0.5), 2.0)
    assert float(u.steer) == 0 and float(u.brake_torque) == 3000.0


def test_cruise_has_the_spreads_of_its_speed_and_its_pedals():
    m = manoeuvres.cruise(25.0, KEY, speed_std=2.0, pedal_noise=60.0, duration=4000.0)
    u = jax.tree.map(np.asarray, inputs(m, np.arange(0.0, 4000.0, 0.1)))
    np.testing.assert_allclose([np.mean(u.v_x), np.std(u.v_x)], [25.0, 2.0], rtol=0.05)
    net = u.drive_torque - u.brake_torque
    np.testing.assert_allclose(np.std(net), 60.0, rtol=0.05)
    lag = 20  # 2 s, the correlation time
    np.testing.assert_allclose(np.mean(net[lag:] * net[:-lag]) / 3600, np.exp(-1), atol=0.06)
    held = inputs(manoeuvres.cruise(25.0, KEY, speed_std=0.0), np.arange(0.0, 50.0))
    assert np.all(np.asarray(held.v_x) == 25.0)


def test_changing_speed_rises_linearly_between_its_corners():
    speed = manoeuvres.ChangingSpeed(10.0, 20.0, start=2.0, time=5.0, edge=1.0)
    v_x, rate = jax.jit(lambda t: speed.at(t))(np.array([0.0, 3.0, 4.5, 6.0, 9.0]))
    np.testing.assert_allclose(v_x, [10, 12, 15, 18, 20], rtol=1e-13)
    np.testing.assert_allclose(rate, [0, 2, 2, 2, 0], atol=1e-13)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: manoeuvres.sine_with_dwell(22.0, 7.0), r"steer = 7\.0: must be within a quarter turn.*not degrees"),
        (lambda: manoeuvres.sine_with_dwell(22.0, 0.1, duration=2.0), r"duration = 2\.0: must be at least start \+ period"),
        (lambda: manoeuvres.sine_with_dwell(22.0, 0.1, edge=0.6), r"edge = 0\.6: must be at most 0\.3\d+ s"),
        (lambda: manoeuvres.sine_with_dwell(22.0, 0.1, start=0.0), r"start = 0\.0: must be at least 0\.025"),
        (lambda: manoeuvres.sine_with_dwell(22.0, 0.1, dwell=-1.0), r"dwell = -1\.0: must be positive"),
        (lambda: manoeuvres.ramp_steer(22.0, 0.1, rise=0.0), r"rise = 0\.0: must be positive"),
        (lambda: manoeuvres.ramp_steer(22.0, 0.1, duration=3.0), r"duration = 3\.0: must be at least start \+ rise"),
        (lambda: manoeuvres.slalom(22.0, 0.1, frequency=0.0), r"frequency = 0\.0: must be positive"),
        (lambda: manoeuvres.slalom(-22.0, 0.1), r"speed = -22\.0: must be between 0 and 150 m/s"),
        (lambda: manoeuvres.random_steering(22.0, 0.1, KEY, highest=0.05), r"highest = 0\.05: must be above lowest = 0\.1"),
        (lambda: manoeuvres.random_steering(22.0, 0.1, KEY, count=0), r"count = 0: must be a whole number of at least 1"),
        (lambda: manoeuvres.random_steering(22.0, 0.1, KEY, edge=40.0), r"edge = 40\.0: must be at most half the duration"),
        (lambda: manoeuvres.braking_in_a_turn(22.0, 0.1, -5.0), r"deceleration = -5\.0: must be positive"),
        (lambda: manoeuvres.braking_in_a_turn(22.0, 0.1, brake_at=1.0), r"brake_at = 1\.0: must be at least start \+ ramp"),
        (lambda: manoeuvres.mu_jump_braking(22.0, duration=1.0), r"duration = 1\.0: must be at least brake_at"),
        (lambda: manoeuvres.cruise(22.0, KEY, pedal_noise=-1.0), r"pedal_noise = -1\.0: must be at least 0"),
        (lambda: manoeuvres.cruise(22.0, KEY, speed_time=0.0), r"speed_time = 0\.0: must be positive"),
        (lambda: manoeuvres.ChangingSpeed(1.0, -2.0), r"after = -2\.0: must be between 0 and 150 m/s"),
        (lambda: manoeuvres.ChangingSpeed(1.0, 2.0, edge=20.0), r"edge = 20\.0: must be at most time = 10 s"),
        (lambda: manoeuvres.wavering_speed(20.0, -2.0, KEY), r"std = -2\.0: must be at least 0\.0"),
        (lambda: manoeuvres.SteadySpeed(-1.0), r"speed = -1\.0: must be between 0 and 150 m/s"),
        (lambda: manoeuvres.named_manoeuvre("stepsteer", 20.0), r"manoeuvre = 'stepsteer': must be one of 'double-lane-change'"),
    ],
)  # fmt: skip
def test_bad_input_raises_by_name_value_and_range(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize("name", manoeuvres.MANOEUVRES)
def test_every_name_is_what_it_says(name):
    entry = manoeuvres.MANOEUVRES[name]
    made = manoeuvres.named_manoeuvre(name, 12.0, 0.05, duration=70.0)
    assert made.duration == 70.0 and len(entry.help) > 10
    assert isinstance(made, manoeuvres.AbstractDriver) == entry.closed_loop
    assert isinstance(made, manoeuvres.AbstractManoeuvre) != entry.closed_loop
    if not entry.closed_loop:
        assert hasattr(made.inputs(0.0), "brake_torque") == entry.pedals


def test_a_speed_takes_a_plain_number_as_its_time():
    for speed in (
        manoeuvres.SteadySpeed(20.0), manoeuvres.ChangingSpeed(15.0, 25.0), manoeuvres.wavering_speed(20.0, 1.0, KEY)
    ):  # fmt: skip
        assert speed.v_x(3.0) == speed.at(3.0)[0]

"""The extended-state observer: placed bandwidth, constant disturbances exactly, ramps with the lag that is known."""

import numpy as np
import pytest
from observer_systems import drive, mass, pendulum, regression

from jaxveh import InputError, observers, run
from jaxveh import statespace as ss
from jaxveh.observers.chains import chained_gain

DT = 0.01


def pushed(model):
    return ss.with_disturbances(model, {"speed": 1.0})


def pushes(push, model, rows=400):
    """A mass that starts at rest elsewhere and is pushed by `push(t)`."""
    time = DT * np.arange(rows)
    inputs = {"force": np.sin(3.0 * time) + push(time)}
    states, recording = drive(model, (0.3, -0.5), time, inputs)
    quiet = {"force": np.sin(3.0 * time)}
    return states, type(recording)(time, {**{name: recording[name] for name in model.channels}, **quiet})


@pytest.mark.parametrize("channels", [("place",), ("place", "speed")])
def test_every_pole_is_at_the_bandwidth(channels):
    model, bandwidth = pushed(mass(channels=channels)), 6.0
    gain = np.asarray(observers.extended_state(model, bandwidth, dt=DT).gain)
    F, H = observers.linearised_step(model, DT)
    pole = np.exp(-bandwidth * DT)
    error = (np.eye(3) - gain @ H) @ F
    # Eigenvalues that coincide lose digits; the polynomial that is zero does not.
    np.testing.assert_allclose(np.linalg.matrix_power((error - pole * np.eye(3)) / (1 - pole), 3), 0.0, atol=1e-10)
    assert np.abs(np.linalg.matrix_power((error - pole * np.eye(3)) / (1 - pole), 1)).max() > 0.1


def test_a_constant_disturbance_is_found_exactly_with_the_bandwidth():
    model, bandwidth = pushed(mass(damping=0.0, channels=("place",))), 6.0
    time = DT * np.arange(600)
    states, recording = drive(model, (0.3, -0.5, 0.7), time, {"force": np.sin(3.0 * time)})
    observer = observers.extended_state(model, bandwidth, dt=DT)
    error = np.stack(run(observer, model, recording).mean, axis=1) - states
    F, H = observers.linearised_step(model, DT)
    step, expected = (np.eye(3) - np.asarray(observer.gain) @ H) @ F, error[0]
    for k in range(1, 200):
        expected = step @ expected
        np.testing.assert_allclose(error[k], expected, atol=1e-11)
    assert np.abs(error[:, 2]).max() > 0.7 and np.abs(error[-1]).max() < 1e-11
    # t^2 exp(-bandwidth t): over a second late in the decay, by exp(-bandwidth) (t + 1)^2 / t^2 to first order in 1 / t.
    ratio = np.linalg.norm(error[400]) / np.linalg.norm(error[300])
    np.testing.assert_allclose(ratio, np.exp(-bandwidth) * (4.0 / 3.0) ** 2, rtol=0.15)


def test_a_ramp_is_followed_three_poles_late():
    # A free mass, its place seen: the estimate is the push through bandwidth^3 / (s + bandwidth)^3.
    free, bandwidth, slope = mass(0.0, 0.0, ("place",)), 5.0, 0.4
    _, recording = pushes(lambda t: slope * t, free, 800)
    model = pushed(free)
    found = run(observers.extended_state(model, bandwidth, dt=DT), model, recording).mean.disturbance_speed
    lag = (slope * np.asarray(recording.time) - np.asarray(found))[-1] / slope
    np.testing.assert_allclose(lag, 3.0 / bandwidth, rtol=0.03)


def test_what_is_not_modelled_is_a_disturbance():
    # The observer's spring is softer: the state is found the better, and the disturbance is the spring's missing force.
    states, recording = pushes(lambda t: 0.0 * t, mass(8.0, channels=("place",)), 600)
    soft = mass(4.0, channels=("place",))
    plain = run(observers.Luenberger(observers.place_poles(soft, [-12.0, -13.0], dt=DT)), soft, recording)
    model = pushed(soft)
    robust = run(observers.extended_state(model, 12.0, dt=DT), model, recording)
    rms = lambda estimate: np.sqrt(np.mean(np.square(np.asarray(estimate.mean.speed) - states[:, 1])[200:]))
    assert rms(robust) < 0.5 * rms(plain)
    late = round(3.0 / 12.0 / DT)
    missing = -4.0 * states[200 - late : -late, 0]
    assert np.corrcoef(missing, np.asarray(robust.mean.disturbance_speed)[200:])[0, 1] > 0.98


def test_on_a_pendulum_the_disturbance_settles():
    model = ss.with_disturbances(pendulum(), {"rate": 1.0})
    time = DT * np.arange(500)
    states, recording = drive(model, (1.0, 0.0, 0.6), time, {"force": np.zeros(500)})
    found = run(observers.extended_state(model, 8.0, dt=DT), model, recording).mean
    np.testing.assert_allclose(np.stack(found, axis=1)[-1], states[-1], atol=1e-6)


def test_chains_of_several_channels_place_every_pole():
    rng = np.random.default_rng(0)
    for n, m in ((2, 1), (4, 1), (4, 2), (5, 2), (6, 3)):
        F, C = np.eye(n) + 0.05 * rng.normal(size=(n, n)), rng.normal(size=(m, n))
        gain = chained_gain(F, C, np.full(n, 0.9))
        error = (F - gain @ C - 0.9 * np.eye(n)) / 0.1
        np.testing.assert_allclose(np.linalg.matrix_power(error, n), 0.0, atol=1e-8)
    poles = np.array([0.9, 0.9, 0.8, 0.8])
    F, C = np.eye(4) + 0.1 * rng.normal(size=(4, 4)), rng.normal(size=(1, 4))
    found = np.poly(F - chained_gain(F, C, poles) @ C)
    np.testing.assert_allclose(found, np.poly(poles), rtol=1e-9)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: observers.extended_state(mass(), 5.0, dt=DT), "the model has no disturbances"),
        (lambda: observers.extended_state(pushed(mass()), -5.0, dt=DT), "bandwidth = -5.0: must be positive"),
        (
            lambda: observers.extended_state(
                ss.with_disturbances(mass(channels=("place",)), {"place": 1.0, "speed": 1.0}), 5.0, dt=DT
            ),
            "3 of 4 directions",
        ),
        (
            lambda: observers.place_poles(pushed(mass()), [-3.0, -3.0, -3.0001], dt=0.0),
            "dt = 0.0: must be positive",
        ),
        (
            lambda: observers.place_poles(
                ss.with_disturbances(mass(), {"place": 1.0, "speed": 1.0}), [-3.0, -3.0, -3.0, -4.0], dt=DT
            ),
            "a pole is repeated 3 times with 2 channels",
        ),
        (lambda: observers.place_poles(regression(), [-1.0, -2.0], dt=DT), "in a, b does not"),
        (lambda: observers.place_poles(mass(), [-1.0], dt=DT, leave=("place",)), "speed, place depends on place"),
        (lambda: observers.place_poles(mass(), [-1.0 + 1j, -2.0], dt=DT), "conjugate pairs"),
        (lambda: observers.place_poles(mass(), [-1.0, -2.0], dt=DT, u={"torque": 1.0}), "unknown name.* torque"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_without_float64_gains_and_estimates_are_good_enough(float32):
    model, time = pushed(mass(channels=("place",))), DT * np.arange(600)
    states, recording = drive(model, (0.3, -0.5, 0.7), time, {"force": np.sin(3.0 * time)})
    found = run(observers.extended_state(model, 6.0, dt=DT), model, recording).mean
    assert found.speed.dtype == np.float32
    np.testing.assert_allclose(np.stack(found, axis=1)[-100:], states[-100:], atol=2e-2)
    with pytest.raises(InputError, match="1 of 2 directions.*in speed"):
        observers.place_poles(mass_unseen(), [-3.0, -4.0], dt=DT)


def mass_unseen():
    """Two states that nothing couples; one is seen."""
    stays = lambda system, t0, t1, x, u: x
    still = mass(channels=("place",))
    return ss.StateSpace(
        transition=stays,
        observation=still.observation_function,
        process_noise=None,
        measurement_noise=still.measurement_noise,
        prior=still.prior,
        inputs=("force",),
    )

"""The adaptive observer: errors apart, Lyapunov's function, what excitation decides, and what holds it without."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from observer_systems import Mass, drive, mass, move_mass, pendulum, regression, see_mass

from jaxveh import InputError, Recording, observers, run
from jaxveh import statespace as ss

DT, ROWS = 0.02, 800
TIME = DT * np.arange(ROWS)


def pushed_mass(system, t0, t1, x, u):
    """Linear in the state and in both parameters: a pull that is constant, and a gain on the force."""
    dt, x = t1 - t0, move_mass(system, t0, t1, x, u)
    return Mass(x.place, x.speed + dt * (system["pull"] + (system["gain"] - 1.0) * u.force))


def model(**start):
    base = mass(channels=("place",))
    values = {"pull": 0.5, "gain": 2.0, **start}
    return ss.StateSpace(
        system={**base.system, **{name: jnp.asarray(value) for name, value in values.items()}},
        transition=pushed_mass,
        observation=see_mass,
        process_noise=None,
        measurement_noise=base.measurement_noise,
        prior=base.prior,
        inputs=("force",),
    )


def joint(**start):
    return ss.with_parameters(model(**start), lambda m: (m.system["pull"], m.system["gain"]), prior=0.5)


def observer(rate=3e-3, **options):
    gain = observers.place_poles(mass(channels=("place",)), [-2.0, -3.0], dt=DT)
    return observers.Adaptive(gain, {"pull": rate, "gain": rate}, **options)


def errors(estimate, states, truth=(0.5, 2.0)):
    """What the states (T, 2) and the parameters (T, 2) lack."""
    found = np.stack(estimate.mean, axis=1)
    return states - found[:, :2], np.array(truth) - found[:, 2:]


RICH = {"force": np.sin(1.5 * TIME) + np.cos(4.0 * TIME)}
POOR = {"force": np.ones(ROWS)}


def test_the_state_s_own_error_has_the_placed_poles_while_the_parameters_move():
    # What the parameters' error does not explain, x - Y theta, obeys (I - gain H) F alone, whatever the adaptation does.
    states, recording = drive(model(), (0.4, -0.3), TIME, RICH)
    made, system = observer(), joint(pull=1.5, gain=0.7)
    rows = jax.tree.map(np.asarray, system.rows(recording))
    row = lambda k: jax.tree.map(lambda leaf: leaf[k], rows)
    init, advance = eqx.filter_jit(made.init), eqx.filter_jit(made.step)
    belief, _ = init(system, row(0))
    F, H = observers.linearised_step(mass(channels=("place",)), DT)
    step = (np.eye(2) - np.asarray(made.gain) @ H) @ F
    expected = None
    for k in range(60):
        if k:
            belief, _ = advance(system, belief, row(k))
        found = np.asarray(belief.vector)
        own = states[k] - found[:2] - np.asarray(belief.memory) @ (np.array([0.5, 2.0]) - found[2:])
        expected = own if expected is None else step @ expected
        np.testing.assert_allclose(own, expected, atol=1e-12)
    assert np.abs(found[2:] - [1.5, 0.7]).max() > 0.05


@pytest.mark.parametrize("rate", [1e-4, 3e-3, 1e6])
def test_lyapunov_s_function_never_rises_however_large_the_rate(rate):
    states, recording = drive(model(), (0.0, 0.0), TIME, RICH)
    _, theta = errors(run(observer(rate), joint(pull=1.5, gain=0.7), recording), states)
    V = np.sum(theta**2, axis=1)
    assert (np.diff(V) <= 1e-15).all() and V[-1] < 0.95 * V[0]


def test_when_excited_both_errors_die_out_exponentially():
    time = DT * np.arange(3 * ROWS)
    force = {"force": np.sin(1.5 * time) + np.cos(4.0 * time)}
    states, recording = drive(model(), (0.4, -0.3), time, force)
    state, theta = errors(run(observer(3e-3), joint(pull=1.5, gain=0.7), recording), states)
    V = np.sum(theta**2, axis=1)
    for k in range(0, 3 * ROWS - 400, 400):
        assert V[k + 399] < 0.2 * V[k]
    assert V[-1] < 1e-5 * V[0] and np.abs(state[-100:]).max() < 0.01 * np.abs(state[:100]).max()


def test_without_excitation_only_the_sum_is_found():
    # Under a constant force only pull + gain force leaves a trace: V falls to what that leaves, and no further.
    states, recording = drive(model(), (0.0, 0.0), TIME, POOR)
    state, theta = errors(run(observer(1e3), joint(pull=1.5, gain=0.7), recording), states)
    np.testing.assert_allclose(theta[-1].sum(), 0.0, atol=1e-6)
    np.testing.assert_allclose(theta[-1, 0] - theta[-1, 1], -1.0 - 1.3, atol=1e-6)
    assert np.abs(state[-1]).max() < 1e-6


def test_alone_it_is_normalised_least_mean_squares():
    # Every state is a parameter: theta += G p e / (R + p G p) in closed form.
    rng = np.random.default_rng(1)
    p, q, time = rng.normal(size=60), rng.normal(size=60), 0.1 * np.arange(60)
    recording = Recording(time, {"p": p, "q": q, "y": 2.0 * p - q + 0.2 * rng.normal(size=60)})
    made = observers.Adaptive(np.zeros((0, 1)), {"a": 3.0, "b": 1.0})
    found = run(made, regression(), recording)
    theta = np.zeros(2)
    for k in range(60):
        phi, G = np.array([p[k], q[k]]), 0.1 * np.diag([3.0, 1.0])
        if k:
            theta = theta + G @ phi * (recording["y"][k] - phi @ theta) / (0.2**2 + phi @ G @ phi)
        np.testing.assert_allclose([found.mean.a[k], found.mean.b[k]], theta, rtol=1e-10, atol=1e-14)


def drift(**options):
    """y = a p with p dying out, and a bias that no a explains for long: the estimates of a (true: 0)."""
    rows = 4000
    time = 0.1 * np.arange(rows)
    p = 1.0 / np.sqrt(1.0 + time)
    recording = Recording(time, {"p": p, "q": np.zeros(rows), "y": np.full(rows, 0.3)})
    made = observers.Adaptive(np.zeros((1, 1)), {"a": 0.2}, **options)
    return np.asarray(run(made, regression(noise=0.2), recording).mean.a)


def test_what_holds_it_where_nothing_excites():
    free = drift()
    assert free[-1] > 4.0 and (np.diff(free[10:]) > 0).all()
    np.testing.assert_allclose(drift(dead_zone=1.5), 0.0, atol=1e-14)
    bounded = drift(bounds={"a": (-1.0, 1.0)})
    assert bounded[-1] == 1.0 and bounded.max() <= 1.0
    leaky = drift(leakage=1.0)
    assert leaky.max() < 1.0 and leaky[-1] < 0.1 * free[-1]


def test_leakage_forgets_at_its_rate():
    rows = 200
    y = np.where(np.arange(rows) < 100, 1.0, np.nan)
    recording = Recording(DT * np.arange(rows), {"p": np.ones(rows), "q": np.zeros(rows), "y": y})
    made = observers.Adaptive(np.zeros((1, 1)), {"a": 5.0}, leakage=0.8)
    a = np.asarray(run(made, regression(), recording).mean.a)
    assert a[99] > 0.5
    np.testing.assert_allclose(a[100:], a[99] * np.exp(-0.8 * DT * np.arange(1, 101)), rtol=1e-10)


def test_a_dead_zone_lets_small_errors_pass():
    recording = Recording(DT * np.arange(50), {"p": np.ones(50), "q": np.zeros(50), "y": np.full(50, 0.19)})
    made = lambda zone: observers.Adaptive(np.zeros((1, 1)), {"a": 5.0}, dead_zone=zone)
    assert np.asarray(run(made(1.0), regression(), recording).mean.a).max() == 0.0
    assert np.asarray(run(made(0.9), regression(), recording).mean.a)[-1] == pytest.approx(0.01, abs=1e-3)


def test_a_pendulum_s_pull_is_found_and_with_it_the_rate():
    force = {"force": 3.0 * np.sin(2.0 * TIME)}
    states, recording = drive(pendulum(9.0), (1.0, 0.0), TIME, force, noise=0.2)
    wrong = ss.with_parameters(pendulum(13.0), lambda m: m.system["pull"], prior=0.3)
    gain = observers.place_poles(pendulum(13.0), [-4.0, -5.0], dt=DT)
    found = run(observers.Adaptive(gain, {"pull": 5.0}, bounds={"pull": (3.0, 20.0)}), wrong, recording)
    assert np.abs(np.asarray(found.mean.pull)[-200:] - 9.0).max() < 0.15
    fixed = run(observers.Luenberger(gain), pendulum(13.0), recording)
    rms = lambda estimate: np.sqrt(np.mean(np.square(np.asarray(estimate.mean.rate) - states[:, 1])[-400:]))
    assert rms(found) < 0.1 * rms(fixed)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: observers.Adaptive(np.zeros((2, 1)), {}), "Adaptive.rate is empty"),
        (lambda: observers.Adaptive(np.zeros((2, 1)), {"a": 0.0}), "Adaptive.rate of a = 0.0: must be positive"),
        (
            lambda: observers.Adaptive(np.zeros((2, 1)), {"a": 1.0}, bounds={"b": (0.0, 1.0)}),
            "Adaptive.bounds: unknown",
        ),
        (lambda: observers.Adaptive(np.zeros((2, 1)), {"a": 1.0}, bounds={"a": (1.0, 1.0)}), "low below high"),
        (lambda: observers.Adaptive(np.zeros((2, 1)), {"a": 1.0}, leakage=-1.0), "Adaptive.leakage = -1.0"),
        (lambda: observers.Adaptive(np.zeros((2, 1)), {"a": 1.0}, dead_zone=-1.0), "Adaptive.dead_zone = -1.0"),
        (
            lambda: observers.Adaptive(np.zeros((2, 1)), {"mass": 1.0}).check(joint()),
            "Adaptive.rate: unknown name.* mass",
        ),
        (
            lambda: observers.Adaptive(np.zeros((4, 1)), {"pull": 1.0, "gain": 1.0}).check(joint()),
            r"Adaptive.gain has shape \(4, 1\): must be \(2, 1\), states place, speed by channels place",
        ),
        (
            lambda: observers.Adaptive(np.full((2, 1), np.nan), {"pull": 1.0, "gain": 1.0}).check(joint()),
            r"Adaptive.gain = \[\[nan\]",
        ),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(InputError, match=message):
        call()

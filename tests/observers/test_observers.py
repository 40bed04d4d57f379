"""Observers on linear models: the poles that were asked for, switching, least squares against a batch, bad input."""

from collections import namedtuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from observer_systems import regression as line

from jaxveh import InputError, Recording, observers, run
from jaxveh import statespace as ss
from jaxveh._core.names import record_type

DT = 0.01
X, Y = record_type("X", ("place", "speed", "offset")), record_type("Y", ("place", "speed"))


def move(system, t0, t1, x, u):
    dt = t1 - t0
    return X(x.place + dt * x.speed, x.speed + dt * (u.force - system["stiffness"] * x.place), x.offset)


def see(system, t, x, u):
    return Y(x.place, x.speed + x.offset)


def model(stiffness=4.0):
    """A mass on a spring, its place seen, and its speed with an unknown offset."""
    return ss.StateSpace(
        system={"stiffness": jnp.asarray(stiffness)},
        transition=move,
        observation=see,
        process_noise=None,
        measurement_noise=ss.Gaussian({"place": 0.01, "speed": 0.1}),
        prior=ss.Prior(X(0.0, 0.0, 0.0), {"place": 1.0, "speed": 1.0, "offset": 1.0}),
        inputs=("force",),
    )


def truth(rows=400, start=(1.0, -0.5, 0.3), stiffness=4.0):
    system, x, states = model(stiffness), X(*start), []
    force = np.sin(3.0 * DT * np.arange(rows))
    for k in range(rows):
        states.append(tuple(x))
        u = record_type("U", ("force",))(force[k])
        x = X(*[float(v) for v in move({"stiffness": stiffness}, 0.0, DT, x, u)])
    states = np.array(states)
    channels = {"place": states[:, 0], "speed": states[:, 1] + states[:, 2], "force": force}
    return system, states, Recording(DT * np.arange(rows), channels)


def test_a_state_is_known_by_its_fields():
    system, _, _ = truth()
    own = namedtuple("Mine", system.states)(*system.prior.mean)
    for a, b in zip(observers.linearised_step(system, DT, own), observers.linearised_step(system, DT), strict=True):
        np.testing.assert_array_equal(a, b)
    with pytest.raises(InputError, match="must have the fields place, speed"):
        observers.linearised_step(system, DT, (0.0, 0.0, 0.0))


def test_the_error_dies_out_with_the_poles_that_were_asked_for():
    system, states, recording = truth()
    poles = np.array([-8.0, -5.0 + 3.0j, -5.0 - 3.0j])
    gain = observers.place_poles(system, poles, dt=DT)
    F, H = observers.linearised_step(system, DT)
    found = np.sort_complex(np.linalg.eigvals((np.eye(3) - gain @ H) @ F))
    np.testing.assert_allclose(found, np.sort_complex(np.exp(poles * DT)), rtol=1e-8)
    estimate = run(observers.Luenberger(gain), system, recording)
    error = np.stack(estimate.mean, axis=1) - states
    expected = error[0]
    for k in range(1, 50):
        expected = (np.eye(3) - gain @ H) @ F @ expected
        np.testing.assert_allclose(error[k], expected, rtol=1e-6, atol=1e-12)
    assert np.max(np.abs(error[300:])) < 1e-5
    assert np.isnan(estimate.std.place).all() and np.isnan(estimate.log_likelihood)


def test_missing_rows_leave_the_model_to_itself():
    system, _, recording = truth(20)
    gain = observers.place_poles(system, [-8.0, -5.0, -6.0], dt=DT)
    place, speed = np.array(recording["place"]), np.array(recording["speed"])
    place[10:], speed[10:] = np.nan, np.nan
    silent = Recording(recording.time, {"place": place, "speed": speed, "force": recording["force"]})
    found = run(observers.Luenberger(gain), system, silent)
    u = record_type("U", ("force",))(float(recording["force"][14]))
    x = X(*[float(leaf[14]) for leaf in found.mean])
    expected = move({"stiffness": 4.0}, 0.0, DT, x, u)
    np.testing.assert_allclose([leaf[15] for leaf in found.mean], expected, rtol=1e-12)


def test_switching_holds_what_a_wrong_model_adds():
    # The observer's spring is half as stiff: the place, which is seen, is off by what that adds, and held by switching.
    _, states, recording = truth(stiffness=8.0)
    system = model(4.0)
    gain = observers.place_poles(system, [-3.0, -4.0, -5.0], dt=DT)
    linear = run(observers.Luenberger(gain), system, recording)
    switching = np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    same = run(observers.SlidingMode(gain, switching, [0.02, 0.05]), system, recording)
    np.testing.assert_allclose(np.stack(same.mean), np.stack(linear.mean), rtol=1e-12)
    switching[0, 0], switching[1, 0] = 0.01, 0.05
    robust = run(observers.SlidingMode(gain, switching, [0.02, 0.05]), system, recording)
    rms = lambda estimate: np.sqrt(np.mean(np.square(np.asarray(estimate.mean.place) - states[:, 0])[200:]))
    assert rms(robust) < 0.1 * rms(linear)


Place, Seen = record_type("Place", ("x",)), record_type("Seen", ("x",))


def drifts(system, t0, t1, x, u):
    return Place(x.x + u.push)


def test_a_bounded_disturbance_is_rejected_from_a_time_that_is_known():
    # A place that something unknown moves by d a step, |d| < K: within the boundary b in (e_0 - b) / (K / 2 - d) steps, and then
    # for a constant d at b q / (1 - q), q = d / K; the linear observer of the same slope at zero has b q there, but no bound on
    # what a large d does. Without the boundary's smoothing it would be zero.
    system = ss.StateSpace(
        transition=drifts,
        observation=lambda s, t, x, u: Seen(x.x),
        process_noise=None,
        measurement_noise=ss.Gaussian({"x": 0.01}),
        prior=ss.Prior(Place(0.0), {"x": 1.0}),
        inputs=("push",),
    )
    K, b, rows = 0.02, 0.05, 600
    d = np.where(np.arange(rows) < 300, 0.006, 0.006 * np.sign(np.sin(np.arange(rows))))
    x = 1.0 + np.concatenate([[0.0], np.cumsum(d[:-1])])
    recording = Recording(np.arange(float(rows)), {"x": x, "push": np.zeros(rows)})
    sliding = observers.SlidingMode(np.zeros((1, 1)), [[K]], b)
    error = x - np.asarray(run(sliding, system, recording).mean.x)
    reached = int(np.ceil((1.0 - b) / (K / 2 - 0.006)))
    assert error[0] > 10 * b and (np.abs(error[reached:]) <= b).all()
    # The innovation is at b q / (1 - q); what is left after its correction lacks d.
    q = 0.006 / K
    np.testing.assert_allclose(error[299], b * q / (1 - q) - 0.006, rtol=1e-6)
    assert (np.abs(error[reached:]) <= b * q / (1 - q) + 1e-9).all()


def test_gains_have_the_gradients_of_differences():
    system, _, recording = truth(60)
    gain = np.asarray(observers.place_poles(system, [-3.0, -4.0, -5.0], dt=DT))
    total = lambda gain: jnp.sum(run(observers.Luenberger(gain), system, recording, throw=False).mean.speed)
    both = jax.jit(jax.value_and_grad(total))
    step = np.zeros_like(gain)
    step[1, 0] = 1e-5
    difference = (both(gain + step)[0] - both(gain - step)[0]) / 2e-5
    np.testing.assert_allclose(both(gain)[1][1, 0], difference, rtol=1e-6)


ROWS = 1200


def regression(rows=ROWS, jump=None):
    """What y = a p - q is, a jumping from 2 to 5."""
    rng = np.random.default_rng(0)
    p, q = rng.normal(size=rows), rng.normal(size=rows)
    a = np.where(np.arange(rows) < (rows if jump is None else jump), 2.0, 5.0)
    y = a * p - 1.0 * q + 0.2 * rng.normal(size=rows)
    return p, q, y, Recording(np.arange(float(rows)), {"p": p, "q": q, "y": y})


@pytest.mark.parametrize("forgetting", [1.0, 0.95])
def test_least_squares_are_those_of_the_batch(forgetting):
    p, q, y, recording = regression()
    found = run(observers.RecursiveLeastSquares(forgetting), line(), recording)
    rows = len(y)
    A = np.stack([p, q], axis=1)
    weights = forgetting ** np.arange(rows - 1, -1, -1) / 0.2**2
    # The prior counts as a row that is forgotten with the others.
    normal = A.T @ (weights[:, None] * A) + np.eye(2) / 10.0**2 * forgetting ** (rows - 1)
    expected = np.linalg.solve(normal, A.T @ (weights * y))
    np.testing.assert_allclose([found.mean.a[-1], found.mean.b[-1]], expected, rtol=1e-10)


def test_several_factors_forget_apart_and_a_reset_follows_a_jump():
    *_, recording = regression(jump=50)
    last = lambda observer: float(run(observer, line(), recording).mean.a[55])
    never = last(observers.RecursiveLeastSquares(1.0))
    several = last(observers.RecursiveLeastSquares([0.8, 1.0]))
    anew = last(observers.RecursiveLeastSquares(1.0, reset=6.0))
    assert never < 3.0 < several < 5.2 and abs(anew - 5.0) < 0.5


def vahidi(p, q, y, forgetting, start):
    """Their scalar form for two parameters, forgetting before the gain: P starts multiplied by the factors."""
    theta, P, out = np.zeros(2), np.array(start) * forgetting, []
    for k in range(len(y)):
        phi = np.array([p[k], q[k]])
        gain = P * phi / forgetting / (1.0 + np.sum(P * phi**2 / forgetting))
        theta = theta + gain * (y[k] - phi @ theta)
        P = (1.0 - P * phi / (forgetting + phi**2 * P) * phi) * P / forgetting
        out.append(theta)
    return np.array(out)


def test_separate_variances_are_those_of_the_paper():
    p, q, y, recording = regression()
    factors = np.array([0.9, 0.99])
    found = run(observers.RecursiveLeastSquares(factors, separate=True), line(), recording)
    expected = vahidi(p, q, y, factors, np.full(2, (10.0 / 0.2) ** 2))
    np.testing.assert_allclose(np.stack(found.mean, axis=1), expected, rtol=1e-9)


def test_several_factors_follow_what_is_fast_beside_what_is_slow():
    # Mass and grade: a stays, b swings. One slow factor smears b, one fast factor shakes a.
    rng, rows = np.random.default_rng(2), ROWS
    p, q = 1.0 + 0.5 * rng.normal(size=rows), rng.normal(size=rows)
    b = np.sin(0.02 * np.arange(rows))
    recording = Recording(np.arange(float(rows)), {"p": p, "q": q, "y": 2.0 * p + b * q + 0.2 * rng.normal(size=rows)})

    def rms(forgetting, **options):
        mean = run(observers.RecursiveLeastSquares(forgetting, **options), line(), recording).mean
        return [np.sqrt(np.mean(np.square(e)[300:])) for e in (np.asarray(mean.a) - 2.0, np.asarray(mean.b) - b)]

    slow, fast = rms(0.999), rms(0.9)
    for options in ({}, {"separate": True}):
        a, swings = rms([0.999, 0.9], **options)
        assert a < 0.5 * fast[0] and swings < 0.3 * slow[1]
        assert swings < 1.2 * fast[1]


def test_what_is_not_excited_does_not_wind_up():
    rows = 3000
    recording = Recording(np.arange(float(rows)), {"p": np.ones(rows), "q": np.zeros(rows), "y": np.full(rows, 2.0)})
    found = run(observers.RecursiveLeastSquares(0.9, ceiling=4.0), line(spread=1.0), recording)
    P = np.asarray(found.belief.memory)
    assert np.isfinite(P).all() and P[1, 1] < 4.0 * 1.0001 and P[0, 0] < 0.1


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: run(observers.Luenberger(np.zeros((2, 2))), model(), truth(5)[2]),
            r"Luenberger.gain has shape \(2, 2\)",
        ),
        (lambda: observers.place_poles(model(), [-1.0, -2.0], dt=DT), r"poles have shape \(2,\): must be \(3,\)"),
        (lambda: observers.place_poles(model(), [-1.0, -2.0, 1.0], dt=DT), "negative real parts"),
        (lambda: observers.SlidingMode(np.zeros((3, 2)), np.zeros((3, 2)), [0.0, 1.0]), "SlidingMode.boundary"),
        (
            lambda: observers.SlidingMode(np.zeros((3, 2)), np.zeros((3, 2)), [0.1, 0.1, 0.1]).check(model()),
            r"SlidingMode.boundary has shape \(3,\)",
        ),
        (lambda: observers.RecursiveLeastSquares(1.1), "RecursiveLeastSquares.forgetting"),
        (
            lambda: run(observers.RecursiveLeastSquares([0.9, 0.9, 0.9]), line(), regression(5)[3]),
            "must be one, or one for each of a, b",
        ),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_an_unobservable_state_is_told():
    blind = ss.StateSpace(
        transition=lambda s, t0, t1, x, u: X(x.place, x.speed, x.offset),
        observation=lambda s, t, x, u: Y(x.place, x.speed),
        process_noise=None,
        measurement_noise=ss.Gaussian({"place": 0.01, "speed": 0.1}),
        prior=ss.Prior(X(0.0, 0.0, 0.0), {"place": 1.0, "speed": 1.0, "offset": 1.0}),
    )
    with pytest.raises(InputError, match="2 of 3 directions"):
        observers.place_poles(blind, [-1.0, -2.0, -3.0], dt=DT)

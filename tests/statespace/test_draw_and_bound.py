"""Draws of a model, and the posterior Cramer-Rao bound where it is known in closed form."""

import functools
from collections import namedtuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Recording
from jaxveh import statespace as ss
from jaxveh.statespace.draw import draw_rows, schedule_rows

Car = namedtuple("Car", "place speed drift")
Seen = namedtuple("Seen", "at v")
X = namedtuple("X", "x")
Y = namedtuple("Y", "y")


def drive(system, t0, t1, x, u):
    dt = t1 - t0
    return Car(x.place + dt * x.speed, x.speed + dt * (x.drift - system["drag"] * x.speed + u.force), x.drift)


def look(system, t, x, u):
    return Seen(x.place + 0.5 * u.force, x.speed)


def car(noise=("speed",)):
    """Linear; by default only the speed carries process noise: the place is its integral, the drift a constant."""
    std = {"place": 0.2, "speed": 0.5, "drift": 0.1}
    correlated = np.array([[0.3, 0.1], [0.1, 0.2]])
    return ss.StateSpace(
        system={"drag": jnp.asarray(0.3)},
        transition=drive,
        observation=look,
        process_noise=ss.Continuous(ss.Gaussian({name: std[name] for name in noise})) if noise else None,
        measurement_noise=ss.MultivariateGaussian(("at", "v"), correlated),
        prior=ss.Prior(Car(1.0, 2.0, 0.1), {"speed": 1.5, "place": 2.0, "drift": 0.4}),
        inputs=("force",),
    )


def schedule(rows=30, seed=0):
    """Irregular steps, channels and whole rows missing."""
    rng = np.random.default_rng(seed)
    at, v = np.zeros(rows), np.zeros(rows)
    at[rng.uniform(size=rows) < 0.4] = np.nan
    v[rng.uniform(size=rows) < 0.4] = np.nan
    at[5:8] = v[5:8] = np.nan
    time = 50.0 + np.cumsum(rng.uniform(0.05, 0.3, rows))
    return Recording(time, {"force": np.sin(time), "at": at, "v": v}, {"force": "m/s^2"})


def riccati(model, recording):
    """Kalman covariances (T, 3, 3) in NumPy."""
    drag, R = 0.3, np.asarray(model.measurement_noise.matrix)
    Q = np.zeros((3, 3))
    for name, std in ({} if model.process_noise is None else model.process_noise.law.std._asdict()).items():
        Q[Car._fields.index(name), Car._fields.index(name)] = std**2
    time, seen = recording.time, np.isfinite(np.stack([recording["at"], recording["v"]], axis=1))
    P, found = np.diag([4.0, 2.25, 0.16]), []
    for k in range(len(time)):
        if k:
            dt = time[k] - time[k - 1]
            F = np.array([[1, dt, 0], [0, 1 - dt * drag, dt], [0, 0, 1]])
            P = F @ P @ F.T + dt * Q
        here = seen[k]
        H = np.eye(3)[:2][here]
        P = P - P @ H.T @ np.linalg.solve(H @ P @ H.T + R[np.ix_(here, here)], H @ P)
        found.append(P)
    return np.stack(found)


@pytest.mark.parametrize("noise", [("drift", "speed", "place"), ("speed",), ()])
def test_on_linear_models_the_bound_is_the_kalman_filter_s_covariance(noise):
    model, recording = car(noise), schedule()
    bound = ss.posterior_cramer_rao(model, recording, jax.random.key(0), runs=7)
    exact = riccati(model, recording)
    scale = np.sqrt(np.einsum("tii->ti", exact))
    np.testing.assert_allclose(
        bound.covariance / scale[:, :, None] / scale[:, None], exact / scale[:, :, None] / scale[:, None], atol=1e-9
    )
    np.testing.assert_allclose(bound.std.drift, scale[:, 2], rtol=1e-9)
    np.testing.assert_array_equal(bound.time, recording.time)


def bend(system, t0, t1, x, u):
    return X(x.x + system["dt"] * jnp.sin(x.x))


def curve(noise, seen):
    return ss.StateSpace(
        system={"dt": jnp.asarray(0.5)},
        transition=bend,
        observation=lambda s, t, x, u: Y(x.x + 0.1 * x.x**2),
        process_noise=noise,
        measurement_noise=seen,
        prior=ss.Prior(X(0.5), {"x": 0.7}),
    )


def test_on_nonlinear_models_it_is_the_last_block_of_the_whole_trajectory_s_information():
    """Student-t noises; the joint information of all states is tridiagonal, and its inverse's last entry the bound."""
    model = curve(ss.Discrete(ss.StudentT(3.0, {"x": 0.4})), ss.StudentT(5.0, {"y": 0.3}))
    recording, runs = Recording(np.arange(6.0), {"y": np.array([0, 0, np.nan, 0, 0, 0])}), 50
    key = jax.random.key(4)
    bound = ss.posterior_cramer_rao(model, recording, key, runs)
    rows = schedule_rows(model, recording)
    x = np.asarray(jax.jit(jax.vmap(lambda k: draw_rows(model, rows, k)[0].x))(jax.random.split(key, runs)))
    F, H = 1 + 0.5 * np.cos(x), 1 + 0.2 * x
    # Fisher information of a t law's location, by quadrature.
    z = np.linspace(-300, 300, 2_000_001)

    def information(dof, scale):
        density = (1 + z**2 / dof) ** (-0.5 * (dof + 1))
        score = (dof + 1) * z / (dof + z**2)
        return np.sum(score**2 * density) / np.sum(density) / scale**2

    q, r = information(3.0, 0.4), information(5.0, 0.3)
    J = np.zeros((6, 6))
    J[0, 0] = 1 / 0.7**2
    for k in range(6):
        J[k, k] += 0 if k == 2 else np.mean(H[:, k] ** 2) * r
        if k:
            J[k - 1, k - 1] += np.mean(F[:, k - 1] ** 2) * q
            J[k - 1, k] = J[k, k - 1] = -np.mean(F[:, k - 1]) * q
            J[k, k] += q
    np.testing.assert_allclose(bound.std.x[-1], np.sqrt(np.linalg.inv(J)[-1, -1]), rtol=1e-6)


def test_states_without_noise_that_move_nonlinearly_are_refused():
    with pytest.raises(InputError, match="x carries no process noise and its transition is not linear"):
        ss.posterior_cramer_rao(curve(None, {"y": 0.3}), Recording(np.arange(4.0), {}), jax.random.key(0))


def test_states_without_a_recursion_are_left_out_where_nothing_depends_on_them():
    """A heading and a place, as odometry has them: the speed is as well known as without them."""
    State = namedtuple("State", "heading speed place")

    def move(system, t0, t1, x, u):
        turn = 0.1 * x.speed * x.speed
        return State(x.heading + turn, 0.9 * x.speed + jnp.sin(x.speed), x.place + x.speed * jnp.cos(x.heading))

    def make(seen):
        return ss.StateSpace(
            transition=move,
            observation=lambda s, t, x, u: Seen(x.heading, x.speed),
            process_noise=ss.Discrete(ss.Gaussian({"speed": 0.2})),
            measurement_noise=seen,
            prior=ss.Prior(State(0.0, 1.0, 0.0), {"place": 1.0, "speed": 0.3, "heading": 0.2}),
        )

    alone = ss.StateSpace(
        transition=lambda s, t0, t1, x, u: X(0.9 * x.x + jnp.sin(x.x)),
        observation=lambda s, t, x, u: Y(x.x),
        process_noise=ss.Discrete(ss.Gaussian({"x": 0.2})),
        measurement_noise={"y": 0.3},
        prior=ss.Prior(X(1.0), {"x": 0.3}),
    )
    given, key = Recording(np.arange(8.0), {}), jax.random.key(0)
    bound = ss.posterior_cramer_rao(make({"v": 0.3}), given, key, 4000)
    assert np.isnan([bound.std.heading, bound.std.place]).all()
    np.testing.assert_allclose(bound.std.speed, ss.posterior_cramer_rao(alone, given, key, 4000).std.x, rtol=0.01)
    with pytest.raises(InputError, match="heading carries no process noise"):
        ss.posterior_cramer_rao(make({"at": 0.1, "v": 0.3}), given, key)


def test_laws_without_a_known_information_are_refused():
    mixture = ss.CauchyGaussianMixture(0.3, {"y": 0.1}, {"y": 0.1})
    model = curve(ss.Discrete(ss.Gaussian({"x": 0.3})), mixture)
    with pytest.raises(InputError, match="CauchyGaussianMixture: its Fisher information is not known"):
        ss.posterior_cramer_rao(model, Recording(np.arange(4.0), {}), jax.random.key(0))
    with pytest.raises(InputError, match="runs = 0: must be a whole number of at least 1"):
        ss.posterior_cramer_rao(model, Recording(np.arange(4.0), {}), jax.random.key(0), runs=0)


def test_a_draw_has_the_schedule_s_rows_and_gaps():
    model, given = car(), schedule()
    drawn = ss.draw(model, given, jax.random.key(1))
    assert drawn.recording.names == ("force", "at", "v", "true.place", "true.speed", "true.drift")
    assert drawn.recording.unit("force") == "m/s^2"
    np.testing.assert_array_equal(drawn.recording.time, given.time)
    for name in ("at", "v"):
        np.testing.assert_array_equal(np.isnan(drawn.recording[name]), np.isnan(given[name]))
    np.testing.assert_array_equal(drawn.recording.truth["speed"], drawn.states.speed)
    np.testing.assert_allclose(drawn.states.drift, drawn.states.drift[0])
    dt, place, speed = np.diff(given.time), np.asarray(drawn.states.place), np.asarray(drawn.states.speed)
    np.testing.assert_allclose(np.diff(place), dt * speed[:-1], atol=1e-12)
    other = ss.draw(model, given, jax.random.key(2))
    assert other.states.drift[0] != drawn.states.drift[0]
    with pytest.raises(InputError, match=r"unknown name\(s\) force"):
        ss.draw(model, given.without("force"), jax.random.key(1))


def test_draws_have_the_model_s_moments():
    model, given = car(), Recording(np.array([0.0, 0.5, 0.7]), {"force": np.array([1.0, -2.0, 0.5])})
    rows = schedule_rows(model, given)
    keys = jax.random.split(jax.random.key(3), 40_000)
    states, seen = jax.jit(jax.vmap(functools.partial(draw_rows, model, rows)))(keys)
    x, y = np.stack(states), np.stack(seen.y)
    mean, P = np.array([1.0, 2.0, 0.1]), np.diag([4.0, 2.25, 0.16])
    for k in range(3):
        if k:
            dt, force = (0.5, 1.0) if k == 1 else (0.2, -2.0)
            F = np.array([[1, dt, 0], [0, 1 - 0.3 * dt, dt], [0, 0, 1]])
            mean, P = F @ mean + [0, dt * force, 0], F @ P @ F.T + dt * np.diag([0, 0.25, 0])
        tolerance = 5 * np.sqrt(np.diag(P) / 40_000)
        assert (np.abs(x[:, :, k].mean(axis=1) - mean) < tolerance).all()
        np.testing.assert_allclose(np.cov(x[:, :, k]), P, rtol=0.05, atol=0.03)
        force = np.asarray(given["force"])[k]
        np.testing.assert_allclose(
            np.cov(y[:, :, k] - x[:2, :, k]), model.measurement_noise.matrix, rtol=0.04, atol=0.01
        )
        np.testing.assert_allclose(np.mean(y[0, :, k] - x[0, :, k]), 0.5 * force, atol=0.015)


def test_float32_stays_so_and_comes_near(float32):
    model, given = ss.cast(car(), jnp.float32), schedule()
    drawn = ss.draw(model, given, jax.random.key(1))
    assert {leaf.dtype for leaf in (*drawn.states, *drawn.recording.channels.values())} == {jnp.dtype("float32")}
    bound = ss.posterior_cramer_rao(model, given, jax.random.key(0), runs=7)
    exact = riccati(model, given)
    np.testing.assert_allclose(np.stack(bound.std, axis=1), np.sqrt(np.einsum("tii->ti", exact)), rtol=1e-4)

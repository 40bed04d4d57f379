"""Systems whose answer is known in closed form, and a Kalman filter in NumPy that gives it."""

from collections import namedtuple

import jax.numpy as jnp
import numpy as np
from nile import NILE

from jaxveh import Recording
from jaxveh import statespace as ss
from jaxveh._core.names import record_type

Level = namedtuple("Level", "level")
Flow = namedtuple("Flow", "flow")


def stay(system, t0, t1, x, u):
    return x


def see_level(system, t, x, u):
    return Flow(x.level)


def nile_model(mean=0.0, std=1e7**0.5):
    """The local-level model with the maximum-likelihood variances 15099 and 1469.1."""
    return ss.StateSpace(
        transition=stay,
        observation=see_level,
        process_noise=ss.Discrete(ss.Gaussian({"level": 1469.1**0.5})),
        measurement_noise=ss.Gaussian({"flow": 15099**0.5}),
        prior=ss.Prior(Level(mean), {"level": std}),
    )


def nile_recording():
    return Recording(np.arange(1871.0, 1971.0), {"flow": NILE})


def linear_transition(system, t0, t1, x, u):
    """x + dt (A x + B force)."""
    rates = times(system["A"], x) + column(system["B"], x) * u.force
    return type(x)(*(jnp.stack(x) + (t1 - t0) * rates))


def linear_observation(system, t, x, u):
    """H x + D force."""
    rows = times(system["H"], x) + column(system["D"], x) * u.force
    return record_type("Y", [f"y{i}" for i in range(len(system["H"]))])(*rows)


def times(matrix, x):
    """Rows of a matrix (m, n) times a state of n fields, (m,) or (m, batch): one product and sum, which compile quickly."""
    return jnp.sum(jnp.expand_dims(matrix, range(2, 2 + jnp.ndim(x[0]))) * jnp.stack(x), axis=1)


def column(vector, x):
    """A vector (m,) beside a batch of states."""
    return jnp.expand_dims(vector, range(1, 1 + jnp.ndim(x[0])))


def spd(rng, n, scale=1.0):
    a = rng.normal(size=(n, n))
    return scale * (a @ a.T / n + 0.3 * np.eye(n))


def linear_model(n=3, m=2, seed=0, dtype=None):
    """A random stable linear model with full covariances of process, measurement and prior."""
    rng = np.random.default_rng(seed)
    states, channels = tuple(f"x{i}" for i in range(n)), tuple(f"y{i}" for i in range(m))
    model = ss.StateSpace(
        system={
            "A": jnp.asarray(rng.normal(size=(n, n)) - 1.5 * np.eye(n)),
            "B": jnp.asarray(rng.normal(size=n)),
            "H": jnp.asarray(rng.normal(size=(m, n))),
            "D": jnp.asarray(rng.normal(size=m)),
        },
        transition=linear_transition,
        observation=linear_observation,
        process_noise=ss.Continuous(ss.MultivariateGaussian(states, spd(rng, n, 0.5))),
        measurement_noise=ss.MultivariateGaussian(channels, spd(rng, m, 0.2)),
        prior=ss.Prior(record_type("X", states)(*rng.normal(size=n)), ss.MultivariateGaussian(states, spd(rng, n))),
        inputs=("force",),
    )
    return model if dtype is None else ss.cast(model, dtype)


def linear_recording(model, rows=40, seed=1):
    """Irregular steps, rows without any measurement, and single missing channels."""
    rng = np.random.default_rng(seed)
    time = 100.0 + np.cumsum(rng.uniform(0.02, 0.2, rows))
    channels = {name: rng.normal(size=rows) for name in model.channels}
    for name in model.channels:
        channels[name][rng.uniform(size=rows) < 0.25] = np.nan
        channels[name][7:9] = np.nan
    return Recording(time, {**channels, "force": np.sin(time)})


def kalman(model, recording):
    """The exact answer in NumPy: log-likelihood increments, means, covariances, innovations, their spread, NIS."""
    A, B, H, D = (np.asarray(model.system[k]) for k in "ABHD")
    Q = np.asarray(model.process_noise.law.covariance())
    R = np.asarray(model.measurement_noise.covariance())
    t, u = np.asarray(recording.time), np.asarray(recording["force"])
    y = np.stack([np.asarray(recording[name]) for name in model.channels], axis=1)
    x, P = np.array([float(v) for v in model.prior.mean]), np.asarray(model.prior.covariance())
    out = {name: [] for name in ("log_likelihood", "mean", "covariance", "innovation", "innovation_std", "nis")}
    for k in range(len(t)):
        if k:
            dt = t[k] - t[k - 1]
            F = np.eye(len(x)) + dt * A
            x, P = F @ x + dt * B * u[k - 1], F @ P @ F.T + Q * dt
        here = np.isfinite(y[k])
        innovation, std, ll, nis = np.full(len(here), np.nan), np.full(len(here), np.nan), 0.0, 0.0
        if here.any():
            h, S = H[here], H[here] @ P @ H[here].T + R[np.ix_(here, here)]
            e = y[k, here] - h @ x - D[here] * u[k]
            K = P @ h.T @ np.linalg.inv(S)
            nis = e @ np.linalg.solve(S, e)
            ll = -0.5 * (nis + np.linalg.slogdet(2 * np.pi * S)[1])
            x, P = x + K @ e, P - K @ S @ K.T
            innovation[here], std[here] = e, np.sqrt(np.diag(S))
        for name, value in zip(out, (ll, x, P, innovation, std, nis), strict=True):
            out[name].append(value)
    return {name: np.array(values) for name, values in out.items()}

"""A pendulum with unknown stiffness and damping, drives of it, and its multiple-shooting residuals in plain NumPy."""

from collections import namedtuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import Recording
from jaxveh import statespace as ss
from jaxveh._core.parameter import positive

State = namedtuple("State", "angle rate")
Torque = namedtuple("Torque", "torque")
Seen = namedtuple("Seen", "angle rate")
TRUE = np.array([4.0, 0.5])
NOISE = np.array([0.05, 0.1])
START = np.array([0.8, 0.0])
PRIOR_STD = np.array([0.3, 0.3])


class Pendulum(eqx.Module):
    k: jax.Array = positive("1/s^2")
    d: jax.Array = positive("1/s")


def derivatives(system, t, x, u):
    return State(x.rate, -system.k * jnp.sin(x.angle) - system.d * x.rate + u.torque)


def see(system, t, x, u):
    return Seen(x.angle, x.rate)


def plain(k=3.0, d=0.7, noise=None, process=None, law=None, see=see):
    """The pendulum with its parameters in place."""
    return ss.StateSpace(
        system=Pendulum(k, d),
        transition=ss.Propagate(derivatives),
        observation=see,
        process_noise=process,
        measurement_noise=noise or ss.Gaussian({"angle": NOISE[0], "rate": NOISE[1]}),
        prior=ss.Prior(State(*START), law or {"angle": PRIOR_STD[0], "rate": PRIOR_STD[1]}),
        inputs=("torque",),
    )


def model(k=3.0, d=0.7, prior=0.5, **parts):
    """The pendulum with its parameters among the states."""
    return ss.with_parameters(plain(k, d, **parts), lambda m: (m.system.k, m.system.d), prior=prior)


def rk4(f, x, dt):
    k1 = f(x)
    k2 = f(x + 0.5 * dt * k1)
    k3 = f(x + 0.5 * dt * k2)
    k4 = f(x + dt * k3)
    return x + dt * (k1 + 2 * k2 + 2 * k3 + k4) / 6


def move(parameters, x, dt, torque):
    k, d = parameters
    return rk4(lambda x: np.array([x[1], -k * np.sin(x[0]) - d * x[1] + torque]), x, dt)


def drive(rows=60, dt=0.1, seed=0, noise=True, start=START):
    rng = np.random.default_rng(seed)
    time = dt * np.arange(rows)
    torque = 2.0 * np.sin(1.5 * time + seed)
    states = [np.array(start)]
    for k in range(rows - 1):
        states.append(move(TRUE, states[-1], dt, torque[k]))
    measured = np.array(states) + noise * NOISE * rng.normal(size=(rows, 2))
    measured[rows // 6, 0] = np.nan
    return Recording(time, {"torque": torque, "angle": measured[:, 0], "rate": measured[:, 1]})


def residuals(unknown, recordings, length, tie, centre, spread):
    """What `multiple_shooting` minimises, written out: misfits, ties, first states, parameters on the logarithm."""
    logs, starts = unknown[:2], unknown[2:].reshape(-1, 2)
    parameters, out, segment = np.exp(logs), [(logs - centre) / spread], 0
    for recording in recordings:
        time, torque = recording.time, np.asarray(recording["torque"])
        y = np.stack([recording["angle"], recording["rate"]], axis=1)
        out.append((starts[segment] - START) / PRIOR_STD)
        for first in range(0, len(time), length):
            x = starts[segment]
            for k in range(first, min(first + length, len(time))):
                out.append(np.nan_to_num((y[k] - x) / NOISE))
                if k + 1 < len(time):
                    x = move(parameters, x, time[k + 1] - time[k], torque[k])
            if first + length < len(time):
                out.append((starts[segment + 1] - x) / (tie * PRIOR_STD))
            segment += 1
    return np.concatenate(out)

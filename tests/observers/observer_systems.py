"""A mass on a spring, a pendulum, a regression, and what they really do."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import Recording
from jaxveh import statespace as ss
from jaxveh._core.names import record_type

Mass, PlaceSpeed = record_type("Mass", ("place", "speed")), record_type("PlaceSpeed", ("place", "speed"))
Swing, Angle = record_type("Swing", ("angle", "rate")), record_type("Angle", ("angle",))
Theta, One = record_type("Theta", ("a", "b")), record_type("One", ("y",))


def move_mass(system, t0, t1, x, u):
    """Euler's step, so that the model is linear in its parameters as well."""
    dt = t1 - t0
    pull = u.force - system["stiffness"] * x.place - system["damping"] * x.speed
    return Mass(x.place + dt * x.speed, x.speed + dt * pull)


def mass(stiffness=4.0, damping=0.5, channels=("place", "speed")):
    """A mass of 1 kg on a spring, driven by a force; its place and speed are seen, or one of them."""
    noise = {"place": 0.01, "speed": 0.05}
    return ss.StateSpace(
        system={"stiffness": jnp.asarray(stiffness), "damping": jnp.asarray(damping)},
        transition=move_mass,
        observation=see_mass,
        process_noise=None,
        measurement_noise=ss.Gaussian({name: noise[name] for name in channels}),
        prior=ss.Prior(Mass(0.0, 0.0), {"place": 0.5, "speed": 1.0}),
        inputs=("force",),
    )


def see_mass(system, t, x, u):
    return PlaceSpeed(x.place, x.speed)


def swing(system, t0, t1, x, u):
    """Heun's step."""
    dt = t1 - t0
    pull = lambda angle, rate: u.force - system["pull"] * jnp.sin(angle) - 0.2 * rate
    half_angle, half_rate = x.angle + 0.5 * dt * x.rate, x.rate + 0.5 * dt * pull(x.angle, x.rate)
    return Swing(x.angle + dt * half_rate, x.rate + dt * pull(half_angle, half_rate))


def see_angle(system, t, x, u):
    return Angle(x.angle)


def pendulum(pull=9.0):
    """A pendulum that swings far, driven by a moment; its angle is seen."""
    return ss.StateSpace(
        system={"pull": jnp.asarray(pull)},
        transition=swing,
        observation=see_angle,
        process_noise=None,
        measurement_noise=ss.Gaussian({"angle": 0.01}),
        prior=ss.Prior(Swing(0.5, 0.0), {"angle": 0.3, "rate": 1.0}),
        inputs=("force",),
    )


def stay(system, t0, t1, x, u):
    return x


def see_line(system, t, x, u):
    return One(x.a * u.p + x.b * u.q)


def see_curve(system, t, x, u):
    return One(jnp.sin(x.a * u.p) + x.b * u.q)


def regression(observation=see_line, spread=10.0, noise=0.2):
    """y = a p + b q, or sin(a p) + b q."""
    return ss.StateSpace(
        transition=stay,
        observation=observation,
        process_noise=None,
        measurement_noise=ss.Gaussian({"y": noise}),
        prior=ss.Prior(Theta(0.0, 0.0), {"a": spread, "b": spread}),
        inputs=("p", "q"),
    )


def drive(model, x, time, inputs, during=lambda k: {}, noise=0.0, seed=0):
    """What happens to the state x from `time[0]` on: the states (T, n) and what is measured of them, with the inputs.

    `during(k)`: leaves of the system (a mapping) that are others in row k; `noise`: its share of the model's own.
    """
    rng, u_type, states, seen = np.random.default_rng(seed), record_type("U", model.inputs), [], []
    x = type(model.prior.mean)(*[np.float64(value) for value in x])
    std, known = model.measurement_noise.std, jax.tree.map(np.asarray, model.system)
    for k, t in enumerate(time):
        system = {**known, **during(k)} if during(k) else known
        u = u_type(*[inputs[name][k] for name in model.inputs])
        y = model.observation_function(system, t, x, u)
        states.append([float(value) for value in x])
        seen.append([float(getattr(y, c)) + noise * float(getattr(std, c)) * rng.normal() for c in model.channels])
        if k + 1 < len(time):
            x = model.transition_function(system, t, time[k + 1], x, u)
            x = type(x)(*[np.float64(value) for value in x])
    channels = dict(zip(model.channels, np.array(seen).T, strict=True))
    return np.array(states), Recording(time, {**channels, **inputs})


def without(recording, rows, channels):
    """The recording with these channels missing in these rows."""
    values = {name: np.array(recording[name]) for name in recording.names}
    for name in channels:
        values[name][rows] = np.nan
    return Recording(np.array(recording.time), values)

"""Nonlinear systems of one state, and a dense grid filter in NumPy that answers them."""

from collections import namedtuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import Recording
from jaxveh import statespace as ss

X = namedtuple("X", "x")
Y = namedtuple("Y", "y")


class LogChiSquared(ss.AbstractNoise):
    """The logarithm of the square of a standard normal number, on the channel y: not Gaussian, and not of mean zero."""

    has_covariance = False
    names = ("y",)

    def sample(self, key, shape=()):
        return {"y": jnp.log(jnp.square(jax.random.normal(key, shape)))}

    def log_prob(self, residual, present):
        z = jnp.where(present["y"], residual["y"], 0.0)
        return jnp.where(present["y"], 0.5 * (z - jnp.exp(z)) - 0.5 * jnp.log(2 * jnp.pi), 0.0)

    def covariance(self):
        raise NotImplementedError

    def times(self, factor):
        raise NotImplementedError


class Either(LogChiSquared):
    """That law, or a standard normal one."""

    squared: jax.Array

    def sample(self, key, shape=()):
        z = jax.random.normal(key, shape)
        return {"y": jnp.where(self.squared, jnp.log(jnp.square(z)), z)}

    def log_prob(self, residual, present):
        z = jnp.where(present["y"], residual["y"], 0.0)
        normal = jnp.where(present["y"], -0.5 * z**2 - 0.5 * jnp.log(2 * jnp.pi), 0.0)
        return jnp.where(self.squared, super().log_prob(residual, present), normal)


def move(system, t0, t1, x, u):
    a, b, c = system["move"]
    return X(a * x.x + b * x.x / (1 + x.x**2) + c * jnp.cos(1.2 * t0))


def see(system, t, x, u):
    level, straight, square = system["see"]
    return Y(level + straight * x.x + square * x.x**2)


def volatility():
    """Stochastic volatility: log y^2 = log beta^2 + x + log chi^2 (S. Kim, N. Shephard & S. Chib 1998)."""
    return ss.StateSpace(
        system={"move": jnp.array([0.95, 0.0, 0.0]), "see": jnp.array([-0.7, 1.0, 0.0])},
        transition=move,
        observation=see,
        process_noise=ss.Discrete(ss.Gaussian({"x": 0.3})),
        measurement_noise=Either(jnp.asarray(True)),
        prior=ss.Prior(X(0.0), {"x": 0.3 / (1 - 0.95**2) ** 0.5}),
    )


def growth():
    """The univariate nonstationary growth model, whose posterior has two peaks (N. Gordon, D. Salmond & A. Smith 1993)."""
    return ss.StateSpace(
        system={"move": jnp.array([0.5, 25.0, 8.0]), "see": jnp.array([0.0, 0.0, 0.05])},
        transition=move,
        observation=see,
        process_noise=ss.Discrete(ss.Gaussian({"x": 10.0**0.5})),
        measurement_noise=ss.Gaussian({"y": 1.0}),
        prior=ss.Prior(X(0.1), {"x": 2.0**0.5}),
    )


def growth_like_volatility():
    """The growth model with a noise of which nothing but density and draws is known: other numbers of the volatility model, so
    that a filter is one program for both."""
    return eqx.tree_at(lambda m: m.measurement_noise, growth(), Either(jnp.asarray(False)))


@eqx.filter_jit
def simulate(model, key, rows):
    """A draw of the model: states (T,) and measurements (T,) at the times 0, 1, 2, ..."""
    keys = jax.random.split(key, 2 * rows).reshape(rows, 2)
    first = model.prior.sample(keys[0, 0])
    see = lambda x, t, key: model.observation(t, x, None).y + model.measurement_noise.sample(key)["y"]

    def step(x, given):
        t, (one, two) = given
        noise = model.process_noise.over(1.0).sample(one)
        x = X(model.transition(t - 1.0, t, x, None).x + noise["x"])
        return x, (x.x, see(x, t, two))

    times = jnp.arange(1.0, rows)
    _, (states, measured) = jax.lax.scan(step, first, (times, keys[1:]))
    start = see(first, jnp.asarray(0.0), keys[0, 1])
    return jnp.concatenate([first.x[None], states]), jnp.concatenate([start[None], measured])


def as_recording(measured):
    return Recording(np.arange(float(len(measured))), {"y": np.asarray(measured)})


def grid_filter(model, measured, low, high, points=1000):
    """Log-likelihood and posterior means (T,) by sums over a grid of states from `low` to `high`."""
    grid = np.linspace(low, high, points)
    width = grid[1] - grid[0]
    spread = float(model.process_noise.law.std[0])
    density = lambda z, s: np.exp(-0.5 * (z / s) ** 2) / (s * np.sqrt(2 * np.pi))
    here = {"y": jnp.asarray(True)}
    parts = jax.jit(
        lambda k, y: (
            model.transition(k - 1.0, k, X(jnp.asarray(grid)), None).x,
            model.measurement_noise.log_prob({"y": y - model.observation(k, X(jnp.asarray(grid)), None).y}, here),
        )
    )
    weights = density(grid - float(model.prior.mean.x), float(model.prior.law.std[0]))
    total, means = 0.0, []
    for k, y in enumerate(np.asarray(measured)):
        moved, log_likely = parts(float(k), y)
        if k:
            weights = density(grid[:, None] - np.asarray(moved)[None], spread) @ weights * width
        weights = weights * np.exp(np.asarray(log_likely))
        part = weights.sum() * width
        weights, total = weights / part, total + np.log(part)
        means.append((weights * grid).sum() * width)
    return total, np.array(means)

"""A linear model of two states or more, a drive drawn from it, and the exact answer."""

import functools

import equinox as eqx
import numpy as np
from filter_systems import kalman, linear_model, linear_recording

from jaxveh import statespace as ss

STD = {"y0": 0.4, "y1": 0.3}


@functools.cache
def linear(n=2):
    """Independent measurement noises, so that every filter takes them."""
    return eqx.tree_at(lambda m: m.measurement_noise, linear_model(n, 2, seed=3), ss.Gaussian(STD))


@functools.cache
def drawn(rows=25, seed=1, n=2):
    """Drawn from the model, with steps of 0.02 to 0.2 s, channels missing and two rows without any."""
    model, rng = linear(n), np.random.default_rng(seed)
    given = linear_recording(model, rows, seed)
    A, B, H, D = (np.asarray(model.system[k]) for k in "ABHD")
    root = np.linalg.cholesky(np.asarray(model.process_noise.law.matrix))
    x = np.array(model.prior.mean) + np.linalg.cholesky(model.prior.covariance()) @ rng.normal(size=n)
    values = {name: np.array(given[name]) for name in STD}
    for k in range(rows):
        if k:
            dt = given.time[k] - given.time[k - 1]
            x = x + dt * (A @ x + B * given["force"][k - 1]) + dt**0.5 * root @ rng.normal(size=n)
        seen = H @ x + D * given["force"][k] + np.array(list(STD.values())) * rng.normal(size=2)
        for y, value in zip(seen, values.values(), strict=True):
            value[k] = np.where(np.isnan(value[k]), np.nan, y)
    return given.replace(**values)


@functools.cache
def exact(rows=25, seed=1, n=2):
    """The Kalman filter's answer in NumPy."""
    noise = ss.MultivariateGaussian(tuple(STD), np.diag(np.square(list(STD.values()))))
    return kalman(eqx.tree_at(lambda m: m.measurement_noise, linear(n), noise), drawn(rows, seed, n))

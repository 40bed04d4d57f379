"""The log-likelihood with its gradient with respect to every number of the model, over the log-likelihood alone."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import filters

from . import ours
from .measure import Bound, Case, Contestant
from .problems import single_track, speed_and_mass

__all__ = ["cases"]

VALUE, GRADIENT = "value", "value and gradient"


def cases(smoke: bool) -> list[Case]:
    """Return the cases: particle filters of 1000 particles, the unscented filter, and 64 runs of it, float64."""
    count, rows, long, runs = (16, 10, 20, 3) if smoke else (1000, 300, 5000, 64)
    titles = {
        "pf": (f"Bootstrap particle filter, {count} particles", 3.5),
        "apf": (f"Auxiliary particle filter, {count} particles", 3.5),
        "ukf": ("Unscented Kalman filter of 3 states", 5.0),
        "ukf-batch": (f"Unscented Kalman filter of 3 states, {runs} runs", 4.0),
    }
    builders = {
        "pf": functools.partial(_particles, filters.ParticleFilter(count), rows),
        "apf": functools.partial(_particles, filters.AuxiliaryParticleFilter(count), rows),
        "ukf": functools.partial(_unscented, long),
        "ukf-batch": functools.partial(_batch, runs, long // 10),
    }
    return [
        Case(
            name=f"gradients/{kind}",
            title=f"Gradient: {title}, float64",
            unit="us a step",
            build=builders[kind],
            base=VALUE,
            bounds=(Bound(GRADIENT, (VALUE,), most),),
        )
        for kind, (title, most) in titles.items()
    ]


def _particles(filter_: filters.AbstractFilter, rows: int) -> Sequence[Contestant]:
    problem = single_track(rows)
    model = ours.single_track_model(problem, np.float64)
    return _pair(filter_, model, model.rows(ours.single_track_recording(problem)), rows)


def _unscented(rows: int) -> Sequence[Contestant]:
    problem = speed_and_mass(rows)
    model = ours.speed_model(problem, np.float64)
    return _pair(filters.Unscented(), model, model.rows(ours.speed_recording(problem)), rows)


def _batch(runs: int, rows: int) -> Sequence[Contestant]:
    """The sum over the runs, whose model is the same."""
    problem = speed_and_mass(rows, runs)
    model = ours.speed_model(problem, np.float64)
    measured = model.rows(ours.speed_recording(problem))
    speeds = jnp.asarray(problem.speed.T)

    def log_likelihood(model: object, key: jax.Array) -> jax.Array:
        one = lambda v: filters.scan(filters.Unscented(), model, measured._replace(y=measured.y._replace(v=v)), key, ())
        return jnp.sum(jax.vmap(one)(speeds).log_likelihood)

    return _timed(log_likelihood, model, runs * (rows - 1))


def _pair(filter_: filters.AbstractFilter, model: object, measured: object, rows: int) -> Sequence[Contestant]:
    def log_likelihood(model: object, key: jax.Array) -> jax.Array:
        return filters.scan(filter_, model, measured, key).log_likelihood

    return _timed(log_likelihood, model, rows - 1)


def _timed(log_likelihood: Callable, model: object, work: float) -> Sequence[Contestant]:
    value, gradient = jax.jit(log_likelihood), jax.jit(jax.value_and_grad(log_likelihood))

    def calling(function: Callable) -> Callable[[int], object]:
        return ours.blocked(lambda index: function(model, jax.random.key(index)))

    return [Contestant(VALUE, calling(value), work), Contestant(GRADIENT, calling(gradient), work)]

"""The log-likelihood with its gradient with respect to every number of the model, over the log-likelihood alone."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import jax
import numpy as np

from jaxveh import filters

from . import ours
from .measure import Bound, Case, Contestant
from .problems import single_track, speed_and_mass

__all__ = ["cases"]

VALUE, GRADIENT = "value", "value and gradient"


def cases(smoke: bool) -> list[Case]:
    """Return the cases: particle filters of 1000 particles and the unscented filter, float64."""
    count, rows, long = (16, 10, 20) if smoke else (1000, 300, 5000)
    titles = {
        "pf": (f"Bootstrap particle filter, {count} particles", 3.5),
        "apf": (f"Auxiliary particle filter, {count} particles", 3.5),
        "ukf": ("Unscented Kalman filter of 3 states", 5.0),
    }
    builders = {
        "pf": functools.partial(_particles, filters.ParticleFilter(count), rows),
        "apf": functools.partial(_particles, filters.AuxiliaryParticleFilter(count), rows),
        "ukf": functools.partial(_unscented, long),
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


def _pair(filter_: filters.AbstractFilter, model: object, measured: object, rows: int) -> Sequence[Contestant]:
    def log_likelihood(model: object, key: jax.Array) -> jax.Array:
        return filters.scan(filter_, model, measured, key).log_likelihood

    value, gradient = jax.jit(log_likelihood), jax.jit(jax.value_and_grad(log_likelihood))

    def calling(function: Callable) -> Callable[[int], object]:
        return ours.blocked(lambda index: function(model, jax.random.key(index)))

    return [Contestant(VALUE, calling(value), rows - 1), Contestant(GRADIENT, calling(gradient), rows - 1)]

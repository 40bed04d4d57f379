"""The time from Python functions to machine code: tracing, lowering and compiling, without running.

Whole programs, cold and warm, are in `python -m benchmarks.starts`: they use all cores, and separate processes.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import filters

from . import ours
from .measure import Case, Contestant, Skipped
from .problems import single_track, speed_and_mass

__all__ = ["cases"]

OURS = "jaxveh"


def cases(smoke: bool) -> list[Case]:
    """Return the cases: both particle filters and the unscented filter, and their gradients."""
    kinds = {
        "pf": ("Compiling a bootstrap particle filter, 1000 particles", filters.ParticleFilter(1000)),
        "apf": ("Compiling an auxiliary particle filter, 1000 particles", filters.AuxiliaryParticleFilter(1000)),
        "ukf": ("Compiling an unscented Kalman filter of 3 states", filters.Unscented()),
    }
    return [
        Case(
            name=f"compile_times/{kind}",
            title=f"{title}, float64",
            unit="s",
            build=functools.partial(_build, kind, filter_, smoke),
            base=OURS,
            warm=False,
        )
        for kind, (title, filter_) in kinds.items()
    ]


def _build(kind: str, filter_: filters.AbstractFilter, smoke: bool) -> Sequence[Contestant | Skipped]:
    particle = kind != "ukf"
    problem = single_track(50) if particle else speed_and_mass(50)
    if particle:
        model, recording = ours.single_track_model(problem, np.float64), ours.single_track_recording(problem)
    else:
        model, recording = ours.speed_model(problem, np.float64), ours.speed_recording(problem)
    rows, key = model.rows(recording), jax.random.key(0)

    def estimate(model: object, rows: object, key: jax.Array) -> object:
        done = filters.scan(filter_, model, rows, key)
        return done.mean, done.std, done.log_likelihood, done.info

    def gradient(model: object, rows: object, key: jax.Array) -> object:
        return jax.grad(lambda m: filters.scan(filter_, m, rows, key).log_likelihood)(model)

    made: list[Contestant | Skipped] = [
        Contestant(OURS, _compiling(estimate, model, rows, key, smoke=smoke), 1),
        Contestant(f"{OURS}, gradient", _compiling(gradient, model, rows, key, smoke=smoke), 1),
    ]
    names = ("smcx",) if particle else ("dynamax", "smcx")
    for name in names:
        try:
            made.append(Contestant(name, _peer(name, kind, problem, smoke), 1))
        except ImportError as error:
            made.append(Skipped(name, f"not installed here ({error.name})"))
    return made


def _compiling(function: Callable, *arguments: object, smoke: bool) -> Callable[[int], object]:
    """Return a function that compiles again in each call: caches are cleared, so that tracing and lowering count as well.

    In a `smoke` run it stops before XLA, which compiles the same filters in other experiments."""

    def call(index: int) -> object:
        jax.clear_caches()
        lowered = jax.jit(lambda *a: function(*a)).lower(*arguments)
        return lowered if smoke else lowered.compile()

    return call


def _peer(name: str, kind: str, problem: object, smoke: bool) -> Callable[[int], object]:
    if kind == "ukf":
        if name == "dynamax":
            from .peers.dynamax_filters import unscented
        else:
            from .peers.smcx_filters import unscented
        return _compiling(unscented(problem, np.float64), jnp.asarray(problem.speed[:, 0]), smoke=smoke)
    from .peers.smcx_filters import particle_filter

    run = particle_filter(problem, 1000, auxiliary=kind == "apf", dtype=np.float64)
    return _compiling(run, jax.random.key(0), smoke=smoke)

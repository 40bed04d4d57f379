"""Bootstrap and auxiliary particle filter on the eleven-state single track."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import jax
import numpy as np

from jaxveh import filters

from . import limit, ours
from .measure import Bound, Case, Contestant, Skipped
from .peers import numpy_filters
from .problems import SingleTrack, single_track

__all__ = ["cases"]

VEHICLE, OWN_MODEL, LIMIT = "jaxveh", "jaxveh, own model", "C++ limit"

# What a step may cost over the limit, by precision.
BOUNDS = {"float64": 1.6, "float32": 2.6}


def cases(smoke: bool) -> list[Case]:
    """Both filters in both precisions for 1000 and 10000 particles."""
    made = []
    for kind in ("pf", "apf"):
        for dtype in ("float64", "float32"):
            for count in (64,) if smoke else (1000, 10000):
                made.append(
                    Case(
                        name=f"particle_filters/{kind}-{dtype}-{count}",
                        title=f"{'Auxiliary' if kind == 'apf' else 'Bootstrap'} particle filter, {count} particles, {dtype}",
                        unit="ns a particle-step",
                        build=functools.partial(_build, kind == "apf", np.dtype(dtype), count, smoke),
                        base=LIMIT,
                        bounds=tuple(Bound(name, (LIMIT,), BOUNDS[dtype]) for name in (VEHICLE, OWN_MODEL)),
                    )
                )
    return made


def _build(auxiliary: bool, dtype: np.dtype, count: int, smoke: bool) -> Sequence[Contestant | Skipped]:
    # Slow contestants see fewer rows; a time per particle-step does not depend on their number.
    rows, few = (20, 10) if smoke else (700, 60)
    problem, short = (single_track(n, dtype=dtype.type) for n in (rows, few))
    work, little = count * (rows - 1), count * (few - 1)
    filter_ = (filters.AuxiliaryParticleFilter if auxiliary else filters.ParticleFilter)(count)
    made: list[Contestant | Skipped] = [
        _ours(VEHICLE, ours.vehicle_model, filter_, problem, dtype, work),
        _ours(OWN_MODEL, ours.single_track_model, filter_, problem, dtype, work),
    ]
    reason = limit.unavailable()
    if reason:
        made.append(Skipped(LIMIT, reason))
    else:
        made.append(Contestant(LIMIT, limit.particle_filter(problem, count, auxiliary=auxiliary, dtype=dtype), work))
    made.append(Contestant("NumPy", numpy_filters.particle_filter(short, count, auxiliary=auxiliary), little))
    for name, builder in (("particles", _particles), ("smcx", _smcx)):
        try:
            made.append(builder(name, short, count, auxiliary, dtype, little))
        except ImportError as error:
            made.append(Skipped(name, f"not installed here ({error.name})"))
    return made


def _ours(
    name: str,
    build: Callable,
    filter_: filters.AbstractFilter,
    problem: SingleTrack,
    dtype: np.dtype,
    work: float,
) -> Contestant:
    with ours.precision(dtype):
        model, recording = build(problem, dtype), ours.single_track_recording(problem)

    def call(seed: int) -> filters.Estimate:
        with ours.precision(dtype):
            return filters.run(filter_, model, recording, key=jax.random.key(seed))

    return Contestant(name, ours.blocked(call), work)


def _particles(
    name: str, problem: SingleTrack, count: int, auxiliary: bool, dtype: np.dtype, work: float
) -> Contestant:
    from .peers import particles_filters

    return Contestant(name, particles_filters.particle_filter(problem, count, auxiliary=auxiliary), work)


def _smcx(name: str, problem: SingleTrack, count: int, auxiliary: bool, dtype: np.dtype, work: float) -> Contestant:
    from .peers import smcx_filters

    with ours.precision(dtype):
        run: Callable = smcx_filters.particle_filter(problem, count, auxiliary=auxiliary, dtype=dtype)

    def call(seed: int) -> object:
        with ours.precision(dtype):
            return run(jax.random.key(seed))

    return Contestant(name, ours.blocked(call), work)

"""Bootstrap and auxiliary particle filters on the eleven-state single track."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import filters

from . import limit, ours
from .measure import Bound, Case, Contestant, Skipped
from .peers import numpy_filters
from .problems import SingleTrack, single_track

__all__ = ["cases"]

VEHICLE, OWN_MODEL, LIMIT = "jaxveh", "jaxveh, own model", "C++ limit"
PEERS = ("particles", "smcx", "cuthbert")

# Bounds of the time per step over that of the limit, by precision.
BOUNDS = {"float64": 1.6, "float32": 2.6}
# With fewer particles the fixed cost of a step matters, which the limit does not have.
FEW = 300
RUNS = 64


def cases(smoke: bool) -> list[Case]:
    """Return both filters in both precisions for 300, 1000 and 10000 particles, and 64 runs of 300 at once."""
    if smoke:
        return [_case("pf", "float64", 64, smoke), _case("apf", "float32", 64, smoke)]
    made = []
    for kind in ("pf", "apf"):
        for dtype in ("float64", "float32"):
            made += [_case(kind, dtype, count, smoke) for count in (FEW, 1000, 10000)]
            made.append(_case_of_many(kind, dtype))
    return made


def _title(kind: str) -> str:
    return f"{'Auxiliary' if kind == 'apf' else 'Bootstrap'} particle filter"


def _case(kind: str, dtype: str, count: int, smoke: bool) -> Case:
    ours_both = (VEHICLE, OWN_MODEL)
    bounds = [Bound(name, (LIMIT,), BOUNDS[dtype]) for name in ours_both if count > FEW]
    bounds += [Bound(name, PEERS, 1.0) for name in ours_both]
    return Case(
        name=f"particle_filters/{kind}-{dtype}-{count}",
        title=f"{_title(kind)}, {count} particles, {dtype}",
        unit="ns a particle-step",
        build=functools.partial(_build, kind == "apf", np.dtype(dtype), count, smoke),
        base=LIMIT,
        bounds=tuple(bounds),
    )


def _case_of_many(kind: str, dtype: str) -> Case:
    return Case(
        name=f"particle_filters/{kind}-{dtype}-{RUNS}x{FEW}",
        title=f"{_title(kind)}, {RUNS} runs of {FEW} particles, {dtype}",
        unit="ns a particle-step",
        build=functools.partial(_build_many, kind == "apf", np.dtype(dtype)),
        base=OWN_MODEL,
        bounds=(Bound(OWN_MODEL, PEERS, 1.0),),
    )


def _filter(auxiliary: bool, count: int) -> filters.AbstractParticleFilter:
    if not auxiliary:
        return filters.ParticleFilter(count)
    # Like the limit and the peers, it looks ahead to a point.
    return filters.AuxiliaryParticleFilter(count, lookahead=filters.PointLookahead())


def _build(auxiliary: bool, dtype: np.dtype, count: int, smoke: bool) -> Sequence[Contestant | Skipped]:
    # Slow contestants have fewer rows; a time per particle-step does not depend on their number.
    rows, few = (20, 10) if smoke else (700, 60)
    problem, short = (single_track(n, dtype=dtype.type) for n in (rows, few))
    work, little = count * (rows - 1), count * (few - 1)
    filter_ = _filter(auxiliary, count)
    made: list[Contestant | Skipped] = [_ours(OWN_MODEL, ours.single_track_model, filter_, problem, dtype, work)]
    if not (smoke and auxiliary):  # one compilation of the vehicle shows that it runs
        made.insert(0, _ours(VEHICLE, ours.vehicle_model, filter_, problem, dtype, work))
    reason = limit.unavailable()
    if reason:
        made.append(Skipped(LIMIT, reason))
    else:
        made.append(Contestant(LIMIT, limit.particle_filter(problem, count, auxiliary=auxiliary, dtype=dtype), work))
    made.append(Contestant("NumPy", numpy_filters.particle_filter(short, count, auxiliary=auxiliary), little))
    for name in PEERS:
        if name == "cuthbert" and auxiliary:
            continue  # it has no auxiliary filter
        try:
            if name == "particles":
                made.append(_particles(name, short, count, auxiliary, little))
            else:
                made.append(_jax_peer(name, short, count, auxiliary, dtype, little))
        except ImportError as error:
            made.append(Skipped(name, f"not installed here ({error.name})"))
    return made


def _build_many(auxiliary: bool, dtype: np.dtype) -> Sequence[Contestant | Skipped]:
    rows = 100
    problems = [single_track(rows, seed, dtype.type) for seed in range(RUNS)]
    work = RUNS * FEW * (rows - 1)
    measured = np.stack([np.stack([p.yaw_rate, p.lateral_acceleration], axis=-1) for p in problems])
    filter_ = _filter(auxiliary, FEW)
    with ours.precision(dtype):
        model = ours.single_track_model(problems[0], dtype)
        given = model.rows(ours.single_track_recording(problems[0]))

    def one(key: jax.Array, y: jax.Array) -> filters.Estimate:
        return filters.scan(filter_, model, given._replace(y=type(given.y)(y[:, 0], y[:, 1])), key)

    made: list[Contestant | Skipped] = [_many(OWN_MODEL, one, measured, dtype, work)]
    for name in PEERS[1:]:
        if name == "cuthbert" and auxiliary:
            continue
        try:
            with ours.precision(dtype):
                run = _peer_module(name).particle_filter(problems[0], FEW, auxiliary=auxiliary, dtype=dtype)
            made.append(_many(name, run, measured, dtype, work))
        except ImportError as error:
            made.append(Skipped(name, f"not installed here ({error.name})"))
    return made


def _many(name: str, one: Callable, measured: np.ndarray, dtype: np.dtype, work: float) -> Contestant:
    with ours.precision(dtype):
        run, y = jax.jit(jax.vmap(one)), jnp.asarray(measured, dtype)

    def call(seed: int) -> object:
        with ours.precision(dtype):
            return run(jax.random.split(jax.random.key(seed), len(y)), y)

    return Contestant(name, ours.blocked(call), work)


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


def _particles(name: str, problem: SingleTrack, count: int, auxiliary: bool, work: float) -> Contestant:
    from .peers import particles_filters

    return Contestant(name, particles_filters.particle_filter(problem, count, auxiliary=auxiliary), work)


def _jax_peer(name: str, problem: SingleTrack, count: int, auxiliary: bool, dtype: np.dtype, work: float) -> Contestant:
    with ours.precision(dtype):
        run: Callable = _peer_module(name).particle_filter(problem, count, auxiliary=auxiliary, dtype=dtype)

    def call(seed: int) -> object:
        with ours.precision(dtype):
            return run(jax.random.key(seed))

    return Contestant(name, ours.blocked(call), work)


def _peer_module(name: str):
    return importlib.import_module(f".peers.{name}_filters", __package__)

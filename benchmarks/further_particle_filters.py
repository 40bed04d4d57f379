"""Further particle filters that several libraries have: guided, Liu and West's, and paths drawn backwards through the particles.

The guided filter of the linear problem draws from the optimal proposal; the peers receive its gain and factor, which are the
same for all particles. For the eleven-state problem every contestant linearises for each particle. All resample before every
step, and all use weights p(y | x) p(x | x') / q(x | x', y), even if a special proposal would allow simpler ones.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from jaxveh import filters
from jaxveh.statespace.contract import innermost

from .compared import LOOPS, OURS, PROBLEMS, Compared, contestants, same
from .measure import Bound, Case, Contestant, Skipped

__all__ = ["FAMILY", "Kind", "cases"]

COUNTS = (300, 1000, 10000)
FEW, RUNS = COUNTS[0], 64
PATHS = 100
DISCOUNT = 0.98
COEFFICIENTS = tuple(f"{axle}_{letter}" for axle in ("front", "rear") for letter in "DCBE")


@dataclass(frozen=True)
class Kind:
    """A comparison for every number of particles, `of(count)`, and the number of rows."""

    of: Callable[[int], Compared]
    rows: int
    rows_of_loops: int = 60


def _guided(count: int) -> Compared:
    peers = same("guided", "smcx", "cuthbert", "particles")
    return _compared("Guided particle filter", filters.Guided(count), "linear", peers)


def _guided_track(count: int) -> Compared:
    return _compared("Guided particle filter", filters.Guided(count), "track", same("guided", "smcx", "cuthbert"))


def _liu_west(count: int) -> Compared:
    filter_ = filters.LiuWest(filters.AuxiliaryParticleFilter(count), DISCOUNT, COEFFICIENTS)
    settings = {"shrinkage": (3 * DISCOUNT - 1) / (2 * DISCOUNT), "states": 3}
    return _compared("Liu and West's filter", filter_, "parameters", same("liu_west", "smcx"), **settings)


def _backward(count: int) -> Compared:
    peers = same("backward_sampling", "cuthbert", "particles")
    draw = functools.partial(filters.smooth, method=filters.BackwardSampling(PATHS))
    title = f"{PATHS} paths drawn backwards through a bootstrap filter"
    return _compared(title, filters.ParticleFilter(count), "linear", peers, draw, paths=PATHS)


def _compared(
    title: str,
    filter_: filters.AbstractFilter,
    problem: str,
    peers: dict[str, str],
    smoother: Callable | None = None,
    **settings: object,
) -> Compared:
    count = innermost(filter_).particles
    return Compared(title, filter_, problem, peers, smoother, {"count": count, **settings}, random=True)


FAMILY = {
    "guided": Kind(_guided, 300),
    "guided-11": Kind(_guided_track, 60),
    "liu-west": Kind(_liu_west, 300),
    "backward-sampling": Kind(_backward, 60, 10),
}
# The cases of the smoke run, and their peers.
SMOKE = {"guided": ("smcx",), "backward-sampling": ("cuthbert", "particles")}


def cases(smoke: bool) -> list[Case]:
    """Return every filter for 300, 1000 and 10000 particles, and 64 runs of 300 at once."""
    if smoke:
        return [_case(name, 20, 1, smoke) for name in SMOKE]
    sizes = [(count, 1) for count in COUNTS] + [(FEW, RUNS)]
    return [_case(name, count, runs, smoke) for name in FAMILY for count, runs in sizes]


def _case(name: str, count: int, runs: int, smoke: bool) -> Case:
    compared = FAMILY[name].of(count)
    peers = SMOKE[name] if smoke else tuple(p for p in compared.peers if runs == 1 or p not in LOOPS)
    size = f"{count} particles" if runs == 1 else f"{runs} runs of {count} particles"
    return Case(
        name=f"further_particle_filters/{name}-{count if runs == 1 else f'{runs}x{count}'}",
        title=f"{compared.title}, {PROBLEMS[compared.problem].title}, {size}, float64",
        unit="ns a particle-step",
        build=functools.partial(_build, name, peers, count, runs, smoke),
        base=OURS,
        bounds=(Bound(OURS, peers, 1.0),),
    )


def _build(name: str, peers: Sequence[str], count: int, runs: int, smoke: bool) -> Sequence[Contestant | Skipped]:
    kind = FAMILY[name]
    compared = kind.of(count)
    plain = PROBLEMS[compared.problem].plain
    # Fewer rows for many particles or runs: a time per step does not depend on their number.
    rows = 8 if smoke else kind.rows if count * runs <= 1000 else max(kind.rows // 5, 20)
    return contestants(compared, peers, plain(rows, runs), plain(min(rows, kind.rows_of_loops), 1), count)

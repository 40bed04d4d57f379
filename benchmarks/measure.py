"""Round-robin timing: every round runs every contestant once, so that a slow period of the machine affects all equally."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

__all__ = ["Bound", "Case", "Contestant", "Samples", "Skipped", "Spread", "measure"]


@dataclass(frozen=True)
class Contestant:
    """A contestant: `call(round)` does the work and returns when it is done; `units` is the amount of work."""

    name: str
    call: Callable[[int], object]
    units: float
    note: str = ""


@dataclass(frozen=True)
class Skipped:
    """A contestant that cannot run here, and the reason."""

    name: str
    reason: str


@dataclass(frozen=True)
class Bound:
    """A bound: `contestant` may take at most `limit` times the time of the fastest of `references`."""

    contestant: str
    references: tuple[str, ...]
    limit: float


@dataclass(frozen=True)
class Case:
    """A table of the report. `build()` makes the contestants; times are in `unit` per unit of work."""

    name: str
    title: str
    unit: str
    build: Callable[[], Sequence[Contestant | Skipped]]
    base: str
    bounds: tuple[Bound, ...] = ()
    # Compile times need no warm-up: the first call is timed.
    warm: bool = True


@dataclass(frozen=True)
class Spread:
    """Median, quartiles and extremes of a sample."""

    median: float
    lower: float
    upper: float
    least: float
    most: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """Return the spread of at least one number."""
        if len(values) == 1:
            return cls(*[values[0]] * 5)
        lower, median, upper = statistics.quantiles(values, n=4, method="inclusive")
        return cls(median, lower, upper, min(values), max(values))


@dataclass
class Samples:
    """Nanoseconds per unit of work of one contestant, one number per round: on the chosen clock, and by the wall clock."""

    contestant: Contestant
    repeats: int
    times: list[float] = field(default_factory=list)
    wall: list[float] = field(default_factory=list)


def measure(
    contestants: Sequence[Contestant], *, rounds: int, seconds: float, cpu_time: bool, warm: bool = True
) -> list[Samples]:
    """Time all contestants in turn, `rounds` times, with at least `seconds` per sample (by repeating short calls).

    The order rotates from round to round. With `cpu_time` the clock is the CPU time of all threads of this process, which
    excludes the time of other programs on a shared core. Pin the process first.
    """
    clock = time.process_time if cpu_time else time.perf_counter
    samples = []
    for contestant in contestants:
        repeats = 1
        if warm:
            contestant.call(0)
            started = clock()
            contestant.call(0)
            repeats = max(1, round(seconds / max(clock() - started, 1e-9)))
        samples.append(Samples(contestant, repeats))
    for index in range(rounds):
        turn = index % len(samples)
        for sample in samples[turn:] + samples[:turn]:
            wall, started = time.perf_counter(), clock()
            for _ in range(sample.repeats):
                sample.contestant.call(index)
            work = sample.repeats * sample.contestant.units
            sample.times.append((clock() - started) / work * 1e9)
            sample.wall.append((time.perf_counter() - wall) / work * 1e9)
    return samples

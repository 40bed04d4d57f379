"""How many devices of a CPU may run a program at once, if its kernels wait for each other's workers.

jaxlib 0.9.1 to 0.11 hands a large batch of a LAPACK routine (factorisations, eigenvalues, triangular solves) in parts to the
pool of worker threads that all devices of a process share, and waits for them; XLA's FFT does the same. If such a kernel runs
on a worker itself, that worker is blocked. Once all workers are blocked, none is left for the parts, and the program never
ends. One free worker is enough, because the parts themselves wait for nothing. More workers than cores would also help, but
make every program slower (two devices on two cores: 1.3 times as fast as one with three workers, 1.9 times with two).
"""

from __future__ import annotations

import math
import os
import re
from typing import Any

import jax

from jaxveh._core.errors import warn

WHOLE_AGAIN = (0, 12)
"""The first jax whose LAPACK kernels compute a batch without other workers."""

LARGE = 200_000
"""Operations of a batch from which on it is handed out in parts."""

POOL = "PJRT_NPROC"
"""The variable with the number of workers, read when jax makes its devices; without it there are as many as cores."""

COST = {"potrf": 1 / 3, "trsm": 1.0, "getrf": 1.0, "geqrf": 2.0, "orgqr": 4.0}
"""Operations for a matrix of n rows, divided by n^3, as jaxlib counts them, at most; ten for other routines."""

_KERNEL = re.compile(r"= (?P<shapes>.*?) custom-call\(.*custom_call_target=\"lapack_(?P<kind>\w)(?P<routine>[a-z]+)_")
_HEADER = re.compile(r"^(ENTRY )?(?P<name>%[\w.\-]+) .*\{$")
_NAME = re.compile(r"%[\w.\-]+")
_SHAPE = re.compile(r"\w+\[([\d,]*)\]")


def fit_for(program: Any, devices: list) -> list:
    """As many of `devices` as can run a compiled program without ever blocking all workers; at least one.

    Warns if even one may block them all: a program in which as many kernels may wait at once as there are workers.
    """
    if devices[0].platform != "cpu":
        return devices
    places = places_that_wait(program.as_text())
    if not places:
        return devices
    fit = (workers() - 1) // places
    if fit == 0:
        warn(
            f"{places} kernels of this program may at once block one of the {workers()} workers of jax {jax.__version__}; once "
            f"all are blocked, it never ends. Set the environment variable {POOL} to {places + 1} or more before jax starts, "
            "or take jax 0.12."
        )
    return devices[: max(fit, 1)]


def places_that_wait(text: str) -> int:
    """The largest number of kernels of a compiled program (its HLO as text) that may wait for the pool at the same time."""
    most: dict[str, int] = {}
    entry = 0
    for name, lines in _computations(text):
        most[name] = entry = _at_once(lines, most)
    return entry  # the last one


def _computations(text: str) -> list[tuple[str, list[str]]]:
    """The instructions of each computation by its name; computations come before those that call them."""
    found: list[tuple[str, list[str]]] = []
    for line in text.splitlines():
        header = _HEADER.match(line)
        if header:
            found.append((header["name"], []))
        elif found and " = " in line:
            found[-1][1].append(line)
    return found


def _at_once(lines: list[str], most: dict[str, int]) -> int:
    """The number of kernels of one computation that may run at once. Kernels that need each other's results form a chain, of
    which one runs at a time; an instruction that calls computations counts as many kernels as they have."""
    needs: dict[str, int] = {}  # by instruction: the waiting kernels from which it follows, one bit each
    chains: list[tuple[int, int]] = []  # the last waiting kernel, and the largest count in the chain
    waiting = 0
    for line in lines:
        own, _, rest = line.partition(" = ")
        used = _NAME.findall(rest)
        before = 0
        for name in used:
            before |= needs.get(name, 0)
        count = int(_waits(line)) + sum(most.get(name, 0) for name in used)
        if count:
            where = next((i for i, (last, _) in enumerate(chains) if before >> last & 1), None)
            if where is None:
                chains.append((waiting, count))
            else:
                chains[where] = (waiting, max(chains[where][1], count))
            before |= 1 << waiting
            waiting += 1
        needs[_NAME.findall(own)[0]] = before
    return sum(count for _, count in chains)


def _waits(line: str) -> bool:
    return " fft(" in line or (jax.__version_info__[:2] < WHOLE_AGAIN and _is_lapack_kernel(line))


def workers() -> int:
    """The number of worker threads of the process: one per core or the value of `POOL` (or NPROC), at least one per device."""
    told = os.environ.get(POOL) or os.environ.get("NPROC")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(int(told) if told else cores, len(jax.devices("cpu")))


def _is_lapack_kernel(line: str) -> bool:
    """Whether a line of HLO is a LAPACK kernel whose batch may be large."""
    kernel = _KERNEL.search(line)
    if kernel is None:
        return False
    shapes = [[int(n) for n in dims.split(",") if n] for dims in _SHAPE.findall(kernel["shapes"])]
    *batch, rows, columns = max((shape for shape in shapes if len(shape) > 1), key=math.prod)
    cost = (
        COST.get(kernel["routine"], 10.0) * rows * columns * max(rows, columns) * (3 if kernel["kind"] in "cz" else 1)
    )
    return math.prod(batch) > 1 and math.prod(batch) * cost >= LARGE

"""`python -m benchmarks.two_cores [--runs N] [--rounds N]`: the gain from a second core for 1000 drives of the 7-DOF car.

XLA does not use a second core by itself; `shard_map` over two host devices does. The benchmark measures wall time and is not
pinned to a core, and is therefore separate from the others; no other work should run on the machine. The processors' time over
the wall time shows that: it is 1 with one device and 2 with two. With other programs both threads may share one core, at 1 and 1.
"""

from __future__ import annotations

import argparse
import functools
import os
import statistics
import sys
import time
from collections.abc import Callable
from typing import NamedTuple

from .machine import VECTOR_WIDTH_FLAG

__all__ = ["Time", "main", "measure"]


def main(arguments: list[str] | None = None) -> int:
    """Measure and print; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.two_cores", description=__doc__)
    parser.add_argument("--runs", type=int, default=1000, help="drives, an even number (default 1000)")
    parser.add_argument("--rows", type=int, default=100, help="rows of ten steps (default 100)")
    parser.add_argument("--rounds", type=int, default=9, help="rounds over both (default 9)")
    options = parser.parse_args(arguments)
    if options.runs < 2 or options.runs % 2 or min(options.rows, options.rounds) < 1:
        parser.error(f"--runs is {options.runs}; it must be even, and --rows and --rounds at least 1")
    os.environ["XLA_FLAGS"] = f"{VECTOR_WIDTH_FLAG} --xla_force_host_platform_device_count=2"
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    found = measure(options.runs, options.rows, options.rounds)
    ratios, busy = (
        [one.wall / two.wall for one, two in found],
        [[t.busy for t in times] for times in zip(*found, strict=True)],
    )
    print(f"two cores: {statistics.median(ratios):.2f} times one core (rounds: {min(ratios):.2f} to {max(ratios):.2f})")
    print(
        f"processors busy: {statistics.median(busy[0]):.2f} of the time with one, {statistics.median(busy[1]):.2f} with two"
    )
    return 0


class Time(NamedTuple):
    """Seconds of wall time, and of all processors."""

    wall: float
    processors: float

    @property
    def busy(self) -> float:
        """The mean number of busy processors."""
        return self.processors / self.wall


def measure(runs: int, rows: int, rounds: int) -> list[tuple[Time, Time]]:
    """Return times of one device and of two, one pair per round; raise if their states differ."""
    import jax
    import numpy as np

    jax.config.update("jax_enable_x64", True)
    one, two = contestants(runs, rows)
    for a, b in zip(jax.tree.leaves(one()), jax.tree.leaves(two()), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)
    return [(_time(one), _time(two)) for _ in range(rounds)]


def contestants(runs: int, rows: int) -> tuple[Callable[[], object], Callable[[], object]]:
    """Return functions that run all drives on one device, and half of them on each of two."""
    import jax
    import jax.numpy as jnp
    import numpy as np
    from jax.sharding import Mesh, NamedSharding
    from jax.sharding import PartitionSpec as P

    from . import simulation
    from .seven_dof_problem import drives

    problem = drives(runs, rows)
    cars, speed = simulation.car(problem, np.float64), jnp.asarray(problem.speed)
    run = functools.partial(simulation.simulate, problem)
    mesh = Mesh(jax.devices()[:2], "runs")
    parts = jax.tree.map(lambda leaf: P("runs") if leaf.ndim else P(), (cars, speed))
    # No check of the variation over devices: a car that starts without lateral motion has constants among its states.
    split = jax.jit(jax.shard_map(run, mesh=mesh, in_specs=parts, out_specs=P(None, "runs"), check_vma=False))
    given = jax.device_put((cars, speed), jax.tree.map(lambda part: NamedSharding(mesh, part), parts))
    whole = jax.jit(run)
    return lambda: jax.block_until_ready(whole(cars, speed)), lambda: jax.block_until_ready(split(*given))


def _time(function: Callable[[], object]) -> Time:
    wall, processors = time.perf_counter(), time.process_time()
    function()
    return Time(time.perf_counter() - wall, time.process_time() - processors)


if __name__ == "__main__":
    sys.exit(main())

"""`python -m benchmarks.live [--steps N] [--json FILE]`: the time of one step of a live loop at 100 Hz, by the wall clock.

The problem is the single track with eight tyre coefficients, 11 states. A row of plain numbers goes through `model.row` into a
jitted `filter.step`, and the loop waits for the results, one row after another. A step's time is split where the call returns:
before that the host makes the row and starts the work (dispatch), after that the host waits (computing). Short work may be
computed by JAX within the call, on the calling thread: then it counts as dispatch. The process is pinned to one core, as a loop
in a car would be. On a machine with other work the extremes are due to that work.
"""

from __future__ import annotations

import argparse
import functools
import gc
import itertools
import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from . import machine

__all__ = ["BOUND_US", "Latency", "main", "measure"]

BOUND_US = 1000.0
"""Bound of the 99th percentile of a step's time (us): a tenth of the period at 100 Hz."""


@dataclass(frozen=True)
class Latency:
    """Microseconds per step: quantiles and maximum of the whole, and the medians of its two parts."""

    name: str
    steps: int
    p50: float
    p99: float
    most: float
    dispatch: float
    computing: float

    @property
    def holds(self) -> bool:
        """Whether the 99th percentile is within the bound."""
        return self.p99 <= BOUND_US


def main(arguments: list[str] | None = None) -> int:
    """Measure and print; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.live", description=__doc__)
    parser.add_argument("--steps", type=int, default=10000, help="steps of each contestant (default 10000)")
    parser.add_argument("--only", default="", help="part of a contestant's name, e.g. APF or float32")
    parser.add_argument("--core", type=int, default=None, help="core to be pinned to (default: the last)")
    parser.add_argument("--json", type=Path, default=None, help="write every number to this file")
    options = parser.parse_args(arguments)
    if options.steps < 1:
        parser.error(f"--steps is {options.steps}; it must be at least 1")
    try:
        core = machine.prepare(options.core)
    except ValueError as error:
        parser.error(str(error))
    found = measure(options.steps, options.only)
    print(f"{'us a step':34}{'p50':>8}{'p99':>8}{'max':>9}{'dispatch':>10}{'computing':>11}")
    for one in found:
        verdict = "" if one.holds else f"  p99 ABOVE {BOUND_US:g}"
        print(
            f"{one.name:34}{one.p50:8.0f}{one.p99:8.0f}{one.most:9.0f}{one.dispatch:10.0f}{one.computing:11.0f}{verdict}"
        )
    if options.json:
        document = {"manifest": machine.describe(core), "bound_us": BOUND_US, "latencies": [asdict(o) for o in found]}
        options.json.write_text(json.dumps(document, indent=1))
    return 0


def measure(steps: int, only: str = "") -> list[Latency]:
    """Measure the latencies of every contestant with `only` in its name, one after another."""
    import jax

    jax.config.update("jax_enable_x64", True)
    return [_latency(name, *prepare(), steps) for name, prepare in _contestants() if only in name]


def _latency(name: str, step: Callable, rows: Iterator, steps: int) -> Latency:
    """Time the steps of `step(row) -> (done after dispatch, wait)` one by one, with the garbage collector on as usual."""
    for _ in range(min(steps, 200)):
        step(next(rows))()
    gc.collect()
    whole, handed = [], []
    for _ in range(steps):
        row = next(rows)
        started = time.perf_counter_ns()
        wait = step(row)
        between = time.perf_counter_ns()
        wait()
        whole.append((time.perf_counter_ns() - started) / 1e3)
        handed.append((between - started) / 1e3)
    computed = sorted(w - h for w, h in zip(whole, handed, strict=True))
    whole.sort()
    handed.sort()
    at = lambda values, share: values[min(len(values) - 1, int(share * len(values)))]
    return Latency(name, steps, at(whole, 0.5), at(whole, 0.99), whole[-1], at(handed, 0.5), at(computed, 0.5))


def _contestants() -> Iterator[tuple[str, Callable[[], tuple[Callable, Iterator]]]]:
    """Yield names, and functions that make a step and its rows."""
    import numpy as np

    from jaxveh import filters

    kinds = {"UKF, 11 states": filters.Unscented(), "APF, 300 particles": filters.AuxiliaryParticleFilter(300)}
    for (kind, filter_), dtype in itertools.product(kinds.items(), (np.float64, np.float32)):
        name = f"{kind}, {np.dtype(dtype).name}"
        yield name, functools.partial(_stepper, filter_, dtype)
        yield f"{name}, model held", functools.partial(_stepper, filter_, dtype, held=True)
        yield f"{name}, exported", functools.partial(_exported, filter_, dtype)


def _drive(dtype: type) -> tuple:
    """Return the model, and an endless iterator of rows as plain numbers: time, inputs, measurements."""
    from . import ours
    from .problems import single_track

    problem = single_track(2000, dtype=dtype)
    columns = (problem.steer, problem.speed, problem.yaw_rate, problem.lateral_acceleration)
    numbers = list(zip(*(column.tolist() for column in columns), strict=True))

    def rows() -> Iterator[tuple]:
        for k in itertools.count():
            steer, speed, yaw_rate, a_y = numbers[k % len(numbers)]
            yield problem.step * k, {"steer": steer, "v_x": speed}, {"yaw_rate": yaw_rate, "a_y": a_y}

    with ours.precision(dtype):
        return ours.single_track_model(problem, dtype), rows()


def _stepper(filter_: object, dtype: type, *, held: bool = False) -> tuple[Callable, Iterator]:
    """Return the jitted `filter.step` in the form for a live loop, and its rows.

    The model is an argument, which may change between steps, or with `held` the model's numbers are part of the program.
    """
    import equinox as eqx
    import jax

    from . import ours

    model, rows = _drive(dtype)
    with ours.precision(dtype):
        belief, _ = filter_.init(model, model.row(*next(rows)), jax.random.key(0))
        whole = eqx.filter_jit(filter_.step)
        fixed = jax.jit(functools.partial(filter_.step, model))
        step = fixed if held else functools.partial(whole, model)

    def call(row: tuple) -> Callable:
        nonlocal belief
        belief, info = step(belief, model.row(*row))
        return lambda: jax.block_until_ready((belief, info))

    _use_precision(dtype)
    return call, rows


def _exported(filter_: object, dtype: type) -> tuple[Callable, Iterator]:
    """Return the program that `export_filter` wrote, called as in its documentation."""
    import jax
    import jax.export
    import numpy as np

    from jaxveh import filters

    from . import ours

    model, rows = _drive(dtype)
    with ours.precision(dtype), tempfile.TemporaryDirectory() as folder:
        written = filters.export_filter(Path(folder) / "filter", filter_, model, key=jax.random.key(0))
        read = lambda name: jax.export.deserialize(bytearray((written / f"{name}.jaxexport").read_bytes()))
        init, step = read("init"), jax.jit(read("step").call)

        def arrays(row: tuple) -> tuple:
            t, u, y = row
            inputs = [u[name] for name in model.inputs]
            return np.asarray(t, dtype), np.array(inputs, dtype), np.array([y[name] for name in model.channels], dtype)

        state, *_ = init.call(*arrays(next(rows)))

    def call(row: tuple) -> Callable:
        nonlocal state
        state, *shown = step(state, *arrays(row))
        return lambda: jax.block_until_ready((state, shown))

    _use_precision(dtype)
    return call, rows


def _use_precision(dtype: type) -> None:
    """Switch x64 off for float32, as a user of float32 would, for the rest of the process."""
    import jax
    import numpy as np

    jax.config.update("jax_enable_x64", np.dtype(dtype) == np.float64)


if __name__ == "__main__":
    sys.exit(main())

"""`python -m benchmarks.million_runs [--runs N] [--cars N] [--processes N]`: sweeps with a store, at scale.

A million log-likelihoods of the unscented filter of three states (20 rows each), and 10,000 drives of the 7-DOF car (100 rows of
ten steps); each with a tenth of the runs and with all, to show what grows with their number. By the wall clock, on all cores:
seconds, runs per second, largest memory of this process and of its largest worker in megabytes, and the store's size; then the
cost of a store in one process.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from .machine import VECTOR_WIDTH_FLAG

__all__ = ["main"]


def main(arguments: list[str] | None = None) -> int:
    """Measure and print; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.million_runs", description=__doc__)
    parser.add_argument("--runs", type=int, default=1_000_000, help="runs of the filter (default 1,000,000)")
    parser.add_argument("--cars", type=int, default=10_000, help="drives of the 7-DOF car (default 10,000)")
    parser.add_argument("--processes", type=int, default=2, help="processes (default 2)")
    options = parser.parse_args(arguments)
    if min(options.runs, options.cars) < 10 or options.processes < 1:
        parser.error(
            f"--runs is {options.runs}, --cars {options.cars}, at least 10; --processes {options.processes}, 1"
        )
    os.environ["XLA_FLAGS"] = VECTOR_WIDTH_FLAG
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    import jax

    jax.config.update("jax_enable_x64", True)
    print(f"{'':34}{'seconds':>9}{'runs/s':>10}{'MB here':>9}{'MB a worker':>12}{'store MB':>10}")
    for title, run, runs, batch in (
        ("unscented filter, 3 states", filter_once, options.runs, 10_000),
        ("7-DOF car", car_once, options.cars, 250),
    ):
        for count in (runs // 10, runs):
            print(_line(f"{title}, {count:,} runs", run, count, min(batch, count), options.processes), flush=True)
    print(_overhead(car_once, options.cars, max(options.cars // 5, 1)))
    return 0


def _line(title: str, run: Callable, runs: int, batch: int, processes: int) -> str:
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "sweep.zarr"
        took = _seconds(run, runs, batch, store=store, processes=processes)
        size = sum(file.stat().st_size for file in store.rglob("*") if file.is_file()) / 1e6
    here, workers = (
        resource.getrusage(who).ru_maxrss / 1e3 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    return f"{title:34}{took:9.1f}{runs / took:10,.0f}{here:9.0f}{workers:12.0f}{size:10.1f}"


def _overhead(run: Callable, runs: int, batch: int) -> str:
    """Return the cost of a store in one process, alternating with none: compiled programs are kept, so that neither compiles."""
    import jax

    with tempfile.TemporaryDirectory() as folder:
        jax.config.update("jax_compilation_cache_dir", str(Path(folder) / "programs"))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
        times: dict[str, list[float]] = {"without": [], "with": []}
        for turn in range(4):
            times["without"].append(_seconds(run, runs, batch, devices=jax.devices()[:1]))
            times["with"].append(_seconds(run, runs, batch, store=Path(folder) / f"{turn}.zarr"))
    ratios = sorted(b / a for a, b in zip(*(times[name][1:] for name in ("without", "with")), strict=True))
    chunk = min(times["without"]) * batch / runs
    spread = f"{ratios[1]:.3f} times the time without ({ratios[0]:.3f} to {ratios[-1]:.3f})"
    return f"a store in one process, chunks of {chunk:.1f} s: {spread}"


def _seconds(run: Callable, runs: int, batch: int, **options: object) -> float:
    import jax

    from jaxveh import sweeps

    begun = time.perf_counter()
    sweeps.sweep(run, sweeps.Design(), runs, jax.random.key(0), batch=batch, **options)
    return time.perf_counter() - begun


def filter_once(point: object, key: object) -> dict[str, object]:
    """Return the log-likelihood of one simulated log."""
    import jax
    import numpy as np

    from jaxveh import filters

    from . import ours
    from .problems import speed_and_mass

    problem = speed_and_mass(20)
    model, recording = ours.speed_model(problem, np.float64), ours.speed_recording(problem)
    rows = model.rows(recording)
    noisy = rows._replace(y=rows.y._replace(v=rows.y.v + 0.1 * jax.random.normal(key, rows.y.v.shape)))
    found = filters.scan(filters.Unscented(), model, noisy, None, ())
    return {"log_likelihood": found.log_likelihood, "result": found.result}


def car_once(point: object, key: object) -> dict[str, object]:
    """Return the final yaw of a drive of the 7-DOF car from a random speed, and its largest yaw rate."""
    import jax
    import jax.numpy as jnp
    import numpy as np

    from . import simulation
    from .seven_dof_problem import drives

    problem = drives(1, 100)
    states = simulation.simulate(
        problem, simulation.car(problem, np.float64), jax.random.uniform(key, minval=18.0, maxval=30.0)
    )
    return {"yaw": states.yaw[-1], "peak_yaw_rate": jnp.max(jnp.abs(states.yaw_rate))}


if __name__ == "__main__":
    sys.exit(main())

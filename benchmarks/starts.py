"""`python -m benchmarks.starts [--only NAME] [--rounds N] [--json FILE]`: the time of programs from their start to their end.

Each is a separate process on all cores, measured by the wall clock: cold, with an empty folder of compiled programs, and warm,
with the programs of the cold start. The parts are importing; tracing and lowering, which every start does; compiling, or reading
compiled programs back; and the rest, which is mostly the work itself. Time in which two threads do the same part counts once.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

__all__ = ["Start", "covered", "main", "start"]

PARTS = {"import": "importing", "trace": "tracing", "lower": "lowering", "compile": "compiling", "read": "reading back"}

EVENTS = {
    "/jax/core/compile/jaxpr_trace_duration": "trace",
    "/jax/core/compile/jaxpr_to_mlir_module_duration": "lower",
    "/jax/core/compile/backend_compile_duration": "compile",
    "/jax/compilation_cache/cache_retrieval_time_sec": "read",
}

PROBE = """
import json, sys, time
begun = time.perf_counter()
import jax, jaxveh.cli
jaxveh.cli.prepare()
import jaxveh.cli.app
spans = [("import", begun, time.perf_counter())]
events = json.loads(sys.argv[1])
def note(event, duration, **more):
    now = time.perf_counter()
    if event in events:
        spans.append((events[event], now - duration, now))
jax.monitoring.register_event_duration_secs_listener(note)
try:
    jaxveh.cli.app.app(args=sys.argv[3:], prog_name="jaxveh")
except SystemExit as end:
    with open(sys.argv[2], "w") as said:
        said.write(json.dumps(spans))
    jaxveh.cli.leave(end)
"""

CAR = """\
name = "a compact car"
mass = 1300.0
yaw_inertia = 1800.0
front_axle_to_cg = 1.05
rear_axle_to_cg = 1.55
front_cornering_stiffness = 80000.0
rear_cornering_stiffness = 100000.0
"""


class Start(NamedTuple):
    """Seconds of one start: the whole, and by part."""

    whole: float
    parts: dict[str, float]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.starts", description=__doc__)
    parser.add_argument("--only", default="", help=f"part of a program's name: {', '.join(PROGRAMS)}")
    parser.add_argument("--rounds", type=int, default=3, help="cold and warm starts of each (default 3)")
    parser.add_argument("--json", type=Path, default=None, help="write every number to this file")
    options = parser.parse_args(arguments)
    chosen = {name: make for name, make in PROGRAMS.items() if options.only in name}
    if not chosen or options.rounds < 1:
        parser.error(f"--only is {options.only!r}, of {', '.join(PROGRAMS)}; --rounds {options.rounds}, at least 1")
    print(f"{'seconds, medians':24}{'in all':>16}" + "".join(f"{title:>14}" for title in (*PARTS.values(), "the rest")))
    document = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, make in chosen.items():
            command = make(Path(folder))
            for kind, found in _cold_and_warm(command, Path(folder) / "kept", options.rounds).items():
                document[f"{name}, {kind}"] = [one._asdict() for one in found]
                print(_line(f"{name}, {kind}", found), flush=True)
    if options.json:
        options.json.write_text(json.dumps(document, indent=1))
    return 0


def _cold_and_warm(command: Sequence[str], kept: Path, rounds: int) -> dict[str, list[Start]]:
    found: dict[str, list[Start]] = {"cold": [], "warm": []}
    for index in range(rounds):
        for kind in found:
            found[kind].append(start(command, kept.with_name(f"{kept.name}-{command[0]}-{index}")))
    return found


def _line(title: str, found: Sequence[Start]) -> str:
    whole = [one.whole for one in found]
    spread = f" ({min(whole):.1f}-{max(whole):.1f})" if len(found) > 1 else ""
    medians = [statistics.median(one.parts[part] for one in found) for part in (*PARTS, "rest")]
    return f"{title:24}{f'{statistics.median(whole):.1f}{spread}':>16}" + "".join(
        f"{value:>14.1f}" for value in medians
    )


def start(command: Sequence[str], kept: Path) -> Start:
    """Run `jaxveh` with these arguments as a process that keeps its compiled programs in a folder; raise if it fails."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("JAX_", "XLA_"))}
    with tempfile.TemporaryDirectory() as folder:
        said = Path(folder) / "spans.json"
        begun = time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-c", PROBE, json.dumps(EVENTS), str(said), *command],
            env={**environment, "JAXVEH_CACHE": str(kept)}, cwd=folder, capture_output=True, text=True,
        )  # fmt: skip
        whole = time.perf_counter() - begun
        if done.returncode:
            raise RuntimeError(f"jaxveh {' '.join(command)} ended with {done.returncode}: {done.stderr[-2000:]}")
        spans = json.loads(said.read_text())
    parts = {part: covered([(a, b) for kind, a, b in spans if kind == part]) for part in PARTS}
    # Reading back is part of the time that jax reports as compiling.
    parts["compile"] = max(parts["compile"] - parts["read"], 0.0)
    parts["rest"] = whole - covered([(a, b) for _, a, b in spans])
    return Start(whole, parts)


def covered(spans: Sequence[tuple[float, float]]) -> float:
    """Return the length of the union of these spans: overlaps count once."""
    whole, reached = 0.0, float("-inf")
    for a, b in sorted(spans):
        whole += max(0.0, b - max(a, reached))
        reached = max(reached, b)
    return whole


def _log(folder: Path) -> list[str]:
    """Return a log and its car file, simulated once."""
    car, log = folder / "car.toml", folder / "drive.csv"
    if not log.exists():
        car.write_text(CAR)
        start(["simulate", *DRIVE, "-o", str(log), "--vehicle", str(car)], folder / "kept-for-the-log")
    return [str(log), "--vehicle", str(car)]


def _rig(folder: Path) -> str:
    """Write sweeps of slip angle at four loads: a Magic Formula with load-dependent peak, plus noise, in the signs of ISO-W."""
    rng, lines = np.random.default_rng(0), ["Fz [N],alpha [rad],kappa,gamma [rad],Vx [m/s],Fy [N]"]
    for load in (1500.0, 3000.0, 4500.0, 6000.0):
        slip = np.linspace(-0.2, 0.2, 200)
        peak, stiffness = load * (1.1 - 2e-5 * load), 80000.0 * np.sin(2 * np.arctan(load / 4000.0))
        inside = stiffness / (1.4 * peak) * slip
        force = peak * np.sin(1.4 * np.arctan(inside + 0.5 * (inside - np.arctan(inside))))
        force = force + 20.0 * rng.standard_normal(slip.size)
        lines += [f"{load},{a:.6f},0,0,15,{-f:.3f}" for a, f in zip(slip, force, strict=True)]
    path = folder / "rig.csv"
    path.write_text("\n".join(lines) + "\n")
    return str(path)


DRIVE = ("--manoeuvre", "double-lane-change", "--duration", "20")

PROGRAMS: dict[str, Callable[[Path], list[str]]] = {
    "demo": lambda folder: ["demo", "--out", str(folder / "demo")],
    "simulate": lambda folder: ["simulate", *DRIVE, "-o", str(folder / "simulated.csv"), "--force"],
    "estimate": lambda folder: ["estimate", *_log(folder), "-o", str(folder / "estimated.csv"), "--force"],
    "fit": lambda folder: ["fit", *_log(folder), "-o", str(folder / "fitted.toml"), "--force"],
    "tyre fit": lambda folder: ["tyre", "fit", _rig(folder), "-o", str(folder / "tyre.tir"), "--force"],
}


if __name__ == "__main__":
    sys.exit(main())

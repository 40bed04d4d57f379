"""`jaxveh reproduce all`: every paper in a process of its own, as many at once as there are cores.

Most of a paper's time is compilation, which uses one core; two papers side by side take little longer than one.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import typer

from jaxveh.cli.console import messages, progress, results, table
from jaxveh.cli.family import Family, ends_in_order
from jaxveh.cli.output import plain
from jaxveh.io import write_text

SLOWEST = ("model-adaptive-pf", "sideslip-review", "tyre-apf", "mass-grade-aukf", "federated-ckf")
"""The order that fills two cores best: the first paper and both short ones on one core, the others on the other."""


class Done(NamedTuple):
    """A paper's program after its end: its exit `code`, its printed output, its numbers, and the time that it took (s)."""

    code: int
    printed: str
    numbers: dict[str, Any]
    took: float


OF_EACH = ("--out", "--store")
"""Options whose folder gets a subfolder for each paper."""


def all_papers(asked: Mapping[str, Mapping[str, Any]], numbers: Path | None, *, at_once: int | None = None) -> None:
    """Run each paper with its options in `asked`, print the outputs in that order, and write all numbers to one file.

    `at_once`: number of papers that run at the same time; None: the number of cores. If one fails, the others are finished, and
    the program exits with 1.
    """
    order = sorted(asked, key=lambda name: SLOWEST.index(name) if name in SLOWEST else -1)
    with ends_in_order(), progress("reproduce") as report, tempfile.TemporaryDirectory() as folder:
        finished: list[str] = []
        family = Family()

        def go(name: str) -> Done:
            tell = lambda line: report(len(finished), len(order), f"{name}: {line}")
            done = run_program(name, asked[name], Path(folder), tell, family)
            finished.append(name)
            return done

        with ThreadPoolExecutor(min(at_once or os.cpu_count() or 1, len(order))) as pool:
            try:
                done = dict(zip(order, pool.map(go, order), strict=True))
            except BaseException:
                family.end()
                pool.shutdown(wait=False, cancel_futures=True)
                raise
    done = {name: done[name] for name in asked}
    for one in done.values():
        typer.echo(one.printed, nl=False)
    table(
        "Papers",
        ("paper", "criteria that hold", "time, s"),
        [(n, _tally(one), f"{one.took:.0f}") for n, one in done.items()],
    )
    if numbers is not None:
        content = {name: one.numbers for name, one in done.items()}
        write_text(
            json.dumps(plain(content), indent=2, allow_nan=False, ensure_ascii=False) + "\n", numbers, overwrite=True
        )
        results().print(f"numbers: {numbers}")
    failed = [name for name, one in done.items() if one.code != 0]
    if failed:
        messages().print(f"error: {', '.join(failed)} failed; run each alone to see why.")
        raise typer.Exit(1)


def _tally(done: Done) -> str:
    from jaxveh.experiments import report

    if done.code != 0:
        return "failed"
    return str(report.Tally(**done.numbers["tally"])) if done.numbers.get("checks") else "none made"


def run_program(name: str, asked: Mapping[str, Any], folder: Path, tell: Callable[[str], None], family: Family) -> Done:
    """Run `jaxveh reproduce NAME` to its end, and pass each line of its progress to `tell`.

    Figures and stores go to a folder with the paper's name.
    """
    start, file = time.perf_counter(), folder / f"{name}.json"
    arguments = [sys.executable, "-m", "jaxveh", "reproduce", name, "--json", str(file)]
    for option, value in asked.items():
        value = value / name if option in OF_EACH and value is not None else value
        if value is not None:
            arguments += [option] if value is True else [option, str(value)]
    with tempfile.TemporaryFile("w+") as printed:
        # One device per program: the programs already use all cores.
        with family.child(arguments, printed, JAX_NUM_CPU_DEVICES="1") as running:
            assert running.stderr is not None
            for line in running.stderr:
                tell(line.strip().removeprefix("reproduce: "))
        printed.seek(0)
        text = printed.read()
    found = json.loads(file.read_text()) if file.exists() else {}
    return Done(running.returncode, text, found, time.perf_counter() - start)

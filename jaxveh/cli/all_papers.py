"""`jaxveh reproduce all`: every paper in a process of its own, as many at a time as there are cores.

Most of a paper's time is compiling, which takes one core; two papers beside each other take little longer than one.
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
"""In this order they fill two cores best: the first with both short ones on one, the others on the other."""


class Done(NamedTuple):
    """A paper's program after its end: its exit `code`, what it printed, the numbers it wrote, and the time it took (s)."""

    code: int
    printed: str
    numbers: dict[str, Any]
    took: float


OF_EACH = ("--out", "--store")
"""Options whose folder has one of its name for each paper."""


def all_papers(asked: Mapping[str, Mapping[str, Any]], numbers: Path | None, *, at_once: int | None = None) -> None:
    """Run each paper with the options `asked` of it, so many `at_once` (None: as there are cores), show what they print in the
    mapping's order, and write all numbers as one file. Exits with 1 where one of them failed, after the others."""
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
        ("paper", "criteria that hold", "took, s"),
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
        messages().print(f"error: {', '.join(failed)} failed; run each by itself to see why.")
        raise typer.Exit(1)


def _tally(done: Done) -> str:
    from jaxveh.experiments import report

    if done.code != 0:
        return "failed"
    return str(report.Tally(**done.numbers["tally"])) if done.numbers.get("checks") else "none made"


def run_program(name: str, asked: Mapping[str, Any], folder: Path, tell: Callable[[str], None], family: Family) -> Done:
    """Run `jaxveh reproduce NAME` to its end; each line of its progress is told. Figures and stores go to a folder of the paper's
    name."""
    start, file = time.perf_counter(), folder / f"{name}.json"
    arguments = [sys.executable, "-m", "jaxveh", "reproduce", name, "--json", str(file)]
    for option, value in asked.items():
        value = value / name if option in OF_EACH and value is not None else value
        if value is not None:
            arguments += [option] if value is True else [option, str(value)]
    with tempfile.TemporaryFile("w+") as printed:
        # One device a program: the cores are shared out already.
        with family.child(arguments, printed, JAX_NUM_CPU_DEVICES="1") as running:
            assert running.stderr is not None
            for line in running.stderr:
                tell(line.strip().removeprefix("reproduce: "))
        printed.seek(0)
        text = printed.read()
    found = json.loads(file.read_text()) if file.exists() else {}
    return Done(running.returncode, text, found, time.perf_counter() - start)

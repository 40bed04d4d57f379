"""Mutations tried: a copy of the tree with one line changed, and the tests that execute the line, until one fails."""

from __future__ import annotations

import ast
import os
import queue
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from tests.mutations.candidates import NOTICED_AT_ONCE, Mutant, mutants
from tests.mutations.coverage_map import Covered

COPIED = (
    "jaxveh",
    "tests",
    "benchmarks",
    "notebooks",
    "pyproject.toml",
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
)

TABLES = (
    "vehicles/sets/",
    "vehicles/parameter_sets.py",
    "tyres/typical.py",
    "tyres/mf_tyre/typical.py",
    "sensors/typical.py",
)
"""Numbers of particular cars, tyres and devices: a test that repeats them would test nothing."""

SLACK = 3.0
"""A mutation that makes a test file this many times slower than it was has been noticed."""


class Trial(NamedTuple):
    """`outcome`: killed, survived, unseen (no test executes the line); `by`: the test file that failed; `seconds`."""

    mutant: Mutant
    outcome: str
    by: str
    seconds: float


def chosen(root: Path, rooms: tuple[str, ...], count: int, seed: int) -> list[Mutant]:
    """`count` mutations of as many lines: a line at random, then one of its mutations."""
    by_line: dict[tuple[str, int], list[Mutant]] = {}
    for room in rooms:
        for path in sorted((root / "jaxveh" / room).rglob("*.py")):
            name = path.relative_to(root).as_posix()
            if name.removeprefix("jaxveh/").startswith(TABLES):
                continue
            for mutant in mutants(name, path.read_text()):
                by_line.setdefault((name, mutant.line), []).append(mutant)
    pick = random.Random(seed)
    weights = {place: [NOTICED_AT_ONCE.get(mutant.kind, 1.0) for mutant in found] for place, found in by_line.items()}
    # Weighted, without repetition: the smallest of exponential times (Efraimidis & Spirakis 2006).
    times = {place: pick.expovariate(max(weights[place])) for place in sorted(by_line)}
    return [pick.choices(by_line[place], weights[place])[0] for place in sorted(times, key=times.__getitem__)[:count]]


def try_all(
    root: Path, work: Path, todo: list[Mutant], covered: Covered, processes: int, until: float
) -> Iterator[Trial]:
    """Trials as they end; none begins after the time `until`."""
    copies: queue.Queue[Path] = queue.Queue()
    for i in range(processes):
        copies.put(_copy(root, work / f"tree-{i}"))

    def one(mutant: Mutant) -> Trial | None:
        if time.time() > until:
            return None
        tree = copies.get()
        try:
            return _try(tree, mutant, covered)
        finally:
            copies.put(tree)

    with ThreadPoolExecutor(processes) as pool:
        yield from (trial for trial in pool.map(one, todo) if trial is not None)


def _copy(root: Path, tree: Path) -> Path:
    shutil.rmtree(tree, ignore_errors=True)
    tree.mkdir(parents=True)
    for name in COPIED:
        source = root / name
        if source.is_dir():
            shutil.copytree(source, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, tree / name)
    return tree


def _try(tree: Path, mutant: Mutant, covered: Covered) -> Trial:
    path = tree / mutant.path
    source = path.read_text()
    files = covered.of(mutant.path, _lines_of(source, mutant.line))
    if not files:
        return Trial(mutant, "unseen", "", 0.0)
    lines = source.splitlines(keepends=True)
    lines[mutant.line - 1] = mutant.after + "\n"
    began = time.monotonic()
    path.write_text("".join(lines))
    try:
        for name in files:
            if not _passes(tree, name, 60.0 + SLACK * covered.seconds[name]):
                return Trial(mutant, "killed", name, time.monotonic() - began)
    finally:
        path.write_text(source)
    return Trial(mutant, "survived", "", time.monotonic() - began)


def _lines_of(source: str, line: int) -> list[int]:
    """The line itself if a function holds it; else what is executed on import is tested where the module's functions run."""
    functions = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef | ast.Lambda)]
    inside = lambda n, at: n.body[0].lineno <= at <= n.end_lineno if isinstance(n, ast.FunctionDef) else n.lineno == at
    if any(inside(node, line) for node in functions):
        return _statement(source, line)
    return sorted(
        {i for n in functions if isinstance(n, ast.FunctionDef) for i in range(n.body[0].lineno, n.end_lineno + 1)}
    )


def _statement(source: str, line: int) -> list[int]:
    """The lines of the innermost statement around a line: coverage counts a statement at its first line."""
    around = [
        node for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or node.lineno)
    ]  # fmt: skip
    node = max(around, key=lambda node: node.lineno)
    last = node.body[0].lineno - 1 if getattr(node, "body", None) else node.end_lineno or node.lineno
    return list(range(node.lineno, max(last, line) + 1))


def _passes(tree: Path, name: str, seconds: float) -> bool:
    run = [sys.executable, "-m", "pytest", "-n", "0", "-x", "-q", "-p", "no:cacheprovider", name]
    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}
    try:
        ended = subprocess.run(run, cwd=tree, env=environment, capture_output=True, timeout=seconds)
    except subprocess.TimeoutExpired:
        return False
    # 5: no test was left to run, as where shared data are absent.
    return ended.returncode in (0, 5)

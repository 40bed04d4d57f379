"""Which test files execute which lines: each file runs once, in a process of its own, under `coverage`.

A process of its own, because a compiled program that an earlier file left behind hides the lines that it was traced from.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

SLOWEST = 1800
"""Seconds that one test file may take under coverage."""

LEFT_OUT = ("tests/peers", "tests/notebooks", "tests/benchmarks")
"""What compares with others or runs whole stories: too slow for a mutation, and not where an equation is tested."""


def test_files(root: Path) -> list[str]:
    """Test files below the root, as text."""
    found = (path.relative_to(root).as_posix() for path in sorted((root / "tests").rglob("test_*.py")))
    return [name for name in found if not name.startswith(LEFT_OUT)]


def cover(root: Path, out: Path, processes: int) -> None:
    """Write `out`: by test file its `seconds` and `lines`, by module. Files that are there already are not run again."""
    known = json.loads(out.read_text()) if out.exists() else {}
    todo = [name for name in test_files(root) if name not in known]

    def one(name: str) -> None:
        known[name] = _covered(root, name, out.with_suffix(f".{name.replace('/', '.')}.coverage"))
        out.write_text(json.dumps(known))
        print(f"{len(known)} files, {name}: {known[name]['seconds']:.0f} s", flush=True)

    with ThreadPoolExecutor(processes) as pool:
        list(pool.map(one, todo))


def _covered(root: Path, name: str, data: Path) -> dict:
    environment = os.environ | {"COVERAGE_FILE": str(data)}
    run = [
        sys.executable,
        "-m",
        "coverage",
        "run",
        "--source=jaxveh",
        "-m",
        "pytest",
        "-n",
        "0",
        "-p",
        "no:cacheprovider",
    ]
    began = time.monotonic()
    ended = subprocess.run([*run, name], cwd=root, env=environment, capture_output=True, text=True, timeout=SLOWEST)
    seconds = time.monotonic() - began
    if ended.returncode != 0:
        raise SystemExit(f"{name} fails without a mutation:\n{ended.stdout[-3000:]}")
    report = data.with_suffix(".json")
    write = [sys.executable, "-m", "coverage", "json", "-q", "-o", str(report)]
    subprocess.run(write, cwd=root, env=environment, check=True)
    files = json.loads(report.read_text())["files"]
    for path in (report, data):
        path.unlink()
    return {"seconds": seconds, "lines": {path: part["executed_lines"] for path, part in files.items()}}


class Covered:
    """A map that was written, asked for the test files of a line."""

    def __init__(self, path: Path):
        known = json.loads(path.read_text())
        self.seconds = {name: part["seconds"] for name, part in known.items()}
        self.tests: dict[tuple[str, int], list[str]] = {}
        for name, part in known.items():
            for module, lines in part["lines"].items():
                for line in lines:
                    self.tests.setdefault((module, line), []).append(name)

    def of(self, module: str, lines: Iterable[int]) -> list[str]:
        """Test files that execute one of the lines, nearest first: the module's mirror, its room, then the quick ones."""
        found = {name for line in lines for name in self.tests.get((module, line), [])}
        place = Path(module)
        room = place.parts[1]

        def distance(name: str):
            stem = Path(name).stem.removeprefix("test_")
            mirrored = stem == place.stem or place.stem.startswith(stem) or stem.startswith(place.stem)
            return not mirrored, f"tests/{room}/" not in name, self.seconds[name]

        return sorted(found, key=distance)

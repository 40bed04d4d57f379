"""Which test files execute which lines: each file's own coverage, measured once and kept."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

FOLDERS = ("tyres", "vehicles", "sensors", "statespace", "filters", "simulation", "estimators")
"""Rooms of tests that are measured."""


def test_files(root: Path) -> list[str]:
    """The test files of the rooms, from the root."""
    return sorted(
        str(path.relative_to(root)) for folder in FOLDERS for path in (root / "tests" / folder).glob("test_*.py")
    )


def measured(root: Path, kept: Path, file: str, environment: dict[str, str], limit: float) -> dict:
    """What a test file executes: `seconds`, and `lines` by file of the package; from `kept` where it has been measured.

    In a process of its own: what another file has traced already would not be executed again.
    """
    found = kept / (file.replace("/", "__") + ".json")
    if found.exists():
        return json.loads(found.read_text())
    data = kept / (file.replace("/", "__") + ".coverage")
    start = time.monotonic()
    coverage = [sys.executable, "-m", "coverage"]
    tests = ["-m", "pytest", "-n", "0", "-q", "-p", "no:cacheprovider", file]
    subprocess.run(
        [*coverage, "run", "--source=jaxveh", f"--data-file={data}", *tests],
        cwd=root, env=environment, capture_output=True, timeout=limit, check=False,
    )  # fmt: skip
    seconds = time.monotonic() - start
    shown = kept / (data.name + ".shown")
    subprocess.run(
        [*coverage, "json", f"--data-file={data}", "-o", str(shown)],
        cwd=root,
        env=environment,
        capture_output=True,
        check=True,
    )
    files = json.loads(shown.read_text())["files"]
    result = {"seconds": seconds, "lines": {name: about["executed_lines"] for name, about in files.items()}}
    found.write_text(json.dumps(result))
    for path in (data, shown):
        os.remove(path)
    return result


def choose(measurements: dict[str, dict], file: str, line: int) -> list[str]:
    """The test files that execute a line: those of its own room first, then the quick ones."""
    room = Path(file).parts[1]
    hit = [name for name, about in measurements.items() if line in about["lines"].get(file, ())]
    return sorted(hit, key=lambda name: (Path(name).parts[1] != room, measurements[name]["seconds"]))

"""The lines that each test file executes: its coverage, measured once and kept."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
import time
from pathlib import Path

FOLDERS = (
    "tyres",
    "vehicles",
    "sensors",
    "statespace",
    "filters",
    "simulation",
    "estimators",
    "io",
    "fitting",
    "observers",
)
"""Folders of tests that are measured."""

SETTINGS = "tests/core/test_recorded_settings.py"
"""The tests of what modules set on import, constants and defaults, which they read without executing a function."""


def test_files(root: Path) -> list[str]:
    """Return the test files of these folders and `SETTINGS`, relative to the root."""
    inside = [str(path.relative_to(root)) for folder in FOLDERS for path in (root / "tests" / folder).glob("test_*.py")]
    return sorted([*inside, SETTINGS])


def measured(
    root: Path, kept: Path, file: str, environment: dict[str, str], limit: float, selected: tuple[str, ...] = ()
) -> dict:
    """Return `seconds` of a test file, and the `lines` that it executes by file of the package; from `kept` if measured before.
    `selected`: further arguments of pytest.

    It runs in a separate process, because functions that another file has traced would not be executed again. A file whose tests
    fail without a mutation cannot judge one: it ends the program.
    """
    found = kept / (file.replace("/", "__") + ".json")
    if found.exists():
        return json.loads(found.read_text())
    data = kept / (file.replace("/", "__") + ".coverage")
    start = time.monotonic()
    coverage = [sys.executable, "-m", "coverage"]
    tests = ["-m", "pytest", "-n", "0", "-q", "-p", "no:cacheprovider", *selected, file]
    ended = subprocess.run(
        [*coverage, "run", "--source=jaxveh", f"--data-file={data}", *tests],
        cwd=root, env=environment, capture_output=True, text=True, timeout=limit, check=False,
    )  # fmt: skip
    if ended.returncode not in (0, 5):
        raise SystemExit(f"{file} fails without a mutation:\n{ended.stdout[-2000:]}")
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


def never_executed(root: Path, measurements: dict[str, dict], files: list[str]) -> dict[str, list[str]]:
    """Return the names of the functions, by file, of which no test executes a line: none can notice what is wrong in them."""
    found = {}
    for file in files:
        executed = {line for about in measurements.values() for line in about["lines"].get(file, ())}
        tree = ast.parse((root / file).read_text())
        functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
        names = [node.name for node in functions if (code := _lines_of_code(node)) and not executed & code]
        if names:
            found[file] = names
    return found


def _lines_of_code(function: ast.FunctionDef) -> set[int]:
    """The lines of a function's statements; a docstring and an ellipsis are none."""
    code = [node for node in function.body if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))]
    return {line for node in code for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)}


def choose(
    measurements: dict[str, dict], file: str, lines: set[int], own: bool = False, imported: bool = False
) -> list[str]:
    """Return the test files that execute one of the lines: first those of its own folder, recorded numbers and quick ones first.

    `own`: only those of its own folder. `imported`: the change is of a line that runs on import, so that `SETTINGS` is asked
    before the others.
    """
    room = Path(file).parts[1]
    hit = [name for name, about in measurements.items() if lines & set(about["lines"].get(file, ()))]
    recorded = lambda name: Path(name).name.startswith("test_recorded")
    if own:
        hit = [name for name in hit if Path(name).parts[1] == room]
    hit = [*{*hit, *[SETTINGS] * imported}]
    key = lambda name: (Path(name).parts[1] != room, not recorded(name), measurements[name]["seconds"])
    return sorted(hit, key=lambda name: (not (imported and name == SETTINGS), key(name)))


def on_import(source: str, line: int) -> bool:
    """Return whether a line runs on import: it is in no function's body."""
    return line not in _bodies(ast.parse(source))


def _bodies(tree: ast.AST) -> set[int]:
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    return {i for node in functions for i in range(node.body[0].lineno, (node.end_lineno or 0) + 1)}


def lines_beside(source: str, line: int) -> set[int]:
    """Return the lines whose execution shows that of `line`: those of its statement.

    For a line that runs on import they are those of all functions of the module, because every test file runs it, but few test
    it.
    """
    tree = ast.parse(source)
    bodies = _bodies(tree)
    if line not in bodies:
        return bodies or {line}
    around = [
        node for node in ast.walk(tree)
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or node.lineno)
    ]  # fmt: skip
    statement = max(around, key=lambda node: node.lineno)
    inner = getattr(statement, "body", None)
    last = inner[0].lineno - 1 if isinstance(inner, list) else statement.end_lineno or line
    return set(range(statement.lineno, max(last, line) + 1))

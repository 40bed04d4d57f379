"""Runs the code of a page from top to bottom in an empty folder, and keeps its output and its figures.

All `python` blocks share one namespace. A block of `sh` runs in the same folder. A block with a title
(`toml title="car.toml"`) is written to the file of that name. Other blocks are not run.

`python -m notebooks.site.executed PAGE FOLDER` writes `outputs.json` and figures to FOLDER.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import io
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

FENCE = re.compile(r"^```(?P<language>\w+)(?P<rest>[^\n`]*)\n(?P<code>.*?)^```[ ]*$", re.S | re.M)
ROOT = Path(__file__).resolve().parents[2]


class Block(NamedTuple):
    """A fenced block: its language, its title (or ""), its code and where it ends in the page."""

    language: str
    title: str
    code: str
    end: int


def blocks_of(text: str) -> list[Block]:
    """The fenced blocks of a page."""
    found = []
    for match in FENCE.finditer(text):
        title = re.search(r'title="([^"]+)"', match["rest"])
        found.append(Block(match["language"], title[1] if title else "", match["code"], match.end()))
    return found


def digest(text: str) -> str:
    """A hash of a page, which changes with its text."""
    return hashlib.sha256(text.encode()).hexdigest()


def outputs_of(page: str, folder: Path) -> list[dict]:
    """The outputs of the blocks of this text in a folder; empty if another text, or none, was run."""
    file = folder / "outputs.json"
    left = json.loads(file.read_text()) if file.exists() else {}
    return left["outputs"] if left.get("page") == digest(page) else []


def is_run(block: Block) -> bool:
    """Whether a block runs or makes a file."""
    return bool(block.title) or block.language in ("python", "sh")


def run_page(page: Path, folder: Path) -> list[dict]:
    """Run a page's blocks in a new folder; return each block's output (`text`) and the name of its figure (`figure`, "" if none).

    Figures are written to `folder`. **Raises** the errors of the page's code, or `RuntimeError` for a command that fails.
    """
    folder.mkdir(parents=True, exist_ok=True)
    namespace: dict = {"__name__": "__main__"}
    outputs = []
    with tempfile.TemporaryDirectory() as work, contextlib.chdir(work):
        for place, block in enumerate(blocks_of(page.read_text())):
            one = {"text": "", "figure": ""}
            if block.title:
                Path(block.title).write_text(block.code)
            elif block.language == "python":
                one["text"], figure = _run_python(block.code, namespace, f"{page.name}[{place}]")
                if figure is not None:
                    one["figure"] = f"{page.stem}-{place}.png"
                    figure.savefig(folder / one["figure"], dpi=110, bbox_inches="tight")
            elif block.language == "sh":
                one["text"] = _run_shell(block.code, page.name)
            outputs.append(one)
    (folder / "outputs.json").write_text(json.dumps({"page": digest(page.read_text()), "outputs": outputs}, indent=1))
    return outputs


def _run_python(code: str, namespace: dict, name: str):
    """The output of a block, and its last expression if that is a figure."""
    tree = ast.parse(code)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    printed, value = io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, name, "exec"), namespace)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), name, "eval"), namespace)
            if value is not None and not hasattr(value, "savefig"):
                print(value if isinstance(value, str) else repr(value))
    return printed.getvalue(), value if hasattr(value, "savefig") else None


def _run_shell(code: str, name: str) -> str:
    """The output of the commands of a block; programs are those of this Python."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-e", "-c", code],
        capture_output=True,
        text=True,
        env={**os.environ, "PATH": path, "COLUMNS": "100", "NO_COLOR": "1", "TERM": "dumb"},
    )
    if done.returncode:
        raise RuntimeError(f"{name}: the commands\n{code}\nended with {done.returncode}:\n{done.stdout}\n{done.stderr}")
    return done.stdout


if __name__ == "__main__":
    run_page(Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve())

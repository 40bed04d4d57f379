"""Every guide's Python runs from top to bottom, and uses public names alone."""

import ast
import importlib
import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "notebooks"
GUIDES = sorted(FOLDER.glob("*.md"))


def program(path):
    return "\n".join(re.findall(r"^```python\n(.*?)^```", path.read_text(), re.S | re.M))


@pytest.mark.parametrize("path", GUIDES, ids=lambda path: path.stem)
def test_a_guide_runs_from_top_to_bottom(path):
    text = program(path)
    assert "assert" in text
    exec(compile(text, str(path), "exec"), {"__name__": path.stem})


@pytest.mark.parametrize("path", GUIDES, ids=lambda path: path.stem)
def test_a_guide_takes_only_what_is_public(path):
    for node in ast.walk(ast.parse(program(path))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("jaxveh"):
            assert node.module.count(".") <= 1
            listed = importlib.import_module(node.module).__all__
            assert not [alias.name for alias in node.names if alias.name not in listed]


def test_there_is_a_guide():
    assert "filter_kit" in [path.stem for path in GUIDES]

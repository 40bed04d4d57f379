"""Every page's code runs from top to bottom in an empty folder, and takes only what is public."""

import ast
import importlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from notebooks.site.executed import ROOT, blocks_of, is_run
from notebooks.site.pages import name_of, sources

PAGES = {"README.md": ROOT / "README.md", **sources()}
RUN = [place for place, page in PAGES.items() if any(map(is_run, blocks_of(page.read_text())))]
PYTHON = [place for place in RUN if any(block.language == "python" for block in blocks_of(PAGES[place].read_text()))]


def python_of(place):
    return [block.code for block in blocks_of(PAGES[place].read_text()) if block.language == "python"]


def when(k, place):
    """Starts, and of the other pages one in twelve, are run for each change; the rest by `-m full`."""
    marks = pytest.mark.studies if k % 12 == 0 or place.startswith(("README", "index", "start/")) else pytest.mark.full
    return pytest.param(place, marks=marks)


@pytest.mark.parametrize("place", [when(k, place) for k, place in enumerate(RUN)])
def test_a_page_runs_from_top_to_bottom(place, tmp_path):
    """What it leaves is kept where the site is built of it (`JAXVEH_EXECUTED`)."""
    given = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))}
    given.pop("JAX_DISABLE_MOST_OPTIMIZATIONS", None)
    done = subprocess.run(
        [sys.executable, "-m", "notebooks.site.executed", str(PAGES[place]), str(tmp_path)],
        cwd=ROOT, env=given, capture_output=True, text=True,
    )  # fmt: skip
    assert not done.returncode, done.stderr
    if kept := os.environ.get("JAXVEH_EXECUTED"):
        shutil.copytree(tmp_path, Path(kept) / name_of(place), dirs_exist_ok=True)


OF_NAMED_TUPLES = ("_asdict", "_fields", "_replace")
"""Public for all that they begin with: Python's own names of a NamedTuple."""

HOOKS = ("_labelled",)
"""What a class says of itself, for those who write one."""


@pytest.mark.parametrize("place", PYTHON)
def test_a_page_takes_only_what_is_public(place):
    for code in python_of(place):
        for node in ast.walk(ast.parse(code)):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("jaxveh"):
                listed = importlib.import_module(node.module).__all__
                assert not [alias.name for alias in node.names if alias.name not in listed]
            if isinstance(node, ast.Attribute):
                allowed = node.attr.startswith("__") or node.attr in (*OF_NAMED_TUPLES, *HOOKS) or "own_" in place
                assert not node.attr.startswith("_") or allowed


@pytest.mark.parametrize(
    "place", [place for place in PYTHON if place.startswith(("start", "guides", "explanations", "reference"))]
)
def test_a_page_asserts_something(place):
    assert any(isinstance(node, ast.Assert) for code in python_of(place) for node in ast.walk(ast.parse(code)))


def test_readme_is_short_and_names_what_there_is():
    from jaxveh import estimators, tyres

    text = PAGES["README.md"].read_text()
    assert len(text.split()) < 1000
    quantities = [vars(estimators)[name] for name in estimators.__all__ if hasattr(vars(estimators)[name], "METHODS")]
    methods = sum(len(quantity.METHODS) for quantity in quantities)
    assert f"[{methods} methods]" in text
    around = (
        tyres.LongitudinalLaw,
        tyres.FrictionEllipse,
        tyres.Similarity,
        tyres.OnRoad,
        tyres.Mirrored,
        tyres.Relaxed,
    )
    laws = [
        law for law in vars(tyres).values()
        if isinstance(law, type) and issubclass(law, tyres.AbstractTyre) and law.__module__.startswith("jaxveh")
        and not law.__name__.startswith("Abstract") and law not in around
    ]  # fmt: skip
    assert f"[{len(laws)} laws]" in text

"""Formulas of tyres and vehicles read as in the book: fences are decorators there, but for those below, each with its figure."""

import ast
from pathlib import Path

import pytest

import jaxveh

ROOT = Path(jaxveh.__file__).parent
FENCES = {"fence", "fence_blocks", "fence_results", "apart"}

INSIDE = {
    ("tyres/mf_tyre/formula.py", "sine_curve"): "of the arguments, where the curve begins",
    ("tyres/mf_tyre/formula.py", "cosine_curve"): "of the arguments, where the curve begins",
    ("tyres/mf_tyre/tyre.py", "outputs"): "554 instead of 647 ns",
    ("vehicles/load_transfer.py", "planar_loads"): "180 instead of 192 ns",
}


def fenced_functions(path):
    """Functions that fence in their body (not by a decorator), with their source."""
    text = path.read_text(encoding="utf-8")
    for function in ast.walk(ast.parse(text)):
        if isinstance(function, ast.FunctionDef):
            calls = [node.func for line in function.body for node in ast.walk(line) if isinstance(node, ast.Call)]
            names = {f.attr if isinstance(f, ast.Attribute) else getattr(f, "id", "") for f in calls}
            if names & FENCES:
                yield function.name, ast.get_source_segment(text, function) or ""


def test_formulas_are_fenced_at_their_ends():
    found = {
        (path.relative_to(ROOT).as_posix(), name): source
        for room in ("tyres", "vehicles")
        for path in sorted((ROOT / room).rglob("*.py"))
        for name, source in fenced_functions(path)
    }
    assert found.keys() == INSIDE.keys()
    for place, why in INSIDE.items():
        assert not why.endswith(" ns") or why in " ".join(found[place].replace("#", " ").split())


@pytest.mark.whole
def test_what_a_fence_is_made_of_stands_in_one_module():
    made = {"optimization_barrier", "UNUSED_NAN", "barriers_hold"}
    allowed = {"numerics/fences.py", "numerics/platform.py", "numerics/__init__.py"}
    # Which of two forms is faster, of `barriers_hold`.
    asks = {"numerics/random.py", "numerics/steps_last.py", "simulation/fixed_steps.py"}
    users = {
        path.relative_to(ROOT).as_posix()
        for path in ROOT.rglob("*.py")
        if made & {getattr(n, "id", getattr(n, "attr", "")) for n in ast.walk(ast.parse(path.read_text("utf-8")))}
    }
    assert users <= allowed | asks

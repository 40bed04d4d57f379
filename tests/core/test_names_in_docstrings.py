"""What a docstring names in backticks exists: in its own file or room, or wherever the name says."""

import ast
import builtins
import functools
import pathlib
import re

import pytest

import jaxveh

pytestmark = pytest.mark.whole

ROOT = pathlib.Path(jaxveh.__file__).parent
ROOMS = sorted({path.relative_to(ROOT).parts[0] for path in ROOT.rglob("*.py") if path.parent != ROOT})
ELSEWHERE = {
    "F_N": "a quantity of TYDEX", "F_peak": "a letter of the formula", "D_rphi": "a letter of the formula", "atan2": "a function",
    "kappa_i": "a letter of the formula", "name_std": "a column", "roll_centre": "a stem of names",
    "pitch_slope": "a stem of names",
    "SubFigure": "matplotlib's", "Nissan_Patrol": "a car of another library", "disturbance_v_y": "an example of a state's name",
    "finally": "Python's", "PCY1": "a coefficient",
    "Time": "a field of MATLAB's", "Data": "a field of MATLAB's", "Units": "a field of MATLAB's",
    "TimedeltaIndex": "pandas'", "DatetimeIndex": "pandas'",
}  # fmt: skip
FILES = {"init.jaxexport", "step.jaxexport", "names.json"}


def known(trees):
    """Every name that code has: definitions, arguments, attributes, keywords, short strings."""
    found = set(dir(builtins)) | set(ELSEWHERE)
    for tree in trees:
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef | ast.FunctionDef):
                found.add(node.name)
            elif isinstance(node, ast.Name):
                found.add(node.id)
            elif isinstance(node, ast.arg | ast.keyword):
                found.add(node.arg)
            elif isinstance(node, ast.Attribute):
                found.add(node.attr)
            elif isinstance(node, ast.alias):
                found.add((node.asname or node.name).split(".")[-1])
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and len(node.value) < 40:
                found.add(node.value)
    return found


@functools.cache
def trees():
    return {path: ast.parse(path.read_text()) for path in ROOT.rglob("*.py")}


@functools.cache
def everywhere():
    return known(trees().values()) | {path.stem for path in trees()}


def named(tree):
    """Names in backticks of docstrings, those under a constant included, with their lines."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            for name in re.findall(r"`([A-Za-z_][\w.]+)(?:\(|`)", node.value.value):
                yield node.lineno, name


def exists(name, own):
    last = name.split(".")[-1]
    if name.startswith(("jax.", "diffrax.", "prefix_")) or name in FILES or re.search(r"_(fl|fr|rl|rr)?$", last):
        return True
    # A constant is looked for where a reader would: in the room, unless the name says of which module it is.
    return last in (own if last.isupper() and len(last) > 3 and "." not in name else everywhere())


@pytest.mark.parametrize("room", ROOMS)
def test_names_in_backticks_exist(room):
    own = known(tree for path, tree in trees().items() if path.relative_to(ROOT).parts[0] == room)
    lost = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for path, tree in trees().items()
        if path.relative_to(ROOT).parts[0] == room
        for line, name in named(tree)
        if not exists(name, own)
    ]
    assert not lost

"""Rooms take from each other what is public alone, and every room is reached from `import jaxveh`."""

import ast
import importlib
import pathlib

import numpy as np
import pytest
from families import listed_modules

import jaxveh

pytestmark = pytest.mark.whole

ROOT = pathlib.Path(jaxveh.__file__).parent
ROOMS = sorted(path.parent.name for path in ROOT.glob("*/__init__.py") if path.parent.name != "_core")
KITS = sorted(path.parent.name for path in ROOT.glob("*/kit.py"))


def public(room):
    return set(importlib.import_module(f"jaxveh.{room}").__all__)


def taken(path):
    """What a file takes from rooms: (module, name, line) each."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("jaxveh."):
            yield from ((node.module, alias.name, node.lineno) for alias in node.names)
        if isinstance(node, ast.Import):
            yield from ((alias.name, "", node.lineno) for alias in node.names if alias.name.startswith("jaxveh."))


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_takes_only_what_is_public(room):
    around = []
    for path in (ROOT / room).rglob("*.py"):
        for module, name, line in taken(path):
            other = module.split(".")[1]
            if other in (room, "_core"):
                continue
            if module != f"jaxveh.{other}" or name not in public(other):
                around.append(f"{path.relative_to(ROOT)}:{line}: {name} from {module}")
    assert not around


@pytest.mark.parametrize("room", ROOMS)
def test_what_a_room_lists_is_there_and_in_order(room):
    module = importlib.import_module(f"jaxveh.{room}")
    names = module.__all__
    assert len(set(names)) == len(names)
    assert not [name for name in names if not hasattr(module, name)]


def test_every_module_that_a_user_reaches_lists_its_names():
    """Of one that does not, the reference has no page, and no test looks at its names."""
    exempt = {
        "diagnostics.drive_channels": "what the figures of a drive read",
        "experiments.report": "for the papers of this package",
        "experiments.tyre_apf.figures": "the figures of a paper, which its program draws",
        "numerics.polynomials": "the coefficients of `numerics`' own functions",
        "numerics.sigma_points": "the points of the filters, which take them by name",
        "studies.figures": "the figures of a sweep: `Swept.plot` and `jaxveh sweep show` draw them",
    }
    silent = {name for name, module in listed_modules().items() if not hasattr(module, "__all__")}
    assert not [f"{name}: give it `__all__`, and a page in the nav of mkdocs.yml" for name in silent - set(exempt)]
    assert not [f"{name}: has `__all__`, or is not listed: remove its reason here" for name in set(exempt) - silent]


@pytest.mark.parametrize("room", KITS)
def test_a_kit_lists_all_that_it_takes_and_is_used(room):
    module = importlib.import_module(f"jaxveh.{room}.kit")
    given = {name for name in vars(module) if not name.startswith("_") and name != "contract"}
    assert sorted(module.__all__) == sorted(given)
    assert "kit" in public(room)
    # What a user writes with is in the room itself; the filters' kit repeats it for those who write one.
    assert room == "filters" or not given & public(room)


def test_every_room_is_reached_from_the_package():
    assert not [room for room in ROOMS if room != "cli" and room not in jaxveh.__all__]
    for name in jaxveh.__all__:
        assert getattr(jaxveh, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'garage'"):
        _ = jaxveh.garage


LONGEST_FUNCTION, LONGEST_MODULE, MEDIAN_MODULE = 60, 350, 100


def test_functions_and_modules_stay_short():
    """With their docstrings."""
    lengths, long = {}, []
    for path in ROOT.rglob("*.py"):
        text = path.read_text()
        lengths[str(path.relative_to(ROOT))] = len(text.splitlines())
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef) and node.end_lineno - node.lineno >= LONGEST_FUNCTION:
                long.append(f"{path.relative_to(ROOT)}:{node.name}: {node.end_lineno - node.lineno + 1} lines")
    assert not long
    assert not {name: count for name, count in lengths.items() if count > LONGEST_MODULE}
    assert np.median(list(lengths.values())) <= MEDIAN_MODULE

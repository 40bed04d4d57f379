"""The defaults of what the modules of a room define, and their constants, as recorded.

A default and a threshold decide a user's numbers without standing in his code: a change of either shows in the difference.
Fields of classes are on record with their families (`check_declared`).
"""

import ast
import importlib
import inspect
import pkgutil

import jax
import numpy as np
import pytest
from recorded_numbers import check_recorded, check_words

import jaxveh

pytestmark = pytest.mark.whole

ROOMS = sorted(
    {one.name for one in pkgutil.iter_modules(jaxveh.__path__) if one.ispkg} - {"_core", "cli", "experiments"}
)
"""Programs are told of in their help, and a paper's numbers in its criteria and tables."""

MAKES = ("__init__", "__new__")
"""The second is that of named tuples."""


def defaults(made):
    """What a function, or a class and its methods, take without being told, as text by name."""
    if not inspect.isclass(made):
        return {"": said(made)} if callable(made) else {}
    own = {name: getattr(made, name) for name in vars(made) if inspect.isfunction(getattr(made, name))}
    asked = {name: said(one) for name, one in own.items() if name in MAKES or not name.startswith("_")}
    return {name: text for name, text in asked.items() if text}


def said(function):
    """The defaults that are numbers, words or switches: others are objects, whose text is a place in memory."""
    given = {one.name: one.default for one in inspect.signature(function).parameters.values()}
    return ", ".join(
        f"{name}={value!r}" for name, value in given.items() if isinstance(value, int | float | str | tuple)
    )


def modules(room):
    """The modules of a room by their name in it."""
    package = importlib.import_module(f"jaxveh.{room}")
    for one in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        yield one.name.removeprefix(f"jaxveh.{room}."), importlib.import_module(one.name)


def defined(room):
    """The functions and classes that the modules of a room define, listed or not, by their name in the room."""
    for place, module in modules(room):
        for node in ast.parse(inspect.getsource(module)).body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                yield f"{place}.{node.name}", getattr(module, node.name)


def constants(room):
    """The numbers in each constant that a module of a room defines, by its name in the room."""
    for place, module in modules(room):
        for name in constant_names(module):
            found = list(numbers(getattr(module, name)))
            if found:
                yield f"{place}.{name}", np.concatenate(found)


def constant_names(module):
    """The names in capitals that a module gives, in their order."""
    tree = ast.parse(inspect.getsource(module))
    targets = [
        target
        for node in tree.body if isinstance(node, ast.Assign | ast.AnnAssign)
        for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
    ]  # fmt: skip
    names = [node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)]
    return [name for name in names if name.isupper()]


def numbers(thing):
    """All numbers in a value, those among a mapping's keys too."""
    if isinstance(thing, int | float | complex | np.ndarray | np.generic | jax.Array):
        yield np.ravel(np.asarray(thing, float))
    elif isinstance(thing, dict):
        for pair in thing.items():
            yield from numbers(pair)
    elif isinstance(thing, list | tuple):
        for one in thing:
            yield from numbers(one)
    elif not isinstance(thing, type):
        yield from (np.ravel(np.asarray(leaf, float)) for leaf in jax.tree.leaves(thing) if isinstance(leaf, jax.Array))


@pytest.mark.parametrize("room", ROOMS)
def test_defaults_are_those_recorded(room):
    found = {}
    for name, made in defined(room):
        found |= {f"{name}.{method}".rstrip("."): text for method, text in defaults(made).items() if text}
    check_words(__file__, room, found)


@pytest.mark.parametrize("room", ROOMS)
def test_constants_are_those_recorded(room):
    check_recorded(__file__, room, dict(constants(room)), given=True)

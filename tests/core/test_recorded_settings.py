"""The defaults of what a room lists, and the constants of its modules, as recorded.

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


def defaults(made):
    """What a function, or a class and its methods, take without being told, as text by name."""
    if not inspect.isclass(made):
        return {"": said(made)} if callable(made) else {}
    own = {name: one for name, one in vars(made).items() if inspect.isfunction(one)}
    asked = {name: said(one) for name, one in own.items() if name == "__init__" or not name.startswith("_")}
    return {name: text for name, text in asked.items() if text}


def said(function):
    """The defaults that are numbers, words or switches: others are objects, whose text is a place in memory."""
    given = {one.name: one.default for one in inspect.signature(function).parameters.values()}
    return ", ".join(
        f"{name}={value!r}" for name, value in given.items() if isinstance(value, int | float | str | tuple)
    )


def listed(room):
    """What a room and its kit list, by name."""
    module = importlib.import_module(f"jaxveh.{room}")
    kit = getattr(module, "kit", None) if "kit" in module.__all__ else None
    return {name: getattr(place, name) for place in (module, kit) if place for name in place.__all__}


def constants(room):
    """The numbers in each constant that a module of a room defines, by its name in the room."""
    package = importlib.import_module(f"jaxveh.{room}")
    for one in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        module = importlib.import_module(one.name)
        for name in constant_names(module):
            found = list(numbers(getattr(module, name)))
            if found:
                yield f"{one.name.removeprefix(f'jaxveh.{room}.')}.{name}", np.concatenate(found)


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
    for name, made in listed(room).items():
        found |= {f"{name}.{method}".rstrip("."): text for method, text in defaults(made).items() if text}
    check_words(__file__, room, found)


@pytest.mark.parametrize("room", ROOMS)
def test_constants_are_those_recorded(room):
    check_recorded(__file__, room, dict(constants(room)), given=True)

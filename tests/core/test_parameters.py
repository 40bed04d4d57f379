"""`Parameters`: by name and as in the car, whole parts, one array, a pytree whose leaves have names."""

import contextlib
import copy
import importlib
import inspect
import pickle

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Parameters

FOUND = Parameters({"rear.B": 8.0, "front.tyre.B": 9.0, "front.tyre.D": 7e3, "table.0": 3.0, "mass": 1500.0})


def test_by_name_and_as_in_the_car():
    assert FOUND["front.tyre.B"] == FOUND.front.tyre.B == FOUND["front"]["tyre.B"] == FOUND.front["tyre"].B == 9.0
    assert FOUND.mass == 1500.0 and FOUND["table"]["0"] == 3.0
    assert dict(FOUND.front) == {"tyre.B": 9.0, "tyre.D": 7e3}
    assert list(FOUND) == ["rear.B", "front.tyre.B", "front.tyre.D", "table.0", "mass"] and len(FOUND) == 5
    assert "rear.B" in FOUND and "front" not in FOUND and FOUND.get("rear.D") is None


@pytest.mark.parametrize("name", ["rear.D", "fro", "front.tyre.", "front_B"])
def test_what_is_not_there_is_told_with_what_is(name):
    with pytest.raises(KeyError, match=f"no parameter '{name}'; there are: rear.B, front.tyre.B"):
        FOUND[name]
    with pytest.raises(AttributeError, match="there are: rear.B"):
        getattr(FOUND, name)


def test_one_array_in_their_order():
    np.testing.assert_array_equal(FOUND.array(), [8.0, 9.0, 7e3, 3.0, 1500.0])
    over = jax.jit(lambda found: jax.tree.map(lambda value: value * jnp.arange(4.0), found))(FOUND)
    assert isinstance(over, Parameters) and isinstance(over.array(), jax.Array) and over.array().shape == (5, 4)
    assert isinstance(FOUND.array(), np.ndarray)


def test_leaves_have_names_and_keep_their_order():
    paths = [path for path, _ in jax.tree_util.tree_leaves_with_path({"found": FOUND})]
    assert [path[-1].key for path in paths] == list(FOUND)
    other = Parameters(dict(reversed(list(FOUND.items()))))
    assert jax.tree.structure(other) != jax.tree.structure(FOUND)
    slope = jax.grad(lambda found: found.rear.B * found.mass)(FOUND)
    assert slope.rear.B == 1500.0 and slope.mass == 8.0 and slope.front.tyre.D == 0.0


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_copies_are_the_same(again):
    assert dict(again(FOUND)) == dict(FOUND)
    assert repr(again(FOUND)) == repr(FOUND)


def test_they_look_like_a_table():
    lines = repr(FOUND).splitlines()
    assert (
        lines[0] == "Parameters: 5"
        and lines[2].split() == ["rear.B", "8"]
        and lines[4].split() == ["front.tyre.D", "7000"]
    )


@pytest.mark.parametrize("room", ["manoeuvres", "roads", "tyres"])
@pytest.mark.parametrize("huge", [10**30, 10**400, -(10**400)], ids=["fits a float", "fits none", "negative"])
def test_a_whole_number_that_no_type_holds_is_no_internal_error(room, huge):
    module, made = importlib.import_module(f"jaxveh.{room}"), 0
    for kind in (getattr(module, name) for name in module.__all__):
        if not inspect.isclass(kind) or not issubclass(kind, eqx.Module) or inspect.isabstract(kind):
            continue
        needed = [p.name for p in inspect.signature(kind).parameters.values() if p.default is p.empty]
        # Other objects, texts and NumPy's arrays are refused in words of their own.
        with contextlib.suppress(InputError, TypeError, AttributeError):
            made += 1
            kind(**dict.fromkeys(needed, huge))
    assert made > 3

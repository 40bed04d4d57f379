"""Numbers that were found once and stand in `tests/recorded/`, a file for each test file that asks.

They say that nothing has changed, for every member of a family at once and cheaply; that it is right is said elsewhere, against
closed forms, references and peers. Who changes a number on purpose records it anew and looks at the difference:

    `COMMAND`, then git diff --stat tests/recorded
"""

import dataclasses
import inspect
import json
import os
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

FOLDER = Path(__file__).parent / "recorded"

COMMAND = 'JAXVEH_RECORD=1 python -m pytest -n 0 -m "full or not full" -k recorded'
"""Without the `-m`, the cases that only `-m full` runs would stay without numbers."""

TO_RECORD = f"record it by {COMMAND}, and look at the difference"


def unrecorded(test_file, names):
    """What of these names a test file has no numbers of, each with what to do."""
    known = json.loads((FOLDER / f"{Path(test_file).stem}.json").read_text())
    return [f"{name} has no numbers: {TO_RECORD}" for name in names if name not in known]


def classes_of(*modules):
    """Every class with fields of these modules, by module and name: two rooms' words may be one."""
    found = {
        f"{module.__name__.rpartition('.')[2]}.{name}": one for module in modules for name, one in vars(module).items()
    }
    return {name: one for name, one in sorted(found.items()) if inspect.isclass(one) and dataclasses.is_dataclass(one)}


def _declared(test_file):
    return FOLDER / f"{Path(test_file).stem}_declared.json"


def check_declared(test_file, name, one):
    """Compare what a class declares of its fields with what is on record: the unit, the domain, the scale, and the default
    where it is a number or a word.

    A scale is the step of a random walk and of a search: nothing but its size depends on it, so that no other test would notice.
    """
    found = {}
    for field in dataclasses.fields(one):
        about = {
            key: field.metadata.get(key) for key in ("unit", "scale", "domain") if field.metadata.get(key) is not None
        }
        if isinstance(field.default, bool | int | float | str | np.ndarray):
            about["default"] = field.default
        found[field.name] = " ".join(f"{key}={value}" for key, value in about.items())
    check_words(test_file, name, found)


def check_words(test_file, name, found):
    """Compare texts by name with those on record for `name`, or record them where JAXVEH_RECORD is set."""
    path = _declared(test_file)
    known = json.loads(path.read_text()) if path.exists() else {}
    if os.environ.get("JAXVEH_RECORD"):
        known[name] = found
        path.write_text(json.dumps(dict(sorted(known.items())), indent=1) + "\n")
        return
    assert name in known, f"{name} is not on record in {path.name}: {TO_RECORD}"
    assert found == known[name]


def declared_names(test_file, one):
    """Names of a class's fields as `check_declared` has them on record; of a class that is not there, as they are declared."""
    names = [field.name for field in dataclasses.fields(one)]
    known = json.loads(_declared(test_file).read_text())
    on_record = next((list(known[key]) for key in known if key.endswith(f".{one.__name__}")), names)
    return on_record if sorted(on_record) == sorted(names) else names


def check_recorded(test_file, name, values, rtol=1e-7, given=False):
    """Compare a tree of numbers with those on record for `name`, or record them where JAXVEH_RECORD is set.

    `rtol` is of each leaf's largest number: rounding differs between machines and versions of jax, a changed formula shows. Of
    numbers that are `given`, not computed, it is of each.
    """
    path = FOLDER / f"{Path(test_file).stem}.json"
    flat = {
        jax.tree_util.keystr(at): np.asarray(leaf, float).ravel()
        for at, leaf in jax.tree_util.tree_leaves_with_path(values)
    }
    known = json.loads(path.read_text()) if path.exists() else {}
    if os.environ.get("JAXVEH_RECORD"):
        known[name] = {at: [float(f"{number:.10g}") for number in leaf] for at, leaf in flat.items()}
        path.write_text(_one_leaf_a_line(known))
        return
    assert name in known, f"{name} has no numbers on record in {path.name}: {TO_RECORD}"
    assert flat.keys() == known[name].keys()
    for at, leaf in flat.items():
        expected = np.asarray(known[name][at], float)
        largest = 0.0 if given else np.abs(expected[np.isfinite(expected)]).max(initial=0.0)
        np.testing.assert_allclose(leaf, expected, rtol=rtol, atol=rtol * largest, err_msg=f"{name}: {at}")


def lively(tree, size=0.1):
    """A tree of modules each of whose numbers that is 0 or 1 has become another one, so that no term and no factor is without
    effect: up to `size` instead of 0."""
    random = np.random.default_rng(7)
    near = {
        0.0: lambda: random.choice([-1, 1]) * random.uniform(0.2, 1.0) * size,
        1.0: lambda: random.uniform(0.8, 0.95),
    }
    drawn = lambda leaf: jnp.asarray(near[float(leaf)]()) if np.size(leaf) == 1 and float(leaf) in near else leaf
    return jax.tree.map(lambda leaf: drawn(leaf) if eqx.is_inexact_array(leaf) else leaf, tree)


def without_effect(members, package):
    """What no member on record tells from another formula, by class and field of a package's modules: numbers that are 0 or 1 in
    all members, so that a term or a factor may be missing, and options that are None, or one flag or word, in all."""
    seen = {}
    for kind, name, value in _fields(members):
        if kind.__module__.startswith(package):
            seen.setdefault(f"{kind.__name__}.{name}", []).append(value)
    return {name for name, values in seen.items() if _same(values)}


def _fields(thing):
    if dataclasses.is_dataclass(thing) and not isinstance(thing, type):
        for field in dataclasses.fields(thing):
            yield type(thing), field.name, getattr(thing, field.name)
            yield from _fields(getattr(thing, field.name))
    elif isinstance(thing, list | tuple | dict):
        for one in thing.values() if isinstance(thing, dict) else thing:
            yield from _fields(one)


def _same(values):
    given = [value for value in values if value is not None]
    if all(isinstance(value, bool | str) for value in given):
        return len(set(given)) < 2
    numbers = [value for value in given if isinstance(value, float | int | np.ndarray | jax.Array)]
    return len(numbers) == len(given) and all(np.isin(number, (0, 1)).all() for number in numbers)


def _one_leaf_a_line(known):
    """Text of which a difference can be read."""
    entries = []
    for name, leaves in sorted(known.items()):
        lines = ",\n".join(f"  {json.dumps(at)}: {json.dumps(values)}" for at, values in leaves.items())
        entries.append(f"{json.dumps(name)}: {{\n{lines}\n}}")
    return "{\n" + ",\n".join(entries) + "\n}\n"

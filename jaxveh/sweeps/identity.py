"""Everything that determines a stored sweep's numbers to the last bit, as text that can be compared and stored."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import jax
import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.processor import processor
from jaxveh._core.version import VERSION
from jaxveh.sweeps.design import Axis, Design
from jaxveh.sweeps.given import Given
from jaxveh.sweeps.plan import Plan
from jaxveh.sweeps.swept import named_leaves

CONFIGURED = ("jax_enable_x64", "jax_default_matmul_precision", "jax_threefry_partitionable")
"""Settings of jax on which results depend."""

OF_PROCESS = ("jaxveh", "jax", "jaxlib", "XLA_FLAGS", *CONFIGURED, "processor")
"""Entries that belong to a process that computes chunks; the others belong to the sweep."""


def identity(design: Design, given: Given, plan: Plan, programs: Mapping[str, str]) -> dict[str, Any]:
    """Everything from which a sweep's numbers follow. `programs`: the description of each combination of choices, with the
    hash of its program."""
    axes = [_of_axis(axis) for axis in design.axes]
    return {
        "design": axes,
        "seeds": given.seeds,
        "key": None if given.key is None else _of_key(given.key),
        "data": {name: _hashed(np.asarray(leaf)) for name, leaf in named_leaves(given.data).items()},
        "batch": list(plan.block),
        "programs": dict(programs),
        **of_process(),
    }


def _of_axis(axis: Axis) -> dict[str, Any]:
    labels = [str(label) if axis.choice else label for label in axis.labels]
    columns = {name: [float(x) for x in column] for name, column in (axis.columns or {}).items()}
    return {"name": axis.name, "choice": axis.choice, "labels": labels, **({"columns": columns} if columns else {})}


def of_process() -> dict[str, Any]:
    """The versions and settings with which this process computes."""
    settings = {name: str(getattr(jax.config, name)) for name in CONFIGURED}
    flags = " ".join(sorted(os.environ.get("XLA_FLAGS", "").split()))
    versions = {"jaxveh": VERSION, "jax": version("jax"), "jaxlib": version("jaxlib")}
    return {**versions, "XLA_FLAGS": flags, **settings, "processor": processor()}


def of_program(lowered: Any) -> str:
    """The hash of a lowered program, with all numbers in the closure of `run`."""
    return hashlib.sha256(lowered.as_text().encode()).hexdigest()[:16]


def check_same(path: Any, stored: Mapping[str, Any], asked: Mapping[str, Any]) -> None:
    """Raise `InputError` if a store was begun with something else, naming the first difference."""
    was, here = _flat(stored), _flat(asked)
    for name in [*here, *(name for name in was if name not in here)]:
        if was.get(name) != here.get(name):
            raise InputError(
                f"{path}: it was begun with {name} = {_short(was.get(name))}, here it is {_short(here.get(name))}: these are not "
                "numbers of one sweep. Take another store, or the setting with which it was begun."
            )


def _flat(identity: Mapping[str, Any]) -> dict[str, Any]:
    """An identity whose axes, data and programs have their own names."""
    axes = {f"axis {axis['name']}": axis.get("columns", axis["labels"]) for axis in identity["design"]}
    data = {f"data {name or 'array'}": said for name, said in identity["data"].items()}
    programs = {f"the hash of the program of {said or 'run'}": found for said, found in identity["programs"].items()}
    rest = {name: value for name, value in identity.items() if name not in ("design", "data", "programs", "values")}
    return {**axes, "order of axes": [axis["name"] for axis in identity["design"]], **data, **rest, **programs}


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 300 else f"{text[:300]}..."


def _of_key(key: Any) -> str:
    if not jax.numpy.issubdtype(key.dtype, jax.dtypes.prng_key):
        return str(np.asarray(key).tolist())
    return f"{jax.random.key_impl(key)} {np.asarray(jax.random.key_data(key)).ravel().tolist()}"


def _hashed(array: np.ndarray) -> str:
    return f"{array.dtype}{array.shape} {hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()[:16]}"

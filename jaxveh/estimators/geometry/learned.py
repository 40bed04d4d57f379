"""The parameters of a car that one drive has learned, as a file from which the next drive starts."""

from __future__ import annotations

import dataclasses
import os
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_flags, check_has, check_kind, check_positive, path_of
from jaxveh._core.version import VERSION
from jaxveh.estimators.geometry.learner import RELATIVE, UNITS, Learner
from jaxveh.estimators.prepared import Prepared
from jaxveh.io import kit

KEYS = ("value", "std", "unit", "valid")

SPREADS = {
    "yaw_inertia": "inertia_spread", "front_axle_to_cg": "place_spread", "steer_offset": "offset_spread",
    "steering_ratio": "ratio_spread",
}  # fmt: skip
"""The learner's parameter that has the standard deviation of a number before a drive."""


class Entry(NamedTuple):
    """A number, its standard deviation (both in the unit of `UNITS`), and whether it counts as known."""

    value: float
    std: float
    valid: bool


@dataclasses.dataclass(frozen=True)
class Learned:
    """The learned parameters of a car: an `Entry` by name, for each of `UNITS`.

    **Raises** `InputError` for missing or unknown names, standard deviations that are not positive, and values that no car has.
    """

    entries: dict[str, Entry]

    def __post_init__(self):
        kit.check_keys("Learned", self.entries, UNITS)
        missing = [name for name in UNITS if name not in self.entries]
        if missing:
            raise InputError(f"Learned: no {', '.join(missing)}: incomplete or from another version; learn again.")
        for name, entry in self.entries.items():
            check_positive(f"{name}: std", entry.std, UNITS[name])
            if name != "steer_offset":
                check_positive(name, entry.value, UNITS[name])


def numbers_learned(said: Any) -> Learned:
    """The last values of a learner, from `Answers` along a log or from a live `Answer`."""
    advice = "estimators.geometry.estimate and live return them."
    check_has("numbers_learned: said", said, ("mean", "std", "known"), advice)
    check_has("numbers_learned: said.mean", said.mean, UNITS, advice)
    last = lambda part, name: np.asarray(getattr(part, name)).reshape(-1)[-1]
    return Learned(
        {
            name: Entry(float(last(said.mean, name)), float(last(said.std, name)), bool(last(said.known, name)))
            for name in UNITS
        }
    )


def start_from(method: Learner | Prepared, learned: Learned) -> Learner | Prepared:
    """The learner that starts where another drive ended: with the values and standard deviations of the `valid` entries.

    The standard deviations grow by a fifth from drive to drive, so that changes of the car are learned.
    """
    if isinstance(method, Prepared):
        return dataclasses.replace(method, inner=start_from(method.inner, learned))
    check_kind("start_from: method", method, Learner, "A METHODS of estimators.geometry makes one of a car's file.")
    check_kind("start_from: learned", learned, Learned, "numbers_learned and read_learned return them.")
    changes: dict[str, Any] = {}
    for name, entry in learned.entries.items():
        if entry.valid:
            changes[name] = entry.value
            changes[SPREADS[name]] = 1.2 * entry.std / (entry.value if name in RELATIVE else 1.0)
    names = tuple(changes)
    dtype = method.mass.dtype
    values = [jnp.asarray(changes[name], dtype) for name in names]
    return eqx.tree_at(lambda m: [getattr(m, name) for name in names], method, values) if names else method


def write_learned(learned: Learned, path: str | os.PathLike, *, overwrite: bool = False) -> None:
    """Write the learned parameters as TOML, which `read_learned` reads back exactly. The file is written completely or not at
    all.

    **Raises** `InputError` where the file exists and `overwrite` is False.
    """
    check_flags(overwrite=overwrite)
    check_kind("write_learned: learned", learned, Learned, "numbers_learned returns it.")
    lines = [
        "# Parameters of a car that jaxveh has learned. SI units; valid: the standard deviation is small enough to use them.",
        f"version = {kit.toml_string(VERSION)}",
    ]
    for name, entry in learned.entries.items():
        lines += ["", f"[{name}]", f"value = {entry.value!r}", f"std = {entry.std!r}"]
        lines += [f"unit = {kit.toml_string(UNITS[name])}", f"valid = {str(entry.valid).lower()}"]
    kit.write_toml(lines, path, overwrite)


def read_learned(path: str | os.PathLike) -> Learned:
    """Read a file of `write_learned`. **Raises** `InputError` with file and key if it is no such file, is incomplete, or has
    another unit."""
    path = path_of(path)
    content = dict(kit.read_toml(path))
    try:
        kit.check_keys("the file", content, ("version", *UNITS))
        content.pop("version", None)
        return Learned({name: _entry(name, table) for name, table in content.items()})
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _entry(name: str, table: Any) -> Entry:
    kit.check_keys(f"[{name}]", table, KEYS)
    missing = [key for key in KEYS if key not in table]
    if missing:
        raise InputError(f"[{name}]: no {', '.join(missing)}: incomplete; learn again.")
    if kit.toml_text(f"[{name}]: unit", table["unit"]) != UNITS[name]:
        raise InputError(f"[{name}]: unit = {table['unit']!r}: must be {UNITS[name]!r}.")
    if not isinstance(table["valid"], bool):
        raise InputError(f"[{name}]: valid = {table['valid']!r}: must be true or false.")
    return Entry(
        kit.toml_number(f"[{name}]: value", table["value"]),
        kit.toml_number(f"[{name}]: std", table["std"]),
        table["valid"],
    )

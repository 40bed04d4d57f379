"""Findings about the lines of a tyre property file: entries that are not read or cannot be read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import equinox as eqx

from jaxveh.io import PropertyFile, kit
from jaxveh.tyres.mf_tyre import MFTyre
from jaxveh.tyres.property_file import NOT_MEASURED

NEUTRAL = {"LMUV": 0.0}
"""Scaling factors that have no effect at a value other than 1, with that value."""

DYNAMIC = ("QTZ1", "MBELT")
"""Coefficients of the gyroscopic moment, which a steady law does not use."""

DEFLECTIONS = "[DEFLECTION_LOAD_CURVE]"
"""A table that replaces VERTICAL_STIFFNESS."""

WORDS = ("TYRESIDE", "PROPERTY_FILE_FORMAT")
"""Entries that are words, read with or without quotes, like those of [UNITS]."""

LISTED = 6
"""The largest number of keys that are listed in full; of more keys only the first ones are."""


class PropertyFinding(NamedTuple):
    """One finding about a property file: `about` is the key or quantity, `says` the text."""

    about: str
    says: str


def first_of(file: PropertyFile, key: str) -> kit.Entry | None:
    """The first entry of that name with a value, even if others differ (`PropertyFile.find` raises an error if they do)."""
    return next((entry for entry in file.entries if entry.key == key and entry.value != ""), None)


def odd_lines(file: PropertyFile, tyre: MFTyre) -> Iterator[PropertyFinding]:
    """Findings about single lines of a file, and about coefficients that `tyre`, made from this file, does not use."""
    known = {name for part in vars(tyre).values() if isinstance(part, eqx.Module) for name in vars(part)}
    yield from _without_value(file, known)
    yield from _zeros(file)
    yield from _texts(file)
    yield from _twice(file)
    yield from _unread(file, known)


def _without_value(file: PropertyFile, known: set[str]) -> Iterator[PropertyFinding]:
    """Empty entries: one finding for those that the tyre reads (it uses the defaults), and one for those that it does not."""
    told = {entry.key for entry in file.entries if entry.value != ""}
    empty = [entry for entry in file.entries if entry.value == "" and entry.key not in told]
    read = [entry for entry in empty if entry.key in known or entry.key in WORDS or entry.section == "UNITS"]
    if read:
        yield PropertyFinding(_list_keys(read), "without a value: the lines are ignored")
    if others := [entry for entry in empty if entry not in read and not entry.quoted]:
        yield PropertyFinding(_list_keys(others), "without a value, and not read")


def _zeros(file: PropertyFile) -> Iterator[PropertyFinding]:
    if zeros := [entry for entry in file.entries if entry.value == 0 and entry.key in NOT_MEASURED]:
        yield PropertyFinding(_list_keys(zeros), "0, where only a positive number has a meaning: the lines are ignored")


def _texts(file: PropertyFile) -> Iterator[PropertyFinding]:
    """Entries without quotes that are not numbers; the tyre does not use them."""
    for entry in file.entries:
        if entry.quoted or not isinstance(entry.value, str) or entry.value == "":
            continue
        if entry.key not in WORDS and entry.section != "UNITS":
            place = f"in [{entry.section}], line {entry.line}"
            yield PropertyFinding(
                entry.key, f"{place}, is {entry.short_value}: neither a number nor in quotes; it is kept but not read"
            )


def _twice(file: PropertyFile) -> Iterator[PropertyFinding]:
    """Entries that contradict each other and that the tyre does not use (otherwise it could not have been made)."""
    first: dict[tuple[str, str], kit.Entry] = {}
    for entry in file.entries:
        section = "" if entry.key in (*WORDS, "USE_MODE") else entry.section
        before = first.setdefault((section, entry.key), entry)
        if before.value != entry.value and "" not in (before.value, entry.value):
            yield PropertyFinding(entry.key, f"has different values in lines {before.line} and {entry.line}")


def _unread(file: PropertyFile, known: set[str]) -> Iterator[PropertyFinding]:
    """Coefficients of forces and moments that would have an effect but are not read; tables."""
    unread: dict[str, list[kit.Entry]] = {}
    for entry in file.entries:
        if entry.key in known or entry.key in DYNAMIC or isinstance(entry.value, str):
            continue
        if entry.section.endswith("COEFFICIENTS") or entry.section.startswith("TURNSLIP"):
            neutral = NEUTRAL.get(entry.key, 1.0 if entry.section.startswith("SCALING") else 0.0)
            if entry.value != neutral:
                unread.setdefault(entry.section, []).append(entry)
    for section, entries in unread.items():
        yield PropertyFinding(f"[{section}]", f"{_list_keys(entries)}: not read, and not neutral")
    if DEFLECTIONS in (line.strip().upper() for line in file.lines):
        yield PropertyFinding(DEFLECTIONS, "is not read: the deflection follows VERTICAL_STIFFNESS")


def _list_keys(entries: Iterable[kit.Entry]) -> str:
    keys = list(dict.fromkeys(entry.key for entry in entries))
    return (
        ", ".join(keys)
        if len(keys) <= LISTED
        else f"{', '.join(keys[: LISTED // 2])} and {len(keys) - LISTED // 2} more"
    )

"""Tyre property files (.tir): read in all the variants in use, and written back without loss."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from jaxveh._core.errors import InputError, check_flags, path_of
from jaxveh.io.decimals import decimal
from jaxveh.io.files import check_readable, replacing_file

PROPERTY_UNITS = {
    "LENGTH": {
        "meter": 1.0, "metre": 1.0, "m": 1.0, "mm": 1e-3, "millimeter": 1e-3, "millimetre": 1e-3, "cm": 1e-2, "centimeter": 1e-2,
        "centimetre": 1e-2, "km": 1e3, "kilometer": 1e3, "inch": 0.0254, "inches": 0.0254, "foot": 0.3048,
    },
    "FORCE": {
        "newton": 1.0, "n": 1.0, "kn": 1e3, "kilonewton": 1e3, "knewton": 1e3, "dekanewton": 10.0,
        "pound_force": 4.4482216152605, "kilogram_force": 9.80665, "kg_force": 9.80665,
    },
    "ANGLE": {"radian": 1.0, "radians": 1.0, "rad": 1.0},
    "MASS": {"kg": 1.0, "kilogram": 1.0, "gram": 1e-3, "tonne": 1e3, "pound_mass": 0.45359237},
    "TIME": {"second": 1.0, "sec": 1.0, "s": 1.0, "millisecond": 1e-3, "minute": 60.0, "hour": 3600.0},
}  # fmt: skip
"""The allowed units of a [UNITS] section, and their size in SI; words also in the plural, with an `s`."""

_SECTION = re.compile(r"^\s*\[(?P<name>[^\]]+)\]\s*$")
# A value is a text in quotes, or everything up to a comment.
_ENTRY = re.compile(
    r"^(?P<lead>\s*(?P<key>[A-Za-z_][\w.]*)\s*=[^\S\r\n]*)"
    r"(?P<value>'[^'\r\n]*'|\"[^\"\r\n]*\"|[^$!\r\n]*[^$!\s]|)(?P<rest>.*)$",
    re.DOTALL,
)
SHOWN = 40
"""Largest number of characters of a value in a message."""


@dataclass(frozen=True)
class Entry:
    """One line `key = value` of a property file: `section`, `key`, `value`, its `line` from 1.

    `section` and `key` are in capitals, however the file writes them: the format does not distinguish small letters.

    `value`: a float if it is one finite number, otherwise the text, which is empty if there is none; `quoted`: whether the text
    was in quotes, which are removed.
    """

    section: str
    key: str
    value: float | str
    line: int
    quoted: bool = False

    @property
    def short_value(self) -> str:
        """The value for a message, shortened."""
        text = repr(self.value)
        return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


@dataclass(frozen=True)
class PropertyFile:
    """A tyre property file: its `lines` unchanged, line ends included, and the `entries` found in them.

    Comments (`$`, `!`), tables such as [SHAPE] and unknown sections are kept in `lines`.
    """

    source: str
    lines: tuple[str, ...]
    entries: tuple[Entry, ...]

    @property
    def sections(self) -> dict[str, dict[str, float | str]]:
        """Values by section and key, in the file's order."""
        found: dict[str, dict[str, float | str]] = {}
        for entry in self.entries:
            found.setdefault(entry.section, {})[entry.key] = entry.value
        return found

    def find(self, key: str) -> Entry | None:
        """Return the entry of that name that has a value, from any section; None if there is none.

        **Raises** `InputError` if there are several with different values.
        """
        return _one(self.source, key, self._by_key.get(key.upper(), []))

    def holds(self, key: str) -> bool:
        """Whether there is a line of that name, with or without a value."""
        return key.upper() in self._by_key

    @cached_property
    def _by_key(self) -> dict[str, list[Entry]]:
        found: dict[str, list[Entry]] = {}
        for entry in self.entries:
            found.setdefault(entry.key, []).append(entry)
        return found

    def number(self, key: str, default: float | None = None) -> float:
        """Return the number of that name; `default` if the file has no value.

        **Raises** `InputError` if the value is not one finite number, or is missing and there is no default.
        """
        entry = self.find(key)
        if entry is None:
            if default is None:
                raise InputError(
                    f"{self.source}: {key} {'has no value' if self.holds(key) else 'is missing'}, but this tyre needs "
                    f"it: {'complete' if self.holds(key) else 'add'} the line `{key} = ...`."
                )
            return default
        if isinstance(entry.value, str):
            raise InputError(
                f"{self.source}, line {entry.line}: {key} = {entry.short_value}: must be one finite number."
            )
        return entry.value

    def text(self, key: str, default: str = "") -> str:
        """Return the text of that name; a number is formatted as text."""
        entry = self.find(key)
        if entry is None:
            return default
        return entry.value if isinstance(entry.value, str) else f"{entry.value:g}"

    def unit(self, quantity: str) -> float:
        """Return the size in SI of the file's unit of `LENGTH`, `FORCE`, `ANGLE`, `MASS` or `TIME`; 1 if it names none."""
        entry = _one(self.source, quantity, [e for e in self._by_key.get(quantity, []) if e.section == "UNITS"])
        if entry is None:
            return 1.0
        known, said = PROPERTY_UNITS[quantity], str(entry.value).strip().lower()
        said = said if said in known or len(said) < 4 else said.removesuffix("s")
        if said not in known:
            raise InputError(
                f"{self.source}, line {entry.line}: {quantity} = {entry.short_value}: must be one of {', '.join(known)}."
            )
        return known[said]

    def replace(self, values: Mapping[str, float]) -> PropertyFile:
        """Return the file with other numbers; everything else is unchanged, comments and columns included.

        **Raises** `InputError` for a key that is not in the file.
        """
        lines = list(self.lines)
        for key, value in values.items():
            if not self.holds(key):
                raise InputError(f"{self.source}: {key} is not in the file; there are: {', '.join(self._numbers())}.")
            for each in self.entries:
                if each.key == key.upper():
                    lines[each.line - 1] = _with_value(lines[each.line - 1], repr(float(value)))
        return parse_property_file("".join(lines), self.source)

    def _numbers(self) -> list[str]:
        return [entry.key for entry in self.entries if isinstance(entry.value, float)]


def _one(source: str, key: str, entries: list[Entry]) -> Entry | None:
    """Return the first entry that has a value. **Raises** `InputError` if the values differ."""
    told = [entry for entry in entries if entry.value != ""]
    if len({str(entry.value) for entry in told}) > 1:
        places = ", ".join(f"{e.short_value} in [{e.section}], line {e.line}" for e in told)
        raise InputError(f"{source}: {key} has several values: {places}. Keep one.")
    return told[0] if told else None


def read_property_file(path: str | Path) -> PropertyFile:
    """Read a .tir file.

    Values that are not numbers stay text; `PropertyFile.number` raises when such a number is needed.

    **Raises** `InputError` for a file that is missing, has no section with entries, or is not text in UTF-8 or a
    single-byte encoding.
    """
    path = path_of(path)
    if path.suffix.lower() == ".toml":
        raise InputError(
            f"{path}: is TOML: must be a tyre property file (.tir). The parameter file of a law, as `jaxveh tyre fit "
            "--model` writes it, is read by tyres.read_parameters, and is a --start of another fit."
        )
    check_readable(path)
    # Bytes that are not UTF-8 (a degree sign in a comment) are written back unchanged.
    with open(path, encoding="utf-8", errors="surrogateescape", newline="") as file:
        return parse_property_file(file.read(), str(path))


def parse_property_file(text: str, source: str = "property file") -> PropertyFile:
    """Parse the text of a .tir file; see `read_property_file`."""
    if "\0" in text:
        raise InputError(f"{source}: contains zero bytes: it is not text, or is in UTF-16; save it as UTF-8.")
    lines = tuple(re.findall(r"[^\r\n]*(?:\r\n|\n|\r)|[^\r\n]+$", text))
    section, entries = "", []
    for number, line in enumerate(lines, start=1):
        # A byte order mark must not hide the first heading, which may be that of the units.
        bare = line.rstrip("\r\n").removeprefix("\ufeff" if number == 1 else "")
        if heading := _SECTION.match(_without_comment(bare)):
            section = heading["name"].strip().upper()
            continue
        entry = _ENTRY.match(bare)
        # Lines before the first section are a preamble; other lines are comments and rows of tables.
        if not entry or not section or bare.lstrip().startswith(("$", "!", "{")):
            continue
        value, quoted = _value(entry["value"])
        entries.append(Entry(section, entry["key"].upper(), value, number, quoted))
    if not entries:
        raise InputError(f"{source}: no section with entries: this is not a tyre property file (.tir).")
    return PropertyFile(source, lines, tuple(entries))


def write_property_file(file: PropertyFile, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a property file; a file that was read and not changed is written back byte for byte.

    **Raises** `InputError` if the file exists and `overwrite` is not set.
    """
    check_flags(overwrite=overwrite)
    with (
        replacing_file(path, overwrite) as part,
        open(part, "w", encoding="utf-8", errors="surrogateescape", newline="") as out,
    ):
        out.write("".join(file.lines))


def _without_comment(line: str) -> str:
    return re.split(r"[$!]", line, maxsplit=1)[0]


def _value(text: str) -> tuple[float | str, bool]:
    """Return the value of a text, and whether it was in quotes."""
    if len(text) > 1 and text[0] in "'\"" and text[-1] == text[0]:
        return text[1:-1], True
    try:
        return decimal(re.sub("[dD]", "e", text)), False  # Fortran writes 1.0d3
    except ValueError:
        return text, False


def _with_value(line: str, text: str) -> str:
    """Return the line with another value; its comment stays in its column if the width allows."""
    found = _ENTRY.match(line)
    assert found is not None
    lead, rest = found["lead"], found["rest"]
    if not found["value"]:
        # The value is empty: the blanks before the comment are room for it.
        lead = lead.rstrip() + " "
        rest = " " * (len(found["lead"]) - len(lead)) + rest
    width = len(found["value"]) + len(rest) - len(rest.lstrip(" "))
    return lead + text.ljust(max(width, len(text) + 1)) + rest.lstrip(" ")

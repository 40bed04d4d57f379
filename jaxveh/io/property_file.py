"""Tyre property files (.tir): read as they are written in the world, written back without loss."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from jaxveh._core.errors import InputError
from jaxveh.io.files import check_readable, replacing

UNITS = {
    "LENGTH": {"meter": 1.0, "metre": 1.0, "m": 1.0, "mm": 1e-3, "millimeter": 1e-3, "cm": 1e-2, "inch": 0.0254},
    "FORCE": {"newton": 1.0, "n": 1.0, "kn": 1e3, "pound_force": 4.4482216152605},
    "ANGLE": {"radian": 1.0, "radians": 1.0, "rad": 1.0},
    "MASS": {"kg": 1.0, "kilogram": 1.0, "gram": 1e-3, "pound_mass": 0.45359237},
    "TIME": {"second": 1.0, "sec": 1.0, "s": 1.0, "millisecond": 1e-3},
}
"""What a [UNITS] section may say, and its size in SI."""

_SECTION = re.compile(r"^\s*\[(?P<name>[^\]]+)\]\s*$")
_ENTRY = re.compile(
    r"^(?P<lead>\s*(?P<key>[A-Za-z_][\w.]*)\s*=\s*)(?P<value>'[^']*'|\"[^\"]*\"|[^\s$!]*)(?P<rest>.*)$", re.DOTALL
)


@dataclass(frozen=True)
class Entry:
    """One coefficient of a property file: `section`, `key`, `value` (float, or str where it is quoted), its `line` from 1."""

    section: str
    key: str
    value: float | str
    line: int


@dataclass(frozen=True)
class PropertyFile:
    """A tyre property file: its `lines` as they are, line ends included, and the `entries` found in them.

    Comments (`$`, `!`), tables such as [SHAPE] and sections that nobody knows are kept in `lines`.
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
        """The entry of that name, wherever it stands; None where there is none.

        **Raises** `InputError` where sections disagree about it.
        """
        found = [entry for entry in self.entries if entry.key == key]
        if len({str(entry.value) for entry in found}) > 1:
            places = ", ".join(f"{e.value!r} in [{e.section}], line {e.line}" for e in found)
            raise InputError(f"{self.source}: {key} has several values: {places}. Leave one.")
        return found[0] if found else None

    def number(self, key: str, default: float | None = None) -> float:
        """The number of that name; `default` where the file is silent, an `InputError` without one or for a text."""
        entry = self.find(key)
        if entry is None:
            if default is None:
                raise InputError(
                    f"{self.source}: {key} is missing, and this tyre cannot do without: add a line `{key} = ...`."
                )
            return default
        if isinstance(entry.value, str):
            raise InputError(f"{self.source}, line {entry.line}: {key} = {entry.value!r}: must be a number.")
        return entry.value

    def text(self, key: str, default: str = "") -> str:
        """The text of that name, numbers as they print."""
        entry = self.find(key)
        if entry is None:
            return default
        return entry.value if isinstance(entry.value, str) else f"{entry.value:g}"

    def unit(self, quantity: str) -> float:
        """The size in SI of the file's unit of `LENGTH`, `FORCE`, `ANGLE`, `MASS` or `TIME`; 1 where it is silent."""
        said = self.sections.get("UNITS", {}).get(quantity)
        if said is None:
            return 1.0
        known = UNITS[quantity]
        if str(said).strip().lower() not in known:
            raise InputError(f"{self.source}: {quantity} = {said!r}: must be one of {', '.join(known)}.")
        return known[str(said).strip().lower()]

    def replace(self, values: Mapping[str, float]) -> PropertyFile:
        """The same file with other numbers; everything else stays as it is, comments and columns included.

        **Raises** `InputError` for a key that the file does not hold.
        """
        lines = list(self.lines)
        for key, value in values.items():
            entry = self.find(key)
            if entry is None:
                raise InputError(f"{self.source}: {key} is not in the file; there are: {', '.join(self._numbers())}.")
            for each in self.entries:
                if each.key == key:
                    lines[each.line - 1] = _with_value(lines[each.line - 1], repr(float(value)))
        return parse_property_file("".join(lines), self.source)

    def _numbers(self) -> list[str]:
        return [entry.key for entry in self.entries if isinstance(entry.value, float)]


def read_property_file(path: str | Path) -> PropertyFile:
    """Read a .tir file.

    **Raises** `InputError` for a file that is missing or holds no section, a coefficient that is no number, or one that
    stands twice in a section.
    """
    path = Path(path)
    check_readable(path)
    # Bytes that are no UTF-8 (a degree sign in a comment) come back as they were.
    with open(path, encoding="utf-8", errors="surrogateescape", newline="") as file:
        return parse_property_file(file.read(), str(path))


def parse_property_file(text: str, source: str = "property file") -> PropertyFile:
    """Parse the text of a .tir file; see `read_property_file`."""
    lines = tuple(re.findall(r"[^\r\n]*(?:\r\n|\n|\r)|[^\r\n]+$", text))
    section, entries, seen = "", [], {}
    for number, line in enumerate(lines, start=1):
        bare = line.rstrip("\r\n")
        if heading := _SECTION.match(_uncommented(bare)):
            section = heading["name"].strip().upper()
            continue
        entry = _ENTRY.match(bare)
        # What stands before any section is a preamble; other lines are comments and rows of tables.
        if not entry or not section or bare.lstrip().startswith(("$", "!", "{")):
            continue
        key = entry["key"]
        if (section, key) in seen:
            first = seen[section, key]
            raise InputError(f"{source}: {key} stands twice in [{section}], lines {first} and {number}: leave one.")
        seen[section, key] = number
        entries.append(Entry(section, key, _value(entry["value"], key, source, number), number))
    if not entries:
        raise InputError(f"{source}: no section with entries: this is no tyre property file (.tir).")
    return PropertyFile(source, lines, tuple(entries))


def write_property_file(file: PropertyFile, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a property file; one that was read and not changed comes out byte for byte.

    **Raises** `InputError` where the file exists and `overwrite` is not set.
    """
    with (
        replacing(path, overwrite) as part,
        open(part, "w", encoding="utf-8", errors="surrogateescape", newline="") as out,
    ):
        out.write("".join(file.lines))


def _uncommented(line: str) -> str:
    return re.split(r"[$!]", line, maxsplit=1)[0]


def _value(text: str, key: str, source: str, line: int) -> float | str:
    if text[:1] in ("'", '"'):
        return text[1:-1]
    try:
        return float(re.sub(r"(?<=[\d.])[dD](?=[+-]?\d)", "e", text))  # Fortran writes 1.0d3
    except ValueError:
        raise InputError(
            f"{source}, line {line}: {key} = {text or 'nothing'}: must be a number, or a text in quotes."
        ) from None


def _with_value(line: str, text: str) -> str:
    """The line with another value, the comment where it was if the width allows."""
    found = _ENTRY.match(line)
    assert found is not None
    width = len(found["value"]) + len(found["rest"]) - len(found["rest"].lstrip(" "))
    return found["lead"] + text.ljust(max(width, len(text) + 1)) + found["rest"].lstrip(" ")

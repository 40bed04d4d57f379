"""Reading of MATLAB files of version 5 (`save` with -v6 and -v7) by their tagged elements, each checked against the file's end.

Source: MAT-File Format, MathWorks R2024a, chapter 1. SciPy reads these files too, but ends the process if a tag is damaged.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import InputError

HEADER = 128
MATRIX, COMPRESSED = 14, 15
STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
TEXTS = {16: "utf-8", 17: "utf-16", 18: "utf-32"}
CELL, STRUCT, OBJECT, CHAR, SPARSE, FUNCTION, OPAQUE = 1, 2, 3, 4, 5, 16, 17
NUMBERS = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
COMPLEX, LOGICAL = 0x0800, 0x0200

DEEPEST = 24
"""Deepest nesting of structs: a damaged file may contain itself."""
LARGEST = 2**32
"""Largest size of an element after decompression, bytes."""


class Unread(NamedTuple):
    """Stands for a value that cannot be read: an object of a MATLAB class, a table, a function."""

    what: str


def variables_of(data: bytes) -> Iterator[tuple[str, Any]]:
    """Yield name and value of each variable: arrays, dicts (structs), lists (cells and arrays of structs), `str`, `Unread`.

    **Raises** `InputError` if an element does not fit into the file.
    """
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if order is None:
        # Version 4 begins with a whole number: its order of bytes, kind of numbers and of matrix, each a digit.
        if int.from_bytes(data[:4], "little") in range(60) or int.from_bytes(data[:4], "big") in range(1000, 1060):
            raise InputError(
                "it is of version 4, as Dymola and OpenModelica write results; export CSV there, or load it in MATLAB and "
                "save it with -v7"
            )
        raise InputError("it begins neither as version 5 nor as 7.3; save it again with -v7")
    reader = _Elements(data, HEADER, len(data), order)
    while reader.left():
        kind, inside = reader.next()
        if kind == COMPRESSED:
            kind, inside = _unpack(inside).next()
        if kind == MATRIX:
            name, value = _matrix(inside, 0)
            # Elements without a name are internal to MATLAB: the data of its objects.
            if name:
                yield name, value


def _unpack(packed: _Elements) -> _Elements:
    unpacker = zlib.decompressobj()
    data = unpacker.decompress(packed.rest(), LARGEST)
    if not unpacker.eof:
        raise InputError("a compressed element has no end")
    return _Elements(data, 0, len(data), packed.order)


class _Elements:
    """The elements between two positions in the data, one after the other."""

    def __init__(self, data: bytes, at: int, end: int, order: str):
        self.data, self.at, self.end, self.order = data, at, end, order

    def left(self) -> bool:
        return self.at < self.end

    def rest(self) -> bytes:
        return self.data[self.at : self.end]

    def next(self) -> tuple[int, _Elements]:
        """Return the kind and the contents of the next element."""
        if self.end - self.at < 8:
            raise InputError(f"it ends within an element, at byte {self.at}")
        kind, size = struct.unpack_from(f"{self.order}II", self.data, self.at)
        start, length = self.at + 8, size
        if kind >> 16:
            # Up to four bytes are in the tag itself.
            kind, size, start, length = kind & 0xFFFF, kind >> 16, self.at + 4, 4
        elif kind != COMPRESSED:
            length = -(-size // 8) * 8
        if size > length or start + size > self.end:
            raise InputError(f"an element of {size} bytes at byte {self.at} does not fit into it")
        self.at = min(start + length, self.end)
        return kind, _Elements(self.data, start, start + size, self.order)

    def array(self) -> np.ndarray:
        """Return the numbers of the next element, (n,)."""
        kind, inside = self.next()
        if kind not in STORED:
            raise InputError(f"an element of type {kind} has no numbers")
        dtype = np.dtype(inside.order + STORED[kind])
        raw = inside.rest()
        if len(raw) % dtype.itemsize:
            raise InputError(f"{len(raw)} bytes are no numbers of {dtype.itemsize} bytes")
        return np.frombuffer(raw, dtype).astype(dtype.newbyteorder("="))

    def text(self) -> str:
        """Return the text of the next element."""
        kind, inside = self.next()
        if kind in TEXTS:
            suffix = "" if kind == 16 else {"<": "-le", ">": "-be"}[inside.order]
            return inside.rest().decode(TEXTS[kind] + suffix, errors="replace")
        if kind == 4:
            return inside.rest().decode("utf-16-le" if inside.order == "<" else "utf-16-be", errors="replace")
        return inside.rest().decode("latin-1")


def _matrix(inside: _Elements, depth: int) -> tuple[str, Any]:
    """Return name and value of a variable, a cell or a field."""
    if depth > DEEPEST:
        raise InputError(f"structs are nested more than {DEEPEST} levels deep")
    if not inside.left():
        return "", np.zeros((0, 0))
    flags = int(inside.array()[:1].sum())
    kind = flags & 0xFF
    if kind == OPAQUE:
        name = inside.text()
        inside.text()
        return name, Unread(inside.text() or "an object")
    shape = tuple(int(side) for side in inside.array())
    name = inside.text()
    count = int(np.prod(shape, dtype=object)) if shape else 0
    if min(shape, default=0) < 0:
        raise InputError(f"{name} has the shape {shape}")
    if kind in NUMBERS:
        return name, _numbers(inside, name, kind, flags, shape, count)
    if kind == CHAR:
        return name, inside.text() if count else ""
    if kind == CELL:
        return name, [_field(inside, depth) for _ in range(count)]
    if kind in (STRUCT, OBJECT):
        if kind == OBJECT:
            inside.text()
        return name, _structs(inside, name, count, depth)
    return name, Unread({SPARSE: "a sparse matrix", FUNCTION: "a function"}.get(kind, f"class {kind}"))


def _field(inside: _Elements, depth: int) -> Any:
    kind, element = inside.next()
    if kind != MATRIX:
        raise InputError(f"an element of type {kind} is in the place of a matrix")
    return _matrix(element, depth + 1)[1]


def _structs(inside: _Elements, name: str, count: int, depth: int) -> Any:
    """Return a struct as a dict, and an array of structs as a list of dicts."""
    length = int(inside.array()[:1].sum())
    _, element = inside.next()
    raw = element.rest()
    if length <= 0 or len(raw) % length:
        raise InputError(f"{name} has fields of {length} letters in {len(raw)} bytes")
    fields = [raw[k : k + length].partition(b"\0")[0].decode("latin-1") for k in range(0, len(raw), length)]
    parts = [{field: _field(inside, depth) for field in fields} for _ in range(count if fields else 0)]
    return parts[0] if len(parts) == 1 else parts


def _numbers(inside: _Elements, name: str, kind: int, flags: int, shape: tuple[int, ...], count: int) -> Any:
    stored = inside.array()
    if stored.size != count:
        raise InputError(f"{name} has {stored.size} numbers for the shape {shape}")
    if flags & COMPLEX:
        return Unread("complex numbers")
    values = stored.astype(bool if flags & LOGICAL else NUMBERS[kind])
    return values.reshape(shape, order="F")

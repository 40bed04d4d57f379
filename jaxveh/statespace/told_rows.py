"""Checks of what `scan`, and `init` and `step` of a filter, are given: rows of the model, and a belief of the filter."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, word_for
from jaxveh.statespace.model import Row, StateSpace

MAKES = "model.row(t, u, y) makes a row of plain numbers, model.rows(recording) those of a recording."


def check_rows(who: str, model: StateSpace, rows: Any, axes: int) -> None:
    """Raise `InputError` unless `rows` is a `Row` of numbers of the model's inputs and channels in its precision: scalars
    for no `axes`, as many rows in each for one."""
    name = "rows" if axes else "row"
    if not isinstance(rows, Row):
        raise InputError(f"{who}: {name} = {word_for(rows)}: must be a Row(t, u, y). {MAKES}")
    _check_fields(f"{who}: {name}.u", rows.u, model.inputs, "the model's inputs")
    _check_fields(f"{who}: {name}.y", rows.y, model.channels, "the model's channels, NaN where one is missing")
    own = model.dtype
    values = (rows.t, *(rows.u or ()), *rows.y)
    # A live loop is held up by every name that is put together for nothing.
    shape = getattr(rows.t, "shape", ())
    alike = all(getattr(value, "shape", None) == shape and value.dtype == own for value in values)
    if not alike or len(shape) != axes or 0 in shape:
        _tell(who, name, rows, own, axes)


def _tell(who: str, name: str, rows: Row, own: Any, axes: int) -> None:
    """Raise `InputError` naming the first number of rows that is none, or of another precision or shape."""
    needed = None
    for place, value in _numbers(rows):
        said = f"{who}: {name}.{place}"
        if not hasattr(value, "dtype") or value.dtype != own:
            raise InputError(
                f"{said} = {word_for(value)}: must be an array of {own}, the precision of the model. {MAKES}"
            )
        needed = np.shape(value) if needed is None else needed
        if len(needed) != axes or np.shape(value) != needed or 0 in needed:
            wanted = "one number; jax.vmap takes several rows at once"
            if axes:
                wanted = "(T,), with the same T of at least one row in each of them"
            raise InputError(f"{said} has the shape {np.shape(value)}: must be {wanted}. {MAKES}")


def check_has_count(who: str, belief: Any) -> None:
    """Raise `InputError` for what is no belief of any filter."""
    count = getattr(belief, "count", None)
    # Lists, tuples and texts have a method of this name.
    if count is None or callable(count) or isinstance(belief, type):
        raise InputError(
            f"{who}: belief = {word_for(belief)}: must be the belief, the first of the two that init returned."
        )


def check_belief(who: str, belief: Any, like: Any) -> None:
    """Raise `InputError` naming the first place in which a belief is of another kind, size or precision than `like`, that of
    this filter and model after a first row."""
    for place, given, own in _differences("belief", belief, like):
        raise InputError(
            f"{who}: {place} is {given}: must be {own}, as in the belief that init of this filter returns for this model. It is "
            "of another filter, another model or another precision."
        )


def _check_fields(name: str, value: Any, fields: tuple[str, ...], what: str) -> None:
    if not fields and (value is None or value == ()):
        return
    if not hasattr(value, "_fields") or set(value._fields) != set(fields):
        raise InputError(f"{name} = {word_for(value)}: must be a NamedTuple of ({', '.join(fields)}), {what}. {MAKES}")


def _numbers(rows: Row) -> Iterator[tuple[str, Any]]:
    yield "t", rows.t
    for part in ("u", "y"):
        values = getattr(rows, part)
        yield from ((f"{part}.{name}", getattr(values, name)) for name in getattr(values, "_fields", ()))


def _differences(place: str, given: Any, own: Any) -> Iterator[tuple[str, str, str]]:
    """The places where two trees differ, with what is there in words. NamedTuples are alike if their fields are, and keys of
    jax.random are of an old kind or a new one."""
    if all(hasattr(one, "dtype") for one in (given, own)):
        if not jnp.issubdtype(own.dtype, jax.dtypes.prng_key) and (given.shape, given.dtype) != (own.shape, own.dtype):
            yield place, f"{given.dtype}{list(given.shape)}", f"{own.dtype}{list(own.shape)}"
        return
    parts, needed = _parts(given), _parts(own)
    if parts.keys() != needed.keys() or (dataclasses.is_dataclass(own) and type(given) is not type(own)):
        yield place, word_for(given), word_for(own)
        return
    for name, part in needed.items():
        yield from _differences(f"{place}.{name}", parts[name], part)


def _parts(value: Any) -> dict[str, Any]:
    """The parts of a tree by name, and the fields of a NamedTuple that is one of them; others have none."""
    if isinstance(value, type):
        return dict.fromkeys(getattr(value, "_fields", ()))
    if dataclasses.is_dataclass(value):
        return {field.name: getattr(value, field.name, None) for field in dataclasses.fields(value)}
    if hasattr(value, "_fields"):
        return value._asdict()
    if isinstance(value, tuple | list):
        return dict(zip(map(str, range(len(value))), value, strict=True))
    return value if isinstance(value, dict) else {}

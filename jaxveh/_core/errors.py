"""Errors that name the thing, the value, the allowed range and the remedy."""

from __future__ import annotations

import difflib
import inspect
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np


class InputError(ValueError):
    """An input of jaxveh is wrong, and the caller can correct it (the programs exit with code 2)."""


class FilterError(RuntimeError):
    """A filter, a simulation or a fit ended with a failing result code; the message names the step and the reason."""


class JaxvehWarning(UserWarning):
    """Something is unusual but not wrong."""


INSIDE = ("jaxveh", "jax", "equinox", "optimistix", "diffrax")
"""Packages in which nobody looks for the reason of a warning."""


def warn(message: str) -> None:
    """Warn of something unusual (`JaxvehWarning`), at the line of the caller's own code."""
    frame, level = inspect.currentframe(), 1
    while frame is not None and (frame.f_globals.get("__name__") or "").partition(".")[0] in INSIDE:
        frame, level = frame.f_back, level + 1
    warnings.warn(message, JaxvehWarning, stacklevel=level)


def is_concrete(*values) -> bool:
    """Whether none of the values is a tracer, so that they can be checked (checks skip tracers)."""
    return not any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(values))


NOT_REAL = "USOcMm"
"""The kinds of NumPy's types whose values are no real numbers: text, objects, complex numbers and dates."""


def check(name: str, value, holds, allowed: str, advice: str = "") -> None:
    """Raise `InputError` naming `name`, `value` and the `allowed` range unless `holds(value)`; tracers pass, None does not.

    `holds` is applied to the value as a NumPy array of real numbers and must hold for every element.
    """
    if not is_concrete(value):
        return
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        array = np.asarray(None)
    if array.dtype.kind in NOT_REAL:
        raise InputError(f"{name} = {value!r}: must be a real number, {allowed}." + (f" {advice}" if advice else ""))
    held = holds(array)
    # Inside jit a limit may be traced where the value is not.
    if is_concrete(held) and not np.all(held):
        shown = array.item() if array.ndim == 0 else array
        raise InputError(f"{name} = {shown}: must be {allowed}." + (f" {advice}" if advice else ""))


def check_positive(name: str, value, unit: str = "", advice: str = "") -> None:
    """Raise `InputError` unless every element of `value` is finite and above zero."""
    check(name, value, lambda v: np.isfinite(v) & (v > 0), f"positive and finite{f' ({unit})' if unit else ''}", advice)


def check_finite(name: str, value, advice: str = "") -> None:
    """Raise `InputError` unless every element of `value` is finite."""
    check(name, value, np.isfinite, "finite", advice)


def check_at_least(name: str, value, least, advice: str = "") -> None:
    """Raise `InputError` unless every element of `value` is at least `least`."""
    check(name, value, lambda v: v >= least, f"at least {least}", advice)


def check_single(**values) -> None:
    """Raise `InputError` unless each of the named values is one real number, and no array, list, text or None; tracers pass."""
    for name, value in values.items():
        check(name, value, lambda _: True, "one number")
        if np.ndim(value):
            raise InputError(f"{name} has the shape {np.shape(value)}: must be one number.")


def check_flags(**flags) -> None:
    """Raise `InputError` unless each of the named values is True or False: to Python, every text is true, "no" as well."""
    for name, value in flags.items():
        if not isinstance(value, bool | np.bool_):
            raise InputError(f"{name} = {word_for(value)}: must be True or False.")


def check_known(**values) -> None:
    """Raise `InputError` unless each of the named values is one real number that is known outside of jit, no tracer."""
    check_single(**values)
    for name, value in values.items():
        if not is_concrete(value):
            raise InputError(f"{name} = {value!r}: must be one number that is known outside of jit, vmap and grad.")


def check_kind(name: str, value, kind: Any, advice: str = "") -> None:
    """Raise `InputError` unless `value` is of a kind, or of one of several (A | B); `advice` says what makes one."""
    if not isinstance(value, kind):
        shown = " or ".join(one.__name__.removeprefix("Abstract") for one in getattr(kind, "__args__", (kind,)))
        raise InputError(f"{name} = {word_for(value)}: must be of the kind {shown}." + (f" {advice}" if advice else ""))


def check_callable(name: str, value, advice: str = "") -> None:
    """Raise `InputError` unless `value` is a function, or an object that can be called; a class is neither."""
    if not callable(value) or isinstance(value, type):
        raise InputError(f"{name} = {word_for(value)}: must be a function." + (f" {advice}" if advice else ""))


def check_has(name: str, value, fields: Iterable[str], advice: str = "") -> None:
    """Raise `InputError` unless `value` is an object with these fields; `advice` says what makes one."""
    fields = tuple(fields)
    missing = [field for field in fields if isinstance(value, type) or not hasattr(value, field)]
    if missing:
        told = (
            f"{name} = {word_for(value)}: must be an object with {', '.join(fields)}; it has no {', '.join(missing)}."
        )
        raise InputError(told + (f" {advice}" if advice else ""))


def path_of(path) -> Path:
    """Return a path; raises `InputError` for what is no name of a file or folder."""
    try:
        return Path(path)
    except TypeError:
        raise InputError(f"path = {word_for(path)}: must be the name of a file or folder.") from None


def word_for(value) -> str:
    """Return a value of a wrong kind as every message shows it: words and numbers as they are, an array with its shape, a
    NamedTuple with its fields, a function by its name, others by their type."""
    if value is None or isinstance(value, str | bool | int | float | complex):
        return repr(value)
    if isinstance(value, type):
        return f"the class {value.__name__}"
    if isinstance(value, jax.Array) and jax.numpy.issubdtype(value.dtype, jax.dtypes.prng_key):
        return "a key of jax.random"
    if isinstance(value, jax.Array | np.ndarray):
        return f"an array of {value.dtype} of shape {value.shape}"
    if hasattr(value, "_fields"):
        return word_for_kind(type(value))
    return f"the function {value.__name__}" if inspect.isroutine(value) else type(value).__name__


def word_for_kind(kind: type) -> str:
    """Return a kind that is asked for as a message shows it: its name, with the fields of a NamedTuple."""
    fields = getattr(kind, "_fields", None)
    return kind.__name__ if fields is None else f"{kind.__name__}({', '.join(fields)})"


def arguments_in_words(parameters: Iterable[inspect.Parameter]) -> str:
    """Return the arguments of a function as a message shows them, without annotations and long defaults."""
    short = lambda one: one.default is one.empty or len(repr(one.default)) < 10
    shown = lambda one: str(one.replace(annotation=one.empty)) if short(one) else f"{one.name}=..."
    return ", ".join(map(shown, parameters))


def check_takes(name: str, function, *arguments: str) -> None:
    """Raise `InputError` unless `function` is a function, or an object that can be called, of these `arguments`, by position."""
    check_callable(name, function, f"It takes ({', '.join(arguments)}).")
    try:
        takes = inspect.signature(function)
    except (TypeError, ValueError):
        return  # one of C, which does not tell
    try:
        takes.bind(*arguments)
    except TypeError:
        shown = arguments_in_words(takes.parameters.values())
        raise InputError(f"{name} takes ({shown}): must take ({', '.join(arguments)}).") from None


def kind_of_inner(value) -> str:
    """Return the type of what a wrapper has inside as a message shows it; of a class itself, that it is one."""
    return (
        f"the class {value.__name__}, not {value.__name__}(...)," if isinstance(value, type) else type(value).__name__
    )


def is_whole(value) -> bool:
    """Whether a value is an integer of Python or NumPy, and no truth value."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, (bool, np.bool_))


def check_whole(name: str, value, least: int = 1, advice: str = "", most: int | None = None) -> None:
    """Raise `InputError` unless `value` is a Python or NumPy integer of at least `least` and at most `most`.

    Floats and truth values are refused.
    """
    if not is_whole(value) or value < least or (most is not None and value > most):
        allowed = f"of at least {least}" if most is None else f"from {least} to {most}"
        raise InputError(f"{name} = {value}: must be a whole number {allowed}." + (f" {advice}" if advice else ""))


LARGEST_SEED = 2**63 - 1
"""The largest seed that jax takes."""


def check_seed(name: str, value) -> None:
    """Raise `InputError` unless `value` is a whole number from 0 to `LARGEST_SEED`."""
    check_whole(name, value, 0, most=LARGEST_SEED)


def check_one_of(name: str, value, allowed) -> None:
    """Raise `InputError` unless `value` is one of `allowed`; the message suggests the most similar one."""
    if not is_concrete(value) or isinstance(value, jax.Array | np.ndarray) or value not in tuple(allowed):
        raise InputError(
            f"{name} = {word_for(value)}: must be one of {', '.join(map(repr, allowed))}.{did_you_mean([value], allowed)}"
        )


WHEELS = {"front_left": "fl", "front_right": "fr", "rear_left": "rl", "rear_right": "rr"}
"""Common names of the wheels, and the short names of this package."""


def near(name: str, names: Iterable[str]) -> list[str]:
    """Return the names that are similar to `name`, the nearest first; case is ignored, and wheels may have their long names."""
    names, name = list(names), str(name)
    for whole, short in WHEELS.items():
        if name.casefold().endswith(whole) and name[: -len(whole)] + short in names:
            return [name[: -len(whole)] + short]
    folded: dict[str, list[str]] = {}
    for candidate in names:
        folded.setdefault(candidate.casefold(), []).append(candidate)
    close = difflib.get_close_matches(name.casefold(), folded, n=3, cutoff=0.6)
    return [candidate for match in close for candidate in folded[match]]


def did_you_mean(unknown: Iterable[Any], names: Iterable[Any]) -> str:
    """Return the question " Did you mean a, b?" with the names most similar to the unknown ones; "" if there are none."""
    names = [name for name in names if isinstance(name, str)]
    found = [close[0] for one in unknown if isinstance(one, str) and (close := near(one, names))]
    return f" Did you mean {', '.join(dict.fromkeys(found))}?" if found else ""


def check_key(who: str, key: Any) -> None:
    """Raise `InputError` unless `key` is one key of `jax.random`, of the new or the old kind."""
    dtype = getattr(key, "dtype", None)
    new = dtype is not None and jax.numpy.issubdtype(dtype, jax.dtypes.prng_key)
    if not new and dtype != np.uint32:
        raise InputError(f"{who}: key = {key!r}: must be a key of jax.random, e.g. key=jax.random.key(0).")
    if key.ndim != (0 if new else 1):
        raise InputError(f"{who}: key has shape {key.shape}: must be one key; use jax.vmap over several.")


def float_array(value) -> Any:
    """Convert to a strong float array, of the default precision unless the value has its own float dtype.

    A Python float or a weak type would cause a new compilation; see `equinox.field(converter=...)`. What is no real number is
    returned as it is, for a check that knows its name.
    """
    if type(value) is float:
        # NumPy converts it in two thirds of the time, and a tyre has hundreds of them.
        with np.errstate(over="ignore"):
            return jax.numpy.asarray(np.asarray(value, jax.dtypes.canonicalize_dtype(float)))
    if isinstance(value, (jax.Array, np.ndarray, np.generic)) and jax.numpy.issubdtype(value.dtype, np.floating):
        weak = getattr(value, "weak_type", False)
        dtype = jax.dtypes.canonicalize_dtype(float if weak else value.dtype)
        # Of NumPy's arrays a copy: jax would share the memory of some, and the caller may write into it later.
        return jax.numpy.array(value, dtype) if isinstance(value, np.ndarray) else jax.numpy.asarray(value, dtype)
    if type(value) is int and abs(value) > LARGEST_SEED:
        # No integer type holds it, and perhaps no float type either.
        value = np.float64(value) if abs(value) < 10**300 else np.float64(np.inf)
    if eqx.is_array_like(value) and not _is_no_number(value):
        return jax.numpy.asarray(value, dtype=jax.dtypes.canonicalize_dtype(float))
    return _of_list(value) if isinstance(value, list) else value


def _of_list(values: list) -> Any:
    """A list of real numbers as an array, also of traced ones; others, which are no table of numbers, as they are."""
    leaves = jax.tree.leaves(values)
    if not leaves or not all(isinstance(one, int | float | np.generic | np.ndarray | jax.Array) for one in leaves):
        return values
    try:
        return float_array(jax.numpy.asarray(values, dtype=jax.dtypes.canonicalize_dtype(float)))
    except (TypeError, ValueError, OverflowError):
        return values


def check_numbers(name: str, value) -> None:
    """Raise `InputError` unless `value` is a real number, or an array or list of them. NaN passes, as a missing value."""
    check(name, value, lambda _: True, "or an array of them")


def real_array(name: str, value) -> Any:
    """Return what may be a number, an array or a list of numbers as an array of JAX; raises `InputError` for others."""
    check_numbers(name, value)
    return jax.numpy.asarray(value, None if hasattr(value, "dtype") else jax.dtypes.canonicalize_dtype(float))


def _is_no_number(value) -> bool:
    dtype = getattr(value, "dtype", np.dtype(complex if isinstance(value, complex) else float))
    return jax.numpy.issubdtype(dtype, jax.dtypes.extended) or np.dtype(dtype).kind in NOT_REAL

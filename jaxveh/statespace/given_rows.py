"""Rows as they are given: the channels of a recording, and the plain numbers of a live loop."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_numbers, check_single, is_concrete
from jaxveh._core.recording import Recording, gap_to_fill

COARSEST = 0.05
"""The coarsest resolution of a live loop's time, s: that of float32 after four days; at UNIX time stamps it is two minutes."""


def scalar_row(t, numbers: list, dtype, names: tuple[str, ...]) -> tuple:
    """A row's time (s) and numbers, each with its name, as scalars of a dtype, for a live loop.

    **Raises** `InputError` for a time that is not finite or that the dtype resolves too coarsely, and what is no number.
    """
    _check_stamp(t, dtype)
    for name, number in zip(names, numbers, strict=True):
        if getattr(number, "ndim", 0):
            check_single(**{f"row: {name}": number})
    try:
        return _scalars([t, *numbers], dtype)
    except (TypeError, ValueError):
        for name, number in zip(names, numbers, strict=True):
            check_numbers(f"row: {name}", np.nan if number is None else number)
        raise


def _check_stamp(t, dtype) -> None:
    """Raise `InputError` for a time so large that no digits are left for a step, and for one that is no finite number."""
    if not is_concrete(t):
        return
    if type(t) is not float:
        check_single(**{"row: t": t})
    if not np.isfinite(t):
        raise InputError(f"row: t = {t}: must be finite (s), in every row.")
    if np.spacing(np.abs(np.asarray(t, dtype))) > COARSEST:
        raise InputError(
            f"row: t = {float(t)} s has a resolution of {float(np.spacing(np.asarray(t, dtype))):.3g} s in "
            f"{np.dtype(dtype).name}: count time from the first row, or use float64."
        )


def _scalars(numbers: list, dtype) -> tuple:
    """Numbers as arrays, all at once: passing each one separately would take longer than computing a filter's step."""
    if is_concrete(*numbers) and not any(np.ndim(number) for number in numbers):
        return _split(np.array(numbers, dtype))
    return tuple(jnp.asarray(number, dtype) for number in numbers)


@jax.jit
def _split(vector):
    return tuple(vector)


def channel_values(recording: Recording, name: str, dtype, is_input: bool) -> jax.Array:
    """The values of a channel (T,) in a dtype. **Raises** `InputError` for infinite ones, and for NaN in an input."""
    values = recording[name]
    if is_concrete(values):
        array = np.asarray(values)
        if is_input and np.isnan(array).any():
            k = int(np.argmax(np.isnan(array)))
            if np.isnan(array).all():
                raise InputError(f"input channel {name} has no value in any row.")
            needed = gap_to_fill(recording, name)
            raise InputError(
                f"input channel {name} is NaN in {int(np.isnan(array).sum())} rows, first at t = {recording.time[k]} s: "
                f'an input must be known in every row. Fill it with: recording.fill("{name}", "linear", max_gap={needed:g}).'
            )
        if np.isinf(array).any():
            k = int(np.argmax(np.isinf(array)))
            raise InputError(
                f"channel {name} is {array[k]} at t = {recording.time[k]} s: must be finite, or NaN if missing."
            )
    return values.astype(dtype)

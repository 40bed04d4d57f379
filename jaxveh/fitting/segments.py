"""Recordings cut into segments of equal length, so that all of them are simulated as one batch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check
from jaxveh._core.host import check_on_host
from jaxveh._core.recording import Recording
from jaxveh.fitting.recorded import as_list
from jaxveh.statespace import Row, StateSpace, kit


class Segments(NamedTuple):
    """Rows as (W+1, K) leaves: K segments of W rows, the last row being the next segment's first.

    `linked`: (K,) whether the next segment continues this one. `first`: (K,) whether a recording starts here.
    """

    rows: Any
    linked: Any
    first: Any


KNOWN_TIMES = (
    "The times and the window decide how many segments there are, and must be known: let only the recordings' channels and the "
    "model be traced, or cut outside of them and give the segments to fitting.pose_shooting."
)


def cut(model: StateSpace, recordings: Recording | Sequence[Recording], window: float) -> Segments:
    """Cut recordings into segments of `window` seconds (of the first recording's median step, which must be known under `jit`).

    A window longer than every recording is as long as the longest. Raises `InputError` for one that is not positive, or shorter
    than two steps.
    """
    kit.check_model("cut", model)
    recordings = as_list(recordings)
    check_on_host("cut", [one.time for one in recordings], window, advice=KNOWN_TIMES)
    time = np.asarray(recordings[0].time)
    check("window", window, lambda _: True, "a time in seconds")
    step = float(np.median(np.diff(time))) if len(time) > 1 else np.inf
    longest = max(len(recording) for recording in recordings)
    length = round(min(window / step, max(longest, 2))) if window > 0 else 0
    if length < 2:
        raise InputError(f"window = {window} s: must span at least two steps of the recording.")
    parts = [cut_rows(model.rows(recording), length) for recording in recordings]
    # Which recording a segment belongs to is known before anything is traced.
    join = lambda *leaves: (np if isinstance(leaves[0], np.ndarray) else jnp).concatenate(leaves, axis=-1)
    return jax.tree.map(join, *parts)


def cut_rows(rows: Row, length: int) -> Segments:
    """Cut rows (T,) into segments of `length` rows: the pure part of `cut`."""
    count = rows.t.shape[0]
    if count < 3:
        raise InputError(f"recording has {count} rows: a fit needs at least 3.")
    segments = -(-count // length)
    index = np.arange(segments)[None, :] * length + np.arange(length + 1)[:, None]
    inside = index < count
    clipped = np.minimum(index, count - 1)
    take = lambda leaf: leaf[clipped]
    # Past the log's end: time continues evenly, inputs are held, nothing is measured.
    step = (rows.t[-1] - rows.t[0]) / (count - 1)
    t = take(rows.t) + jnp.asarray(index - clipped, rows.t.dtype) * step
    y = jax.tree.map(lambda leaf: jnp.where(inside, take(leaf), jnp.nan), rows.y)
    order = np.arange(segments)
    return Segments(Row(t, jax.tree.map(take, rows.u), y), order < segments - 1, order == 0)

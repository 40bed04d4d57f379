"""Columns with their own time stamps over one common time base."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from jaxveh._core.errors import InputError, check_one_of
from jaxveh._core.names import check_names
from jaxveh._core.recording import Recording, check_recording
from jaxveh.io.log import Column


def merge(columns: Mapping[str, Column]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return one time base (T,) with all time stamps of all columns, and each column's values (T,), NaN where it has no sample.

    Nothing is interpolated and no time stamp is moved: two that differ in the last bit are two rows. Columns without any
    sample are NaN throughout.
    """
    bases = list({id(column.time): column.time for column in columns.values()}.values())
    first = bases[0]
    if all(np.array_equal(first, base) for base in bases[1:]):
        return first, {name: column.values for name, column in columns.items()}
    time = np.unique(np.concatenate(bases))
    merged = {}
    for name, column in columns.items():
        merged[name] = np.full(time.shape, np.nan)
        merged[name][np.searchsorted(time, column.time)] = column.values
    return time, merged


def resample(recording: Recording, raster: str, method: str = "linear", max_gap: float = np.inf) -> Recording:
    """Return the rows in which channel `raster` has a measurement; the others are filled by `method`, `linear` or `hold`.

    Gaps longer than `max_gap` seconds stay NaN, and so do rows before the first sample of a channel and, with `linear`, after its
    last. No low-pass is applied: a channel with more samples than `raster` may alias. Runs on the host, outside jit.

    **Raises** `InputError` for an unknown channel or method, or if `raster` has no sample.
    """
    check_one_of("method", method, ("linear", "hold"))
    check_recording("resample", recording)
    check_names("resample: raster", [raster], recording.names)
    rows = np.isfinite(np.asarray(recording[raster]))
    if not rows.any():
        raise InputError(f"resample: {raster} has no finite sample; choose another raster.")
    filled = recording
    for name in recording.names:
        if np.isfinite(np.asarray(recording[name])).any():
            filled = filled.fill(name, method, max_gap)
    channels = {name: np.asarray(filled[name])[rows] for name in filled.names}
    return Recording(np.asarray(recording.time)[rows], channels, dict(recording.units), recording.source)

"""The ranges of an MF-Tyre and rig data: set to the measured ranges, or widened to contain the data."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxveh.fitting.rig_stages import varying_inputs
from jaxveh.io import RigTable
from jaxveh.tyres import MFTyre

RANGES = {
    "slip_ratio": ("KPUMIN", "KPUMAX"),
    "slip_angle": ("ALPMIN", "ALPMAX"),
    "camber": ("CAMMIN", "CAMMAX"),
    "load": ("FZMIN", "FZMAX"),
    "pressure": ("PRESMIN", "PRESMAX"),
}
"""Inputs and the names of their ranges."""

SIGNED = ("slip_ratio", "slip_angle", "camber")
"""Inputs of either sign: with data from a rig that only brakes, the tyre could not drive, so the larger end counts for both."""


class Widened(NamedTuple):
    """A range that was too narrow for the data: its `name`, and its value `before` and `after`."""

    name: str
    before: float
    after: float


def measured_ranges(tyre: MFTyre, rig: RigTable) -> MFTyre:
    """The tyre with the ranges of the rig data: outside them it holds the value at the edge and does not extrapolate.

    The ranges of slips and camber are symmetric; those of loads start at zero, where a wheel lifts. The range of an input
    that does not vary in the data stays unchanged.
    """
    varies = varying_inputs(rig)
    found = {}
    for name, (low, high) in RANGES.items():
        if name not in varies:
            continue
        values = getattr(rig, name)
        if name in SIGNED:
            reach = float(np.max(np.abs(values)))
            found |= {low: -reach, high: reach}
        elif name == "load":
            found |= {low: 0.0, high: float(np.max(values))}
        else:
            found |= {low: float(np.min(values)), high: float(np.max(values))}
    return _with(tyre, found)


def widened_ranges(tyre: MFTyre, rig: RigTable) -> tuple[MFTyre, tuple[Widened, ...]]:
    """The tyre with ranges that contain all data, and the ranges that were widened: rows outside would count as at the edge."""
    found = []
    for name, ends in RANGES.items():
        values = getattr(rig, name)
        if values is None:
            continue
        # Property files are in ISO-W, where the slip angle has the other sign.
        values = -values if name == "slip_angle" else values
        for key, value, beyond in zip(ends, (np.min(values), np.max(values)), (np.less, np.greater), strict=True):
            before = float(getattr(tyre.ranges, key))
            # FZMIN is not an edge of loads: below it moments fade.
            if key != "FZMIN" and beyond(value, before):
                found.append(Widened(key, before, float(value)))
    return _with(tyre, {one.name: one.after for one in found}), tuple(found)


def _with(tyre: MFTyre, ranges: dict[str, float]) -> MFTyre:
    dtype = tyre.ranges.FZMAX.dtype
    arrays = {name: jnp.asarray(value, dtype) for name, value in ranges.items()}
    return dataclasses.replace(tyre, ranges=dataclasses.replace(tyre.ranges, **arrays))

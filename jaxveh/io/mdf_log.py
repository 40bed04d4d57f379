"""MDF4 through asammdf: every channel group has its own time base."""

from __future__ import annotations

import gc
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, warn
from jaxveh.io.channel_map import ChannelMap
from jaxveh.io.log import Column, Log, numeric
from jaxveh.io.naming import check_known
from jaxveh.io.optional import quiet_finalizers, require

_TIME_SYNC = (0, 1)  # a master channel of no kind, or of time (others are of angle, distance or index)
_FRAME = re.compile(r"(?:CAN|LIN|FLX|ETH|MOST)_[A-Za-z]*(?:Frame|Error|Event|Pdu|Message|WakeUp|Spike)(?:\.\w+)*")
"""The names that ASAM's standard of bus logging gives to frames as they were on the bus, and to their parts."""


class MdfLog(Log):
    """An MDF file (version 3 or 4). Samples that the file marks as invalid are left out; texts are read as their raw numbers.

    `frames`: the channels that hold a bus's frames as they came, whose bytes are no measurement before they are decoded.
    """

    def __init__(self, path: Path, mdf: Any):
        self.path, self._mdf = path, mdf
        self.note = getattr(mdf.header, "description", "") or ""
        masters = set(mdf.masters_db.items())
        places = {name: [place for place in found if place not in masters] for name, found in mdf.channels_db.items()}
        self._places = {name: found for name, found in places.items() if found}
        # asammdf also finds `yaw_rate\\ETKC:1` by its part before the device; that is no channel of its own.
        called = lambda place: mdf.groups[place[0]].channels[place[1]].name
        names = [name for name, found in self._places.items() if name in map(called, found)]
        self.names = tuple(name for name in names if _FRAME.fullmatch(name) is None)
        self.frames = tuple(name for name in names if _FRAME.fullmatch(name) is not None)

    def column(self, name: str, group: int | None = None) -> Column:
        """Load one channel; `group` selects one if several groups have a channel of this name."""
        check_known(str(self.path), "channel", name, self._places, "Name the file's channel in the channel map.")
        groups = [place[0] for place in self._places[name]]
        found = [place for place in self._places[name] if group is None or place[0] == group]
        what = f"{self.path}: channel {name!r}"
        if len(found) != 1:
            asked = "no group is named" if group is None else f"group = {group}"
            there = ", ".join(map(str, sorted(set(groups))))
            if len(found) > 1 and len({place[0] for place in found}) == 1:
                full = [self._mdf.groups[one].channels[k].name for one, k in found]
                advice = "name one of them in full" if len(set(full)) > 1 else "rename one of them in the file"
                raise InputError(f"{what}: is {len(found)} times in group {found[0][0]} ({', '.join(full)}); {advice}.")
            raise InputError(f"{what}: {asked}, but it is in {there}; give one of them as `group` in the channel map.")
        self._check_master(found[0][0], what)
        try:
            signal = self._mdf.get(name, *found[0])
            if signal.samples.dtype.kind in "SUO" and signal.conversion is None:
                raw = self._mdf.get(name, *found[0], raw=True)
                signal = _of_words(raw) if raw.conversion is not None else signal
        except Exception as error:  # asammdf raises any kind of error for a damaged block
            raise InputError(f"{what}: cannot be read ({error}). Is the file damaged?") from error
        time = np.asarray(signal.timestamps, dtype=np.float64)
        if np.any(np.diff(time) <= 0):
            k = int(np.argmax(np.diff(time) <= 0))
            raise InputError(
                f"{what}: time[{k + 1}] = {time[k + 1]} after time[{k}] = {time[k]}: must be strictly increasing. "
                "Correct its group's time channel, or leave the channel out."
            )
        return Column(time, numeric(signal.samples, what), str(signal.unit or ""))

    def close(self) -> None:
        """Close the file."""
        self._mdf.close()

    def _check_master(self, group: int, what: str) -> None:
        master = self._mdf.masters_db.get(group)
        if master is None:
            raise InputError(f"{what}: its group {group} has no time channel. Leave the channel out.")
        if getattr(self._mdf.groups[group].channels[master], "sync_type", 1) not in _TIME_SYNC:
            raise InputError(f"{what}: its group {group} is not recorded over time. Leave the channel out.")


def _of_words(raw: Any) -> Any:
    """Return a signal whose samples are all words: as its raw numbers, or missing if its other values are measurements.

    SNA at 255 is no measurement in a channel that is linear elsewhere; `off` and `on` at 0 and 1 are their numbers.
    """
    parts = (raw.conversion.referenced_blocks or {}).values()
    if any(hasattr(part, "conversion_type") for part in parts):
        raw.samples = np.full(raw.samples.shape, np.nan)
    return raw


def open_mdf(path: Path, channels: ChannelMap | None) -> MdfLog:
    """Open an MDF3 or MDF4 file; time is each group's own master channel, and a time column in the channel map is not used.

    **Raises** `InputError` for a file that cannot be read, and for one that holds the frames of a bus alone.
    """
    asammdf = require("asammdf", "reading MDF4")
    with quiet_finalizers():
        try:
            log = MdfLog(path, asammdf.MDF(path))
        except Exception as error:  # asammdf raises any kind of error for a damaged block
            reason = str(error) or type(error).__name__
        else:
            return _told_of_frames(log)
        gc.collect()
    raise InputError(f"{path}: is not a readable MDF file ({reason}).")


def _told_of_frames(log: MdfLog) -> MdfLog:
    """Return the log; warn of frames of a bus beside its channels, and raise `InputError` for frames alone."""
    if not log.frames:
        return log
    story = f"{log.path}: holds frames of a bus that are not decoded ({log.frames[0]}, ...)"
    advice = "decode them with the DBC file of the bus into MDF4 (asammdf's extract_bus_logging)"
    if not log.names:
        log.close()
        raise InputError(f"{story}, and no other channel: {advice}.")
    warn(f"{story}; they are not read. If a channel is missing, {advice}.")
    return log


def _stored(values: np.ndarray) -> np.ndarray:
    """Return samples of a type that the writer supports: single precision for half."""
    return np.asarray(values, np.float32 if values.dtype.itemsize == 2 else None)


def write_mdf(
    path: Path, time: np.ndarray, columns: Mapping[str, np.ndarray], units: Mapping[str, str], note: str
) -> None:
    """Write one channel group of MDF 4.10 over one time base; NaN stays NaN, and the note becomes the header's comment."""
    asammdf = require("asammdf", "writing MDF4")
    signals = [
        asammdf.Signal(samples=_stored(values), timestamps=time, name=name, unit=units.get(name, ""))
        for name, values in columns.items()
    ]
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append(signals, acq_name="jaxveh", comment="", common_timebase=True)
        mdf.header.comment = note
        saved = mdf.save(path.with_suffix(".mf4"), overwrite=True)
    os.replace(saved, path)

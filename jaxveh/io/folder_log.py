"""A folder as one log: a file for each message of a CAN bus, or for each device, with times of their own on one clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from jaxveh._core.errors import InputError
from jaxveh.io.canonical import canonical_unit
from jaxveh.io.channel_map import Channel, ChannelMap
from jaxveh.io.log import Column, Log
from jaxveh.io.naming import check_known

TEXTS = (".txt", ".dat", ".log")
"""Suffixes that are also those of notes: read only where there are no others."""

Opener = Callable[[Path, ChannelMap | None], Log]


class FolderLog(Log):
    """The columns of all logs of a folder. One whose name several files have is `FILE/COLUMN`, and all can be named so.

    **Raises** `InputError` for a folder without logs, or with logs of several kinds, for a known channel that is in several
    files, and for times that do not meet.
    """

    def __init__(self, path: Path, channels: ChannelMap | None, openers: Mapping[str, Opener]):
        self.path, self.note = path, ""
        self._logs = {file.stem: openers[file.suffix.lower()](file, channels) for file in _files(path, openers)}
        places: dict[str, list[str]] = {}
        for stem, log in self._logs.items():
            for name in log.names:
                places.setdefault(name, []).append(stem)
        self._check_one_drive(places, channels)
        alone = {name: (stems[0], name) for name, stems in places.items() if len(stems) == 1}
        full = {f"{stem}/{name}": (stem, name) for name, stems in places.items() for stem in stems}
        self.names = tuple(
            name if len(stems) == 1 else f"{stem}/{name}" for name, stems in places.items() for stem in stems
        )
        self._places = full | alone

    def column(self, name: str, group: int | None = None) -> Column:
        stem, own = self._place(name)
        return self._logs[stem].column(own, group)

    def column_over(self, name: str, time: Channel) -> Column:
        stem, own = self._place(name)
        return self._logs[stem].column_over(own, time)

    def close(self) -> None:
        for log in self._logs.values():
            log.close()

    def _place(self, name: str) -> tuple[str, str]:
        check_known(str(self.path), "column", name, self._places, "Name the file's column in the channel map.")
        return self._places[name]

    def _check_one_drive(self, places: Mapping[str, list[str]], channels: ChannelMap | None) -> None:
        for name, stems in places.items():
            if len(stems) > 1 and canonical_unit(name) is not None and not (channels and channels.channels):
                raise InputError(
                    f"{self.path}: several of its files have a channel {name} ({', '.join(stems)}). If they are drives, give the "
                    f'files one by one; if messages of one drive, name one in a channel map: column = "{stems[0]}/{name}".'
                )
        spans = {stem: log.column(log.names[0]).time for stem, log in self._logs.items() if log.names}
        before: list[str] = []
        end = 0.0
        for stem, time in sorted(spans.items(), key=lambda one: float(one[1][0])):
            if before and time[0] > end:
                raise InputError(
                    f"{self.path}: the times of {stem} begin at {time[0]:.9g} s, after those of {', '.join(before)} have ended "
                    f"at {end:.9g} s: the files must have one clock. If they are drives, give them one by one."
                )
            before.append(stem)
            end = max(end, float(time[-1])) if len(before) > 1 else float(time[-1])


def _files(path: Path, openers: Mapping[str, Opener]) -> list[Path]:
    files = [one for one in sorted(path.iterdir()) if one.is_file() and not one.name.startswith(".")]
    logs = [one for one in files if one.suffix.lower() in openers]
    logs = [one for one in logs if one.suffix.lower() not in TEXTS] or logs
    kinds = sorted({one.suffix.lower() for one in logs})
    if not logs:
        raise InputError(f"{path}: is a folder without a log; one ends in {', '.join(openers)}.")
    if len(kinds) > 1:
        raise InputError(
            f"{path}: is a folder with logs of several kinds ({', '.join(kinds)}): give one file, or keep one kind."
        )
    return logs

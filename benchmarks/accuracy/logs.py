"""Real logs with a reference, and the parts of each for calibration and for estimation."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jaxveh import Recording, io

LOGS = {
    "Ferrari": ("ferrari_250lm_100hz.csv", "ferrari_250lm.toml"),
    "Genesis": ("genesis_100hz.csv", "genesis.toml"),
    "AV-21": ("av21_putnam_25hz.csv", "av21.toml"),
    "F1TENTH": ("f1tenth_100hz.csv", "f1tenth.toml"),
}
"""The logs by name: the log and its car file, in the folder of the shared data."""

ELSEWHERE = {"AV-21 at its reference's point": ("AV-21", (0.69, 0.0, 0.0))}
"""The same logs with another `reference_position` (m) than in their car file: the AV-21's v_y is that of a point 1.94 m ahead
of a rear axle that hardly slips (least squares of v_y / v_x on yaw_rate / v_x), 0.69 m ahead of the file's centre of gravity."""

REFERENCE = "v_y"
"""The reference channel, hidden from every estimate except in the settings that use it."""


class Log(NamedTuple):
    """A log with its reference, and the car file."""

    name: str
    car: io.CarSpecification
    recording: Recording


class Setting(NamedTuple):
    """The spans of an estimate.

    `calibrate`: start and end of the calibration (s), None for the values of the car file; `estimate`: those of the scored part;
    `uses`: the references of the calibration.
    """

    name: str
    calibrate: tuple[float, float] | None
    estimate: tuple[float, float]
    uses: tuple[str, ...] = ()


def folder() -> Path:
    """Return the folder of the shared data: `JAXVEH_SHARED`, or `shared` beside the project."""
    return Path(os.environ.get("JAXVEH_SHARED", Path(__file__).resolve().parents[3] / "shared")) / "data"


def read(name: str) -> Log:
    """Read a log of `LOGS` or of `ELSEWHERE`."""
    if name in ELSEWHERE:
        same, place = ELSEWHERE[name]
        log = read(same)
        return Log(name, dataclasses.replace(log.car, reference_position=place), log.recording)
    log, car = LOGS[name]
    return Log(name, io.read_car(folder() / car), io.read_recording(folder() / log))


def settings(log: Log) -> Iterator[Setting]:
    """Yield the settings of a log.

    They are: each half calibrated on the other, the rest on the first 60 and 30 s, the whole on itself without its reference, and
    the values of the car file; a calibration on a part is also done with the reference of that part.
    """
    time = np.asarray(log.recording.time)
    start, end = float(time[0]), float(time[-1])
    middle = 0.5 * (start + end)
    parts = {
        "forward": ((start, middle), (middle, end)),
        "reversed": ((middle, end), (start, middle)),
        "first 60 s": ((start, start + 60.0), (start + 60.0, end)),
        "first 30 s": ((start, start + 30.0), (start + 30.0, end)),
    }
    for name, (calibrated, estimated) in parts.items():
        yield Setting(f"{name}, blind", calibrated, estimated)
        yield Setting(f"{name}, with {REFERENCE}", calibrated, estimated, (REFERENCE,))
    yield Setting("itself, blind", (start, end), (start, end))
    yield Setting("as told", None, (start, end))

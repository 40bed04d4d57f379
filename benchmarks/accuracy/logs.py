"""Real logs with a reference, and what of each is calibrated on and what is estimated."""

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
"""By name: the log, and the file of its car, in the folder of the shared data."""

ELSEWHERE = {"AV-21 at its reference's point": ("AV-21", (0.69, 0.0, 0.0))}
"""The same logs with another `reference_position` (m) than their car's file says: the AV-21's v_y is that of a point 1.94 m ahead
of a rear axle that hardly slips (least squares of v_y / v_x on yaw_rate / v_x), 0.69 m ahead of the file's centre of gravity."""

REFERENCE = "v_y"
"""The channel that no estimate sees, but for the settings with it."""


class Log(NamedTuple):
    """A log with its reference, and the car's file."""

    name: str
    car: io.CarSpecification
    recording: Recording


class Setting(NamedTuple):
    """`calibrate`: start and end of the calibration (s), None for the car's file at its word; `estimate`: of what is scored;
    `uses`: the references that the calibration sees."""

    name: str
    calibrate: tuple[float, float] | None
    estimate: tuple[float, float]
    uses: tuple[str, ...] = ()


def folder() -> Path:
    """Where the shared data are: `JAXVEH_SHARED`, or `shared` beside the project."""
    return Path(os.environ.get("JAXVEH_SHARED", Path(__file__).resolve().parents[3] / "shared")) / "data"


def read(name: str) -> Log:
    """A log of `LOGS`, or of `ELSEWHERE`."""
    if name in ELSEWHERE:
        same, place = ELSEWHERE[name]
        log = read(same)
        return Log(name, dataclasses.replace(log.car, reference_position=place), log.recording)
    log, car = LOGS[name]
    return Log(name, io.read_car(folder() / car), io.read_recording(folder() / log))


def settings(log: Log) -> Iterator[Setting]:
    """What is done with a log: each half from the other, the rest from the first 60 and 30 s, the whole from itself without its
    reference, and the car's file at its word; what is calibrated on a part also with the reference of that part."""
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

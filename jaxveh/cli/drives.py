"""Logs for the programs of sideslip: read, cut to a span, and checked before they are used."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import NamedTuple

from jaxveh import InputError, Recording, diagnostics, estimators, io
from jaxveh.cli import options
from jaxveh.cli.blanking import fill_gaps
from jaxveh.cli.console import results
from jaxveh.cli.log_errors import check_trusted, tell
from jaxveh.cli.missing_speed import sources_of_speed, with_speed
from jaxveh.cli.several_logs import SeveralLogs
from jaxveh.io import CarSpecification

BRIDGED = 0.1
"""Longest gap that resampling fills, s."""

UNLIKE, SURE = 1.25, 0.8
"""Ratio of two logs' steer scales, and least correlation of each scale, above which the logs are taken for two cars'.

A steer scale is the measured steer over the steer that the car of the file needs. Quarters of one log differ by up to 1.17 (three
real logs), logs of different cars by 1.1 to 1.5: some logs of different cars are not recognised.
"""


class Drive(NamedTuple):
    """A log's file, the part of it that is used, and the findings of `check` about that part."""

    log: Path
    recording: Recording
    findings: Sequence[diagnostics.LogFinding] = ()


def read_drives(
    several: SeveralLogs,
    car: CarSpecification,
    channels: Path | None,
    fill: float | None,
    span: str | None,
    used: Collection[str],
    anyway: bool,
) -> dict[Path, Drive]:
    """Read the logs, cut each to its span, fill gaps of inputs on request, and check each; without those that are refused.

    The warnings of `check` are printed. A log is refused if `check` finds errors in channels that are `used`, unless `anyway` is
    set. **Raises** `InputError` for a file that is named twice (a fit to it would seem surer than it is).
    """
    files = [log.resolve() for log in several.logs]
    if twice := [log for log, file in zip(several.logs, files, strict=True) if files.count(file) > 1]:
        raise InputError(f"{twice[1]}: the log is named twice; name each log once.")

    def read(log: Path) -> Drive:
        measured = _on_one_clock(log, _read(log, car, channels, span))
        recording = fill_gaps(with_speed(log, measured, car), fill)
        reads = {*used, *sources_of_speed(measured, car)}
        return Drive(log, recording, _look_at(log, recording, car, reads, reads, anyway))

    drives = several.each(read, {log: log for log in several.logs})
    if not anyway:
        _check_one_car(list(drives.values()))
    return drives


def read_log(
    log: Path,
    car: CarSpecification,
    channels: Path | None,
    span: str | None,
    truth: str | None,
    reads: Callable[[Recording], Collection[str]],
    anyway: bool,
) -> Drive:
    """Read one log, cut it to its span, and check it; errors in channels that something `reads` are printed as such.

    **Raises** `InputError` if `check` finds errors in the time or in the `truth`, unless `anyway` is set.
    """
    recording = _read(log, car, channels, span)
    used = () if truth is None else (truth,)
    return Drive(log, recording, _look_at(log, recording, car, used, {*used, *reads(recording)}, anyway))


def _read(log: Path, car: CarSpecification, channels: Path | None, span: str | None) -> Recording:
    recording = io.with_road_steer(car, io.read_recording(log, channels))
    if "steering_wheel" in recording and "steer" not in recording:
        words = "note: steering_wheel is not used: the car's file has no steering_ratio."
        results().print(f"{log.name}: {words}", markup=False, soft_wrap=True)
    wanted = options.span_of(span, float(recording.time[0]), float(recording.time[-1]), "--span")
    return recording if wanted is None else recording.between(*wanted)


def _on_one_clock(log: Path, recording: Recording) -> Recording:
    """Resample the log at the rows of its yaw rate, with a note, if yaw rate and a_y are never measured in the same row."""
    if not estimators.sideslip.speak_apart(recording):
        return recording
    words = (
        f"note: {log.name}: a_y and yaw_rate have separate clocks: all channels are interpolated linearly at the rows of "
        f"yaw_rate, over at most {BRIDGED:g} s."
    )
    results().print(words, markup=False, soft_wrap=True)
    return io.resample(recording, "yaw_rate", max_gap=BRIDGED)


def _check_one_car(drives: Sequence[Drive]) -> None:
    """Raise `InputError` if logs look like those of different cars: measured steer over needed steer differs between them."""
    scales = {}
    for drive in drives:
        for finding in drive.findings:
            if "scale" in finding.values and finding.values["correlation"] > SURE:
                scales[drive.log] = finding.values["scale"]
    if len(scales) < 2:
        return
    order = sorted(scales, key=lambda log: scales[log])
    small, large = order[0], order[-1]
    if scales[large] > UNLIKE * scales[small]:
        cut = max(range(1, len(order)), key=lambda k: scales[order[k]] / scales[order[k - 1]])
        alike = " and ".join(", ".join(log.name for log in group) for group in (order[:cut], order[cut:]))
        raise InputError(
            f"{large}: looks like a log of another car than {small}: in gentle turns its steer is {scales[large]:.2f} times the "
            f"steer that the car of the file needs, in the other {scales[small]:.2f} times. Alike are {alike}. "
            "Run the program once for each car, with its own --vehicle; if all are of one car, --anyway continues."
        )


def _look_at(
    log: Path, recording: Recording, car: CarSpecification, used: Collection[str], read: Collection[str], anyway: bool
) -> Sequence[diagnostics.LogFinding]:
    findings = diagnostics.check_log(recording, car=car)
    tell(log, findings, read)
    if not anyway:
        check_trusted(log, findings, used)
    return findings

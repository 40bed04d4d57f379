"""Logs of a RaceCapture, drawn from a seed, against the drive that they hold; and what else ends in `.log`."""

import random

import numpy as np
import pytest

from jaxveh import InputError, io

ROWS = 30
KINDS = {
    "Speed": ("v_x", [("MPH", 1 / 0.44704), ("KPH", 3.6), ("km/h", 3.6)]),
    "Yaw": ("yaw_rate", [("Deg/Sec", 180 / np.pi), ("deg/sec", 180 / np.pi)]),
    "AccelY": ("a_y", [("G", 1 / 9.80665), ("g", 1 / 9.80665)]),
    "Steering, left": ("steer", [("Degrees", 180 / np.pi), ("deg", 180 / np.pi)]),
}


def log_of(draw):
    """A sparse log as text, and what it holds by channel: times since the start, and values with NaN between samples."""
    columns = draw.sample(list(KINDS), draw.randrange(1, len(KINDS) + 1))
    units = {column: draw.choice(KINDS[column][1]) for column in columns}
    time = draw.choice([0, 1_166_042]) + np.cumsum([draw.choice([10, 20, 50]) for _ in range(ROWS)])
    truth, cells = {}, {}
    for column in columns:
        there = np.array([draw.random() < 0.6 for _ in range(ROWS)])
        there[0] = True
        raw = np.where(there, np.round(10 * np.sin(time / 300), 3), np.nan)
        truth[column] = raw / units[column][1]
        cells[column] = ["" if np.isnan(one) else f"{one:.3f}" for one in raw]
    head = [f'"{name}"|"{units[name][0]}"|{draw.choice(["0", "-2.5"])}|100.0|25' for name in columns]
    more = {'"RPM"|""|0|10000|10': [draw.choice(["", "4006"]) for _ in range(ROWS)]}
    if draw.random() < 0.5:
        # Older ones pack hours, minutes and seconds of a satellite's time.
        more['"Time"|"Time"|0|0|1'] = [draw.choice(["", "215623.938"]) for _ in range(ROWS)]
    head = ['"Interval"|"ms"|0|0|1', *head, *more]
    rows = zip([str(one) for one in time], *cells.values(), *more.values(), strict=True)
    return "\n".join([",".join(head), *map(",".join, rows), ""]), time / 1000.0, truth


def written(folder, draw, text):
    path = folder / f"rc_7{draw.choice(['.log', '.LOG', '.csv', '.txt'])}"
    path.write_bytes(text.replace("\n", draw.choice(["\n", "\r\n"])).encode(draw.choice(["utf-8", "utf-8-sig"])))
    return path


@pytest.mark.parametrize("seed", range(24))
@pytest.mark.filterwarnings("ignore:left out:jaxveh.JaxvehWarning")
def test_a_log_of_a_race_capture_is_the_drive(tmp_path, seed):
    draw = random.Random(seed)
    text, time, truth = log_of(draw)
    path = written(tmp_path, draw, text)
    mapped = io.read_recording(path, io.ChannelMap({KINDS[name][0]: name for name in truth}))
    whole = io.read_recording(path)
    for found in (mapped, whole):
        np.testing.assert_allclose(found.time, time, rtol=1e-12)
    for column, values in truth.items():
        np.testing.assert_allclose(mapped[KINDS[column][0]], values, rtol=1e-6, atol=1e-9)
        assert column in whole.names and whole.unit(column) != "-"
    told = io.read_recording(path, io.ChannelMap({}, time=io.Channel("Interval", offset=-500.0)))
    np.testing.assert_allclose(told.time, time - 0.5, rtol=1e-12)


def test_names_that_come_again_are_two_drives(tmp_path):
    text, _, _ = log_of(random.Random(3))
    (tmp_path / "rc_0.log").write_text(text + text)
    with pytest.raises(InputError, match=rf"data row {ROWS + 1} holds the names of the columns again: several drives"):
        io.read_recording(tmp_path / "rc_0.log")


@pytest.mark.parametrize(
    "line",
    [
        "(1631416514.717133) can0 0D2#0000FFFF10000000",
        " (1631416514.717133)  vcan1  18FEF100   [8]  00 00 FF FF 10 00 00 00",
        "(000.000000) can0 0D3##10006E00F000011",
    ],
)
def test_the_frames_of_a_bus_are_told_as_that(tmp_path, line):
    (tmp_path / "bus.log").write_text(f"{line}\n" * 4)
    with pytest.raises(
        InputError, match=r"bus.log: holds the frames of a CAN bus: decode it with its DBC file into MDF4"
    ):
        io.read_recording(tmp_path / "bus.log")

"""Logs in parts: seconds beside nanoseconds, a file for each message of a bus, names that stand below one another."""

import numpy as np
import pytest

from jaxveh import InputError, JaxvehWarning, io

BEGIN = 1_700_000_000


def write(path, names, *columns):
    rows = zip(*columns, strict=True)
    path.write_text("\n".join([",".join(names), *(",".join(str(cell) for cell in row) for row in rows)]) + "\n")
    return path


@pytest.mark.parametrize(("whole", "part"), [("secs", "nsecs"), ("sec", "nanosec"), ("Seconds", "NanoSeconds")])
@pytest.mark.parametrize("stem", ["", "header.stamp.", "/imu/"])
@pytest.mark.parametrize("named", [False, True])
def test_seconds_and_nanoseconds_are_one_time(tmp_path, whole, part, stem, named):
    nanoseconds = np.arange(25) * 40_000_000 + 7
    names = [f"{stem}{part}", "w", f"{stem}{whole}"]
    path = write(tmp_path / "log.csv", names, nanoseconds % 10**9, np.arange(25), BEGIN + nanoseconds // 10**9)
    told = io.ChannelMap({"yaw_rate": "w"}, time=names[2]) if named else None
    found = io.read_recording(path, told)
    assert found.names == ("yaw_rate" if named else "w",)
    np.testing.assert_allclose(found.time - BEGIN, 1e-9 * nanoseconds, atol=3e-7)


def test_of_several_pairs_one_is_named(tmp_path):
    columns = np.arange(5) + BEGIN, np.zeros(5, int), np.arange(5), np.zeros(5, int), np.arange(5)
    path = write(tmp_path / "log.csv", ["a.sec", "a.nanosec", "b.sec", "b.nanosec", "w"], *columns)
    with pytest.raises(
        InputError, match=r'several pairs .*\(a.sec and a.nanosec; b.sec and b.nanosec\).* time = "a.sec"'
    ):
        io.read_recording(path)
    np.testing.assert_allclose(io.read_recording(path, io.ChannelMap({"w": "w"}, time="b.sec")).time, np.arange(5))
    only = write(tmp_path / "only.csv", ["sec", "w"], np.arange(5), np.arange(5))
    with pytest.raises(InputError, match="no time column"):
        io.read_recording(only)


def folder(tmp_path, seed=0):
    """Three messages, each with its own rows and one name that all have, beside notes."""
    rng = np.random.default_rng(seed)
    parts = {"esp": ("yaw_rate", "a_y"), "wheels": ("v_x",), "eps": ("steer",)}
    there = {}
    for number, (stem, names) in enumerate(parts.items()):
        time = np.round(np.sort(rng.uniform(0.0, 10.0, 40 + number)), 4)
        time = np.unique(np.concatenate([[0.001 * number], time]))
        values = {name: np.round(rng.normal(size=time.size), 3) for name in ("counter", *names)}
        write(tmp_path / f"{stem}.csv", ["time", *values], time, *values.values())
        there |= {(stem, name): (time, one) for name, one in values.items()}
    (tmp_path / "notes.txt").write_text("dry road\n")
    (tmp_path / ".hidden.csv").write_text("no log")
    return there


@pytest.mark.parametrize("seed", range(3))
def test_a_folder_is_one_log(tmp_path, seed):
    there = folder(tmp_path, seed)
    found = io.read_recording(tmp_path)
    assert np.array_equal(found.time, np.unique(np.concatenate([time for time, _ in there.values()])))
    for (stem, name), (time, values) in there.items():
        channel = np.asarray(found[f"{stem}/counter" if name == "counter" else name])
        known = np.isfinite(channel)
        assert np.array_equal(found.time[known], time)
        np.testing.assert_array_equal(channel[known], values)
    told = io.ChannelMap({"yaw_rate": io.Channel("esp/yaw_rate", sign=-1), "rank": "eps/counter"})
    mapped = io.read_recording(tmp_path, told, raster="yaw_rate")
    np.testing.assert_array_equal(mapped["yaw_rate"], -there["esp", "yaw_rate"][1])
    with pytest.raises(InputError, match=r"no column 'esp/yawrate' \(did you mean 'esp/yaw_rate'\?\)"):
        io.read_recording(tmp_path, io.ChannelMap({"yaw_rate": "esp/yawrate"}))


def test_what_is_no_drive_in_a_folder_is_told(tmp_path):
    with pytest.raises(InputError, match=r"is a folder without a log; one ends in \.csv"):
        io.read_recording(tmp_path)
    folder(tmp_path)
    late = write(tmp_path / "late.csv", ["time", "p"], np.arange(5) + 100, np.arange(5))
    with pytest.raises(
        InputError, match=r"the times of late begin at 100 s, after those of .* have ended at .* one clock"
    ):
        io.read_recording(tmp_path)
    write(late, ["time", "v_x"], np.arange(5), np.arange(5))
    with pytest.raises(
        InputError, match=r'several of its files have a channel v_x \(late, wheels\).* column = "late/v_x"'
    ):
        io.read_recording(tmp_path)
    late.rename(tmp_path / "late.tsv")
    with pytest.raises(InputError, match=r"logs of several kinds \(\.csv, \.tsv\)"):
        io.read_recording(tmp_path)


HEAD = ["%DataLog%", "DataLogVersion : 1.1", "Software : Haltech NSP", "DownloadDateTime : 20240301 10:00:00"]
KINDS = {
    "Vehicle Speed": "Speed",
    "Yaw Rate": "AngularVelocity",
    "Lateral G": "Acceleration",
    "Gear": "Gear",
    "State": None,
}


def haltech(path, rows):
    """As NSP exports: each channel in lines of its own, then times of day and whole numbers, here around midnight."""
    lines = list(HEAD)
    for number, (name, kind) in enumerate(KINDS.items()):
        lines += [
            f"Channel : {name}",
            f"ID : {number}",
            *([f"Type : {kind}"] if kind else []),
            "DisplayMaxMin : 4000,0",
        ]
    lines += ["Log Source : 20", "Log Number : 1", "Log : 20240301 10:00:00"]
    for k, row in enumerate(rows):
        ms = (86_399_500 + 50 * k) % 86_400_000
        clock = f"{ms // 3_600_000:02d}:{ms // 60_000 % 60:02d}:{ms // 1000 % 60:02d}.{ms % 1000:03d}"
        lines.append(",".join([clock, *map(str, row)]))
    path.write_text("\r\n".join(lines) + "\r\n", newline="")
    return path


def test_a_log_of_haltech(tmp_path):
    rows = np.random.default_rng(0).integers(-900, 900, (30, len(KINDS)))
    rows[3, 1] = 2_147_483_647
    path = haltech(tmp_path / "log.csv", rows)
    with pytest.warns(JaxvehWarning, match=r"0\.1 km/h.* without a unit: Gear \(Gear\), State \(Raw\)"):
        found = io.read_recording(path)
    np.testing.assert_allclose(np.diff(found.time), 0.05, atol=1e-9)
    steps = {
        "Vehicle Speed": (0.1, "km/h"),
        "Yaw Rate": (0.1, "deg/s"),
        "Lateral G": (1e-3, "g"),
        "Gear": (1, "-"),
        "State": (1, "-"),
    }
    for column, (name, (step, unit)) in enumerate(steps.items()):
        expected = np.where(rows[:, column] > 1e9, np.nan, step * rows[:, column])
        np.testing.assert_allclose(found[name], expected)
        assert found.unit(name) == unit
    with pytest.warns(JaxvehWarning):
        mapped = io.read_recording(path, io.ChannelMap({"v_x": "Vehicle Speed"}))
    np.testing.assert_allclose(mapped["v_x"], rows[:, 0] / 36.0)


@pytest.mark.parametrize(("cut", "words"), [("\r\n23:59", "has no channel or no row"), (",State", "")])
def test_a_broken_log_of_haltech_is_told(tmp_path, cut, words):
    path = haltech(tmp_path / "log.csv", np.ones((3, len(KINDS)), int))
    text = path.read_text()
    path.write_text(text[: text.index("23:59")] if words else text.replace("Channel : State", "Note : State"))
    with pytest.raises(InputError, match=words or "rows have 6 cells, expected 5"):
        io.read_recording(path)

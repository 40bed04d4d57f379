"""Text as loggers write it: lines above the names, lines of units, separators, decimal signs, encodings, time stamps."""

import datetime
import random
import warnings

import numpy as np
import pytest

from jaxveh import InputError, JaxvehWarning, Recording, io

ROWS = 12
TIME = np.round(0.5 + 0.02 * np.arange(ROWS), 6)
TRUTH = {
    "v_x": np.round(20.0 + np.sin(TIME), 6),
    "yaw_rate": np.round(0.3 * np.cos(TIME), 6),
    "a_y": np.round(-2.0 * np.sin(TIME), 6),
}
UNITS = {
    "time": [("s", 1.0), ("ms", 1e3), ("sec", 1.0)],
    "v_x": [("km/h", 3.6), ("m/s", 1.0), ("KPH", 3.6), ("mph", 1 / 0.44704)],
    "yaw_rate": [("deg/s", 180 / np.pi), ("°/s", 180 / np.pi), ("rad/s", 1.0), ("DEG/S", 180 / np.pi)],
    "a_y": [("m/s²", 1.0), ("g", 1 / 9.80665), ("G", 1 / 9.80665), ("m/s^2", 1.0)],
}
ABOVE = {
    "nothing": "",
    "words": "Logger 7\nDriver{s}A. N. Other\n\n",
    "pairs of cells": '"Format"{s}"CSV"\n"Rate"{s}"50"\n"Beacons"{s}"1.5 3.25"\n\n',
    "comments": "# logger 7\n# 50 Hz\n",
    "an odd quote": 'Wheel: 18"\nVersion 1.2\n',
}


def cells(number, decimal):
    return f"{number:.9f}".replace(".", decimal)


def log_of(seed):
    """A log in a form drawn from a seed: its bytes, and whether lines above its names are to be told of."""
    draw = random.Random(seed)
    separator = draw.choice([",", ";", "\t", "|", " "])
    decimal = draw.choice([".", ","]) if separator != "," else "."
    names = ["time", *draw.sample(sorted(TRUTH), 3)]
    units = {name: draw.choice(UNITS[name]) for name in names}
    place = draw.choice(["brackets", "round", "line"]) if separator != " " else draw.choice(["close", "line"])
    form = {"brackets": "{} [{}]", "round": "{} ({})", "close": "{}[{}]", "line": "{}"}[place]
    head = [form.format(name, units[name][0]) for name in names]
    quote = '"' if separator != " " and draw.random() < 0.3 else ""
    join = lambda row, end="": separator.join(f"{quote}{cell}{quote}" for cell in row) + end
    above = draw.choice([one for one in ABOVE if separator != " " or one in ("nothing", "comments")])
    lines = ABOVE[above].format(s=separator).splitlines()
    lines += [join(head)] + ([join(units[name][0] for name in names)] if place == "line" else [])
    lines += [""] * draw.choice([0, 0, 2])
    table = np.column_stack([factor * {"time": TIME, **TRUTH}[name] for name, (_, factor) in units.items()])
    end = draw.choice(["", separator]) if separator in ",;" else ""
    lines += [join((cells(number, decimal) for number in row), end) for row in table]
    lines += draw.choice([[], [""], ["", ""], [separator * 3] if separator != " " else []])
    text = draw.choice(["\n", "\r\n"]).join([*lines, ""])
    encoding = draw.choice(["utf-8", "utf-8-sig", "utf-16", "cp1252"])
    told = above not in ("nothing", "comments")
    return text.encode(encoding), told, encoding == "cp1252" and not text.isascii()


@pytest.mark.parametrize("block", range(6))
def test_every_form_is_the_same_log(tmp_path, block):
    for seed in range(40 * block, 40 * block + 40):
        data, told, foreign = log_of(seed)
        path = tmp_path / f"log{random.Random(seed).choice(['.csv', '.txt', '.tsv', '.dat', '.CSV', '.log'])}"
        path.write_bytes(data)
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always")
            recording = io.read_recording(path)
        words = " ".join(str(one.message) for one in heard)
        assert ("the lines above are not read" in words) == told, (seed, words)
        assert ("read as Windows-1252" in words) == foreign, (seed, words)
        assert set(recording.names) == set(TRUTH), seed
        np.testing.assert_allclose(recording.time, TIME, atol=1e-8, err_msg=str(seed))
        for name, values in TRUTH.items():
            np.testing.assert_allclose(recording[name], values, atol=1e-7, err_msg=f"{seed} {name}")


def read(path, text, channels=None, encoding="utf-8"):
    path.write_bytes(text.encode(encoding))
    return io.read_recording(path, channels)


ROUND = {"km/h": 10.0, "KPH": 10.0, "mph": 36 * 0.44704, "m/s": 36.0, "kmh": 10.0}


@pytest.mark.parametrize("unit", ROUND)
@pytest.mark.parametrize("space", ["", " "])
def test_a_unit_in_round_brackets_holds_for_a_mapped_column(tmp_path, unit, space):
    text = f"time,Speed{space}({unit})\n0,36\n1,36\n"
    for column in (f"Speed{space}({unit})", "Speed"):
        found = read(tmp_path / "log.csv", text, io.ChannelMap({"v_x": column}))
        np.testing.assert_allclose(found["v_x"], [ROUND[unit]] * 2)


@pytest.mark.parametrize("word", ["GPS", "fl", "l", "r", "c", "x", "max", "min", "2", "front left", "can1", "raw"])
def test_a_word_in_round_brackets_is_no_unit(tmp_path, word):
    found = read(tmp_path / "log.csv", f"time,Speed ({word})\n0,36\n1,36\n")
    assert found.names == (f"Speed ({word})",) and found.unit(f"Speed ({word})") == "-"
    found = read(tmp_path / "log.csv", f"time,Speed ({word})\n0,36\n1,36\n", io.ChannelMap({"v_x": f"Speed ({word})"}))
    np.testing.assert_array_equal(found["v_x"], [36.0, 36.0])


@pytest.mark.parametrize("seed", range(12))
def test_rows_that_are_too_short_are_told(tmp_path, seed):
    """Some rows, or the last one of a file that was cut, end early: how many, the first line, and what is missing."""
    draw = random.Random(seed)
    separator, end = draw.choice([",", ";", "\t", "|", " "]), draw.choice(["\n", "\r\n"])
    names, path = ["time", *TRUTH], tmp_path / f"log{draw.choice(['.csv', '.txt', '.dat'])}"
    rows = [[repr(float(cell)) for cell in row] for row in zip(TIME, *TRUTH.values(), strict=True)]
    short = sorted(draw.sample(range(3, ROWS), draw.randint(1, 4))) if draw.random() < 0.7 else [ROWS - 1]
    kept = {row: draw.randint(2, len(names) - 1) for row in short}
    above = draw.choice(["", "# logger 7", "# a|b;c,d"] if separator != " " else [""])
    lines = [separator.join(row[: kept.get(k, len(row))]) for k, row in enumerate(rows)]
    path.write_bytes(end.join([above, separator.join(names), *lines][not above :]).encode())
    with pytest.warns(JaxvehWarning) as told:
        found = io.read_recording(path)
    words = next(str(one.message) for one in told if "fewer cells" in str(one.message))
    assert f"{len(short)} row" in words and f"line {short[0] + 2 + bool(above)}:" in words
    assert f"NaN, in {', '.join(names[min(kept.values()) :])}. " in words
    for column, name in enumerate(TRUTH, 1):
        missing = [k for k in short if kept[k] <= column]
        assert np.flatnonzero(np.isnan(found[name])).tolist() == missing
    full = [separator.join("" if draw.random() < 0.2 and k else cell for k, cell in enumerate(row)) for row in rows]
    if separator != " ":
        path.write_bytes(end.join([separator.join(names), *full, ""]).encode())
        with warnings.catch_warnings():
            warnings.filterwarnings("error", "fewer cells")
            io.read_recording(path)


def test_the_same_name_in_two_units(tmp_path):
    text = "time,Speed (km/h),Speed (mph)\n0,36,22\n1,36,22\n"
    recording = read(tmp_path / "log.csv", text)
    assert recording.names == ("Speed (km/h)", "Speed (mph)")
    assert recording.unit("Speed (mph)") == "mph"
    chosen = read(tmp_path / "log.csv", text, io.ChannelMap({"v_x": "Speed (mph)"}))
    np.testing.assert_allclose(chosen["v_x"], [22 * 0.44704] * 2)


@pytest.mark.parametrize("cell", ["1.234", "1.234,5", "12.5"])
def test_a_point_is_no_decimal_sign_beside_a_decimal_comma(tmp_path, cell):
    told = io.ChannelMap({"v_x": "v_x"}, separator=";", decimal=",")
    with pytest.raises(InputError, match=rf"column 'v_x', data row 1: '{cell}' is not a number"):
        read(tmp_path / "log.csv", f"time;v_x\n0,1;{cell}\n0,2;{cell}\n", told)


STAMPS = {
    "ISO 8601": lambda at: at.isoformat(timespec="milliseconds"),
    "ISO 8601, UTC": lambda at: at.isoformat(timespec="microseconds") + "Z",
    "ISO 8601, with a zone": lambda at: (
        (at + datetime.timedelta(hours=2)).isoformat(timespec="milliseconds") + "+02:00"
    ),
    "a blank": lambda at: at.strftime("%Y-%m-%d %H:%M:%S.%f"),
    "a comma": lambda at: at.strftime("%Y-%m-%d %H:%M:%S,%f")[:-3],
    "a date with dots": lambda at: at.strftime("%d.%m.%Y %H:%M:%S,%f"),
    "a short date with dots": lambda at: f"{at.day}.{at.month}.{at.year} {at.hour}:{at.strftime('%M:%S.%f')}",
    "a month by name": lambda at: f"{at.day}-{at.strftime('%b-%Y %H:%M:%S.%f')}",
    "a month by its long name": lambda at: at.strftime("%d %B %Y %H:%M:%S.%f"),
    "a date with slashes": lambda at: at.strftime("%Y/%m/%d %H:%M:%S.%f"),
    "a date with slashes and twelve hours": lambda at: at.strftime("%Y/%m/%d %I:%M:%S.%f %p"),
    "time of day": lambda at: at.strftime("%H:%M:%S.%f")[:-3],
    "time of day, comma": lambda at: at.strftime("%H:%M:%S,%f"),
    "days": lambda at: f"0 days {at.strftime('%H:%M:%S.%f')}",
    "minutes": lambda at: f"{60 * at.hour + at.minute}:{at.strftime('%S.%f')}",
}
MIDNIGHT = datetime.datetime(2024, 3, 1)


@pytest.mark.parametrize("form", STAMPS)
@pytest.mark.parametrize("hour", [0.5, 10.0, 23.99999])
def test_time_stamps_become_seconds(tmp_path, form, hour):
    steps = np.arange(5) * 0.25
    if hour > 23 and form in ("days", "minutes"):
        hour = 22.0  # they go on, and do not begin again at midnight
    begin = MIDNIGHT + datetime.timedelta(seconds=round(3600 * hour, 3))
    lines = [f"{STAMPS[form](begin + datetime.timedelta(seconds=step))};{k}" for k, step in enumerate(steps)]
    recording = read(tmp_path / "log.csv", "\n".join(["time;v_x", *lines]) + "\n")
    np.testing.assert_allclose(recording.time - recording.time[0], steps, atol=1e-6)
    since = begin.replace(tzinfo=datetime.UTC).timestamp() if form.startswith(("ISO", "a ")) else 3600 * hour
    np.testing.assert_allclose(recording.time[0], since, atol=1e-2)


@pytest.mark.parametrize("order", ["%d/%m/%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S.%f"])
@pytest.mark.parametrize("day", [1, 5, 12, 13, 31])
def test_dates_with_slashes_are_read_if_a_row_tells_their_order(tmp_path, order, day):
    begin = datetime.datetime(2024, 3, day, 23, 59, 58)
    times = [begin + datetime.timedelta(seconds=k) for k in range(4)]
    text = "time,v_x\n" + "".join(f"{at.strftime(order)},{k}\n" for k, at in enumerate(times))
    told = any(at.day > 12 for at in times)
    if told:
        since = [at.replace(tzinfo=datetime.UTC).timestamp() for at in times]
        np.testing.assert_allclose(read(tmp_path / "log.csv", text).time, since, atol=1e-6)
    else:
        with pytest.raises(
            InputError, match=r"column 'time': '.*2024.*: begins with the day or the month\. Write dates as"
        ):
            read(tmp_path / "log.csv", text)


def test_dates_with_slashes_in_two_orders_are_refused(tmp_path):
    text = "time,v_x\n13/03/2024 10:00:00,1\n03/14/2024 10:00:00,2\n"
    with pytest.raises(InputError, match=r"some rows begin with the day and others with the month"):
        read(tmp_path / "log.csv", text)


def test_a_missing_time_of_day_is_no_midnight(tmp_path):
    own = io.ChannelMap({"v_x": io.Channel("v_x", time=io.Channel("clock"))})
    text = "clock,v_x\n23:59:58,1\n,2\n23:59:59,3\n,4\n00:00:01,5\n"
    recording = read(tmp_path / "log.csv", text, own)
    np.testing.assert_allclose(recording.time, [86398.0, 86399.0, 86401.0])
    np.testing.assert_array_equal(recording["v_x"], [1.0, 3.0, 5.0])


def test_time_stamps_that_are_not_alike(tmp_path):
    with pytest.raises(InputError, match=r"column 'time', data row 2: '10:5' is no time stamp like '10:00:00'"):
        read(tmp_path / "log.csv", "time,v_x\n10:00:00,1\n10:5,2\n")
    with pytest.raises(InputError, match=r"2024-13-01"):
        read(tmp_path / "log.csv", "time,v_x\n2024-13-01T10:00:00,1\n2024-13-01T10:00:01,2\n")
    told = io.ChannelMap({"v_x": "v_x"}, time=io.Channel("time", unit="ms"))
    with pytest.raises(InputError, match=r"unit 'ms', but it has dates or times of day"):
        read(tmp_path / "log.csv", "time,v_x\n10:00:00,1\n10:00:01,2\n", told)


@pytest.mark.parametrize("kind", ["float", "dates", "dates with a zone", "durations"])
@pytest.mark.parametrize("place", ["column", "index", "index without a name"])
@pytest.mark.parametrize("way", ["parquet", "frame"])
def test_time_of_pandas(tmp_path, kind, place, way):
    pandas = pytest.importorskip("pandas")
    steps = np.arange(4) * 0.25
    zero = pandas.Timestamp("2024-03-01 10:00", tz="Europe/Berlin" if "zone" in kind else None)
    span = pandas.to_timedelta(steps, unit="s")
    time = pandas.Index(steps) if kind == "float" else span if kind == "durations" else zero + span
    frame = pandas.DataFrame({"v_x": 20.0 + steps})
    if place == "column":
        frame.insert(0, "time", time)
    else:
        frame.index = time.rename(None if place != "index" else "time")
    if way == "frame":
        recording = io.from_frame(frame)
    else:
        frame.to_parquet(tmp_path / "log.parquet")
        recording = io.read_recording(tmp_path / "log.parquet")
    start = {"float": 0.0, "durations": 0.0, "dates": 1709287200.0, "dates with a zone": 1709283600.0}[kind]
    np.testing.assert_allclose(recording.time, start + steps, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(recording["v_x"], 20.0 + steps)


def test_columns_with_times_of_their_own(tmp_path):
    text = "t1;v;t2;r\n0,0;10,0;5;0,1\n0,1;20,0;15;0,2\n0,2;30,0;;\n"
    toml = tmp_path / "map.toml"
    toml.write_text(
        '[channels.v_x]\ncolumn = "v"\ntime = "t1"\n'
        '[channels.yaw_rate]\ncolumn = "r"\nsign = -1\ntime = { column = "t2", unit = "ms" }\n'
    )
    recording = read(tmp_path / "log.csv", text, toml)
    np.testing.assert_allclose(recording.time, [0.0, 0.005, 0.015, 0.1, 0.2])
    np.testing.assert_array_equal(recording["v_x"], [10.0, np.nan, np.nan, 20.0, 30.0])
    np.testing.assert_array_equal(recording["yaw_rate"], [np.nan, -0.1, -0.2, np.nan, np.nan])
    with pytest.raises(InputError, match=r"column 't2': 0.0 s after 0.015 s: the times of 'r' must be strictly"):
        read(tmp_path / "log.csv", text.replace("0,2;30,0;;", "0,2;30,0;0;1"), toml)
    io.write_recording(Recording([0.0, 1.0], {"r": [1.0, 2.0], "v": [1.0, 2.0]}), tmp_path / "log.mf4")
    with pytest.raises(InputError, match=r"column 'v': time = 't1': only for CSV and Parquet"):
        io.read_recording(tmp_path / "log.mf4", toml)


@pytest.mark.parametrize(
    "toml", ['[csv]\ndecimal = ","', '[csv]\nseparator = ";"', 'time = "time"', "[csv]\nnames_line = 1"]
)
def test_a_map_without_channels_takes_every_column(tmp_path, toml):
    (tmp_path / "map.toml").write_text(toml)
    recording = read(tmp_path / "log.csv", "time;v_x;pedal\n0;1,5;3\n1;2,5;4\n", tmp_path / "map.toml")
    assert recording.names == ("v_x", "pedal")
    np.testing.assert_array_equal(recording["v_x"], [1.5, 2.5])


def test_the_line_of_the_names_can_be_given(tmp_path):
    text = "time\tSpeed\ns\tkm/h\nf8\tf4\n0\t36\n1\t72\n"
    recording = read(tmp_path / "log.dat", text, io.ChannelMap({"v_x": "Speed"}, names_line=1))
    np.testing.assert_allclose(recording["v_x"], [10.0, 20.0])


STRANGE = {
    "words": ("gear,state", "1,ON", "left out 'state': .*'ON' is not a number"),
    "dates": ("gear,day", "1,2024-01-01", "left out 'day'"),
    "the same name": ("gear,a,a", "1,2,3", "left out 'a': .*several columns are named 'a'"),
    "more of them": ("gear,a,b,c", "1,x,y,z", r"left out 'a', and 2 more \(b, c\)"),
}


@pytest.mark.parametrize("case", STRANGE)
def test_columns_that_are_no_channels_are_left_out_aloud(tmp_path, case):
    names, row, words = STRANGE[case]
    text = f"time,v_x,{names}\n0,1,{row}\n1,2,{row}\n"
    with pytest.warns(JaxvehWarning, match=words):
        assert read(tmp_path / "log.csv", text).names == ("v_x", "gear")
    known = text.replace("state", "a_y").replace("day", "a_y").replace("a,", "a_y,", 1)
    with pytest.raises(InputError, match=r"a_y|several columns are named"):
        read(tmp_path / "log.csv", known.replace(",a\n", ",a_y\n"))


def test_a_dat_file_may_be_mdf(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="3.30") as mdf:
        mdf.append([asammdf.Signal(np.array([1.0, 2.0]), np.array([0.0, 1.0]), name="v_x", unit="m/s")])
        saved = mdf.save(tmp_path / "log.mdf")
    saved.rename(tmp_path / "log.dat")
    np.testing.assert_array_equal(io.read_recording(tmp_path / "log.dat")["v_x"], [1.0, 2.0])


@pytest.mark.parametrize("suffix", [".xlsx", ".ld", ".blf", ".asc", ".bag", ".h5", ".pkl", ".feather"])
def test_what_is_not_read_is_told_with_what_to_do(tmp_path, suffix):
    with pytest.raises(
        InputError, match=r"is not read: (save|export|decode|convert|load) .*; a log must end in one of"
    ):
        io.read_recording(tmp_path / f"log{suffix}")


NO_TABLES = {
    "blank lines": ("\n\n \n", "has no line with a content"),
    "blank cells": (",,\n,,\n", "has no line with a content"),
    "a long name": (f"time,{'n' * 200_000}\n0,1\n", "is no table of text"),
    "a long cell": (f"time,v_x\n0,{'9' * 200_000}\n", "is no table of text"),
    "numbers": ("0.0,1.0\n0.1,1.0\n", "line 1 holds numbers only"),
    "words": ("hello\nworld\n", "no time column"),
    "zero bytes": ("t\0i\0m\0e\0", "contains zero bytes"),
}


@pytest.mark.parametrize("case", NO_TABLES)
def test_what_is_no_table_is_told(tmp_path, case):
    text, words = NO_TABLES[case]
    with pytest.raises(InputError, match=words):
        read(tmp_path / "log.csv", text)


BRACKETS = ("[]", "()", "<>", "  ")


@pytest.mark.parametrize("brackets", BRACKETS)
@pytest.mark.parametrize("suffix", [".csv", ".txt", ".parquet", ".mf4", ".nc"])
def test_units_in_brackets_are_those_inside(suffix, brackets, tmp_path):
    """Many loggers write `[km/h]`: on a line of units, and in the units of other formats."""
    around = lambda unit: f"{brackets[0]}{unit}{brackets[1]}"
    time, speed, pressure, share = (
        0.01 * np.arange(50),
        np.linspace(36.0, 72.0, 50),
        np.arange(50.0),
        np.linspace(0, 1, 50),
    )
    units = {"v_x": around("km/h"), "hydraulics": around("bar"), "throttle": around("-")}
    path = tmp_path / f"log{suffix}"
    if suffix in (".csv", ".txt"):
        lines = ["time,v_x,hydraulics,throttle", ",".join([around("s"), *units.values()])]
        rows = zip(time, speed, pressure, share, strict=True)
        path.write_text("\n".join([*lines, *(",".join(f"{cell:.9f}" for cell in row) for row in rows)]) + "\n")
    else:
        log = Recording(time, {"v_x": speed, "hydraulics": pressure, "throttle": share}, units)
        io.write_recording(log, path)
    read = io.read_recording(path)
    np.testing.assert_allclose(read["v_x"], speed / 3.6, rtol=1e-6)
    np.testing.assert_allclose(read["throttle"], share, atol=1e-8)
    np.testing.assert_allclose(read["hydraulics"], pressure)
    assert read.unit("v_x") == "m/s"
    if suffix in (".csv", ".txt"):  # other formats keep what they were given
        assert read.unit("hydraulics") == "bar"


@pytest.mark.parametrize("separator", [" ", ",", ";", "\t"])
@pytest.mark.parametrize("mark", ["# ", "#", "#  "])
@pytest.mark.parametrize("units", [None, ["s", "km/h", "deg/s"]])
@pytest.mark.parametrize("above", ["", "# driven by A. N. Other\n", "# run 7\n#\n", "a logger's own words\n"])
@pytest.mark.filterwarnings("ignore:.*names are in line:jaxveh.JaxvehWarning")
def test_names_and_units_may_be_marked_as_comments(tmp_path, separator, mark, units, above):
    """As numpy's savetxt and simulators write them."""
    factors = [1.0, 3.6, 180 / np.pi] if units else [1.0, 1.0, 1.0]
    table = np.column_stack([TIME, TRUTH["v_x"], TRUTH["yaw_rate"]]) * factors
    head = [separator.join(line) for line in (["time", "v_x", "yaw_rate"], *([units] if units else []))]
    rows = [separator.join(f"{one:.9f}" for one in row) for row in table]
    path = tmp_path / "log.txt"
    path.write_text(above + "\n".join([*(mark + line for line in head), *rows, ""]))
    said = len(above.splitlines()) + 1
    for told in (None, io.ChannelMap(names_line=said), io.ChannelMap(separator=separator)):
        found = io.read_recording(path, told)
        assert found.names == ("v_x", "yaw_rate")
        np.testing.assert_allclose(found.time, TIME, atol=1e-9)
        for name in found.names:
            np.testing.assert_allclose(found[name], TRUTH[name], rtol=1e-6, atol=1e-8)

"""Logs as other people's loggers write them: other names, units in names, lines below the names, names twice, rows twice."""

import random
import warnings

import numpy as np
import pandas
import pytest

from jaxveh import InputError, JaxvehWarning, io
from jaxveh.io import kit, likely_names
from jaxveh.io.canonical import CANONICAL

NAMES = {
    "v_x": "Ground Speed, Speed (OBD), vEgo, VehSpd, GPS_Speed, vx, speedKmh, VelForward, Fahrzeuggeschwindigkeit, v_mps",
    "yaw_rate": "yawRate, Z_ANGLE_RATE, AngRateZ, gyro_z, imu_gz_rps, angular_velocity.z, omega, psi_dot, Gierrate, YawRt, "
    "z-rotation-gyroscope",
    "a_y": "G Force Lat, LatAcc, lateral_acc, Y_ACCELERATION, linear_acceleration.y, ay, accel_y, Querbeschleunigung",
    "a_x": "G Force Long, InlineAcc, longitudinal_acc, ax_mps2, LonAcc, Längsbeschleunigung, accx_can",
    "steer": "Steered Angle, SteeringWheelAngle, steeringAngleDeg, delta, StrWhlAng, Lenkradwinkel, SWA, steer_deg",
    "wheel_speed_fl": "wheel_fl, WheelSpeedFL, ABS_WhlSpd_FL, Wheel Speed Front Left, wheel_fl_rps_meas, Radgeschw_VL, WSpd_LF",
    "wheel_speed_rr": "wheel_rr, WheelSpeedRR, ABS_WhlSpd_RR, Wheel Speed Rear Right, wheel_rr_rps_meas, Radgeschw_HR",
    "time": "t_s, Device Time, elapsed_time, write_millis, %time, __time, header.stamp.secs, Zeit, timestamp_us",
}  # fmt: skip
OTHERS = (
    "Engine RPM, Steering Arm Force, Fan Speed, wind speed, deltadelta, targetLateralAcceleration, steerCommand, "
    "Brake Pressure Wheel FL, Fuel Level, device_update_rate, a_y_std, gps_accuracy, imu_gy_rps, roll rate, Boost, distance, "
    "x-rotation-gyroscope, Lap Time, Predicted Lap Time, time_lap, BestSectorTime"
)


@pytest.mark.parametrize("channel", NAMES)
def test_names_of_others_are_taken_for_the_channel_that_they_mean(channel):
    everything = [name for names in NAMES.values() for name in names.split(", ")]
    meant = NAMES[channel].split(", ")
    assert kit.likely_names(channel, everything) == meant
    assert kit.likely_names(channel, OTHERS.split(", ")) == []
    assert kit.likely_names(channel, CANONICAL) == []


@pytest.mark.parametrize("suffix", [".csv", ".txt", ".parquet", ".mf4", ".mat", ".nc", ".vbo", ".tir", ".toml"])
def test_what_was_saved_in_the_place_of_a_file_is_told(tmp_path, suffix):
    """A pointer of Git LFS, and the web page about a file, have the file's name."""
    read = {".tir": io.read_property_file, ".toml": io.read_car}.get(suffix, io.read_recording)
    path = tmp_path / f"file{suffix}"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:12\nsize 123\n")
    with pytest.raises(InputError, match=r"is a pointer of Git LFS, .*`git lfs pull`"):
        read(path)
    path.write_text("\n<!DOCTYPE html>\n<html>\n<body></body></html>\n")
    with pytest.raises(InputError, match=r"is a web page: download the file itself"):
        read(path)


ENDINGS = [
    (quantity, unit, ending)
    for quantity, units in likely_names._UNITS.items()
    for unit, endings in units.items()
    for ending in endings
]


@pytest.mark.parametrize("quantity", likely_names._UNITS)
def test_a_unit_in_a_name_is_not_taken_for_si(tmp_path, quantity):
    """A mapped column whose name ends with a unit other than SI needs the unit, a scale, or SI by word."""
    path = tmp_path / "log.csv"
    names = [name for name, known in CANONICAL.items() if known.unit == quantity and name != "time"] or ["time"]
    endings = [(unit, ending) for one, unit, ending in ENDINGS if one == quantity]
    for k in range(max(len(names), len(endings))):
        name, (unit, ending) = names[k % len(names)], endings[k % len(endings)]
        column = f"sensor_{ending.replace(' ', '_')}"
        path.write_text(f"clock,{column}\n0,1\n1,2\n" if name != "time" else f"{column},v\n0,1\n1,2\n")
        read = lambda name=name, column=column, **told: io.read_recording(
            path,
            io.ChannelMap({"v": "v"}, time=io.Channel(column, **told))
            if name == "time"
            else io.ChannelMap({name: io.Channel(column, **told)}, time=io.Channel("clock")),
        )
        last = lambda log, name=name: float(log.time[1] if name == "time" else log[name][0])
        if unit == quantity:
            assert last(read()) == 1.0
            continue
        with pytest.raises(InputError, match=rf"ends as if it were in {unit}, and no unit .*Add unit = \"{unit}\""):
            read()
        assert last(read(unit=quantity)) == 1.0 == last(read(scale=0.5)) * 2.0
        assert 0.0 < last(read(unit=unit)) != 1.0


def table_of(draw, rows, heads, separator, decimal="."):
    """Lines of a table of random numbers below its heads, and the numbers."""
    values = np.round(draw.random() + np.arange(rows * len(heads[0])).reshape(rows, -1) * 0.125, 6)
    values[:, 0] = 0.02 * np.arange(rows)
    lines = [separator.join(head) for head in heads]
    return lines + [separator.join(f"{cell:.6f}".replace(".", decimal) for cell in row) for row in values], values


@pytest.mark.parametrize("seed", range(12))
def test_a_line_of_sources_below_the_units_is_not_the_line_of_names(tmp_path, seed):
    """Names, units, and a line in which cells are empty or alike."""
    draw = random.Random(seed)
    separator = draw.choice([",", ";", "\t"])
    names = ["timestamp", "speed", "lateral_acc", "bearing", "rpm"]
    units = [draw.choice(["unix time", "s", ""]), "km/h", "G", "deg", "rpm"]
    sources = ["", *draw.choice([["100: gps"] * 4, ["gps", "gps", "calc", "obd"], ["", "gps", "", "can"]])]
    lines, values = table_of(draw, 9, [names, units, sources], separator)
    above = draw.choice([[], ["Logger 7", f"Driver{separator}A. N. Other", ""]])
    (tmp_path / "log.csv").write_text("\n".join([*above, *lines]) + "\n")
    with pytest.warns(JaxvehWarning, match=f"line {len(above) + 3} is not read"):
        log = io.read_recording(tmp_path / "log.csv", io.ChannelMap({"speed": "speed", "a_y": "lateral_acc"}))
    np.testing.assert_allclose(log["speed"], values[:, 1] / 3.6)
    np.testing.assert_allclose(log["a_y"], values[:, 2] * 9.80665)
    np.testing.assert_allclose(log.time, values[:, 0])


@pytest.mark.parametrize("seed", range(8))
def test_the_title_of_a_section_above_the_rows_is_not_the_line_of_names(tmp_path, seed):
    draw = random.Random(seed)
    separator, units = draw.choice([",", ";", "\t"]), draw.choice([[], [["s", "km/h", "deg/s"]]])
    lines, values = table_of(draw, 9, [["Offset", "Vehicle Speed", "Yaw"], *units], separator)
    at = 1 + len(units)
    title = draw.choice(["[Channel Data]", "-----", "DATA", "***End_of_Header***"])
    blank = draw.choice([[], [""]])
    text = "\n".join(["Log of a tool", "", *lines[:at], *blank, title, *lines[at:]])
    (tmp_path / "log.txt").write_text(text + "\n")
    with pytest.warns(JaxvehWarning, match="is not read"):
        log = io.read_recording(
            tmp_path / "log.txt", io.ChannelMap({"v_x": "Vehicle Speed"}, time=io.Channel("Offset"))
        )
    np.testing.assert_allclose(log["v_x"], values[:, 1] / (3.6 if units else 1.0))


@pytest.mark.parametrize("seed", range(8))
def test_comments_among_the_rows_are_no_rows(tmp_path, seed):
    draw = random.Random(seed)
    separator, decimal = draw.choice([(",", "."), (";", "."), (";", ","), ("\t", ",")])
    lines, values = table_of(draw, 12, [["time", "v_x", "a_y"]], separator, decimal)
    count = draw.randint(1, 3)
    for place in sorted(draw.sample(range(4, 13), count), reverse=True):
        lines.insert(place, draw.choice(["# Lap 1: 00:01:31.2", f"// marker{separator}2", f"#{separator}{separator}"]))
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + "\n")
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        log = io.read_recording(path)
    assert [f"{count} line{'s' * (count > 1)} of comments" in str(one.message) for one in heard] == [True]
    np.testing.assert_allclose(log.time, values[:, 0])
    np.testing.assert_allclose(log["a_y"], values[:, 2])
    cars = [f"car{separator}{lines[0]}", *(f"#78{separator}{line}" for line in lines[1:] if line[0] not in "#/")]
    path.write_text("\n".join(cars) + "\n")
    with pytest.warns(JaxvehWarning, match="left out 'car'"):
        assert len(io.read_recording(path)) == 12
    path.write_text("\n".join([*lines, lines[0], *lines[1:]]) + "\n")
    with pytest.raises(InputError, match=r"data row \d+ holds the names of the columns again: several drives"):
        io.read_recording(path)


@pytest.mark.parametrize("separator", [",", ";", "\t", "|", " "])
def test_numbers_without_names_are_told_as_that(tmp_path, separator):
    (tmp_path / "log.txt").write_text("".join(separator.join(["49.0", "8.4", "112.8"]) + "\n" for _ in range(5)))
    with pytest.raises(InputError, match="line 1 holds numbers only; the first line must name the columns"):
        io.read_recording(tmp_path / "log.txt")


@pytest.mark.parametrize("period", [256.0, 65536.0, 65.536, 2.0**32 / 1e6, 60.0, 86_400.0, 604_800.0, 86_400_000.0])
def test_a_time_that_begins_again_is_told_with_its_period(tmp_path, period):
    step = period / 1000
    time = np.mod(0.9937 * period + step * np.arange(40), period)
    (tmp_path / "log.csv").write_text("time,v_x\n" + "".join(f"{t:.9f},1\n" for t in time))
    with pytest.raises(InputError, match=rf"Does it begin again after {period:.9g}, as .* Then add that"):
        io.read_recording(tmp_path / "log.csv")


@pytest.mark.parametrize("place", ["line", "brackets", "none"])
def test_columns_of_one_name_are_told_apart_by_their_numbers(tmp_path, place):
    draw = random.Random(place)
    names = ["time", "speed", "gear", "speed", "speed"]
    heads = {
        "line": [names, ["s", "km/h", "-", "mph", "m/s"]],
        "brackets": [["time [s]", "speed [km/h]", "gear", "speed [km/h]", "speed [m/s]"]],
        "none": [names],
    }[place]
    lines, values = table_of(draw, 9, heads, ",")
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match="'speed"):
        io.read_recording(path)
    factors = {"line": (1 / 3.6, 0.44704, 1.0), "brackets": (1 / 3.6, 1 / 3.6, 1.0), "none": (1.0, 1.0, 1.0)}[place]
    for column, factor in zip((2, 4, 5), factors, strict=True):
        named = "speed [m/s]" if place == "brackets" and column == 5 else f"speed (column {column})"
        log = io.read_recording(path, io.ChannelMap({"v_x": named}))
        np.testing.assert_allclose(log["v_x"], values[:, column - 1] * factor, err_msg=named)
    with pytest.raises(
        InputError, match=r"several columns are named 'speed.*'; name one .*: speed \(column 2\), speed"
    ):
        io.read_recording(path, io.ChannelMap({"v_x": "speed" if place != "brackets" else "speed [km/h]"}))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("own", [False, True])
def test_rows_with_one_time_are_joined_if_they_agree(tmp_path, seed, own):
    """A row is written again, or in parts, each with the cells of one device."""
    draw, path = random.Random(seed), tmp_path / "log.csv"
    rows, lines, again = 20, [], 0
    for k in range(rows):
        cells = [f"{1.0 + k:g}", f"{0.5 * k:g}"]
        parts = draw.choice(
            [[cells], [cells], [cells, cells], [[cells[0], ""], ["", cells[1]]], [cells, [cells[0], ""]]]
        )
        lines += [f"{0.02 * k:.2f}," + ",".join(part) for part in parts]
        again += len(parts) - 1
    path.write_text("clock,a,b\n" + "\n".join(lines) + "\n")
    channels = {"v_x": "a", "a_y": "b"}
    told = (
        io.ChannelMap({name: io.Channel(column, time=io.Channel("clock")) for name, column in channels.items()})
        if own
        else io.ChannelMap(channels, time=io.Channel("clock"))
    )
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        log = io.read_recording(path, told)
    assert any(f"{again} rows have the time of the row before" in str(one.message) for one in heard) == (not own)
    np.testing.assert_allclose(log.time, 0.02 * np.arange(rows))
    np.testing.assert_allclose(log["v_x"], 1.0 + np.arange(rows))
    np.testing.assert_allclose(log["a_y"], 0.5 * np.arange(rows))
    path.write_text(path.read_text() + f"{0.02 * (rows - 1):.2f},99,\n")
    with pytest.raises(InputError, match="must be strictly increasing"):
        io.read_recording(path, told)


@pytest.mark.parametrize("places", [(1,), (3,), (1, 2), (1, 4)])
@pytest.mark.parametrize("line", ["", "s,m/s,rad/s"])
@pytest.mark.filterwarnings("ignore:.*names are in line:jaxveh.JaxvehWarning")
def test_columns_without_names_have_their_numbers(tmp_path, places, line):
    """As pandas writes its index; a column at the end, too, unless each row ends with a separator."""
    names, units = ["time", "v_x", "yaw_rate"], line.split(",") if line else [""] * 3
    values = [0.01 * np.arange(6), 20.0 + np.arange(6), 0.1 * np.arange(6)]
    for place in places:
        names.insert(place - 1, "")
        units.insert(place - 1, "")
        values.insert(place - 1, 100.0 * place + np.arange(6))
    rows = [",".join(f"{one:.3f}" for one in row) for row in zip(*values, strict=True)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([",".join(names), *([",".join(units)] if line else []), *rows, ""]))
    log = io.read_recording(path)
    assert set(log.names) == {"v_x", "yaw_rate", *(f"column {place}" for place in places)}
    for place in places:
        np.testing.assert_allclose(log[f"column {place}"], 100.0 * place + np.arange(6))
    clock = io.Channel("column 1", offset=-100.0, scale=0.01) if places[0] == 1 else io.Channel("time")
    told = io.read_recording(path, io.ChannelMap({"v_x": "v_x"}, time=clock))
    np.testing.assert_allclose(np.diff(told.time), 0.01)
    with pytest.raises(InputError, match=rf"no column 'speed'.*column {places[0]}"):
        io.read_recording(path, io.ChannelMap({"v_x": "speed"}))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize("counts", ["first", "last"])
@pytest.mark.filterwarnings("ignore:.*of each column the:jaxveh.JaxvehWarning")
def test_of_rows_with_one_time_the_one_counts_that_the_map_says(tmp_path, seed, own, suffix, counts):
    """A receiver's sample comes at the instant of another device's, whose row held the sample before."""
    draw, path = random.Random(seed), tmp_path / f"log{suffix}"
    rows, clock, cells, wanted = 40, [], [], []
    for k in range(rows):
        lines = [
            [draw.choice([draw.gauss(0, 1), np.nan]) for _ in range(2)] for _ in range(draw.choice([1, 1, 1, 1, 2, 3]))
        ]
        clock += [0.02 * k] * len(lines)
        cells += lines
        known = lambda column, lines=lines: [line[column] for line in lines if not np.isnan(line[column])]
        wanted.append([(known(one) or [np.nan])[0 if counts == "first" else -1] for one in range(2)])
    frame = pandas.DataFrame({"clock": clock, "a": [c[0] for c in cells], "b": [c[1] for c in cells]})
    frame.to_csv(path, index=False) if suffix == ".csv" else frame.to_parquet(path)
    one = lambda column: io.Channel(column, time=io.Channel("clock") if own else None)
    channels = {"channels": {"v_x": one("a"), "a_y": one("b")}, "time": None if own else io.Channel("clock")}
    told = io.ChannelMap(**channels, repeats=counts)
    log = io.read_recording(path, told)
    np.testing.assert_allclose(log.time, 0.02 * np.arange(rows))
    np.testing.assert_allclose(np.stack([log["v_x"], log["a_y"]], axis=1), np.array(wanted), rtol=1e-6)
    with pytest.raises(InputError, match="must be strictly increasing"):
        io.read_recording(path, io.ChannelMap(**channels))


def test_what_counts_is_told_and_asked_for(tmp_path):
    path, chosen = tmp_path / "log.csv", tmp_path / "map.toml"
    lines = [f"{0.02 * k:.2f},{k}" for k in range(20)]
    path.write_text("\n".join(["time,v_x", *lines[:9], "0.16,99", *lines[9:], ""]))
    with pytest.raises(
        InputError, match=r'Or take one of such rows: repeats = "last" in a channel map, above its tables'
    ):
        io.read_recording(path)
    chosen.write_text('repeats = "last"\n')
    with pytest.warns(
        JaxvehWarning, match=r"1 row has the time of the row before and other values: .* the last counts"
    ):
        assert io.read_recording(path, chosen)["v_x"][8] == 99.0
    chosen.write_text('repeats = "newest"\n')
    with pytest.raises(InputError, match=r"map.toml: repeats = 'newest': must be one of 'first', 'last'"):
        io.read_recording(path, chosen)
    path.write_text("time,v_x\n0.1,1\n0.2,2\n0.1,3\n0.1,4\n")
    with pytest.raises(InputError, match="must be strictly increasing") as told:
        io.read_recording(path, io.ChannelMap(repeats="last"))
    assert "repeats =" not in str(told.value)
    path.write_text("time,v_x\n0.1,1\n0.1,2\n0.2,3\n")
    with pytest.raises(InputError, match="must be strictly increasing") as told:
        io.read_recording(path)
    assert "repeats =" not in str(told.value)


def test_a_time_that_stands_still_is_told_with_the_other_clocks(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("write_millis,time,v_x\n0,0,1\n20,0,2\n40,0,3\n")
    with pytest.raises(InputError, match=r"Or is write_millis the time\? Name it in a channel map"):
        io.read_recording(path)
    path.write_text("write_millis,v_x\n0,1\n20,2\n")
    with pytest.raises(InputError, match=r"no time column .*write_millis may be it\. .*unit = \"ms\""):
        io.read_recording(path)

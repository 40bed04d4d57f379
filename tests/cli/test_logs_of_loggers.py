"""Programs on logs as loggers write them: what was assumed is one line on stderr, and what is missing is told with its remedy."""

import numpy as np
import pytest
from programs import columns, error_line, run, write_car, write_log

from jaxveh import InputError, estimators, io

ABOVE = {"nothing": "", "lines above": "Logger 7\nDriver,A. N. Other\n\n", "comments": "# logger 7\n"}


def logger_file(folder, above="", names="Time,Ground Speed,Gyro,Lat Acc,Wheel"):
    """A log with lines above the names and a line of units below them."""
    table = columns()
    rows = zip(
        table["time"], 3.6 * table["v_x"], 57.29578 * table["yaw_rate"], table["a_y"], table["steer"], strict=True
    )
    lines = [names, "s,km/h,deg/s,m/s²,rad", *(",".join(f"{cell:.7f}" for cell in row) for row in rows)]
    path = folder / "log.txt"
    path.write_text(above + "\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.filterwarnings("default::jaxveh.JaxvehWarning")
@pytest.mark.parametrize("above", ABOVE)
def test_lines_above_the_names_are_told_of(tmp_path, above):
    (tmp_path / "map.toml").write_text(
        '[channels]\nv_x = "Ground Speed"\nyaw_rate = "Gyro"\na_y = "Lat Acc"\nsteer = "Wheel"\n'
    )
    result = run("check", logger_file(tmp_path, ABOVE[above]), "--channels", tmp_path / "map.toml")
    assert result.exit_code == 0
    assert "v_x" in result.stdout and "0 error, 0 warning" in result.stdout, result.stdout
    lines = result.stderr.strip().splitlines()
    assert len(lines) == (above == "lines above"), result.stderr
    assert all(
        one.startswith("warning: ") and "names are in line 4; the lines above are not read" in one for one in lines
    )


def test_check_tells_of_names_that_look_like_known_ones(tmp_path):
    result = run("check", logger_file(tmp_path, names="Time,V_x,YawRate,ay,Steer"))
    assert result.exit_code == 0 and "4 warning" in result.stdout
    for known in ("v_x", "yaw_rate", "a_y", "steer"):
        assert f"the name of this channel is {known}." in " ".join(result.stdout.split())


def test_names_of_others_are_proposed_for_what_is_not_there(tmp_path):
    """`check` says which column may be which channel, and what needs the channel says it too."""
    path = logger_file(tmp_path, names="Time,Ground Speed,Gyro Z,G Force Lat,Steered Angle")
    checked = " ".join(run("check", path).stdout.split())
    meant = {"Ground Speed": "v_x", "Gyro Z": "yaw_rate", "G Force Lat": "a_y", "Steered Angle": "steer, or steering"}
    for column, channel in meant.items():
        assert f"warning {column} may be {channel}" in checked
    line = error_line(run("estimate", path, "--vehicle", write_car(tmp_path), "-o", tmp_path / "o.csv"))
    assert "Ground Speed may be v_x. Gyro Z may be yaw_rate. Map their columns with --channels" in line
    with pytest.raises(InputError, match=r"it has: Ground Speed, .*\. Ground Speed may be v_x\. Name the columns"):
        estimators.kit.check_needs("mass", (estimators.kit.Need("v_x", "m/s"),), io.read_recording(path))
    path = logger_file(tmp_path, names="Time,Wheel FL,Gyro Z,G Force Lat,Steered Angle")
    assert "note Wheel FL may be wheel_speed_fl" in " ".join(run("check", path).stdout.split())
    path = logger_file(tmp_path, names="Time,Ground Speed,Gyro Z,G Force Lat,Steered Angle")
    (tmp_path / "map.toml").write_text("[channels]\n" + 'speed = "Ground Speed"\nsteering_wheel = "Steered Angle"\n')
    checked = run("check", path, "--channels", tmp_path / "map.toml").stdout
    assert "may be" not in checked


@pytest.mark.parametrize("count", [1, 12])
def test_names_of_any_length_leave_room_for_what_is_said_about_them(tmp_path, count):
    table = columns()
    table["v_x"] = 20.0 + np.sin(table["time"])
    table["v_x"][100] += 30.0
    paths = [f"vehicle/dynamics/body/front/left/corner/{k}/sensor/filtered" for k in range(count)]
    path = write_log(tmp_path, {**table, **dict.fromkeys(paths, table["v_x"])})
    words = run("check", path).stdout
    assert words.count("1 spike(s), the largest") >= count
    assert max(map(len, words.splitlines())) <= 200


@pytest.mark.parametrize("unit", ["grad/s", "Grad/s", "GRAD/S"])
def test_a_unit_that_is_not_sure_is_refused(tmp_path, unit):
    path = logger_file(tmp_path, names="time,v_x,yaw_rate,a_y,steer")
    path.write_text(path.read_text(encoding="utf-8").replace("deg/s", unit), encoding="utf-8")
    line = error_line(run("check", path))
    assert f"yaw_rate: unit '{unit}' may be degrees or gradians. Write `deg`" in line


@pytest.mark.parametrize("begin", [0.0, 86_000.0, 1_709_287_200.0])
def test_times_are_shown_so_that_they_can_be_told_apart(tmp_path, begin):
    table = columns()
    table["v_x"] = 20.0 + np.sin(table["time"])
    table["v_x"][100] += 30.0
    table["time"] = begin + table["time"]
    path = write_log(tmp_path, table)
    result = run("check", path)
    words = " ".join(result.stdout.split())
    first, last, spike = (f"{one:.12g}" for one in (begin, begin + 1.99, begin + 1.0))
    assert f"200 rows from {first} to {last} s, every 0.01 s" in words
    assert f"1 spike(s), the largest 50.84 at {spike} s" in words
    car = write_car(tmp_path)
    line = error_line(run("estimate", path, "--vehicle", car, "-o", tmp_path / "o.csv", "--span", "5:6"))
    assert line.endswith(f"lies outside the log, which runs from {first} to {last} s.")

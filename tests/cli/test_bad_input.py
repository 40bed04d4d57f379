"""Each mistake is one line that says what, which value, what is allowed; exit code 2, nothing half written."""

import json
import re

import numpy as np
import pytest
from programs import CAR, columns, error_line, run, write_car, write_log

from jaxveh import FilterError, InputError, estimators, io, studies, tyres
from jaxveh.cli import sideslip


def estimate(folder, *more, log=None, car=None):
    log = write_log(folder) if log is None else log
    car = write_car(folder) if car is None else car
    return run("estimate", log, "--vehicle", car, "-o", folder / "out.csv", *more)


def refused(folder, result) -> str:
    line = error_line(result)
    assert sorted(path.name for path in folder.iterdir() if path.name.startswith(("out", ".writing"))) == []
    return line


def test_log_that_is_not_there(tmp_path):
    line = refused(tmp_path, estimate(tmp_path, log=tmp_path / "missing.csv"))
    assert "missing.csv" in line
    assert "cannot be read" in line


def test_empty_log(tmp_path):
    log = tmp_path / "drive.csv"
    log.write_text("time,steer\n")
    assert "the log is empty" in refused(tmp_path, estimate(tmp_path, log=log))


def test_time_that_goes_back(tmp_path):
    table = columns()
    table["time"][7] = table["time"][5]
    line = refused(tmp_path, estimate(tmp_path, log=write_log(tmp_path, table)))
    assert "time[7] = 0.05" in line
    assert "strictly increasing" in line


def test_unknown_unit_and_unit_of_another_thing(tmp_path):
    log = write_log(tmp_path, head={"yaw_rate": "yaw_rate [furlongs]"})
    assert "'furlongs'" in refused(tmp_path, estimate(tmp_path, log=log))
    log = write_log(tmp_path, head={"yaw_rate": "yaw_rate [kg]"})
    line = refused(tmp_path, estimate(tmp_path, log=log))
    assert "'kg'" in line
    assert "'rad/s'" in line


def test_channel_map_with_an_unknown_column(tmp_path):
    channels = tmp_path / "map.toml"
    channels.write_text('[channels]\nyaw_rate = "yaw_rat"\n')
    line = refused(tmp_path, estimate(tmp_path, "--channels", channels))
    assert "did you mean 'yaw_rate'" in line


def test_unknown_channel_to_calibrate_on(tmp_path):
    line = refused(tmp_path, estimate(tmp_path, "--calibrate-on", "v_yy", "--calibrate", "0:1"))
    assert line.startswith("error: --calibrate-on: unknown name(s) v_yy; there are: ")


def test_truth_that_the_log_lacks(tmp_path):
    line = refused(tmp_path, estimate(tmp_path, "--truth", "sideslip"))
    assert line.startswith("error: --truth: unknown name(s) sideslip; there are: ")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (CAR.replace("1420.0", "-1420.0"), "mass = -1420.0: must be between 0.1 and 1e+06 kg"),
        (CAR.replace("mass = 1420.0", "mass = "), "broken TOML"),
        (CAR.replace("mass", "maas"), "did you mean 'mass'"),
        (CAR.replace("mass = 1420.0\n", ""), "missing key(s): mass"),
    ],
)
def test_car_file(tmp_path, text, words):
    line = refused(tmp_path, estimate(tmp_path, car=write_car(tmp_path, text)))
    assert words in line
    assert "car.toml" in line


@pytest.mark.parametrize("span", ["1", "2:1", "a:b", "5:9", "-9:-5"])
def test_span(tmp_path, span):
    assert f"--calibrate {span}: " in refused(tmp_path, estimate(tmp_path, f"--calibrate={span}"))


def test_span_that_leaves_nothing(tmp_path):
    assert "leaves nothing to estimate" in refused(tmp_path, estimate(tmp_path, "--calibrate", "0:"))


def test_calibrate_on_without_a_span(tmp_path):
    assert "add --calibrate START:END" in refused(tmp_path, estimate(tmp_path, "--calibrate-on", "v_y"))


def test_fewer_than_two_particles(tmp_path):
    line = refused(tmp_path, estimate(tmp_path, "--filter", "apf", "--particles", "1"))
    assert line == "error: --particles = 1: must be at least 2."


def test_product_that_exists_is_kept(tmp_path):
    (tmp_path / "out.csv").write_text("mine")
    line = error_line(estimate(tmp_path))
    assert "exists already" in line
    assert "--force" in line
    assert (tmp_path / "out.csv").read_text() == "mine"


def test_product_that_is_the_log_is_kept_even_by_force(tmp_path):
    log = write_log(tmp_path)
    before = log.read_bytes()
    result = run("estimate", log, "--vehicle", write_car(tmp_path), "-o", log, "--force")
    assert "is an input of this program" in error_line(result)
    assert log.read_bytes() == before


def test_product_suffix_and_folder(tmp_path):
    log, car = write_log(tmp_path), write_car(tmp_path)
    assert "'.txt'" in error_line(run("estimate", log, "--vehicle", car, "-o", tmp_path / "out.txt"))
    assert "there is no folder" in error_line(run("estimate", log, "--vehicle", car, "-o", tmp_path / "a" / "out.csv"))


def test_json_must_be_named_so(tmp_path):
    car = write_car(tmp_path)
    assert "must end in .json" in error_line(run("check", write_log(tmp_path), "--json", car))
    assert car.read_text() == CAR


def test_report_folder_that_is_a_file(tmp_path):
    log = write_log(tmp_path)
    assert "is a file; name a folder" in error_line(run("check", log, "--out", log))


def test_unknown_option(tmp_path):
    result = run("check", write_log(tmp_path), "--quick")
    assert result.exit_code == 2
    assert "--quick" in result.stderr
    assert "Traceback" not in result.stderr


def test_unknown_vehicle(tmp_path):
    line = error_line(run("simulate", "--vehicle", "racing_car", "-o", tmp_path / "out.csv"))
    assert "racing_car" in line
    assert "passenger_car" in line


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--rate", "0", "--rate = 0.0: must be positive"),
        ("--duration", "-1", "duration = -1.0"),
        ("--yaw-rate-std", "0", "yaw_rate"),
        ("--steer-deg", "200", "steer"),
    ],
)
def test_simulation_out_of_range(tmp_path, option, value, words):
    line = refused(tmp_path, run("simulate", "-o", tmp_path / "out.csv", option, value))
    assert words in line


def test_debug_shows_the_error_itself(tmp_path):
    with pytest.raises(ValueError, match="cannot be read"):
        run("check", tmp_path / "missing.csv", "--debug")


def test_numbers_that_are_not_finite_become_null(tmp_path):
    from jaxveh.cli.output import write_numbers

    path = tmp_path / "numbers.json"
    write_numbers(path, {"a": np.array([1.0, np.nan]), "b": float("inf"), "c": np.int32(3)}, {"log": tmp_path}, 4)
    content = json.loads(path.read_text())
    assert content["a"] == [1.0, None]
    assert content["b"] is None
    assert content["c"] == 3
    assert content["manifest"]["seed"] == 4
    assert content["manifest"]["configuration"] == {"log": str(tmp_path)}
    assert set(content["manifest"]["versions"]) == {"jaxveh", "jax", "numpy", "python"}


KINDS = {
    "car": (CAR, io.read_car),
    "calibration": ('estimator = "sideslip"\n[parameters]\n', estimators.read_calibration),
    "study": (studies.STUDY_SCHEMA, studies.read_study),
    "channel map": (io.kit.CHANNEL_MAP_SCHEMA, io.read_channel_map),
    "tyre": ('[tyre]\nmodel = "fiala"\n', tyres.read_parameters),
    "road": ("friction = 0.8\n", io.read_road),
}
"""A file of each kind, and what reads such files."""


@pytest.mark.parametrize("given", KINDS)
@pytest.mark.parametrize("wanted", KINDS)
def test_a_file_of_another_kind_is_told_by_its_name(wanted, given, tmp_path):
    """A calibration in the place of a car's file: 'no key estimator' told of the file's contents alone."""
    assert set(KINDS) == set(io.kit.FILES)
    path = tmp_path / "some.toml"
    path.write_text(KINDS[given][0])
    if wanted != given:
        words = re.escape(f"some.toml: is {io.kit.FILES[given][1]}; a {wanted} file is needed here.")
        with pytest.raises(InputError, match=words):
            KINDS[wanted][1](path)


def test_one_file_by_two_names_is_not_two_products(tmp_path):
    (tmp_path / "sub").mkdir()
    given = ("fit", write_log(tmp_path), "--vehicle", write_car(tmp_path), "-o", tmp_path / "out.toml")
    line = refused(tmp_path, run(*given, "--car-file", tmp_path / "sub" / ".." / "out.toml"))
    assert "--car-file" in line and "is the file of the calibration, -o" in line


PROGRAMS_OF_SEVERAL_LOGS = {
    "fit": ("out.toml",),
    "estimate": ("out",),
    "estimate --what": ("out", "--what", "all"),
}


@pytest.mark.parametrize("program", PROGRAMS_OF_SEVERAL_LOGS)
def test_no_log_is_named_twice_and_none_is_drawn_over_another(program, tmp_path):
    """A log fitted twice would make the fit look surer than it is; the quantities of --what are estimated log by log."""
    name, (product, *more) = program.partition(" ")[0], PROGRAMS_OF_SEVERAL_LOGS[program]
    one, car = write_log(tmp_path), write_car(tmp_path)
    linked, folder = tmp_path / "linked.csv", tmp_path / "other"
    linked.symlink_to(one)
    folder.mkdir()
    other = write_log(folder)
    assert other.name == one.name
    call = lambda second, *options: run(
        name, one, second, "--vehicle", car, "-o", tmp_path / product, "--force", *more, *options
    )
    for second in (one, linked)[: 1 if more else 2]:
        line = error_line(call(second))
        assert "named twice" in line or "two logs would be written to" in line, line
    line = error_line(call(other, "--out", tmp_path / "figures"))
    assert "the figures of two logs" in line or "two logs would be written to" in line, line
    assert not (tmp_path / "figures").exists()


def without(name):
    return {column: values for column, values in columns().items() if column != name}


BAD_AMONG_GOOD = {
    "no yaw rate": without("yaw_rate"),
    "no speed": without("v_x"),
    "no reference": without("v_y"),
    "a gap": columns() | {"v_x": np.where(np.arange(200) == 50, np.nan, 20.0)},
    "an empty channel": columns() | {"v_x": np.full(200, np.nan)},
    "a dead sensor": columns() | {"yaw_rate": np.zeros(200)},
    "parked": columns() | {name: np.zeros(200) for name in ("v_x", "yaw_rate", "a_y")},
    "two rows": columns(2),
    "time that steps back": columns() | {"time": np.roll(columns()["time"], 9)},
}


def called(program, logs, car):
    return run(program[0], *logs, "--vehicle", car, *program[1:])


@pytest.mark.parametrize("fault", BAD_AMONG_GOOD)
@pytest.mark.parametrize(
    "program",
    [
        ("fit", "-o", "out.toml", "--calibrate-on", "v_y"),
        ("estimate", "-o", "out", "--truth", "v_y", "--json", "out.json"),
        (
            "estimate",
            "-o",
            "out",
            "--truth",
            "v_y",
            "--json",
            "out.json",
            "--what",
            "sideslip",
            "--methods",
            "rear_axle",
        ),
    ],
    ids=["fit", "sideslip", "quantity"],
)
def test_a_bad_log_among_good_ones_is_named_and_the_others_are_estimated(fault, program, tmp_path, monkeypatch):
    """A fit, which is one of all logs, is refused before any work. It does not look at the speed of a reference; of the other
    quantities many need no motion."""
    if fault == "parked" and (program[0] == "fit" or "--what" in program):
        pytest.skip("the program does not refuse it")
    bad = write_log(tmp_path, BAD_AMONG_GOOD[fault]).rename(tmp_path / "bad.csv")
    good, car = write_log(tmp_path), write_car(tmp_path)
    monkeypatch.chdir(tmp_path)
    result = called(program, (bad, good), car)
    line = result.stderr.strip().splitlines()[-1]
    assert result.exit_code == 2 and line.startswith("error: "), result.output
    assert "bad.csv" in line and "drive.csv" not in line.replace(str(tmp_path), "")
    if program[0] == "fit":
        assert not (tmp_path / "out.toml").exists()
        return
    assert "no estimate of 1 of 2 logs; the others are written" in line
    assert [path.name for path in tmp_path.rglob("*.parquet")] == ["drive.parquet"]
    numbers = json.loads((tmp_path / "out.json").read_text())
    assert list(numbers["logs"]) == ["drive.csv"] and numbers["refused"]["bad.csv"] in line
    expected = (tmp_path / "out" / "drive.parquet").read_bytes()
    alone = ("estimate", "-o", "alone.parquet", *program[3:])
    assert called(alone, (good,), car).exit_code == 0
    assert (tmp_path / "alone.parquet").read_bytes() == expected


@pytest.mark.parametrize("program", ["fit", "estimate", "estimate --what"])
def test_every_bad_log_is_named_at_once(program, tmp_path):
    name, (product, *more) = program.partition(" ")[0], PROGRAMS_OF_SEVERAL_LOGS[program]
    logs = [write_log(tmp_path, columns(2)).rename(tmp_path / f"bad_{k}.csv") for k in range(3)]
    line = error_line(called((name, "-o", tmp_path / product, *more), logs, write_car(tmp_path)))
    assert all(log.name in line for log in logs) and "the others" not in line
    assert not list(tmp_path.rglob("*.parquet"))


def test_a_filter_that_fails_along_one_log_leaves_the_others(tmp_path, monkeypatch):
    """Its exit code is that of a failure; with a log of bad input beside it, that of the input."""
    names = ("good", "failing", "later")
    logs = [write_log(tmp_path).rename(tmp_path / f"{name}.csv") for name in names]
    estimate_one, count = sideslip.estimate, []

    def failing(*given):
        count.append(given)
        if len(count) == 2:
            raise FilterError("step 3: lost")
        return estimate_one(*given)

    monkeypatch.setattr(sideslip, "estimate", failing)
    result = called(("estimate", "-o", tmp_path / "out", "--as-told"), logs, write_car(tmp_path))
    line = result.stderr.strip().splitlines()[-1]
    assert result.exit_code == 1 and "failing.csv: step 3: lost" in line, result.output
    assert sorted(path.stem for path in (tmp_path / "out").iterdir()) == ["good", "later"]

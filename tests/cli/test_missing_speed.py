"""A log without `v_x` is estimated with the speed that its wheels give, or that over ground, and the program says so."""

import sys
from pathlib import Path

import numpy as np
import pytest
from programs import run

from jaxveh import Recording, estimators, io
from jaxveh.cli.missing_speed import with_speed

sys.path.insert(0, str(Path(__file__).parents[1] / "estimators"))
import method_logs


def log(*without):
    made = method_logs.channels()
    time = made.pop("time")
    whole = Recording(time, made, {name: io.canonical_unit(name) or "" for name in made})
    return whole.without(*[name for name in whole.names if name.startswith(without)]) if without else whole


def test_a_measured_speed_is_left_as_it_is_and_without_wheels_there_is_none(capsys):
    for drive in (log(), log("v_x", "speed", "wheel_speed")):
        assert with_speed(Path("a.csv"), drive, method_logs.CAR) is drive
    assert capsys.readouterr().out == ""


def test_the_speed_is_that_of_the_recommended_method(capsys):
    drive = log("v_x", "speed")
    found = with_speed(Path("a.csv"), drive, method_logs.CAR)
    assert set(found.names) == {*drive.names, "v_x"} and found.unit("v_x") == "m/s"
    np.testing.assert_array_equal(found["v_x"], estimators.speed.estimate(method_logs.CAR, drive)["v_x"])
    error = np.asarray(found["v_x"]) - np.asarray(log()["v_x"])
    assert np.sqrt(np.mean(error**2)) < 0.02 * np.mean(log()["v_x"])
    assert "note: a.csv: there is no v_x: it is estimated from the wheel speeds" in " ".join(
        capsys.readouterr().out.split()
    )


def test_without_wheels_it_is_the_speed_over_ground(capsys):
    drive = log("v_x", "wheel_speed")
    found = with_speed(Path("a.csv"), drive, method_logs.CAR)
    np.testing.assert_array_equal(found["v_x"], log()["speed"])
    assert found.unit("v_x") == "m/s"
    assert "note: a.csv: there is no v_x: the speed over ground is used" in " ".join(capsys.readouterr().out.split())


WITHOUT = {"wheels": ("v_x", "speed"), "satellites": ("v_x", "wheel_speed")}


PROGRAMS = [(what, left) for what in ("--as-told", "--what bank") for left in WITHOUT]


@pytest.mark.parametrize(("what", "left"), PROGRAMS)
def test_programs_take_such_a_log(tmp_path, what, left):
    io.write_car(method_logs.CAR, tmp_path / "car.toml")
    columns = {}
    for name, drive in {"with": log(), "without": log(*WITHOUT[left])}.items():
        io.write_recording(drive, tmp_path / f"{name}.csv")
        out = tmp_path / f"{name}.out.csv"
        fill = ("--fill", 0.3) if left == "satellites" else ()
        car = ("--vehicle", tmp_path / "car.toml")
        result = run("estimate", tmp_path / f"{name}.csv", *car, "-o", out, *what.split(), *fill, "--anyway")
        assert result.exit_code == 0, result.output
        assert ("there is no v_x" in " ".join(result.stdout.split())) == (name == "without")
        frame = np.genfromtxt(out, delimiter=",", names=True, deletechars="")
        column = next(one for one in frame.dtype.names if one.startswith(("v_y", "bank")) and "std" not in one)
        columns[name] = frame[column]
    apart = np.sqrt(np.nanmean((columns["with"] - columns["without"]) ** 2))
    assert 0.0 < apart < 0.3 * np.sqrt(np.nanmean(columns["with"] ** 2))


@pytest.mark.parametrize("quantity", ["navigation", "grade"])
def test_what_can_do_without_is_not_told_the_same_speed_twice(tmp_path, quantity):
    """Both would count as measurements with errors of their own."""
    io.write_car(method_logs.CAR, tmp_path / "car.toml")
    io.write_recording(log("v_x", "wheel_speed"), tmp_path / "log.csv")
    out = tmp_path / "out.csv"
    methods = () if quantity == "navigation" else ("--methods", "satellite")
    car = ("--vehicle", tmp_path / "car.toml")
    result = run("estimate", tmp_path / "log.csv", *car, "-o", out, "--what", quantity, *methods, "--anyway")
    assert result.exit_code == 0, result.output
    assert "there is no v_x" not in " ".join(result.stdout.split()) and out.exists()

"""`jaxveh estimate --what`: quantities by their methods, side by side and scored; what is asked for wrongly in one line."""

import dataclasses
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from programs import error_line, run

from jaxveh import Recording, estimators, io
from jaxveh.cli.quantity_options import QUANTITIES, names_of

sys.path.insert(0, str(Path(__file__).parents[1] / "estimators"))
import method_logs


@pytest.fixture
def drive(tmp_path):
    """A log with every channel, and the car's file."""
    made = method_logs.channels()
    time = made.pop("time")
    units = {name: io.canonical_unit(name) or "" for name in made}
    io.write_recording(Recording(time, made, units), tmp_path / "drive.csv")
    io.write_car(method_logs.CAR, tmp_path / "car.toml")
    return tmp_path


def estimate(folder, *arguments, out="found.csv"):
    return run("estimate", folder / "drive.csv", "--vehicle", folder / "car.toml", "-o", folder / out, *arguments)


def test_list_has_every_method_of_every_quantity():
    result = run("estimate", "--list")
    assert result.exit_code == 0
    words = " ".join(result.stdout.split())
    for name, module in QUANTITIES.items():
        assert f"--what {name}" in words
        for method in module.METHODS:
            assert method in words.replace(" ", "") or method in words


def test_methods_stand_side_by_side_and_are_scored_blind(drive):
    methods = "fastest_wheel,slowest_wheel"
    result = estimate(
        drive,
        "--what",
        "speed",
        "--methods",
        methods,
        "--truth",
        "v_x",
        "--json",
        drive / "n.json",
        "--out",
        drive / "figs",
    )
    assert result.exit_code == 0, result.output
    frame = np.genfromtxt(drive / "found.csv", delimiter=",", names=True, deletechars="")
    log = io.read_recording(drive / "drive.csv")
    numbers = json.loads((drive / "n.json").read_text())["speed"]
    for method in methods.split(","):
        column = next(name for name in frame.dtype.names if name.startswith(f"speed.{method}.v_x"))
        seen = log.without("v_x", "speed", "sideslip")
        expected = estimators.speed.estimate(method_logs.CAR, seen, method=method)
        np.testing.assert_allclose(frame[column], expected["v_x"], rtol=1e-12)
        error = np.asarray(expected["v_x"]) - log["v_x"]
        assert numbers["scores"][method]["v_x"]["rmse"] == pytest.approx(np.sqrt(np.mean(error**2)))
        assert method in result.stdout
    assert numbers["nothing_done_rmse"]["v_x"] > 0.0 and "nothing done" in result.stdout
    assert (drive / "figs" / "speed.png").stat().st_size > 1000


@pytest.mark.parametrize("live", [False, True])
def test_rows_are_estimated_from_all_rows_unless_as_in_a_car(drive, live):
    result = estimate(drive, "--what", "stiffness", "--json", drive / "n.json", *(["--live"] if live else []))
    assert result.exit_code == 0, result.output
    frame = np.genfromtxt(drive / "found.csv", delimiter=",", names=True, deletechars="")
    column = next(name for name in frame.dtype.names if name.startswith("front_cornering_stiffness"))
    log = io.read_recording(drive / "drive.csv")
    expected = estimators.stiffness.estimate(method_logs.CAR, log, smoothed=not live)
    np.testing.assert_allclose(frame[column], expected["front_cornering_stiffness"], rtol=1e-12)
    smoothed = json.loads((drive / "n.json").read_text())["stiffness"]["smoothed"]
    assert smoothed == ([] if live else [estimators.stiffness.RECOMMENDED])
    assert ("up to it" in result.stdout) == live


def test_names_are_taken_once_and_all_of_them_by_all():
    assert names_of("b, a,b", "--what", ("a", "b")) == ("b", "a")
    assert names_of("all", "--what", ("a", "b")) == names_of("b,all", "--what", ("a", "b")) == ("a", "b")


@pytest.mark.full
def test_all_gives_what_can_be_had_and_says_why_not(drive):
    log = io.read_recording(drive / "drive.csv")
    (drive / "drive.csv").unlink()
    lacking = [name for name in log.names if name.startswith(("wheel_speed", "omega"))]
    io.write_recording(log.without(*lacking), drive / "drive.csv")
    result = estimate(drive, "--what", "all")
    assert ("not taken" in result.stdout) and "wheel_speed_fl" in result.stdout
    if len(QUANTITIES) == 1:
        assert result.exit_code == 2 and "no quantity can be estimated" in result.stderr
        return
    assert result.exit_code == 0, result.output
    names = (drive / "found.csv").read_text().splitlines()[0]
    assert "sideslip.v_y" in names and "speed.v_x" not in names


def test_what_is_asked_for_wrongly_is_said_in_a_line(drive):
    assert "--what = 'spede': must be one of" in error_line(estimate(drive, "--what", "spede"))
    assert "must be one of" in error_line(estimate(drive, "--what", "speed", "--methods", "guess"))
    assert "--methods applies to one quantity" in error_line(estimate(drive, "--what", "all", "--methods", "all"))
    assert "--truth = 'mass': must be one of" in error_line(estimate(drive, "--what", "speed", "--truth", "mass"))
    assert "--calibrate: only for --what sideslip" in error_line(
        estimate(drive, "--what", "speed", "--calibrate", "0:5")
    )
    assert "--filter: only for --what sideslip" in error_line(estimate(drive, "--what", "speed", "--filter", "pf"))
    assert "--particles: only for --what sideslip" in error_line(
        estimate(drive, "--what", "speed", "--particles", "50")
    )
    missing = error_line(estimate(drive, "--what", "speed", "--truth", "true.v_x"))
    assert "has no such channel" in missing
    assert "--vehicle is missing" in error_line(
        run("estimate", drive / "drive.csv", "-o", drive / "x.csv", "--what", "speed")
    )


def test_the_file_with_every_key_has_every_key():
    full = estimators.kit.FULL_CAR
    assert [field.name for field in dataclasses.fields(full) if getattr(full, field.name) is None] == [
        "front_tyre", "rear_tyre"
    ]  # fmt: skip


@pytest.mark.parametrize("methods", ["open_loop", "open_loop,steady_turn"])
def test_a_gap_is_told_with_the_option_that_fills_it(drive, methods):
    log = io.read_recording(drive / "drive.csv")
    steer = np.array(log["steer"])
    steer[50:53] = np.nan
    io.write_recording(log.replace(steer=steer), drive / "drive.csv", overwrite=True)
    result = estimate(drive, "--what", "sideslip", "--methods", methods, "--anyway")
    words = " ".join(result.output.split())
    assert "Fill it with --fill" in words and "recording.fill(" not in words, result.output


def test_keys_that_the_car_s_file_lacks_are_told_where_they_would_be_used(drive):
    plain = dataclasses.replace(method_logs.CAR, roll_gradient=None, drag=None)
    io.write_car(plain, drive / "car.toml", overwrite=True)
    words = " ".join(estimate(drive, "--what", "friction", "--methods", "lateral_curve").output.split())
    told = words.split("car.toml has no ")[1].split(": usual values stand for them")[0].split(", ")
    assert "roll_gradient" in told and "sensor_position" in told and "drag" not in told and "mass" not in told, told
    # A log without satellites asks for no antenna; a method that is refused says why by itself.
    log = io.read_recording(drive / "drive.csv").without("speed", "course", "heading", "climb_rate")
    io.write_recording(log, drive / "blind.csv")
    blind = run(
        "estimate", drive / "blind.csv", "--vehicle", drive / "car.toml", "-o", drive / "b.csv", "--what", "stiffness"
    )
    told = " ".join(blind.output.split()).split("car.toml has no ")[1].split(": usual")[0].split(", ")
    assert "roll_gradient" in told and "antenna_position" not in told, told
    refused = estimate(drive, "--what", "bank,stiffness", out="third.csv").output
    told = " ".join(refused.split()).split("car.toml has no ")[1].split(": usual")[0].split(", ")
    assert "antenna_position" in told and "camera_delay" not in told, told
    assert "the car's file has no roll_gradient" in " ".join(refused.split())
    words = " ".join(estimate(drive, "--what", "speed", "--methods", "fastest_wheel", out="other.csv").output.split())
    assert "usual values" not in words


def test_the_catalogue_is_what_the_methods_declare():
    """`python tests/cli/test_quantities_program.py` writes it anew."""
    assert CATALOGUE.read_text() == HEAD + estimators.kit.catalogue(QUANTITIES)


CATALOGUE = Path(__file__).parents[2] / "notebooks" / "catalogues" / "estimators.md"
HEAD = """# Quantities and their methods

All quantities of `jaxveh estimate --what` and `jaxveh.estimators`. Bold is the method that we recommend.

- *from*: section, equation and reference in the review of Chen, Gao & Xu (2013); `mass-grade-aukf` is the paper on mass and grade
  ([papers](papers.md)).
- *reads*: the channels; those in brackets may be missing, `*` stands for the four wheels.
- *asks for*: optional keys of the car's file that the method cannot do without. It uses more keys, if they are there: [the
  last table](#keys-of-the-cars-file) has those of the recommended methods.

This page is generated from the methods' declarations.

"""

if __name__ == "__main__":
    CATALOGUE.write_text(HEAD + estimators.kit.catalogue(QUANTITIES))

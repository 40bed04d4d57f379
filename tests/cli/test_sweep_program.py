"""`jaxveh sweep`: a study into a store, goes on where it was, and is shown; bad input in one line."""

import json

import numpy as np
import pytest
import zarr
from programs import error_line, run

from jaxveh import studies, sweeps

STUDY = """\
seeds = 4
[drive]
manoeuvre = "step-steer"
rate = 20.0
duration = 2.0
steer_deg = 1.0
[sensors]
yaw_rate = 0.01
a_y = 0.1
[vary]
"sensors.yaw_rate" = [0.002, 0.02]
filter = ["extended", "huber"]
"""

OWN = STUDY.replace(
    'filter = ["extended", "huber"]', 'filter = {EKF = "extended", robust = {name = "huber", inner = "extended"}}'
)


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A study that was swept, with what was printed."""
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "study.toml").write_text(OWN)
    result = run(
        "sweep",
        folder / "study.toml",
        "-o",
        folder / "s.zarr",
        "--batch",
        "4",
        "--out",
        folder / "figs",
        "--json",
        folder / "s.json",
    )
    assert result.exit_code == 0, result.output
    return folder, result


@pytest.mark.studies
def test_a_study_is_swept_and_told(swept):
    folder, result = swept
    assert "16 runs: passenger_car as single-track" in result.stdout
    for part in (
        "Median (lower to upper quartile)",
        "Against doing nothing",
        "filter against EKF",
        "Ranks of filter",
        "robust",
    ):
        assert part in result.stdout
    figures = sorted(path.name for path in (folder / "figs").iterdir())
    assert figures == [f"rmse_sideslip_{name}.png" for name in ("by_filter", "over_sensors_yaw_rate", "ranks_filter")]
    told = json.loads((folder / "s.json").read_text())
    assert told["units"]["rmse.sideslip"] == "rad" and len(told["tables"]) == 5 and len(told["figures"]) == 3
    found = sweeps.read_sweep(folder / "s.zarr")
    study = studies.read_study(folder / "study.toml")
    again = sweeps.sweep(study, study.design, study.seeds, study.key, batch=4)
    for name in found.values:
        np.testing.assert_array_equal(found[name], again[name])
    assert "[vary]" in found.note


@pytest.mark.studies
def test_a_store_that_is_whole_is_not_computed_again(swept, monkeypatch):
    folder, result = swept
    from jaxveh.sweeps.chunks import Computing

    monkeypatch.setattr(Computing, "do", lambda *_: pytest.fail("a chunk was computed again"))
    again = run("sweep", "run", folder / "study.toml", "-o", folder / "s.zarr")
    assert again.exit_code == 0, again.output
    assert again.stdout == result.stdout.partition("figure:")[0]


@pytest.mark.studies
def test_it_is_shown_again_and_xarray_knows_the_units(swept):
    import xarray

    folder, _ = swept
    again = run("sweep", "show", folder / "s.zarr", "--value", "rmse.sideslip")
    assert again.exit_code == 0, again.output
    assert again.stdout.count("coverage") == 1 and "Ranks of filter" in again.stdout
    data = xarray.open_zarr(folder / "s.zarr")
    assert data["rmse.sideslip"].attrs["units"] == "rad"
    assert data["sensors_yaw_rate"].attrs["units"] == "rad/s"


def test_parts_of_an_array_of_jobs_make_one_store(swept, tmp_path):
    folder, _ = swept
    for i in range(2):
        one = run("sweep", folder / "study.toml", "-o", tmp_path / "p.zarr", "--batch", "4", "--part", f"{i}/2")
        assert one.exit_code == 0, one.output
        assert "Median" not in one.stdout
    whole, parts = sweeps.read_sweep(folder / "s.zarr"), sweeps.read_sweep(tmp_path / "p.zarr")
    for name in whole.values:
        np.testing.assert_array_equal(whole[name], parts[name])


def test_sweeps_of_other_makers_are_shown_too(tmp_path):
    design = sweeps.Design(x=[1.0, 2.0])
    import jax

    sweeps.sweep(
        lambda point, key: {"error": point.x, "row": point.x * np.ones(3)},
        design,
        2,
        jax.random.key(0),
        store=tmp_path / "o.zarr",
    )
    result = run("sweep", "show", tmp_path / "o.zarr")
    assert result.exit_code == 0 and "error" in result.stdout


@pytest.mark.studies
def test_another_study_in_the_same_store_is_refused(swept, tmp_path):
    folder, _ = swept
    other = tmp_path / "other.toml"
    other.write_text(OWN.replace("steer_deg = 1.0", "steer_deg = 1.5"))
    refused = lambda: run("sweep", other, "-o", folder / "s.zarr").stderr.splitlines()[-1]
    assert "the hash of the program of filter EKF" in refused()
    other.write_text(OWN.replace("seeds = 4", "seeds = 5"))
    assert "it was begun with seeds = 4, here it is 5" in refused()


BAD = {
    (): "STUDY.toml is missing",
    ("study.toml",): "-o STORE.zarr is missing",
    ("study.toml", "-o", "s.csv"): "it must end in .zarr",
    ("none.toml", "-o", "s.zarr"): "none.toml",
    ("study.toml", "-o", "s.zarr", "--part", "2/2"): "--part 2/2: must be I/N",
    ("study.toml", "-o", "s.zarr", "--part", "half"): "--part half: must be I/N",
    ("study.toml", "-o", "s.zarr", "--processes", "2", "--scheduler", "tcp://x:1"): "give one of them, not both",
    ("study.toml", "-o", "s.zarr", "--part", "0/2", "--out", "figs"): "a share has no tables",
    ("show", "none.zarr"): "none.zarr",
    ("wrong.toml", "-o", "s.zarr"): "no manoeuvre 'step'",
}


@pytest.mark.parametrize("arguments", BAD)
def test_what_is_wrong_is_one_line(arguments, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text(OWN)
    (tmp_path / "wrong.toml").write_text(OWN.replace("step-steer", "step"))
    assert BAD[arguments] in error_line(run("sweep", *(arguments or ("run",))))
    assert not (tmp_path / "s.zarr").exists()


TAKEN = {
    "a folder without zarr.json": lambda path: (path.mkdir(), (path / "notes.txt").write_text("mine")),
    "a file": lambda path: path.write_text("mine"),
    "a Zarr store, but no sweep's": lambda path: zarr.open_group(path, mode="w"),
}


@pytest.mark.parametrize("what", TAKEN)
def test_a_place_that_is_taken_by_something_else_is_refused_and_left_alone(what, tmp_path):
    (tmp_path / "study.toml").write_text(STUDY.replace('["extended", "huber"]', '["extended"]'))
    TAKEN[what](tmp_path / "s.zarr")
    before = sorted(tmp_path.rglob("*"))
    result = run("sweep", tmp_path / "study.toml", "-o", tmp_path / "s.zarr")
    line = result.stderr.splitlines()[-1]
    assert result.exit_code == 2, result.output
    assert f"s.zarr: is {what}" in line or f"s.zarr: {what}" in line
    assert what.startswith("a Zarr") or "compiling" not in result.stderr
    assert sorted(tmp_path.rglob("*")) == before  # no lock either


def test_a_wrapper_needs_what_it_wraps(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY)
    assert "filter huber: needs inner" in error_line(run("sweep", tmp_path / "study.toml", "-o", tmp_path / "s.zarr"))


def test_everything_that_can_be_named_is_listed():
    result = run("sweep", "run", "--list")
    assert result.exit_code == 0
    for name in (*studies.ESTIMATORS, *studies.FILTERS, *studies.METRICS):
        assert name in result.stdout


def test_the_schema_is_printed():
    result = run("schema", "study")
    assert result.stdout == studies.STUDY_SCHEMA

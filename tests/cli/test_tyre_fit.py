"""`jaxveh tyre fit`: files of tyres from rig data, numbers with their errors, and each mistake in a line."""

import json

import jax.numpy as jnp
import numpy as np
import pytest
from programs import error_line, run

from jaxveh import Parameters, io, tyres
from jaxveh._core.parameter import resolve
from jaxveh.cli.tyre_fit_report import warnings_of
from jaxveh.fitting import RigFit, StageReport

TRUTH = tyres.Brush(slip_stiffness=9e4, cornering_stiffness=7e4, friction=0.95)
ANGLES, LOADS = np.linspace(-0.2, 0.2, 15), (2000.0, 4000.0, 6000.0)
NOISE = 30.0


def write(path, head, rows):
    path.write_text("\n".join([head, *(",".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n")
    return path


def lateral(folder, name="lateral.csv", sign=-1.0, scale=1.0):
    """Slip angles in degrees, of ISO-W's sign, at three loads, with noise; a run a load."""
    random = np.random.default_rng(4)
    angle, load = (grid.ravel() for grid in np.meshgrid(ANGLES, LOADS, indexing="ij"))
    force = TRUTH.forces(tyres.Contact(slip_angle=jnp.asarray(angle), load=jnp.asarray(load))).F_y
    force = scale * (np.asarray(force) + NOISE * random.standard_normal(angle.size))
    rows = np.stack([sign * np.degrees(angle), load, force, np.searchsorted(LOADS, load)], axis=1)
    return write(folder / name, "alpha [deg],Fz,Fy,run", rows)


@pytest.fixture(scope="module")
def brush(tmp_path_factory):
    """The folder of one fit with everything that it writes, and the program's result."""
    folder = tmp_path_factory.mktemp("brush")
    result = run(
        "tyre", "fit", lateral(folder), "--model", "brush", "--folds", "3", "--out", folder / "figures",
        "--json", folder / "fit.json", "-o", folder / "brush.toml",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    return folder, result


def test_the_parameter_file_is_the_truth_within_its_errors(brush):
    folder, _ = brush
    numbers = json.loads((folder / "fit.json").read_text())
    tyre = tyres.read_parameters(folder / "brush.toml")
    assert isinstance(tyre, tyres.Brush)
    for name in ("cornering_stiffness", "friction"):
        found = numbers["coefficients"][name]
        assert found["value"] == float(getattr(tyre, name)) and found["mark"] == ""
        assert abs(found["value"] - float(getattr(TRUTH, name))) < 4 * found["std"]
        assert 0 < found["std_over_size"] < 0.02
    assert (folder / "brush.toml").read_text().startswith("# Fitted to lateral.csv by jaxveh tyre fit: F_y.\n")


def test_tables_show_baseline_fit_and_unseen_rows(brush):
    folder, result = brush
    numbers = json.loads((folder / "fit.json").read_text())
    channel = numbers["channels"]["F_y"]
    assert channel["start_rmse"] > 2 * channel["rmse"]
    assert 0.7 * NOISE < channel["rmse"] < 1.3 * NOISE and channel["rmse"] < channel["cross_validation"] < 2 * NOISE
    assert numbers["stages"][0] | {"steps": 0, "before": 0, "after": 0} == {
        "name": "joint", "rows": 45, "coefficients": 2, "before": 0, "after": 0, "steps": 0, "converged": True,
    }  # fmt: skip
    for text in ("converged", "RMSE at the start", "cross-validated", "cornering_stiffness", "N/rad", "brush.toml"):
        assert text in result.stdout
    assert numbers["manifest"]["configuration"]["folds"] == 3


def test_what_the_data_do_not_show_is_said(brush):
    folder, result = brush
    numbers = json.loads((folder / "fit.json").read_text())
    unseen = [name for name, one in numbers["coefficients"].items() if one["mark"] == "not identified"]
    assert unseen == ["slip_stiffness", "half_length"] and numbers["identified_directions"] == 2
    assert numbers["coefficients"]["half_length"]["std"] is None
    assert "warning: the data identify 2 of 4 directions" in result.stderr
    assert "held at their start: slip_stiffness, half_length" in result.stderr
    assert (
        result.stdout.count("not identified") == 3
        and "Coefficients that are not identified, and those" in result.stdout
    )


def test_residuals_are_drawn(brush):
    folder, result = brush
    assert [path.name for path in (folder / "figures").iterdir()] == ["rig_fit_F_y.png"]
    assert (folder / "figures" / "rig_fit_F_y.png").stat().st_size > 20_000
    assert "figure: " in result.stdout


def test_a_fit_goes_on_from_a_file_with_bounds(brush, tmp_path):
    folder, _ = brush
    product = tmp_path / "again.toml"
    result = run(
        "tyre", "fit", folder / "lateral.csv", "--start", folder / "brush.toml", "-o", product, "--json", tmp_path / "a.json",
        "--bounds", "friction=0.9:0.97", "--bounds", "half_length=0.05:0.07", "--weight", "F_y=2", "--measured", "F_y",
        "--robust",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    numbers = json.loads((tmp_path / "a.json").read_text())
    # It starts where the other one ended.
    assert numbers["channels"]["F_y"]["start_rmse"] == pytest.approx(numbers["channels"]["F_y"]["rmse"], rel=0.02)
    assert 0.9 < float(tyres.read_parameters(product).friction) < 0.97
    assert numbers["manifest"]["configuration"]["bounds"]["friction"] == [0.9, 0.97]
    assert numbers["manifest"]["configuration"]["weights"] == {"F_y": 2.0}


def test_a_property_file_of_lateral_data(tmp_path):
    product = tmp_path / "tyre.tir"
    result = run(
        "tyre", "fit", lateral(tmp_path), "-o", product, "--side", "left", "--json", tmp_path / "fit.json",
        "--bounds", "PCY1=1:2", "--free", "PKY4",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    numbers = json.loads((tmp_path / "fit.json").read_text())
    assert [stage["name"] for stage in numbers["stages"]] == ["F_y, pure", "joint"]
    assert numbers["channels"]["F_y"]["rmse"] < 1.5 * NOISE
    file = io.read_property_file(product)
    assert "$ Fitted to lateral.csv by jaxveh tyre fit: F_y." in "".join(file.lines)
    assert file.text("TYRESIDE") == "LEFT" and file.number("FZMAX") == 6000.0 and file.number("FNOMIN") == 4000.0
    assert file.number("ALPMAX") == pytest.approx(0.2) and 1 < file.number("PCY1") < 2
    assert file.number("PCY1") == numbers["coefficients"]["lateral.PCY1"]["value"]
    # The true tyre's stiffness does not change with load, which the form of 2 cannot follow.
    assert file.number("PKY4") == numbers["coefficients"]["lateral.PKY4"]["value"] != 2
    assert numbers["findings"] == [f._asdict() for f in tyres.check_property_file(file)]


def fit_of(*converged, rmse=10.0, validated=11.0, std=0.1, identified=1):
    """A fit with stages that converged or not, so that no fit has to be made."""
    stages = tuple(StageReport(f"stage {i}", 9, 1, 1.0, 0.1, 7, one) for i, one in enumerate(converged))
    one, matrix = np.ones(1), np.eye(1)
    of_channel = {
        name: {"F_y": value}
        for name, value in dict(rmse=rmse, start_rmse=50.0, cross_validation=validated, peak=1e3, noise=rmse).items()
    }
    return RigFit(
        parameters=Parameters({"friction": 1.0}), parameters_std=Parameters({"friction": std}), unconstrained=one,
        covariance=matrix, cost=0.0, steps=7, result=0, model=TRUTH,
        chosen=resolve(TRUTH, lambda law: law.friction), identified=identified, **of_channel, residuals={}, stages=stages,
        problem=None,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("fit", "words"),
    [
        (fit_of(True, True), None),
        (fit_of(True, False), "has not converged in 7 steps: the tyre is the best so far"),
        (fit_of(False, True), "stages that stopped before they converged: stage 0"),
        (
            fit_of(True, std=np.nan, identified=0),
            "0 of 1 directions of the coefficients; held at their start: friction",
        ),
        (fit_of(True, rmse=60.0, validated=60.0), "residuals larger than at the start: F_y"),
        (fit_of(True, validated=21.0), "errors on rows left out in a fold are more than twice the fit's RMSE: F_y"),
        (fit_of(True, rmse=0.0, validated=0.0), "fitted to the last digits: F_y"),
    ],
)
def test_warnings_are_honest(fit, words):
    found = warnings_of(fit)
    assert len(found) == (words is not None)
    assert words is None or words in found[0]


def test_a_property_file_tells_its_own_side(tmp_path):
    start = tmp_path / "start.tir"
    io.write_property_file(tyres.to_property_file(tyres.typical_mf_tyre(4e3), side="left"), start)
    line = refused(tmp_path, "--start", start, "--side", "right", product="out.tir")
    assert "start.tir has its own side; leave --side out" in line


def refused(folder, *arguments, data=None, product="out.toml"):
    data = lateral(folder) if data is None else data
    line = error_line(run("tyre", "fit", data, "-o", folder / product, *arguments))
    assert not (folder / product).exists()
    return line


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--model", "brsh"], "--model = 'brsh': must be one of 'mf61'"),
        (["--model", "mf52"], "suffix '.toml'; it must end in one of .tir"),
        (["--model", "brush", "--start", "a.tir"], "--start a.tir defines the law; leave one of the two out"),
        (["--start", "a.txt"], "--start a.txt: suffix '.txt'; it must end in one of .tir, .toml"),
        (["--model", "brush", "--side", "left"], "--side left: only a property file (.tir) has a side"),
        (["--model", "brush", "--measured", "F_q"], "--measured = 'F_q': must be one of 'F_x'"),
        (["--model", "brush", "--measured", ","], "--measured ',': must name at least one of F_x"),
        (["--model", "brush", "--measured", "F_y,F_x"], "measured: F_x is not in"),
        (["--model", "brush", "--bounds", "friction=1"], "--bounds friction=1: must be NAME=LOW:HIGH, such as"),
        (["--model", "brush", "--bounds", "friction=2:1"], "--bounds friction=2:1: 2 must be less than 1"),
        (["--model", "brush", "--bounds", "mu=0:1"], "bounds: unknown name(s) mu; there are: slip_stiffness"),
        (["--model", "brush", "--bounds", "friction=2:3"], "(2, 3): the start 0.9646"),
        (["--model", "brush", "--weight", "F_y"], "--weight F_y: must be CHANNEL=NUMBER, such as"),
        (["--model", "brush", "--weight", "F_y=-1"], "weights['F_y'] = -1.0: must be positive"),
        (["--model", "brush", "--folds", "1"], "folds = 1: must be at least 2"),
        (["--model", "brush", "--axes", "ours"], "F_y falls with slip_angle"),
        (["--model", "brush", "--axes", "sae"], "the median load is -4000"),
        (["--model", "brush", "--free", "PKY4"], "free: unknown name(s) PKY4"),
    ],
)
def test_mistakes_are_named_before_the_fit(tmp_path, arguments, message):
    assert message in refused(tmp_path, *arguments)


def consortium(folder, share=0.0):
    """A cornering run in the form of the FSAE TTC, in SAE's signs, with a share of outliers."""
    random = np.random.default_rng(2)
    angle, load = (grid.ravel() for grid in np.meshgrid(ANGLES, LOADS, indexing="ij"))
    force = np.asarray(TRUTH.forces(tyres.Contact(slip_angle=jnp.asarray(angle), load=jnp.asarray(load))).F_y)
    force = force + NOISE * random.standard_normal(angle.size) + 3e3 * (random.random(angle.size) < share)
    path = folder / "run12.dat"
    rows = ["\t".join(f"{value:.9g}" for value in row) for row in zip(np.degrees(angle), -load, -force, strict=True)]
    path.write_text("\n".join(["Tire_Name=none", "SA\tFZ\tFY", "deg\tN\tN", *rows]) + "\n")
    return path


def test_outliers_of_a_consortium_s_file_are_told_and_borne(tmp_path):
    data, product = consortium(tmp_path, share=0.1), tmp_path / "brush.toml"
    plain = run("tyre", "fit", data, "--model", "brush", "-o", product, "--json", tmp_path / "plain.json")
    assert plain.exit_code == 0, plain.output
    assert "warning: F_y: residuals have heavy tails" in plain.stderr and "--robust" in plain.stderr
    assert json.loads((tmp_path / "plain.json").read_text())["heavy_tails"]["F_y"]["share"] > 0.02
    missed = lambda: abs(float(tyres.read_parameters(product).cornering_stiffness) / 7e4 - 1)
    before = missed()
    robust = run("tyre", "fit", data, "--model", "brush", "-o", product, "--robust", "--force")
    assert robust.exit_code == 0 and "had little weight" in robust.stderr
    assert missed() < 0.02 < before


def test_odd_signs_are_reported_where_the_user_says_what_tyre_it_is(tmp_path):
    start = tmp_path / "start.toml"
    tyres.write_parameters(TRUTH, start)
    result = run("tyre", "fit", lateral(tmp_path, sign=1.0), "--start", start, "-o", tmp_path / "out.toml")
    assert "warning:" in result.stderr and "F_y falls with slip_angle" in result.stderr


def test_the_help_teaches_axes_outliers_and_what_is_held():
    text = " ".join(run("tyre", "fit", "--help").stdout.split())
    for words in ("adapted-sae", "--robust", "PKY4", "FSAE TTC", "keep their start values"):
        assert words in text


def test_files_that_are_there_are_kept(tmp_path):
    (tmp_path / "out.toml").write_text("mine")
    arguments = ("tyre", "fit", lateral(tmp_path), "--model", "brush", "-o", tmp_path / "out.toml")
    assert "exists already; name another file, or pass --force" in error_line(run(*arguments))
    assert (tmp_path / "out.toml").read_text() == "mine"
    start = tmp_path / "start.toml"
    tyres.write_parameters(TRUTH, start)
    result = run("tyre", "fit", lateral(tmp_path), "--start", start, "-o", start, "--force")
    assert "is an input of this program" in error_line(result)
    assert float(tyres.read_parameters(start).friction) == 0.95


def test_data_that_cannot_be_read_are_named(tmp_path):
    assert "cannot be read" in refused(tmp_path, "--model", "brush", data=tmp_path / "absent.csv")
    bare = write(tmp_path / "bare.csv", "alpha,Fy", [(0.1, 1.0)])
    assert "no load among the columns alpha, Fy" in refused(tmp_path, "--model", "brush", data=bare)

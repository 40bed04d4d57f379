"""`jaxveh tyre`: property files shown, tables of inputs evaluated."""

import json

import equinox as eqx
import numpy as np
import pandas as pd
import pytest
from programs import error_line, run
from shared_data import shared

from jaxveh import tyres

FILE = "mfeval__MagicFormula61_Parameters.tir"
TABLE = "Fz,alpha,kappa\n4000,0.05,0\n4000,-0.05,0.02\n"


@pytest.fixture
def tyre_file():
    return shared("tyres") / FILE


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "inputs.csv"
    path.write_text(TABLE)
    return path


def test_the_reference_s_table_as_it_is(tyre_file, tmp_path):
    product = tmp_path / "out.csv"
    result = run("tyre", "evaluate", tyre_file, shared("mfeval_mf61.csv"), "-o", product, "--axes", "iso-w")
    assert result.exit_code == 0, result.output
    found, expected = pd.read_csv(product), pd.read_csv(shared("mfeval_mf61.csv"))
    assert len(found) == len(expected) == 2172
    assert set(expected) - set(found) == {"useMode", "iKya", *(c for c in expected if c.startswith("in_"))}
    for name in found:
        scale = 1e-6 * expected.in_Fz if name in ("Fx", "Fy", "Mx", "My", "Mz") else 0.0
        error = np.abs(found[name] - expected[name]) / np.maximum(np.abs(expected[name]), np.maximum(scale, 1e-300))
        assert error.where(expected[name] != found[name], 0.0).max() < 1e-8, name


def test_axes_turn_the_slip_angle(tyre_file, table, tmp_path):
    outs = {}
    for axes in ("iso-w", "ours"):
        outs[axes] = tmp_path / f"{axes}.csv"
        assert run("tyre", "evaluate", tyre_file, table, "-o", outs[axes], "--axes", axes).exit_code == 0
    iso, ours = (pd.read_csv(outs[axes]) for axes in ("iso-w", "ours"))
    assert iso.Fy[0] < 0 < ours.Fy[0] and iso.Kya[0] < 0 < ours.Kya[0]
    tyre = tyres.from_property_file(tyre_file)
    lateral = eqx.filter_jit(lambda tyre: tyre.forces(tyres.Contact(slip_angle=0.05, load=4000.0)).F_y)
    np.testing.assert_allclose(ours.Fy[0], float(lateral(tyre)), rtol=1e-9)


def test_show_prints_and_draws(tyre_file, tmp_path):
    result = run("tyre", "show", tyre_file, "--out", tmp_path, "--json", tmp_path / "tyre.json")
    assert result.exit_code == 0, result.output
    assert "MF-Tyre 6.1, side RIGHT" in result.stdout
    numbers = json.loads((tmp_path / "tyre.json").read_text())
    assert numbers["loads"] == [3376.0, 6752.0, 10128.0]
    assert numbers["mu_y"][0] > numbers["mu_y"][2] > 0.8
    for name in ("tyre", "friction_ellipse", "gradients"):
        assert (tmp_path / f"{name}.png").stat().st_size > 20_000
        assert f"{name}.png" in result.stdout.replace("\n", "")


def test_show_says_what_is_worth_a_look(tmp_path):
    odd = shared("tyres") / "chrono__hmmwv__tire__HMMWV_pacejka.tir"
    result = run("tyre", "show", odd, "--json", tmp_path / "tyre.json")
    assert result.exit_code == 0, result.output
    assert "Findings about the file" in result.stdout and "0.00501 at nominal load" in result.stdout
    findings = json.loads((tmp_path / "tyre.json").read_text())["findings"]
    assert findings[0]["about"] == "deflection over radius" and "0.01 to 0.2" in findings[0]["says"]
    quiet = run("tyre", "show", shared("tyres") / "chrono__VW_microbus__json__mf_185_80R14.tir")
    assert quiet.exit_code == 0 and "Findings about the file" not in quiet.stdout


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("alpha\n0.1\n", "no load among the columns alpha"),
        ("Fz,alpha\n4000,fast\n", "alpha = 'fast' in row 0: must be a number"),
        ("Fz,alpha\n4000,0.1\n4000,nan\n", "alpha = nan in row 1: must be finite"),
        ("Fz,Vx\n4000,-3\n", "speed = -3 in row 0: must be at least 0"),
        ("Fz,alpha,alpha\n4000,0.1,0.2\n", "several columns are named 'alpha'; rename them"),
        (" \n", "is not a CSV table"),
        ("Fz,useMode\n4000,113\n", "useMode = 113: its digits must be 1 or 2"),
    ],
)
def test_bad_tables_are_named(tyre_file, table, tmp_path, text, message):
    table.write_text(text)
    product = tmp_path / "out.csv"
    assert message in error_line(run("tyre", "evaluate", tyre_file, table, "-o", product))
    assert not product.exists()


def test_bad_files_are_named(table, tmp_path):
    other = tmp_path / "other.tir"
    other.write_text("nothing\n")
    assert "not a tyre property file" in error_line(run("tyre", "show", other))
    assert "cannot be read" in error_line(run("tyre", "show", tmp_path / "absent.tir"))
    law = tmp_path / "brush.toml"
    tyres.write_parameters(
        tyres.Brush(slip_stiffness=1e5, cornering_stiffness=8e4, friction=1.0, half_length=0.06), law
    )
    for given in (("show", law), ("evaluate", law, table, "-o", tmp_path / "out.csv")):
        assert "is TOML: must be a tyre property file (.tir)" in error_line(run("tyre", *given))
    assert "-o" in error_line(run("tyre", "evaluate", other, table, "-o", tmp_path / "out.txt"))


def test_what_is_beyond_the_range_is_told(tyre_file, table, tmp_path):
    table.write_text("Fz,alpha\n4000,1.4\n30000,0.1\n")
    result = run("tyre", "evaluate", tyre_file, table, "-o", tmp_path / "out.csv")
    assert result.exit_code == 0
    assert "alpha is beyond the tyre's range, -0.96 to 0.96, in 1 rows" in result.stderr
    assert "Fz is beyond the tyre's range" in result.stderr

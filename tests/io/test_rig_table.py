"""Rig tables: CSV and TYDEX files, joined, with their runs."""

import numpy as np
import pandas as pd
import pytest
from shared_data import shared
from test_tydex import PLAIN, ROWS, text

from jaxveh import io
from jaxveh._core.errors import InputError
from jaxveh.io.rig_table import COLUMNS
from jaxveh.tyres import evaluation

CSV = "in_Fz,in_alpha,in_kappa,Fy,Mz\n4000,0.05,0,-2000,30\n4000,-0.05,0.01,2000,\n"


@pytest.fixture
def csv(tmp_path):
    path = tmp_path / "rig.csv"
    path.write_text(CSV)
    return path


@pytest.fixture
def tydex(tmp_path):
    path = tmp_path / "sweep.TDX"
    path.write_text(text(PLAIN, ROWS))
    return path


def test_the_reference_s_table_as_it_is():
    table, frame = io.read_rig_table(shared("mfeval_mf61.csv")), pd.read_csv(shared("mfeval_mf61.csv"))
    assert len(table.load) == len(frame) == 2172
    np.testing.assert_array_equal(table.slip_angle, 0.0 - frame.in_alpha)
    for field, column in {"load": "in_Fz", "camber": "in_gamma", "speed": "in_Vx", "F_y": "Fy", "M_z": "Mz"}.items():
        np.testing.assert_array_equal(getattr(table, field), frame[column])


def test_names_of_inputs_are_those_of_the_evaluator():
    ours = [set(names) for names, _ in COLUMNS.values()]
    assert all(set(names) in ours for name, names in evaluation.EVALUATION_INPUTS.items() if name != "phit")


def test_signs_missing_cells_and_absent_columns(csv):
    table = io.read_rig_table(csv)
    np.testing.assert_array_equal(table.slip_angle, [-0.05, 0.05])
    np.testing.assert_array_equal(table.M_z, [30.0, np.nan])
    assert table.F_x is None and table.camber is None and table.pressure is None and table.run is None
    assert str(csv) in table.source
    np.testing.assert_array_equal(io.read_rig_table(csv, "ours").slip_angle, [0.05, -0.05])
    assert io.read_rig_table(csv, measured=("F_y",)).M_z is None


def test_units_in_names_and_a_slip_that_is_not_there(csv):
    csv.write_text("Fz [kN],alpha [deg],P [bar],Fy,run\n4,2,2.5,-1500,3\n")
    table = io.read_rig_table(csv)
    np.testing.assert_allclose([table.load[0], table.pressure[0], table.run[0]], [4000.0, 2.5e5, 3.0])
    np.testing.assert_allclose(table.slip_angle, [np.radians(-2)])
    np.testing.assert_array_equal(table.slip_ratio, [0.0])


def test_a_pressure_of_zero_is_the_nominal_one(csv):
    csv.write_text("Fz,alpha,P,Fy\n4000,0.1,0,-1500\n")
    assert io.read_rig_table(csv).pressure is None


def test_files_are_joined_and_each_is_a_run(csv, tydex, tmp_path):
    csv.write_text(CSV.replace("Fy,Mz", "Fx,in_Vx").replace("-2000,30", "100,20").replace("2000,\n", "200,20\n"))
    table = io.read_rig_table([tydex, csv])
    np.testing.assert_array_equal(table.run, [0, 0, 1, 1])
    np.testing.assert_array_equal(table.F_y, [-2000.0, 2010.0, np.nan, np.nan])
    np.testing.assert_array_equal(table.F_x, [np.nan, np.nan, 100.0, 200.0])
    assert "sweep.TDX" in table.source and "rig.csv" in table.source
    second = table.take(table.run == 1)
    assert len(second.load) == 2 and second.camber is None
    np.testing.assert_array_equal(second.F_x, [100.0, 200.0])
    other = tmp_path / "runs.csv"
    other.write_text("Fz,alpha,Vx,Fy,run\n100,0,20,1,5\n100,0,20,1,9\n")
    np.testing.assert_array_equal(io.read_rig_table([other, tydex]).run, [0, 1, 2, 2])


def test_joined_files_tell_the_same_inputs(csv, tydex):
    with pytest.raises(InputError, match=r"rig.csv: has no speed, which other files have"):
        io.read_rig_table([tydex, csv])


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("alpha,Fy\n0.1,1\n", "no load among the columns alpha, Fy"),
        ("Fz,Fy\n4000,1\n", "no slip among the columns Fz, Fy"),
        ("Fz,alpha\n4000,0.1\n", "no measurement: one of F_x"),
        ("Fz,alpha,Fy\n4000,0.1,\n", "no measurement: one of F_x"),
        ("Fz,alpha,Fy\n-4000,0.1,1\n", "the median load is -4000: it must be positive.*--axes sae"),
        ("Fz,alpha,Fy\n4000,0.1,1\n4000,,1\n", "slip_angle = nan in row 1: must be finite"),
        ("Fz,alpha,Vx,Fy\n4000,0.1,-3,1\n", "speed = -3 in row 0: must be at least 0"),
        ("Fz,alpha,P,Fy\n4000,0.1,2e5,1\n4000,0.1,0,1\n", "pressure = 0 in row 1: must be positive"),
        ("Fz,alpha,phit,Fy\n4000,0.1,0.2,1\n", "phit is not 0 in every row"),
        ("Fz,alpha,Fy\n4000,fast,1\n", "'fast' is not a number"),
        ("Fz,alpha [kg],Fy\n4000,0.1,1\n", "unit 'kg' is of another quantity"),
        ("Fz,alpha,Fy\n4000,12,1\n", "alpha goes to 12 without a unit.*name the column 'alpha [deg]'"),
        ("Fz,in_kappa,camber,Fy\n4000,0.1,-4,1\n", "camber goes to 4 .*229 degrees.*'camber [deg]'"),
        ("Fz,alpha [rad],Fy\n4000,2,1\n", "slip_angle = -2 in row 0: must be radians within a right angle"),
    ],
)
def test_bad_tables_are_named(csv, table, message):
    csv.write_text(table)
    with pytest.raises(InputError, match=message.replace("[", r"\[")):
        io.read_rig_table(csv)


def test_no_column_is_taken_of_two_with_one_name(csv):
    """Also if one of them has another unit, or if the units are in a line of their own."""
    others = {"rad": "deg", "m/s": "km/h", "Pa": "kPa", "N": "kN", "N*m": "N*m"}
    unit = {name: others.get(unit) for names, unit in COLUMNS.values() for name in names[-1:]}
    for name, other in unit.items():
        more = [known for known in ("Fz", "alpha", "Fy") if known != name]
        for second in (name, f"{name} [{other}]" if other else name):
            csv.write_text(f"{name},{','.join(more)},{second}\n1,{','.join('1' for _ in more)},0\n")
            with pytest.raises(InputError, match=f"several columns are named '{name}'"):
                io.read_rig_table(csv)
    csv.write_text("Fz,alpha,Fy,Fy\nN,deg,N,kN\n4000,1,2,3\n4000,-1,-2,-3\n")
    with pytest.raises(InputError, match="several columns are named 'Fy'"):
        io.read_rig_table(csv)


def test_a_unit_in_the_name_is_believed(csv):
    csv.write_text("Fz,alpha [deg],gamma [rad],Fy\n4000,12,1.25,1\n")
    table = io.read_rig_table(csv)
    np.testing.assert_allclose([table.slip_angle[0], table.camber[0]], [-np.radians(12), 1.25])


def test_bad_arguments_are_named(csv, tydex, tmp_path):
    with pytest.raises(InputError, match="axes = 'iso': must be one of 'sae', 'adapted-sae', 'iso-w', 'ours'"):
        io.read_rig_table(csv, "iso")
    with pytest.raises(InputError, match="measured = 'F_q': must be one of"):
        io.read_rig_table(csv, measured=("F_q",))
    with pytest.raises(InputError, match="no file"):
        io.read_rig_table([])
    with pytest.raises(InputError, match="a rig table must end in one of"):
        io.read_rig_table(tmp_path / "rig.xlsx")
    with pytest.raises(InputError, match="must all be"):
        io.RigTable(np.zeros(2), np.zeros(3), np.ones(2), F_y=np.ones(2))


OTHER_UNITS = {
    "load in kN": (
        "Fz,alpha,Fy\n4,0.1,3\n6,0.1,4\n",
        r"Fz goes to 6 without a unit, which would be in N: .*'Fz \[kN\]'",
    ),
    "slip in per cent": ("Fz,kappa,Fx\n4000,-12,3\n4000,10,4\n", r"kappa goes to 12 .*in 1: .*'kappa \[%\]'"),
    "pressure in kPa": ("Fz,alpha,P,Fy\n4000,0.1,83,3\n", r"P goes to 83 .*in Pa: .*'P \[kPa\]'"),
    "pressure in bar": ("Fz,alpha,P,Fy\n4000,0.1,2.2,3\n", r"P goes to 2.2 .*in Pa"),
    "slip angle in degrees": ("Fz,alpha,Fy\n4000,8,3\n", r"alpha goes to 8 .*in rad, 458 degrees: .*'alpha \[deg\]'"),
}


@pytest.mark.parametrize("case", OTHER_UNITS)
def test_numbers_without_a_unit_that_cannot_be_in_si_are_refused(tmp_path, case):
    text, words = OTHER_UNITS[case]
    path = tmp_path / "rig.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        io.read_rig_table(path)


FORMS = {
    "a line of units": "Fz,alpha,Fy\nkN,deg,N\n4,-6,3000.5\n5,3,-2000\n",
    "units in round brackets": "Fz (kN),alpha (deg),Fy (N)\n4,-6,3000.5\n5,3,-2000\n",
    "decimal commas": "Fz [kN];alpha [deg];Fy\n4,0;-6,0;3000,5\n5,0;3,0;-2000,0\n",
    "lines above": "Rig 3\nTyre,205/55 R16\n\nFz [kN],alpha [deg],Fy\n4,-6,3000.5\n5,3,-2000\n",
    "empty rows below": "Fz [kN],alpha [deg],Fy\n4,-6,3000.5\n5,3,-2000\n,,\n,,\n",
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.filterwarnings("ignore:.*lines above are not read:jaxveh.JaxvehWarning")
def test_every_form_of_csv_is_one_table(tmp_path, form):
    path = tmp_path / "rig.csv"
    path.write_text(FORMS[form])
    table = io.read_rig_table(path)
    np.testing.assert_allclose(table.load, [4000.0, 5000.0])
    np.testing.assert_allclose(table.slip_angle, np.radians([6.0, -3.0]))
    np.testing.assert_allclose(table.F_y, [3000.5, -2000.0])

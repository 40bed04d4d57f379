"""Files of the Formula SAE Tire Test Consortium's form, made here: text and MATLAB, metric and US units, what is refused."""

import numpy as np
import pytest
import scipy.io

from jaxveh import io
from jaxveh._core.errors import InputError, JaxvehWarning
from jaxveh.io.ttc import COLUMNS, UNITS, read_ttc

FORM = """
ET sec sec|V kph mph|N rpm rpm|SA deg deg|IA deg deg|RL cm in|RE cm in|P kPa psi|FX N lb|FY N lb|FZ N lb|MX N-m ft-lb|MZ N-m ft-lb
NFX none none|NFY none none|RST C F|TSTI C F|TSTC C F|TSTO C F|AMBTMP C F|SR none none|SL none none
"""
NAMES, METRIC, CUSTOMARY = zip(*(one.split() for one in FORM.strip().replace("\n", "|").split("|")), strict=True)
"""What the consortium's files hold, in their order, with both systems of units."""

FACTORS = {
    "kph": 1.609344, "cm": 2.54, "kPa": 6.894757293168361, "N": 4.4482216152605, "N-m": 1.3558179483314004,
}  # fmt: skip
"""A US customary unit in the metric one of the same column."""


def rows(units=METRIC, count=40):
    """A cornering sweep of SAE's signs: FZ of a loaded wheel and FY of a positive slip angle are negative."""
    angle = np.linspace(-12.0, 12.0, count)
    columns = {name: np.full(count, 20.0 + k) for k, name in enumerate(NAMES)}
    columns |= {"SA": angle, "IA": np.full(count, 2.0), "FZ": -1100.0 + angle, "FY": -120.0 * angle, "MZ": 4.0 * angle}
    columns |= {
        "SL": np.zeros(count),
        "SR": np.full(count, 0.004),
        "V": np.full(count, 40.2),
        "P": np.full(count, 82.7),
    }
    for name, unit in zip(NAMES, units, strict=True):
        metric = METRIC[NAMES.index(name)]
        columns[name] = columns[name] / (1.0 if unit == metric else FACTORS.get(metric, 1.0))
    return columns


def text(columns, units=METRIC, separator="\t", title="Tire_Name=none;Rim_Width=7;made for a test"):
    chosen = [unit for name, unit in zip(NAMES, units, strict=True) if name in columns]
    body = [separator.join(f"{value:.10g}" for value in row) for row in zip(*columns.values(), strict=True)]
    return "\n".join([title, separator.join(columns), separator.join(chosen), *body]) + "\n"


def matlab(path, columns, units=METRIC, **extra):
    channel = np.array([(np.array(NAMES, object), np.array(units, object))], dtype=[("name", "O"), ("units", "O")])
    columns = {name: values.reshape(-1, 1) for name, values in columns.items()}
    scipy.io.savemat(path, {**columns, "channel": channel, "tireid": "a tyre, 7 inch rim", "source": "a test", **extra})
    return path


@pytest.fixture(params=["run.dat", "run.csv", "run.txt", "run.mat", "run73.mat"])
def file(request, tmp_path):
    """A way to write columns in each of the forms."""
    path = tmp_path / request.param

    def write(columns, units=METRIC):
        if path.name == "run73.mat":
            pytest.importorskip("h5py")
            from matlab_files import write_new

            tree = {name: values[:, None] for name, values in columns.items()}
            write_new(path, {**tree, "channel": {"name": list(NAMES), "units": list(units)}, "tireid": "a tyre"})
            return path
        if path.suffix == ".mat":
            return matlab(path, columns, units)
        path.write_text(text(columns, units, "," if path.suffix == ".csv" else "\t"))
        return path

    return write


@pytest.mark.parametrize("units", [METRIC, CUSTOMARY], ids=["metric", "customary"])
def test_columns_come_in_si_units_and_the_package_s_signs(file, units):
    table, plain = io.read_rig_table(file(rows(units), units)), rows()
    expected = {
        "slip_angle": np.radians(plain["SA"]), "slip_ratio": 0 * plain["SL"], "load": -plain["FZ"],
        "camber": np.radians(plain["IA"]),
        "speed": plain["V"] / 3.6, "pressure": 1e3 * plain["P"], "F_x": plain["FX"], "F_y": -plain["FY"],
        "M_x": plain["MX"], "M_z": -plain["MZ"],
    }  # fmt: skip
    for name, values in expected.items():
        np.testing.assert_allclose(getattr(table, name), values, rtol=1e-8, atol=1e-12, err_msg=name)
    assert table.M_y is None and table.run is None
    assert io.read_rig_table(table.source, measured=("F_y",)).F_x is None


def test_every_unit_of_the_table_has_its_size(tmp_path):
    """Against pint, which has them from elsewhere."""
    pint = pytest.importorskip("pint").UnitRegistry()
    ours = {
        "n-m": "N*m", "nm": "N*m", "n m": "N*m", "n*m": "N*m", "ft-lb": "ft*lbf", "lb-ft": "ft*lbf", "in-lb": "inch*lbf",
        "lb": "lbf", "lbs": "lbf",
        "n": "N", "kn": "kN", "kpa": "kPa", "pa": "Pa", "kmh": "km/h", "none": "", "-": "", "unitless": "", "1": "",
        "%": "percent",
    }  # fmt: skip
    si = {"angle": "rad", "ratio": "", "force": "N", "moment": "N*m", "pressure": "Pa", "speed": "m/s"}
    for quantity, known in UNITS.items():
        for unit, size in known.items():
            wanted = pint.Quantity(1.0, ours.get(unit, unit)).to(si[quantity]).magnitude
            assert size == pytest.approx(wanted, rel=1e-7), unit


def test_without_units_they_are_metric(tmp_path):
    path = tmp_path / "run.csv"
    lines = text(rows(), separator=",").splitlines()
    path.write_text("\n".join([lines[1], *lines[3:]]))
    with pytest.warns(JaxvehWarning, match="names no units; those of .* metric files are assumed: angle deg, force n,"):
        table = io.read_rig_table(path)
    np.testing.assert_allclose(table.slip_angle, np.radians(rows()["SA"]), rtol=1e-8)
    channel = {name: values for name, values in rows().items() if name in ("SA", "FZ", "FY")}
    scipy.io.savemat(tmp_path / "bare.mat", channel)
    with pytest.warns(JaxvehWarning, match="bare.mat: names no units"):
        table = io.read_rig_table(tmp_path / "bare.mat")
    np.testing.assert_allclose(table.F_y, -rows()["FY"])


def test_a_unit_in_a_name_and_other_lines_above(tmp_path):
    path = tmp_path / "run.dat"
    path.write_text("a\xb0\nb\nSA [rad]\tFZ\tFY\tIA [deg]\n0.1\t-1000\t-90\t1\n", encoding="latin-1")
    table = io.read_rig_table(path)
    assert table.slip_angle[0] == 0.1 and table.camber[0] == pytest.approx(np.radians(1)) and table.load[0] == 1000
    assert read_ttc(path).title.startswith("a") and read_ttc(path).columns["load"][0] == -1000


def test_blanks_may_split_columns(tmp_path):
    path = tmp_path / "run.txt"
    path.write_text("SA   FZ    FY\ndeg  N     N\n 6.0 -1000 -900\n-6.0 -1000  900\n")
    np.testing.assert_allclose(io.read_rig_table(path).slip_angle, np.radians([6.0, -6.0]))


def test_several_files_are_runs_and_a_run_column_is_kept(tmp_path):
    first, second = tmp_path / "a.dat", tmp_path / "b.mat"
    first.write_text(text(rows()))
    matlab(second, rows(), RUN=np.full((40, 1), 7.0))
    np.testing.assert_array_equal(io.read_rig_table(second).run, 7.0)
    np.testing.assert_array_equal(io.read_rig_table([first, second]).run, np.repeat([0.0, 1.0], 40))


def test_missing_slips_are_zero_and_sr_is_none(tmp_path):
    path = tmp_path / "run.dat"
    free = {name: values for name, values in rows().items() if name != "SL"}
    path.write_text(text(free))
    assert not io.read_rig_table(path).slip_ratio.any()
    path.write_text(text({**free, "SR": np.linspace(-0.2, 0.2, 40)}))
    with pytest.raises(
        InputError, match=r"no SL, and SR goes from -0.19\d* to 0.19\d*: SR refers to the loaded radius"
    ):
        io.read_rig_table(path)


def test_axes_are_asked_for_where_the_load_is_positive(tmp_path):
    path = tmp_path / "run.dat"
    turned = rows()
    path.write_text(text({**turned, "FZ": -turned["FZ"], "SA": -turned["SA"]}))
    with pytest.raises(InputError, match="the median FZ is 1100 N, but it is negative in SAE's axes.*adapted-sae"):
        io.read_rig_table(path)
    adapted = io.read_rig_table(path, "adapted-sae")
    np.testing.assert_allclose(adapted.slip_angle, np.radians(turned["SA"]), rtol=1e-8)
    np.testing.assert_allclose(adapted.F_y, -turned["FY"], rtol=1e-8)


def broken(**changed):
    """The text of a file with some of its lines changed: `names`, `units`, `row`."""
    lines = text(rows()).splitlines()
    for at, key in ((1, "names"), (2, "units"), (5, "row")):
        lines[at] = changed.get(key, lambda line: line)(lines[at])
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (broken(names=lambda line: line.replace("FZ", "FN")), "no line with the names FZ and SA or SL among the first 10"),
        (broken(units=lambda line: line.replace("kPa", "furlong")), "P: unit 'furlong': must be one of kpa, pa, bar, psi"),
        (broken(names=lambda line: line.replace("MZ", "FY")), "several columns are named FY"),
        (broken(row=lambda line: line.replace("-111", "x", 1)), "is not a number"),
        (broken(row=lambda line: line + "\t1\t2"), "Correct the line|more cells"),
        ("\n".join(broken().splitlines()[:3]) + "\n", "no row"),
    ],
)  # fmt: skip
def test_broken_text_is_named(tmp_path, content, message):
    path = tmp_path / "run.dat"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        io.read_rig_table(path)


def test_broken_matlab_files_are_named(tmp_path):
    path = tmp_path / "run.mat"
    path.write_bytes(b"no MATLAB file" * 40)
    with pytest.raises(InputError, match="is not a readable MATLAB file"):
        read_ttc(path)
    scipy.io.savemat(path, {"SA": np.zeros((4, 1)), "FY": np.zeros((4, 1))})
    with pytest.raises(InputError, match="FZ and one of SA, SL are needed among its columns; there are: .*SA"):
        read_ttc(path)
    scipy.io.savemat(path, {"SA": np.zeros((4, 1)), "FZ": np.zeros((4, 2))})
    with pytest.raises(InputError, match="FZ: must be a vector of numbers"):
        read_ttc(path)
    scipy.io.savemat(path, {"SA": np.zeros((4, 1)), "FZ": -np.ones((5, 1)), "FY": np.zeros((4, 1))})
    with pytest.raises(InputError, match="columns of different lengths"):
        read_ttc(path)
    pytest.importorskip("h5py")
    # What MATLAB 7.3 begins with: an HDF5 file behind 512 bytes of its own.
    head = b"MATLAB 7.3 MAT-file" + b" " * 105 + b"\x00\x02IM"
    path.write_bytes(head + b"\x00" * 384 + b"\x89HDF\r\n\x1a\n" + b"\x00" * 64)
    with pytest.raises(InputError, match="is not a readable MATLAB file"):
        read_ttc(path)


def test_columns_are_those_of_a_rig_table():
    from jaxveh.io.rig_table import COLUMNS as FIELDS

    assert set(COLUMNS) == set(FIELDS) and {name for name, _ in COLUMNS.values()} <= {*NAMES, "MY", "RUN"}
    assert {quantity for _, quantity in COLUMNS.values()} == set(UNITS)

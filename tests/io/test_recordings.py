"""Recordings survive every file format bit for bit, and every fault in a file is one clear error."""

import jax
import numpy as np
import pytest
from shared_data import shared

from jaxveh import InputError, JaxvehWarning, Recording, io

SUFFIXES = [".csv", ".parquet", ".mf4", ".mdf"]


def drive(rows=200, dtype=np.float64):
    """A log with irregular stamps, missing samples and values that no short decimal holds."""
    rng = np.random.default_rng(7)
    time = 149.99 + np.cumsum(rng.uniform(0.005, 0.02, rows))
    yaw_rate, v_x = rng.normal(size=(2, rows))
    v_x[rng.random(rows) < 0.3] = np.nan
    extremes = np.array([0.1, 1 / 3, 1e-300, -1e300, 5e-324, -0.0, np.inf, 123456789.123456789] * (rows // 8))
    channels = {"yaw_rate": yaw_rate, "v_x": v_x, "true.v_y": extremes.astype(dtype), "pedal": rng.normal(size=rows)}
    units = {"yaw_rate": "rad/s", "v_x": "m/s", "true.v_y": "m/s", "pedal": "mm"}
    return Recording(
        time, {name: values.astype(dtype) for name, values in channels.items()}, units, "a drive <1> & more"
    )


def same_bits(first, second):
    """Whether two arrays are equal in every bit, NaN in the same places."""
    first, second = np.asarray(first), np.asarray(second)
    return first.dtype == second.dtype and first.tobytes() == second.tobytes()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_round_trip_is_exact(tmp_path, suffix):
    recording = drive()
    io.write_recording(recording, tmp_path / f"log{suffix}")
    again = io.read_recording(tmp_path / f"log{suffix}")
    assert again.names == recording.names
    assert same_bits(again.time, recording.time)
    for name in recording.names:
        np.testing.assert_array_equal(np.asarray(again[name]), np.asarray(recording[name]), err_msg=name)
        assert np.array_equal(np.signbit(again[name]), np.signbit(recording[name])), name
    if suffix == ".csv":  # has no place for the unit of an unknown name, nor for a note
        assert dict(again.units) == {"yaw_rate": "rad/s", "v_x": "m/s", "true.v_y": "m/s"}
        assert again.source == "log.csv"
    else:
        assert again.units == recording.units
        assert again.source == recording.source


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_round_trip_is_exact_in_float32(tmp_path, suffix, float32):
    rng = np.random.default_rng(3)
    recording = Recording(np.arange(50) * 0.01 + 1e6, {"a_y": rng.normal(size=50)}, {"a_y": "m/s^2"})
    assert recording["a_y"].dtype == np.float32
    io.write_recording(recording, tmp_path / f"log{suffix}")
    again = io.read_recording(tmp_path / f"log{suffix}")
    assert same_bits(again["a_y"], recording["a_y"])
    assert same_bits(again.time, recording.time)


def test_float32_channels_survive_csv_under_float64(tmp_path):
    recording = Recording(np.arange(50), {"a_y": jax.random.normal(jax.random.key(0), (50,), np.float32)})
    assert recording["a_y"].dtype == np.float32
    io.write_recording(recording, tmp_path / "log.csv")
    np.testing.assert_array_equal(io.read_recording(tmp_path / "log.csv")["a_y"], recording["a_y"].astype(np.float64))


def test_units_in_names_round_trip(tmp_path):
    recording = drive()
    io.write_recording(io.with_units_in_names(recording), tmp_path / "log.csv")
    assert (tmp_path / "log.csv").read_text().startswith("time,yaw_rate [rad/s],v_x [m/s],")
    assert io.read_recording(tmp_path / "log.csv").units == recording.units


def test_brackets_are_units_only_where_they_hold_one(tmp_path):
    (tmp_path / "log.csv").write_text("time [ms],wheel[0],wheel[1],yaw_rate[deg/s]\n0,1,2,90\n10,1,2,90\n")
    recording = io.read_recording(tmp_path / "log.csv")
    assert recording.names == ("wheel[0]", "wheel[1]", "yaw_rate")
    np.testing.assert_allclose(recording["yaw_rate"], np.pi / 2, rtol=1e-15)
    np.testing.assert_allclose(recording.time, [0.0, 0.01], rtol=1e-15)


def test_csv_refuses_known_channels_in_other_units(tmp_path):
    recording = Recording([0.0, 1.0], {"yaw_rate": [1.0, 2.0]}, {"yaw_rate": "deg/s"})
    with pytest.raises(InputError, match="yaw_rate is in 'deg/s', not in 'rad/s', and CSV has no place for units"):
        io.write_recording(recording, tmp_path / "log.csv")
    io.write_recording(io.with_units_in_names(recording), tmp_path / "log.csv")
    np.testing.assert_allclose(io.read_recording(tmp_path / "log.csv")["yaw_rate"], np.deg2rad([1.0, 2.0]), rtol=1e-15)


def test_csv_takes_a_unit_that_is_written_otherwise(tmp_path):
    recording = Recording([0.0, 1.0], {"drive_torque": [1.0, 2.0]}, {"drive_torque": "N m"})
    io.write_recording(recording, tmp_path / "log.csv")
    np.testing.assert_array_equal(io.read_recording(tmp_path / "log.csv")["drive_torque"], [1.0, 2.0])


@pytest.mark.parametrize("header", ["time;v_x", "Time\tv_x", "timestamps, v_x", "t,v_x,"])
def test_separators_and_time_names(tmp_path, header):
    separator = next(c for c in ";\t," if c in header)
    end = separator if header.endswith(separator) else ""
    rows = [separator.join(row) + end for row in (("0", "1.5"), ("1", " "), ("2", "3.5"))]
    (tmp_path / "log.csv").write_text("\n".join([header, *rows]) + "\n\n")
    recording = io.read_recording(tmp_path / "log.csv")
    assert recording.names == ("v_x",)
    np.testing.assert_array_equal(recording["v_x"], [1.5, np.nan, 3.5])
    np.testing.assert_array_equal(recording.time, [0.0, 1.0, 2.0])


BROKEN_CSV = {
    "word in a cell": ("time,v_x\n0,1\n1,fast\n", r"column 'v_x', data row 2: 'fast' is not a number"),
    "decimal comma or thousands": (
        "time;v_x\n0;1,500\n1;2,500\n",
        r"'v_x', data row 1: '1,500' .* set decimal = \",\" under \[csv\]",
    ),
    "dates": ("time,v_x\n01/02/2024,1\n", r"column 'time', data row 1: '01/02/2024' is not a number"),
    "time goes back": (
        "time,v_x\n0,1\n2,1\n1,1\n",
        r"time\[2\] = 1.0 after time\[1\] = 2.0: must be strictly increasing",
    ),
    "time repeats": (
        "time,v_x\n0,1\n1,1\n1,2\n",
        r"time\[2\] = 1.0 after time\[1\] = 1.0: must be strictly increasing",
    ),
    "time missing in a row": ("time,v_x\n0,1\n,1\n", r"time is not finite in row 1"),
    "no rows": ("time,v_x\n", r"the log is empty: it has columns but no row"),
    "no bytes": ("", r"the file is empty"),
    "no time": ("clock,v_x\n0,1\n", r"no time column \(time, timestamps, .*there are: clock, v_x"),
    "no channel": ("time\n0\n1\n", r"has no channel except time"),
    "no header": ("0.0,1.0\n0.1,1.0\n", r"line 1 holds numbers only"),
    "name twice": ("time,v_x,v_x\n0,1,2\n", r"several columns are named 'v_x'"),
    "name twice but for units": ("time,v_x [m/s],v_x [km/h]\n0,1,2\n", r"same name without their \[unit\]"),
    "rows longer than the header": ("time,v_x\n0,1,2\n1,1,2\n", r"more cells than line 1 has names \(2\)"),
    "one row longer": (
        "time,v_x\n0,1\n1,1,2\n",
        r"more cells than|line 3 has 3 cells, more than the number of names \(2\)",
    ),
    "unit of another thing": ("time,yaw_rate [m]\n0,1\n", r"yaw_rate: unit 'm' is of another quantity.*'rad/s'"),
    "unit unknown": ("time,yaw_rate [furlogs]\n0,1\n", r"yaw_rate: unit 'furlogs' is not known"),
}


@pytest.mark.parametrize("case", BROKEN_CSV)
def test_broken_csv(tmp_path, case):
    content, message = BROKEN_CSV[case]
    path = tmp_path / "log.csv"
    path.write_text(content)
    with pytest.raises(InputError, match=message) as caught:
        io.read_recording(path)
    assert str(path) in str(caught.value)


def test_files_that_are_not_what_they_seem(tmp_path):
    for suffix, kind in ((".parquet", "Parquet"), (".mf4", "MDF")):
        path = tmp_path / f"log{suffix}"
        path.write_bytes(b"nonsense" * 100)
        with pytest.raises(InputError, match=f"is not a readable {kind} file"):
            io.read_recording(path)
    (tmp_path / "log.csv").write_bytes(b"time,v_x\x81\n0,1\n")
    with pytest.raises(InputError, match=r"is not UTF-8 text \(byte 8\), nor Windows-1252"):
        io.read_recording(tmp_path / "log.csv")
    (tmp_path / "late.csv").write_bytes(b"time,v_x\n" + b"0,1\n" * 9 + b"1,\x81\n")
    with pytest.raises(InputError, match=r"is not UTF-8 text \(byte 47\), nor Windows-1252"):
        io.read_recording(tmp_path / "late.csv")
    with pytest.raises(
        InputError, match=r"suffix '.xlsx' is not read: save the sheet as CSV; a log must end in one of .csv"
    ):
        io.read_recording(tmp_path / "log.xlsx")
    with pytest.raises(InputError, match=r"nothing\.csv: cannot be read"):
        io.read_recording(tmp_path / "nothing.csv")


def test_truncated_files(tmp_path):
    for suffix in (".parquet", ".mf4"):
        whole = tmp_path / f"log{suffix}"
        io.write_recording(drive(), whole)
        cut = tmp_path / f"cut{suffix}"
        cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
        with pytest.raises(InputError, match=f"cut{suffix}: is not a readable"):
            io.read_recording(cut)


def test_parquet_of_pandas(tmp_path):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"t": [0, 1, 2], "gear": [1, None, 3], "on": [True, False, True]}, index=[5, 6, 7])
    frame.to_parquet(tmp_path / "log.parquet")
    recording = io.read_recording(tmp_path / "log.parquet")
    assert recording.names == ("gear", "on")
    np.testing.assert_array_equal(recording["gear"], [1, np.nan, 3])
    np.testing.assert_array_equal(recording["on"], [1, 0, 1])
    frame["on"] = pandas.to_datetime([1, 2, 3], unit="s")
    frame.to_parquet(tmp_path / "log.parquet")
    with pytest.warns(JaxvehWarning, match="left out 'on': .*contains dates, not numbers"):
        assert io.read_recording(tmp_path / "log.parquet").names == ("gear",)


def test_nothing_is_overwritten_unasked(tmp_path):
    path = tmp_path / "log.parquet"
    path.write_text("precious")
    with pytest.raises(InputError, match="exists already; pass overwrite=True"):
        io.write_recording(drive(), path)
    assert path.read_text() == "precious"
    io.write_recording(drive(), path, overwrite=True)
    assert len(io.read_recording(path)) == 200


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_failure_leaves_no_half_written_file(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"log{suffix}"
    path.write_text("precious")

    def fails_half_way(part, *_):
        part.write_text("half")
        raise KeyboardInterrupt

    monkeypatch.setitem(io.recordings._WRITE, suffix, fails_half_way)
    with pytest.raises(KeyboardInterrupt):
        io.write_recording(drive(), path, overwrite=True)
    assert path.read_text() == "precious"
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        io.write_recording(drive(), tmp_path / "nowhere" / "log.csv")
    (tmp_path / "log.csv").mkdir()
    with pytest.raises(InputError, match="is a folder"):
        io.write_recording(drive(), tmp_path / "log.csv")
    with pytest.raises(InputError, match="a channel is named `time`"):
        io.write_recording(Recording([0.0], {"time": [1.0]}), tmp_path / "other.csv")


@pytest.mark.parametrize(
    ("library", "suffix"), [("pandas", ".csv"), ("pyarrow", ".parquet"), ("asammdf", ".mf4")], ids=lambda v: v
)
def test_a_missing_library_is_named(tmp_path, monkeypatch, library, suffix):
    path = tmp_path / f"log{suffix}"
    io.write_recording(drive(), path)
    monkeypatch.setitem(__import__("sys").modules, library, None)
    message = rf'{library} is not installed, and reading .* needs it: run `pip install "jaxveh\[io\]"`'
    with pytest.raises(InputError, match=message):
        io.read_recording(path)
    with pytest.raises(InputError, match=f"{library} is not installed, and writing"):
        io.write_recording(drive(), path, overwrite=True)


def test_the_shared_log_reads():
    recording = io.read_recording(shared("ferrari_250lm_100hz.csv"))
    assert len(recording) == 27500
    assert recording.names[:6] == ("v_x", "v_y", "yaw_rate", "a_x", "a_y", "steer")
    assert recording.unit("steer") == "rad"
    np.testing.assert_allclose(np.asarray(recording.time)[[0, -1]], [149.99, 149.99 + 274.99], atol=0.011)
    assert float(recording["v_x"][0]) == 26.05848

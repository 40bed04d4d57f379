"""MATLAB's files as logs, of version 5 by scipy's writer and of version 7.3 in MATLAB's own layout."""

import struct
import warnings
from pathlib import Path

import numpy as np
import pytest

from jaxveh import InputError, io
from jaxveh.io import mat_file

scipy_io = pytest.importorskip("scipy.io")

T = np.arange(5) * 0.1
V = np.array([20.0, 20.5, np.nan, 1 / 3, -0.0])
SLOW = T[::2]


def write_old(path, variables):
    scipy_io.savemat(path, {name: _old(value) for name, value in variables.items()}, oned_as="column")


def write_new(path, variables):
    pytest.importorskip("h5py")
    from matlab_files import write_new

    write_new(path, variables)


def _old(value):
    """Cells and arrays of structs as scipy's writer wants them."""
    if isinstance(value, dict):
        return {name: _old(one) for name, one in value.items()}
    if isinstance(value, list) and isinstance(value[0], dict):
        made = np.empty(len(value), [(name, "O") for name in value[0]])
        for k, one in enumerate(value):
            made[k] = tuple(_old(part) for part in one.values())
        return made
    if isinstance(value, list):
        cells = np.empty(len(value), "O")
        cells[:] = [_old(one) for one in value]
        return cells
    return value


WRITE = {"5": write_old, "7.3": write_new}
LOGS = {
    "vectors of one length": ({"time": T, "v_x": V, "yaw_rate": T}, {"v_x": V, "yaw_rate": T}, {}),
    "rows and columns": ({"t": T[:, None], "v_x": V[None], "gear": np.arange(5, dtype=np.uint8)[:, None],
                          "on": T > 0.1}, {"v_x": V, "gear": np.arange(5.0), "on": [0, 0, 1, 1, 1]}, {}),
    "structs with Time and Data": (
        {"log": {"v_x": {"Time": T, "Data": V, "Units": "m/s"}, "gas": {"Time": T, "Data": T}}}, {"v_x": V, "gas": T}, {}),
    "two rates": ({"log": {"v_x": {"Time": T, "Data": V}, "gas": {"Time": SLOW, "Data": SLOW}}},
                  {"v_x": V, "gas": [0, np.nan, 0.2, np.nan, 0.4]}, {}),
    "a struct of vectors, deep": ({"run": {"bus": {"Time": T, "imu": {"yaw_rate": V}, "v_x": T}}}, {"yaw_rate": V, "v_x": T}, {}),
    "timeseries as a struct, in its units": (
        {"speed": {"Time": 1000 * T, "TimeInfo": {"Units": "milliseconds"}, "Data": 3.6 * T, "DataInfo": {"Units": "km/h"}}},
        {"speed": T}, {"speed": "m/s"}),
    "Simulink's structure with time": (
        {"scope": {"time": T, "blockName": "model/Scope",
                   "signals": [{"values": V[:, None], "label": "v_x"}, {"values": np.stack([T, V], 1), "label": "F"}]}},
        {"v_x": V, "F[0]": T, "F[1]": V}, {}),
    "one signal": ({"scope": {"time": T, "signals": {"values": V[:, None], "label": ""}}}, {"scope": V}, {}),
    "a matrix, text and cells beside it": ({"t": T, "wheels": np.stack([T, V, T, V], 1), "car": "sedan", "notes": ["a", "bc"]},
                                           {"wheels[0]": T, "wheels[1]": V, "wheels[2]": T, "wheels[3]": V}, {}),
    "one name twice": ({"a": {"t": T, "v": T}, "b": {"t": T, "v": V}}, {"a.v": T, "b.v": V}, {}),
}  # fmt: skip


@pytest.mark.parametrize("version", WRITE)
@pytest.mark.parametrize("case", LOGS)
def test_a_log_is_read(tmp_path, case, version):
    content, channels, units = LOGS[case]
    WRITE[version](tmp_path / "log.mat", content)
    found = io.read_recording(tmp_path / "log.mat")
    assert set(found.names) == set(channels) and found.source == "log.mat"
    # HDF5 has the fields of a struct in the order of the alphabet.
    assert version == "7.3" or found.names == tuple(channels)
    np.testing.assert_allclose(found.time, T, rtol=1e-15)
    for name, values in channels.items():
        np.testing.assert_allclose(found[name], values, rtol=1e-14, err_msg=name)
    for name, unit in units.items():
        assert found.unit(name) == unit


@pytest.mark.parametrize("version", WRITE)
@pytest.mark.parametrize("dtype", ["f8", "f4", "i1", "i4", "u2", "u8", "b1"])
def test_every_type_of_numbers(tmp_path, version, dtype):
    values = np.array([0, 1, 2, 100, 1], dtype)
    WRITE[version](tmp_path / "log.mat", {"time": T, "x": values})
    np.testing.assert_array_equal(io.read_recording(tmp_path / "log.mat")["x"], values.astype(float))


@pytest.mark.parametrize("version", WRITE)
def test_a_channel_map_names_time_and_columns_by_their_whole_paths(tmp_path, version):
    content = {"log": {"stamp": 1000 * T, "speed": 3.6 * V, "yaw": T}, "other": {"speed": T, "t": SLOW}}
    WRITE[version](tmp_path / "log.mat", content)
    chosen = io.ChannelMap(
        {"v_x": io.Channel("log.speed", unit="km/h"), "yaw": "yaw"}, time=io.Channel("log.stamp", unit="ms")
    )
    found = io.read_recording(tmp_path / "log.mat", chosen)
    np.testing.assert_allclose(found.time, T, rtol=1e-15)
    np.testing.assert_allclose(found["v_x"], V, rtol=1e-15)
    with pytest.raises(InputError, match=r"no vector 'stmp' \(did you mean 'stamp'\?\); there are"):
        io.read_recording(tmp_path / "log.mat", io.ChannelMap({"yaw": "yaw"}, time=io.Channel("stmp")))
    with pytest.raises(InputError, match=r"no column 'yow' \(did you mean 'yaw'"):
        io.read_recording(tmp_path / "log.mat", io.ChannelMap({"yaw": "yow"}, time=io.Channel("stamp")))


NOTHING = {
    "no time": ({"x": T, "y": V}, r"no vector belongs to a time vector \(time, .*found: x \([15]x[15]\), y"),
    "another length": ({"t": T, "x": np.zeros(7)}, r"found: x \([17]x[17]\)"),
    "words": ({"car": "sedan"}, "found: nothing"),
}


@pytest.mark.parametrize("version", WRITE)
@pytest.mark.parametrize("case", NOTHING)
def test_what_is_no_log_is_told_with_what_was_found(tmp_path, case, version):
    content, message = NOTHING[case]
    WRITE[version](tmp_path / "log.mat", content)
    with pytest.raises(InputError, match=message):
        io.read_recording(tmp_path / "log.mat")


def test_objects_are_named(tmp_path):
    pytest.importorskip("h5py")
    from matlab_files import Opaque

    write_new(tmp_path / "log.mat", {"ts": Opaque()})
    with pytest.raises(InputError, match=r"found: ts \(timeseries\).*save their fields, such as log.v_x.Time"):
        io.read_recording(tmp_path / "log.mat")
    write_new(tmp_path / "log.mat", {"ts": Opaque(), "time": T, "x": V})
    with pytest.raises(InputError, match=r"no column 'ts'.* Not read: ts \(timeseries\)"):
        io.read_recording(tmp_path / "log.mat", io.ChannelMap({"v_x": "ts"}))


@pytest.mark.parametrize("version", WRITE)
def test_time_that_goes_back(tmp_path, version):
    WRITE[version](tmp_path / "log.mat", {"time": T[::-1], "x": V})
    with pytest.raises(InputError, match=r"column 'x': time\[1\] = 0.3.* after time\[0\] = 0.4.*strictly increasing"):
        io.read_recording(tmp_path / "log.mat")


@pytest.mark.parametrize("version", WRITE)
def test_a_matrix_of_many_columns_is_none(tmp_path, version):
    WRITE[version](tmp_path / "log.mat", {"time": T, "x": V, "picture": np.zeros((5, 65))})
    assert io.read_recording(tmp_path / "log.mat").names == ("x",)


def test_a_cut_file_is_told_where_it_ends(tmp_path):
    write_old(tmp_path / "log.mat", {"time": T, "x": V})
    whole = (tmp_path / "log.mat").read_bytes()
    (tmp_path / "log.mat").write_bytes(whole[:-8])
    with pytest.raises(
        InputError, match=r"an element of \d+ bytes at byte \d+ does not fit into it\). Is the file damaged"
    ):
        io.read_recording(tmp_path / "log.mat")
    (tmp_path / "log.mat").write_bytes(whole[:133])
    with pytest.raises(InputError, match="it ends within an element, at byte 128"):
        io.read_recording(tmp_path / "log.mat")


MATLABS = sorted((Path(scipy_io.__file__).parent / "matlab" / "tests" / "data").glob("test*[5-9].*_[GSW]*.mat"))
"""Files that MATLAB itself wrote, on three systems, where scipy was installed with them."""


def test_what_matlab_wrote_is_what_scipy_reads():
    compared = 0
    if not MATLABS:
        pytest.skip("this scipy came without MATLAB's files")
    pytest.importorskip("h5py")  # for one of them
    for path in MATLABS:
        found = mat_file.read_mat(path)
        if "hdf5" in path.name:
            np.testing.assert_allclose(found["testdouble"], np.arange(9)[None] * np.pi / 4)
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of complex numbers
            reference = scipy_io.loadmat(path, mat_dtype=True)
        assert set(found) == {name for name in reference if not name.startswith("__")}, path.name
        for name, value in found.items():
            if isinstance(value, np.ndarray):
                assert value.dtype == reference[name].dtype.newbyteorder("=") or value.dtype == bool
                np.testing.assert_array_equal(value, reference[name], err_msg=path.name)
                compared += 1
    assert compared > 15


@pytest.mark.parametrize("version", WRITE)
def test_the_maps_time_is_for_what_has_no_clock_of_its_own(version, tmp_path):
    """And its unit is that of all clocks."""
    WRITE[version](
        tmp_path / "log.mat", {"Zeit": 1000 * T, "vx": T + 20.0, "log": {"ay": {"Time": 1000 * SLOW, "Data": SLOW}}}
    )
    (tmp_path / "map.toml").write_text(
        'time = { column = "Zeit", unit = "ms" }\n[channels]\nv_x = "vx"\na_y = "log.ay"\n'
    )
    found = io.read_recording(tmp_path / "log.mat", io.read_channel_map(tmp_path / "map.toml"))
    np.testing.assert_allclose(found.time, T)
    np.testing.assert_allclose(found["v_x"], T + 20.0)
    there = np.isfinite(np.asarray(found["a_y"]))
    np.testing.assert_allclose(np.asarray(found.time)[there], SLOW)


@pytest.mark.parametrize("version", WRITE)
def test_a_time_within_a_struct_has_the_maps_unit(version, tmp_path):
    WRITE[version](tmp_path / "log.mat", {"log": {"time": 1000 * T, "vx": T + 20.0}})
    (tmp_path / "map.toml").write_text('time = { column = "log.time", unit = "ms" }\n[channels]\nv_x = "log.vx"\n')
    found = io.read_recording(tmp_path / "log.mat", io.read_channel_map(tmp_path / "map.toml"))
    np.testing.assert_allclose(found.time, T)


@pytest.mark.parametrize("format", ["<", ">"])
def test_version_4_is_told_with_who_writes_it(tmp_path, format):
    """Dymola and OpenModelica write it: a number of four digits, rows, columns, 0, length of the name, the name, the numbers."""
    numbers = np.linspace(0.0, 1.0, 11)
    head = struct.pack(f"{format}5i", 1000 if format == ">" else 0, 11, 1, 0, 5)
    (tmp_path / "log.mat").write_bytes(head + b"time\0" + numbers.astype(f"{format}f8").tobytes())
    with pytest.raises(InputError, match=r"it is of version 4, as Dymola and OpenModelica .*with -v7\)\.$"):
        io.read_recording(tmp_path / "log.mat")


def recorded(axes, traces):
    """A capture of ControlDesk: axes by their instants, traces by the number of their axis (from 1), name, unit and values."""
    row = lambda values: np.asarray(values, float)[None]
    x = [{"Name": "Time", "Type": "time", "Data": row(one), "Unit": "s"} for one in axes]
    y = [
        {"Name": name, "Type": "value", "Data": row(values), "Unit": unit, "XIndex": np.array([[float(axis)]])}
        for axis, name, unit, values in traces
    ]
    return {
        "exp1": {
            "X": x if len(x) > 1 else x[0],
            "Y": y if len(y) > 1 else y[0],
            "Description": "d",
            "Capture": {"Length": 1.0},
        }
    }


@pytest.mark.parametrize("write", [write_old, write_new])
@pytest.mark.parametrize("several", [False, True])
def test_a_capture_of_control_desk(tmp_path, write, several):
    path, deep = tmp_path / "exp1.mat", "Model Root/esp/yaw_rate/Out1"
    traces = [
        (1, f'"{deep}"', "deg/s", 2 * T),
        (1, "a_y", "m/s^2", 3 * T),
        *([(2, "v_x", "km/h", 36 + SLOW)] if several else []),
    ]
    write(path, recorded([T, SLOW] if several else [T], traces))
    found = io.read_recording(path)
    assert set(found.names) == {deep, "a_y", *(["v_x"] if several else [])}
    np.testing.assert_array_equal(found.time, T)
    np.testing.assert_allclose(found[deep], 2 * T)
    np.testing.assert_allclose(found["a_y"], 3 * T)
    if several:
        np.testing.assert_allclose(found["v_x"][::2], (36 + SLOW) / 3.6)
        assert np.isnan(found["v_x"][1::2]).all()
    mapped = io.read_recording(path, io.ChannelMap({"yaw_rate": io.Channel(deep, sign=-1)}))
    np.testing.assert_allclose(mapped["yaw_rate"], -np.radians(2 * T))


def test_a_single_trace_of_control_desk(tmp_path):
    write_old(tmp_path / "exp1.mat", recorded([T], [(1, "a_y", "m/s^2", 3 * T)]))
    np.testing.assert_allclose(io.read_recording(tmp_path / "exp1.mat")["a_y"], 3 * T)
    write_old(tmp_path / "exp1.mat", recorded([T, SLOW], [(3, "a_y", "m/s^2", 3 * T)]))
    with pytest.raises(InputError, match="no vector belongs to a time vector"):
        io.read_recording(tmp_path / "exp1.mat")

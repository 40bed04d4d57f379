"""Recordings through every format, in every float type: what comes back exactly, and what keeps its values alone."""

import jax
import jax.numpy as jnp
import ml_dtypes
import numpy as np
import pytest

from jaxveh import InputError, Recording, io

pandas, xarray = pytest.importorskip("pandas"), pytest.importorskip("xarray")
pytest.importorskip("h5netcdf")
pytest.importorskip("mcap.writer")

DTYPES = {"half": np.float16, "brain": ml_dtypes.bfloat16, "single": np.float32, "double": np.float64}
ROWS = 40


def drive(dtype):
    """Values at the ends of the type, gaps, both zeros; a name that no format likes; stamps in whole microseconds."""
    ends = [
        float(np.asarray(one, dtype)) for one in (1 / 3, jnp.finfo(dtype).max, jnp.finfo(dtype).tiny, -0.0, 0.0, np.nan)
    ]
    waves = np.sin(np.arange(ROWS))
    channels = {
        "yaw_rate": waves,
        "ends": np.resize(ends, ROWS),
        "true.v_y": np.where(waves > 0.5, np.nan, waves),
        "x/y é": waves,
    }
    channels = {name: jnp.asarray(np.asarray(values, dtype)) for name, values in channels.items()}
    units = {"yaw_rate": "rad/s", "true.v_y": "m/s", "x/y é": "mm"}
    return Recording(10.0 + np.cumsum(np.arange(ROWS) * 0.000125), channels, units, "a drive <1> & more")


def through_file(suffix):
    def go(recording, folder):
        recording.save(folder / f"log{suffix}")
        return Recording.load(folder / f"log{suffix}")

    return go


def through_mcap(recording, folder):
    io.write_topics({"/log": recording.to_pandas()}, folder / "log.mcap")
    return Recording.load(folder / "log.mcap")


def through_mat(recording, folder):
    scipy_io = pytest.importorskip("scipy.io")
    names = {f"c{k}": name for k, name in enumerate(recording.names)}
    wide = lambda values: np.asarray(values, np.float32 if values.dtype.itemsize == 2 else values.dtype)
    tree = {"time": recording.time, **{short: wide(recording[name]) for short, name in names.items()}}
    scipy_io.savemat(folder / "log.mat", tree, oned_as="column")
    found = Recording.load(folder / "log.mat")
    return Recording(
        found.time, {name: found[short] for short, name in names.items()}, dict(recording.units), recording.source
    )


EXACT, WIDE = "exact", "its values, in JAX's float type"
WAYS = {
    ".csv": (through_file(".csv"), WIDE, "no units of unknown names, no note"),
    ".parquet": (through_file(".parquet"), EXACT, ""),
    ".mf4": (through_file(".mf4"), WIDE, ""),
    ".mdf": (through_file(".mdf"), WIDE, ""),
    ".nc": (through_file(".nc"), EXACT, ""),
    ".mat": (through_mat, WIDE, ""),
    ".mcap": (through_mcap, WIDE, "stamps in nanoseconds, digits of the column's own type"),
    "pandas": (lambda recording, _: Recording.from_pandas(recording.to_pandas()), EXACT, ""),
    "xarray": (lambda recording, _: Recording.from_xarray(recording.to_xarray()), EXACT, ""),
}
"""How a recording goes and comes back; what of the channels is kept; what else is not."""


def test_every_suffix_is_here():
    texts = {".txt", ".tsv", ".dat", ".log", ".vbo"}  # not written: see test_loggers and test_vbo
    assert {way for way in WAYS if way.startswith(".")} | texts == set(io.LOG_SUFFIXES)
    assert set(io.SUFFIXES) | {".mat", ".mcap"} | texts == set(io.LOG_SUFFIXES)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("way", WAYS)
def test_a_recording_comes_back(way, dtype, tmp_path):
    go, kept, _ = WAYS[way]
    recording = drive(DTYPES[dtype])
    again = go(recording, tmp_path)
    assert again.names == recording.names
    np.testing.assert_array_equal(again.time, recording.time)
    for name in recording.names:
        assert again[name].dtype == (recording[name].dtype if kept == EXACT else np.float64)
        # JSON has the digits of a number's own type, which are fewer than its value has in double precision.
        wide = lambda values: (
            np.asarray(values).astype(DTYPES[dtype] if way == ".mcap" else np.float64).astype(np.float64)
        )
        np.testing.assert_array_equal(wide(again[name]), wide(recording[name]), err_msg=name)
        assert np.array_equal(np.signbit(wide(again[name])), np.signbit(wide(recording[name]))), name
    if way == ".csv":
        assert "x/y é" not in dict(again.units)
    else:
        assert again.units == recording.units and again.source == recording.source


@pytest.mark.parametrize("way", [way for way, (_, kept, _) in WAYS.items() if kept == EXACT])
def test_it_is_the_same_tree_and_unit_as_it_was(way, tmp_path):
    """A known channel in a unit that is not SI too, which `read_recording` would convert."""
    recording = drive(np.float32).replace(units={"yaw_rate": "deg/s"})
    again = WAYS[way][0](recording, tmp_path)
    assert again.unit("yaw_rate") == "deg/s" and jax.tree.structure(again) == jax.tree.structure(recording)
    if way.startswith("."):
        read = io.read_recording(tmp_path / f"log{way}")
        np.testing.assert_allclose(read["yaw_rate"], np.radians(np.asarray(recording["yaw_rate"], float)), rtol=1e-12)
        assert read["yaw_rate"].dtype == np.float64 and read.unit("yaw_rate") == "rad/s"


def test_a_suffix_that_is_not_read_is_told_with_those_that_are(tmp_path):
    for suffix in (".xlsx", ".bag", "", ".py", ".MCPA"):
        path = tmp_path / f"log{suffix}"
        path.write_text("x")
        for read in (io.read_recording, Recording.load):
            with pytest.raises(
                InputError,
                match=r"must end in one of \.csv, \.parquet, \.mf4, \.mdf, \.mat, \.mcap, \.nc, \.vbo, \.txt, .*, \.log\.",
            ) as told:
                read(path)
        assert ("Did you mean .mcap?" in str(told.value)) == (suffix == ".MCPA")


def test_a_stranger_s_netcdf_is_a_log(tmp_path):
    time = np.arange(5) * 0.25
    data = xarray.Dataset(
        {
            "v_x": ("time", time, {"units": "km/h"}),
            "gear": ("time", np.arange(5)),
            "map": (("time", "k"), np.zeros((5, 2))),
        },
        {"time": ("time", time, {"units": "s"})},
    )
    data.to_netcdf(tmp_path / "log.nc", engine="h5netcdf")
    for found in (io.read_recording(tmp_path / "log.nc"), Recording.load(tmp_path / "log.nc")):
        assert found.names == ("v_x", "gear") and found.unit("v_x") == "m/s"
        np.testing.assert_allclose(found["v_x"], time / 3.6, rtol=1e-15)
        np.testing.assert_array_equal(found.time, time)
    assert Recording.from_xarray(data).unit("v_x") == "km/h"  # as it stands there
    with pytest.raises(InputError, match=r"must be of Estimate|no coordinate|another program"):
        Recording.from_xarray(data.drop_vars("time"))


FRAMES = {
    "a column": (lambda T: {"time": T}, None),
    "the index": (lambda T: {}, lambda T: T),
    "a time delta": (lambda T: {}, lambda T: pandas.to_timedelta(T, unit="s")),
    "a date": (lambda T: {}, lambda T: pandas.to_datetime(T, unit="s")),
    "a date somewhere": (
        lambda T: {},
        lambda T: pandas.to_datetime(T, unit="s", utc=True).tz_convert("America/New_York"),
    ),
}


@pytest.mark.parametrize("case", FRAMES)
def test_a_stranger_s_frame_is_a_recording(case):
    T = np.array([0.5, 1.25, 3.0])
    column, index = FRAMES[case]
    columns = {**column(T), "v_x [km/h]": np.float32([36, 72, 18]), "gear": [1, None, 3], "on": [True, False, True]}
    frame = pandas.DataFrame(columns, index=None if index is None else index(T))
    found = Recording.from_pandas(frame)
    assert found.names == ("v_x", "gear", "on") and dict(found.units) == {"v_x": "m/s"}
    np.testing.assert_allclose(found.time, T, rtol=1e-15)
    np.testing.assert_allclose(found["v_x"], [10, 20, 5], rtol=1e-7)
    np.testing.assert_array_equal(found["gear"], [1, np.nan, 3])


def test_a_frame_that_is_none_is_told():
    with pytest.raises(InputError, match="from_frame: dict: must be a pandas.DataFrame"):
        Recording.from_pandas({})
    with pytest.raises(InputError, match="several columns are named 'a'"):
        Recording.from_pandas(pandas.DataFrame([[0.0, 1.0]], columns=["a", "a"]))
    with pytest.raises(InputError, match=r"same name without their \[unit\]"):
        Recording.from_pandas(pandas.DataFrame({"a [m]": [0.0], "a": [1.0]}))
    with pytest.raises(InputError, match="column 'car', data row 1: 'x' is not a number"):
        Recording.from_pandas(pandas.DataFrame({"car": ["x"]}))
    with pytest.raises(InputError, match="no column `time`"):
        Recording.from_pandas(pandas.DataFrame({"a": [1.0]}, index=["x"]))
    with pytest.raises(InputError, match="strictly increasing"):
        Recording.from_pandas(pandas.DataFrame({"a": [1.0, 2.0], "time": [1.0, 1.0]}))

"""Data frames of recordings and estimates."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Recording, io

pandas = pytest.importorskip("pandas")


class Report(NamedTuple):
    v_y: object
    load: object


class Estimate(NamedTuple):
    time: object
    mean: Report
    std: Report


@pytest.fixture
def estimate():
    return Estimate(
        np.array([0.0, 0.1]),
        Report(jnp.array([1.0, 2.0]), jnp.array([3.0, 4.0])),
        Report(jnp.array([0.1, 0.2]), jnp.array([0.3, 0.4])),
    )


def test_frame_of_a_recording():
    recording = Recording([0.0, 1.0], {"v_x": [1.0, np.nan]}, {"v_x": "m/s"}, "here")
    frame = io.to_frame(recording)
    assert list(frame.columns) == ["time", "v_x"]
    np.testing.assert_array_equal(frame["v_x"], [1.0, np.nan])
    assert frame.attrs == {"units": {"v_x": "m/s"}, "source": "here"}


def test_frame_of_an_estimate(estimate):
    frame = io.to_frame(estimate)
    assert list(frame.columns) == ["time", "v_y", "v_y_std", "load", "load_std"]
    np.testing.assert_array_equal(frame["load_std"], [0.3, 0.4])
    assert frame.attrs["units"] == {"v_y": "m/s", "v_y_std": "m/s"}


@pytest.mark.parametrize("suffix", io.SUFFIXES)
def test_frames_written_and_read(tmp_path, estimate, suffix):
    frame = io.to_frame(estimate)
    io.write_frame(frame, tmp_path / f"estimate{suffix}")
    again = io.to_frame(io.read_recording(tmp_path / f"estimate{suffix}"))
    pandas.testing.assert_frame_equal(again, frame, check_exact=True)
    with pytest.raises(InputError, match="exists already"):
        io.write_frame(frame, tmp_path / f"estimate{suffix}")


def test_what_is_no_frame(tmp_path, estimate):
    with pytest.raises(InputError, match="3 has no time, mean and std"):
        io.to_frame(3)
    with pytest.raises(InputError, match=r"v_y has shape \(1,\); it must be that of time, \(2,\)"):
        io.to_frame(estimate._replace(mean=Report(jnp.ones(1), jnp.ones(2))))
    with pytest.raises(InputError, match="no column `time`; there are: a"):
        io.write_frame(pandas.DataFrame({"a": [1.0]}), tmp_path / "x.csv")
    with pytest.raises(InputError, match="column 'a', data row 1: 'x' is not a number"):
        io.write_frame(pandas.DataFrame({"time": [0.0], "a": ["x"]}), tmp_path / "x.csv")
    assert not list(tmp_path.iterdir())

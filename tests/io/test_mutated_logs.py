"""Every kind of log that is no text, cut and spoilt at random: a recording, or an `InputError`; never another exception."""

import random
import warnings

import numpy as np
import pytest
from mutations import spoil

from jaxveh import InputError, Recording, io

COUNT, MANY = 240, 3000
"""Spoilt files of each kind: in the default run and in the full one,"""

SLOW = {"MDF4": 120, "NetCDF": 4}
"""and how many times fewer of those whose readers are slow: MDF4's collects what it has left, which takes a second at times."""

T = np.arange(40) * 0.01
LOG = Recording(T, {"yaw_rate": np.sin(T), "v_x": 20 + T}, {"yaw_rate": "rad/s", "v_x": "m/s"}, "a drive")
TREE = {"time": T, "log": {"v_x": {"Time": T, "Data": 20 + T, "Units": "m/s"}, "yaw": np.stack([T, T], 1)}, "car": "sedan",
        "scope": {"time": T, "signals": [{"values": T, "label": "a"}, {"values": T, "label": "b"}]}}  # fmt: skip


def write_mat_old(path):
    scipy_io = pytest.importorskip("scipy.io")
    scipy_io.savemat(path, {name: value for name, value in TREE.items() if name != "scope"}, do_compression=False)


def write_mat_new(path):
    pytest.importorskip("h5py")
    from matlab_files import write_new

    write_new(path, TREE)


def write_mcap(path):
    pytest.importorskip("mcap.writer")
    io.write_topics({"/log": io.to_frame(LOG)}, path, overwrite=True)


def write_netcdf(path):
    pytest.importorskip("h5netcdf")
    write_as(path)


def write_as(path):
    io.write_recording(LOG, path, overwrite=True)


KINDS = {
    "MATLAB 5": ("mat", write_mat_old),
    "MATLAB 7.3": ("mat", write_mat_new),
    "MCAP": ("mcap", write_mcap),
    "Parquet": ("parquet", write_as),
    "MDF4": ("mf4", write_as),
    "NetCDF": ("nc", write_netcdf),
}


def test_every_log_that_is_no_text_is_here():
    told = {f".{suffix}" for suffix, _ in KINDS.values()}
    # Text is spoilt in test_mutated_files; and MDF4 by its other names.
    assert set(io.LOG_SUFFIXES) - told == {".csv", ".txt", ".tsv", ".dat", ".log", ".vbo", ".mdf"}


def check(kind, count, seed, folder):
    count //= SLOW.get(kind, 1)
    suffix, write = KINDS[kind]
    path = folder / f"odd.{suffix}"
    write(path)
    whole, read = path.read_bytes(), 0
    assert len(io.read_recording(path)) == len(T)
    for k in range(count):
        path.write_bytes(spoil(random.Random(f"{seed}/{k}"), whole))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = io.read_recording(path)
        except InputError:
            continue
        read += 1
        assert (np.diff(np.asarray(found.time)) > 0).all(), k
    assert read < count


@pytest.mark.parametrize("kind", KINDS)
def test_a_recording_or_an_error(kind, tmp_path):
    check(kind, COUNT, 1, tmp_path)


@pytest.mark.full
@pytest.mark.parametrize("kind", KINDS)
def test_a_recording_or_an_error_many_times(kind, tmp_path):
    check(kind, MANY, 2, tmp_path)

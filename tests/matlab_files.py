"""MATLAB's `.mat` files of version 7.3 as MATLAB lays them out: HDF5 behind a block of 512 bytes, arrays transposed, text as
numbers, cells and arrays of structs as references."""

import h5py
import numpy as np

CLASSES = {"f8": "double", "f4": "single", "b1": "logical"}


def write_new(path, variables):
    """Variables by name: arrays, text, dicts (structs), lists of dicts (arrays of structs), lists (cells), `Opaque`."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            _write(file, file, name, value)
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + b"\0" * 8 + b"\x00\x02IM")


class Opaque:
    """An object of a class, which MATLAB keeps as numbers that only it knows."""


def _write(file, parent, name, value):
    if isinstance(value, dict):
        group = parent.create_group(name)
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for key, one in value.items():
            _write(file, group, key, one)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        group = parent.create_group(name)
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for key in value[0]:
            group.create_dataset(key, data=_references(file, [one[key] for one in value]), dtype=h5py.ref_dtype)
    elif isinstance(value, list):
        cells = parent.create_dataset(name, data=_references(file, value), dtype=h5py.ref_dtype)
        cells.attrs["MATLAB_class"] = np.bytes_("cell")
    elif isinstance(value, str):
        text = parent.create_dataset(name, data=np.array([[ord(c)] for c in value], np.uint16))
        text.attrs["MATLAB_class"], text.attrs["MATLAB_int_decode"] = np.bytes_("char"), np.int32(2)
    elif isinstance(value, Opaque):
        numbers = parent.create_dataset(name, data=np.array([[0xDD000000, 2, 1, 1, 1, 1]], np.uint32))
        numbers.attrs["MATLAB_class"], numbers.attrs["MATLAB_object_decode"] = np.bytes_("timeseries"), np.int32(3)
    else:
        array = np.atleast_2d(np.asarray(value))
        kind = CLASSES.get(array.dtype.str[1:], array.dtype.name)
        data = parent.create_dataset(name, data=array.T.astype(np.uint8) if array.dtype == bool else array.T)
        data.attrs["MATLAB_class"] = np.bytes_(kind)


def _references(file, values):
    """Each value under a name in `#refs#`, and the references to them, (n, 1)."""
    refs = file.require_group("#refs#")
    found = []
    for value in values:
        name = f"r{len(refs)}"
        _write(file, refs, name, value)
        found.append(refs[name].ref)
    return np.array([[one] for one in found], dtype=h5py.ref_dtype)

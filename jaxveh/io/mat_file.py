"""The contents of a MATLAB file, of version 5 or 7.3 (HDF5, through h5py), as nested dicts, lists, strings and arrays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.io.mat_elements import DEEPEST, Unread, variables_of
from jaxveh.io.optional import require

HDF5 = b"\x89HDF\r\n\x1a\n"
MOST_CELLS = 100_000
HIDDEN = ("#refs#", "#subsystem#")


def read_mat(path: Path) -> dict[str, Any]:
    """Read the variables of a `.mat` file by name.

    Arrays have MATLAB's shapes; structs are dicts, cells and arrays of structs are lists, text is `str`; values that only MATLAB
    can read are `Unread`.

    **Raises** `InputError` for a file that is not a MATLAB file, or is damaged.
    """
    with path.open("rb") as file:
        head = file.read(520)
    is_new = head.startswith(HDF5) or head[512:520] == HDF5
    h5py = require("h5py", "reading MATLAB files of version 7.3") if is_new else None
    try:
        if is_new:
            return _read_new(h5py, path)
        return dict(variables_of(path.read_bytes()))
    except Exception as error:  # HDF5 raises any kind of error for a damaged block
        reason = str(error) or type(error).__name__
        doubt = "" if "version 4" in reason else " Is the file damaged?"
        raise InputError(f"{path}: is not a readable MATLAB file ({reason}).{doubt}") from error


def _read_new(h5py: Any, path: Path) -> dict[str, Any]:
    with h5py.File(path, "r") as file:
        return {_word(name): _node(h5py, file, file[name], 0) for name in file if name not in HIDDEN}


def _word(name: str | bytes) -> str:
    """Return a name as text, even if it is not UTF-8."""
    return name.decode(errors="replace") if isinstance(name, bytes) else str(name)


def _node(h5py: Any, file: Any, node: Any, depth: int) -> Any:
    """Read a group or data set in MATLAB's layout: transposed arrays, text as numbers, cells and struct arrays as references."""
    if depth > DEEPEST:
        raise InputError(f"structs are nested more than {DEEPEST} levels deep")
    kind = _word(node.attrs.get("MATLAB_class", ""))
    if "MATLAB_object_decode" in node.attrs:
        return Unread(kind or "an object")
    if isinstance(node, h5py.Group):
        parts = {_word(name): node[name] for name in node}
        # The fields of an array of structs are references without a class; a cell in a struct has the class cell.
        fields = {name: _node(h5py, file, one, depth + 1) for name, one in parts.items()}
        is_array = all(_is_bare(h5py, one) for one in parts.values())
        return _structs(fields) if fields and is_array else fields
    if node.attrs.get("MATLAB_empty", 0):
        return "" if kind == "char" else np.zeros((0, 0))
    if h5py.check_ref_dtype(node.dtype) is not None:
        if node.size > MOST_CELLS:
            raise InputError(f"{node.name}: {node.size} cells are too many for a log")
        cells = np.asarray(node[()]).ravel()
        return [_node(h5py, file, file[one], depth + 1) if one else np.zeros((0, 0)) for one in cells]
    values = np.asarray(node[()])
    if kind == "char":
        return "".join(map(chr, values.ravel().tolist()))
    if values.dtype.kind not in "fiub":
        return Unread(kind or str(values.dtype))
    return (values.astype(bool) if kind == "logical" else values).T


def _is_bare(h5py: Any, node: Any) -> bool:
    """Whether a node contains references, but has no class."""
    return (
        isinstance(node, h5py.Dataset)
        and h5py.check_ref_dtype(node.dtype) is not None
        and not node.attrs.get("MATLAB_class")
    )


def _structs(fields: dict[str, list]) -> Any:
    """Return the list of structs from fields that have one value per struct."""
    if len({len(values) for values in fields.values()}) != 1:
        raise InputError("the fields of an array of structs are of different lengths")
    parts = [dict(zip(fields, row, strict=True)) for row in zip(*fields.values(), strict=True)]
    return parts[0] if len(parts) == 1 else parts

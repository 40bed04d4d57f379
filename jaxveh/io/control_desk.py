"""The structs of dSPACE ControlDesk in `.mat` files: axes X and traces Y with a name and data, of which each has an axis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np


def traces_of(node: Mapping[str, Any]) -> list[tuple[int, Mapping[str, Any], int, Mapping[str, Any]]] | None:
    """Return the number and the struct of the axis and of each trace, or None for a struct of another kind."""
    axes, traces = (_structs(node.get(name)) for name in ("X", "Y"))
    if not axes or not traces or not all("Data" in one for one in (*axes, *traces)):
        return None
    found = []
    for number, trace in enumerate(traces):
        told = trace.get("XIndex")
        index = 0
        if len(axes) > 1 and isinstance(told, np.ndarray) and told.size == 1:
            index = int(told.ravel()[0]) - 1
        if not 0 <= index < len(axes):
            return None
        found.append((index, axes[index], number, trace))
    return found


def _structs(value: Any) -> list[Mapping[str, Any]]:
    """Return a struct or an array of structs as a list, empty for anything else."""
    value = value if isinstance(value, list) else [value]
    return value if all(isinstance(one, Mapping) for one in value) else []

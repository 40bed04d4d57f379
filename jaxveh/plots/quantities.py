"""The display of quantities: their names, the usual unit, and the factor from SI."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.recording import TRUTH
from jaxveh.io import CANONICAL, canonical_unit

_SHOWN = {
    "rad": ("°", 180 / math.pi),
    "rad/s": ("°/s", 180 / math.pi),
    "rad/s^2": ("°/s²", 180 / math.pi),
    "m/s^2": ("m/s²", 1.0),
    "N": ("kN", 1e-3),
    "N*m": ("N m", 1.0),
    "kg m^2": ("kg m²", 1.0),
    "N/rad": ("kN/rad", 1e-3),
}

_WORDS = {
    "v_x": "longitudinal speed",
    "v_y": "lateral speed",
    "a_x": "longitudinal acceleration",
    "a_y": "lateral acceleration",
    "a_z": "vertical acceleration",
    "steer": "steer",
    "F_yf": "front lateral force",
    "F_yr": "rear lateral force",
    "slip_angle_front": "front slip angle",
    "slip_angle_rear": "rear slip angle",
}

_UNITS = {
    "load_front": "N",
    "load_rear": "N",
    "yaw_acceleration": "rad/s^2",
    "steer_offset": "rad",
    "mass": "kg",
    "yaw_inertia": "kg m^2",
    "front_axle_to_cg": "m",
    "front_cornering_stiffness": "N/rad",
    "rear_cornering_stiffness": "N/rad",
}


class Quantity(NamedTuple):
    """The display of a quantity: `label` with unit for an axis; displayed value = `factor` times the SI value."""

    label: str
    unit: str
    factor: float

    def show(self, values: Any) -> np.ndarray:
        """Return values (any shape) in the displayed unit, as NumPy."""
        return np.asarray(values, dtype=np.float64) * self.factor


def quantity(name: str, unit: str | None = None) -> Quantity:
    """Return the display of a channel or state; `unit` is its unit in the data (default: the known one)."""
    plain = name.removeprefix(TRUTH)
    if unit in (None, "-"):
        unit = canonical_unit(plain) or _UNITS.get(plain, "-")
    shown, factor = _SHOWN.get(unit, (unit, 1.0))
    words = _WORDS.get(plain, plain.replace("_", " "))
    bare = unit in ("-", "1", "")
    return Quantity(words if bare else f"{words} [{shown}]", "" if bare else shown, factor)


def order(names) -> list[str]:
    """Return names in the order of `io.CANONICAL`, with unknown names last in their own order."""
    place = {name: i for i, name in enumerate(CANONICAL)}
    names = list(names)
    return sorted(names, key=lambda name: place.get(name.removeprefix(TRUTH), len(place) + names.index(name)))

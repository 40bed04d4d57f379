"""The numbers of a car's file that an estimator needs, the message for those that the file lacks, and those of a usual car."""

from __future__ import annotations

from collections.abc import Mapping

from jaxveh._core.errors import InputError
from jaxveh.io import CarSpecification
from jaxveh.io import kit as io
from jaxveh.vehicles import GRAVITY

USUAL_ROLL_GRADIENT = 0.006
"""rad/(m/s^2): roll of a usual body on its springs per lateral acceleration."""


def keys_of(car: CarSpecification, who: str, keys: Mapping[str, str]) -> dict[str, float]:
    """The numbers of a car's file by key; `keys` maps them to units. **Raises** `InputError` naming those that are missing,
    with units."""
    io.check_car_file(who, car)
    missing = [f"{key} ({unit})" for key, unit in keys.items() if getattr(car, key) is None]
    if missing:
        give = "it" if len(missing) == 1 else "them"
        raise InputError(f"{who}: the car's file has no {', '.join(missing)}; give {give}.")
    return {key: getattr(car, key) for key in keys}


def number_of(car: CarSpecification, key: str, who: str, unit: str) -> float:
    """One number of a car's file. **Raises** as `keys_of`."""
    return keys_of(car, who, {key: unit})[key]


def lean_of(car: CarSpecification) -> float:
    """By which share (-) the lateral acceleration that the body's accelerometer measures is larger than that in the road's plane,
    because the body leans: g times the file's `roll_gradient`, or that of a usual car."""
    return GRAVITY * (USUAL_ROLL_GRADIENT if car.roll_gradient is None else car.roll_gradient)


def numbers_in(car: CarSpecification, *keys: str) -> dict[str, float]:
    """The numbers of a car's file by key, without those that the file does not have."""
    return {key: value for key in keys if (value := getattr(car, key)) is not None}

"""The car that an option names: a file, or a car that comes with the package, at a chosen fidelity."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

from jaxveh import InputError, io, vehicles
from jaxveh._core.errors import check_one_of
from jaxveh.vehicles import kit

AS_PRINTED = "passenger_car_as_printed"
"""A car that exists only as a single track, to reproduce a paper."""

BUILT_IN = {**kit.CARS, AS_PRINTED: vehicles.passenger_car_as_printed}
"""The cars that come with the package, by name: functions that make a car's numbers, or the vehicle itself."""


def vehicle_of(name: str, fidelity: str = "single-track") -> vehicles.AbstractVehicle:
    """Return the car of a name or a file as a vehicle of the given fidelity.

    Raises `InputError` for an unknown name, and if the car lacks numbers that the fidelity needs.
    """
    check_one_of("--fidelity", fidelity, kit.FIDELITIES)
    if name in kit.CARS:
        return vehicles.named_car(name, fidelity)
    if name == AS_PRINTED:
        check_one_of(f"--fidelity of {AS_PRINTED}", fidelity, ("single-track",))
        return vehicles.passenger_car_as_printed()
    if not Path(name).suffix:
        raise InputError(f"--vehicle {name}: must be the path of a .toml file, or one of {', '.join(BUILT_IN)}.")
    return vehicles.specified_car(io.read_car(name), fidelity)


def first_line(of: Any) -> str:
    """Return the first paragraph of an object's docstring as one line."""
    return " ".join((inspect.getdoc(of) or "").partition("\n\n")[0].split()).replace("`", "")

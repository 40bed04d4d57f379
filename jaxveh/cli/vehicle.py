"""The car that an option names: a file, or one that comes with the package, at a chosen fidelity."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

from jaxveh import InputError, io, vehicles
from jaxveh._core.errors import check_one_of
from jaxveh.vehicles import kit

AS_PRINTED = "passenger_car_as_printed"
"""A single track alone: it is there to reproduce a paper."""

BUILT_IN = {**kit.CARS, AS_PRINTED: vehicles.passenger_car_as_printed}
"""What makes each car that comes with the package: its numbers, or the vehicle itself."""


def vehicle_of(name: str, fidelity: str = "single-track") -> vehicles.AbstractVehicle:
    """The car of a name or a file as the vehicle of a fidelity.

    Raises `InputError` for names that are not there, and where the car's numbers do not reach for the fidelity.
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
    """What something is in a line: that of its docstring."""
    return " ".join((inspect.getdoc(of) or "").partition("\n\n")[0].split()).replace("`", "")

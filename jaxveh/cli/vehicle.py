"""The car that an option names: a file, or a car that comes with the package, at a chosen fidelity."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

from jaxveh import InputError, io, vehicles
from jaxveh._core.errors import check_one_of, did_you_mean
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
        return _of_fidelity(functools.partial(vehicles.named_car, name), fidelity)
    if name == AS_PRINTED:
        check_one_of(f"--fidelity of {AS_PRINTED}", fidelity, ("single-track",))
        return vehicles.passenger_car_as_printed()
    if not Path(name).suffix:
        raise InputError(f"--vehicle {name}: must be the path of a .toml file, or one of {', '.join(BUILT_IN)}.")
    return _of_fidelity(functools.partial(vehicles.specified_car, io.read_car(name)), fidelity)


def _of_fidelity(make: Callable[[str], vehicles.AbstractVehicle], fidelity: str) -> vehicles.AbstractVehicle:
    """Make a vehicle; the error of a car that lacks numbers for it names the fidelities that can be made."""
    try:
        return make(fidelity)
    except InputError as error:
        others = [other for other in kit.FIDELITIES if other != fidelity and _can_be_made(make, other)]
        if not others:
            raise
        raise InputError(f"{error} The car has the numbers for --fidelity {', '.join(others)}.") from error


def _can_be_made(make: Callable[[str], vehicles.AbstractVehicle], fidelity: str) -> bool:
    try:
        make(fidelity)
    except InputError:
        return False
    return True


def car_of(vehicle: Path) -> io.CarSpecification:
    """Return the content of a car's file, or what it would be for a car that comes with the package, by its name.

    **Raises** `InputError` for an unknown name, a file that cannot be read, and a car that no file can describe.
    """
    name = str(vehicle)
    if vehicle.suffix or vehicle.is_file():
        return io.read_car(vehicle)
    if name not in kit.CARS:
        raise InputError(
            f"--vehicle {name}: must be the path of a car's file (jaxveh schema car), or one of {', '.join(kit.CARS)}."
            f"{did_you_mean([name], kit.CARS)}"
        )
    return vehicles.specification_of(kit.CARS[name]())


def first_line(of: Any) -> str:
    """Return the first paragraph of an object's docstring as one line."""
    return " ".join((inspect.getdoc(of) or "").partition("\n\n")[0].split()).replace("`", "")

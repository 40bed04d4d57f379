"""The car that an option names: a file, or one that comes with the package."""

from __future__ import annotations

from pathlib import Path

from jaxveh import InputError, io, vehicles

BUILT_IN = {
    "passenger_car": vehicles.passenger_car,
    "passenger_car_as_printed": vehicles.passenger_car_as_printed,
}


def car_of(name: str) -> vehicles.SingleTrack:
    """The car of a TOML file, or of a name in `BUILT_IN`; raises `InputError` for neither."""
    if name in BUILT_IN:
        return BUILT_IN[name]()
    if not Path(name).suffix:
        raise InputError(f"--vehicle {name}: must be the path of a .toml file, or one of {', '.join(BUILT_IN)}.")
    return vehicles.from_specification(io.read_car(name))

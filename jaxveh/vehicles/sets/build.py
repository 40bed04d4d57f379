"""Vehicles of any fidelity from the numbers of a car."""

from __future__ import annotations

from dataclasses import MISSING, fields
from typing import Any, TypeVar

from jaxveh._core.errors import InputError, check_kind, word_for
from jaxveh._core.names import check_names
from jaxveh.vehicles.base import AbstractVehicle
from jaxveh.vehicles.drive import AxleDrive, FourMotors
from jaxveh.vehicles.sets.numbers import CarNumbers
from jaxveh.vehicles.sets.tyres import axle_tyre, wheel_tyre

SWITCHES = ("cg_height",)
"""Numbers that switch on a part of the model in classes where they are optional."""

V = TypeVar("V", bound=AbstractVehicle)


def build(numbers: CarNumbers, kind: type[V], **options: Any) -> V:
    """The vehicle of class `kind`, such as `SevenDOF`, with the numbers of a car.

    Each parameter of the class gets the number with its name. The tyres are a `wheel_tyre` per axle for cars with tracks and an
    `axle_tyre` for cars on one track; `drive` is an `AxleDrive` with the car's shares, or `FourMotors`. A class without a
    parameter `mass` has a sprung mass, and gets the position and inertias of that. Parts of a model that a number would switch
    on (load transfer of a `SingleTrack` by `cg_height`) stay off. `options` are parameters to set differently, such as
    `front=tyre` or `cg_height=numbers.cg_height`.

    **Raises** `InputError` with the parameters of the class that are missing from the numbers, and for options that are not
    parameters of the class.
    """
    check_kind("numbers", numbers, CarNumbers, "Such as vehicles.sets.sedan() (called), or numbers_of(...).")
    if not (isinstance(kind, type) and issubclass(kind, AbstractVehicle)):
        raise InputError(f"kind = {word_for(kind)}: must be a class of vehicles, such as vehicles.SevenDOF.")
    entries = {entry.name: entry for entry in fields(kind)}
    check_names(f"build({numbers.name}, {kind.__name__})", options, entries)
    known = numbers.values(sprung="mass" not in entries)
    given = {
        name: known[name]
        for name, entry in entries.items()
        if name in known and name not in options and not (name in SWITCHES and entry.default is None)
    }
    if "grip" in entries and numbers.front is not None:
        given.setdefault("grip", numbers.front.friction)
    given |= _tyres(numbers, entries, options) | _drive(numbers, entries, options) | options
    missing = [name for name, entry in entries.items() if _is_required(entry) and name not in given]
    if missing:
        raise InputError(f"{numbers.name}: {kind.__name__} needs {', '.join(missing)}, missing from its numbers.")
    return kind(**given)


def _is_required(entry) -> bool:
    return entry.default is MISSING and entry.default_factory is MISSING


def _tyres(numbers: CarNumbers, entries, options) -> dict[str, Any]:
    found = {}
    for axle, at in (("front", 0), ("rear", 1)):
        tyre = getattr(numbers, axle)
        if axle not in entries or axle in options or tyre is None:
            continue
        load = numbers.wheel_loads()[at]
        wheels = "track_front" in entries
        found[axle] = wheel_tyre(tyre, load, numbers.wheel_radius) if wheels else axle_tyre(tyre, 2.0 * load)
    return found


def _drive(numbers: CarNumbers, entries, options) -> dict[str, Any]:
    if "drive" not in entries or "drive" in options:
        return {}
    if numbers.four_motors:
        return {"drive": FourMotors()}
    return {"drive": AxleDrive(front_drive=numbers.front_drive, front_brake=numbers.front_brake)}

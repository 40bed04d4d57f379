"""A method made from a car's file, which says where the car's inertial unit and satellite antenna are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from jaxveh._core.errors import InputError, check_kind, check_one_of, word_for
from jaxveh.estimators.at_centre import method_at_centre
from jaxveh.estimators.method import AbstractMethod
from jaxveh.io import CarSpecification
from jaxveh.io import kit as io

TURNING = ("steer", "steering_wheel", "steering_torque", "yaw_rate", "a_y")
"""Channels that describe how a car turns."""


@dataclass(frozen=True)
class MethodOfCar:
    """How to make a method from a car's file (`of_centre`, for measurements of the centre of gravity; it **raises** `InputError`
    for a key missing from the file), its description in one line, its source, and whether it also holds for a car with steered
    rear wheels (`any_steering`): `of_centre` then makes it with `rear_steer.with_rear_steer`, or no axle is part of it."""

    of_centre: Callable[[CarSpecification], AbstractMethod]
    help: str
    source: str
    any_steering: bool = False

    def make(self, car: CarSpecification) -> AbstractMethod:
        """The method for a car's file, whose inertial unit and antenna may be elsewhere (`at_centre.AtCentre`)."""
        return method_at_centre(self.of_centre(car), car)


def method_of(who: str, methods: Mapping[str, MethodOfCar], source: Any, name: str) -> AbstractMethod:
    """The method of a name for a car's file, or the source itself if it is a method. **Raises** `InputError` for an unknown
    name, for methods that are no `MethodOfCar` or make none, and for a car with steered rear wheels unless the method holds for
    it or reads no channel of `TURNING`."""
    if isinstance(source, AbstractMethod):
        return source
    check_one_of(f"{who}: method", name, methods)
    if not isinstance(source, CarSpecification):
        raise InputError(
            f"{who}: source = {word_for(source)}: must be an io.CarSpecification, which io.read_car reads, or a method."
        )
    entry, place = methods[name], f"{who}: METHODS[{name!r}]"
    check_kind(place, entry, MethodOfCar, "Such as MethodOfCar(lambda car: Mine(), 'what it is', 'its source').")
    method = entry.of_centre(source if entry.any_steering else source.with_front_steering())
    check_kind(f"{place}.make(car)", method, AbstractMethod, "Derive it from estimators.AbstractMethod.")
    if not entry.any_steering and any(need.channel in TURNING for need in method.needs):
        others = [f'"{other}"' for other, one in methods.items() if one.any_steering]
        advice = f"Take the method {' or '.join(others)}, which includes those angles. " if others else ""
        io.check_front_steered(source, f"{who}: {name}", advice)
    return method_at_centre(method, source)

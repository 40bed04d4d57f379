"""Cars and fidelities by name, for programs and for tables of comparisons."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from jaxveh._core.errors import check_has
from jaxveh.io import kit
from jaxveh.vehicles.base import AbstractVehicle
from jaxveh.vehicles.fourteen_dof import FourteenDOF
from jaxveh.vehicles.kinematic import Kinematic
from jaxveh.vehicles.kinematic_trailer import KinematicTrailer
from jaxveh.vehicles.linear_handling import LinearSingleTrack
from jaxveh.vehicles.longitudinal import Longitudinal
from jaxveh.vehicles.parameter_sets import from_specification
from jaxveh.vehicles.roll_3dof import Roll3DOF
from jaxveh.vehicles.roll_4dof import Roll4DOF
from jaxveh.vehicles.sets import commonroad_cars, heavy_cars, passenger_cars, race_cars
from jaxveh.vehicles.sets.build import build
from jaxveh.vehicles.sets.numbers import NAMED_ALIKE, CarNumbers
from jaxveh.vehicles.sets.specification import numbers_of
from jaxveh.vehicles.seven_dof import SevenDOF
from jaxveh.vehicles.single_track import SingleTrack
from jaxveh.vehicles.single_track_3dof import SingleTrack3DOF
from jaxveh.vehicles.two_track_2dof import TwoTrack2DOF
from jaxveh.vehicles.two_track_3dof import TwoTrack3DOF

CARS: dict[str, Callable[[], CarNumbers]] = {
    "passenger_car": passenger_cars.passenger_car,
    "compact_car": commonroad_cars.compact_car,
    "sedan": commonroad_cars.sedan,
    "van": commonroad_cars.van,
    "suv": heavy_cars.suv,
    "truck": heavy_cars.truck,
    "race_car": race_cars.race_car,
    "ev": passenger_cars.ev,
    "ferrari_250lm": race_cars.ferrari_250lm,
    "semi_trailer": commonroad_cars.semi_trailer,
}
"""Functions that return the numbers of cars, by name."""

FIDELITIES: dict[str, type[AbstractVehicle]] = {
    "longitudinal": Longitudinal,
    "kinematic": Kinematic,
    "kinematic-trailer": KinematicTrailer,
    "linear": LinearSingleTrack,
    "single-track": SingleTrack,
    "single-track-3dof": SingleTrack3DOF,
    "two-track-2dof": TwoTrack2DOF,
    "two-track-3dof": TwoTrack3DOF,
    "roll-3dof": Roll3DOF,
    "roll-4dof": Roll4DOF,
    "seven-dof": SevenDOF,
    "fourteen-dof": FourteenDOF,
}
"""The classes of vehicles by name, the simplest first."""


def named_car(name: str, fidelity: str = "single-track", **options: Any) -> AbstractVehicle:
    """The car `name` of `CARS` as the vehicle `fidelity` of `FIDELITIES`; `options` as in `build`.

    **Raises** `InputError` for an unknown name (it lists similar ones), and if the vehicle needs numbers that the car does not
    have.
    """
    kit.check_known("vehicles", "car", name, CARS)
    kit.check_known("vehicles", "fidelity", fidelity, FIDELITIES)
    return build(CARS[name](), FIDELITIES[fidelity], **options)


def specified_car(specification: Any, fidelity: str = "single-track") -> AbstractVehicle:
    """The car of a file (`jaxveh.io.CarSpecification`) as the vehicle `fidelity` of `FIDELITIES`.

    **Raises** `InputError` for an unknown fidelity, and if the vehicle needs numbers that are missing from the file.
    """
    kit.check_known("vehicles", "fidelity", fidelity, FIDELITIES)
    check_has("specification", specification, NAMED_ALIKE, "io.read_car reads one from a file.")
    if fidelity == "single-track":
        return from_specification(specification)
    return build(numbers_of(specification), FIDELITIES[fidelity])

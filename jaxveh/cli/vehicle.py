"""The car that an option names: a file, or one that comes with the package, at a chosen fidelity."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from jaxveh import InputError, io, tyres, vehicles
from jaxveh._core.errors import check_one_of

BUILT_IN = {
    "passenger_car": vehicles.passenger_car,
    "passenger_car_as_printed": vehicles.passenger_car_as_printed,
}

HELP = {
    "passenger_car": "1420 kg, understeering (Bao, Sabbioni et al. 2015, its distances the right way round)",
    "passenger_car_as_printed": "the same with the distances as printed: it oversteers and spins easily",
}
"""A line about each car in `BUILT_IN`."""

TRACK, CG_HEIGHT = 1.5, 0.5
"""m: of a car of which the single track alone is known; ours."""

SLIP_STIFFNESS = 1.3
"""A tyre's slip stiffness over its cornering stiffness; ours."""


def car_of(name: str) -> vehicles.SingleTrack:
    """The car of a TOML file, or of a name in `BUILT_IN`; raises `InputError` for neither."""
    if name in BUILT_IN:
        return BUILT_IN[name]()
    if not Path(name).suffix:
        raise InputError(f"--vehicle {name}: must be the path of a .toml file, or one of {', '.join(BUILT_IN)}.")
    return vehicles.from_specification(io.read_car(name))


class Fidelity(NamedTuple):
    """How a single track becomes the vehicle of a fidelity, and what to say about it."""

    make: Callable[[vehicles.SingleTrack], vehicles.AbstractVehicle]
    help: str


def _seven_dof(car: vehicles.SingleTrack) -> vehicles.SevenDOF:
    """Four wheels that spin; what a single track does not say is ordinary (`TRACK`, `CG_HEIGHT`, brush tyres)."""
    slopes = [tyre.cornering_stiffness / 2 for tyre in (vehicles.linear(car).front, vehicles.linear(car).rear)]
    return vehicles.SevenDOF(
        mass=car.mass, yaw_inertia=car.yaw_inertia, front_axle_to_cg=car.front_axle_to_cg, rear_axle_to_cg=car.rear_axle_to_cg,
        track_front=TRACK, track_rear=TRACK, cg_height=CG_HEIGHT if car.cg_height is None else car.cg_height,
        front=tyres.Brush(SLIP_STIFFNESS * slopes[0], slopes[0]), rear=tyres.Brush(SLIP_STIFFNESS * slopes[1], slopes[1]),
        drag=0.4, rolling_resistance=0.01,
    )  # fmt: skip


FIDELITIES: dict[str, Fidelity] = {
    "linear": Fidelity(vehicles.linear, "single track on linear tyres, speed given"),
    "single-track": Fidelity(lambda car: car, "single track on its own tyres, speed given"),
    "seven-dof": Fidelity(_seven_dof, "four spinning wheels with pedals; brush tyres and an ordinary track and height"),
}
"""Vehicles that a car can be made into, the simplest first."""


def vehicle_of(name: str, fidelity: str = "single-track") -> vehicles.AbstractVehicle:
    """The car of a name or a file as the vehicle of a fidelity; raises `InputError` for names that are not there."""
    check_one_of("--fidelity", fidelity, FIDELITIES)
    return FIDELITIES[fidelity].make(car_of(name))

"""The drives of a study: a car, its manoeuvre, road and sensors, made from the study's tables."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax

from jaxveh import manoeuvres, roads, sensors, simulation, vehicles
from jaxveh._core.errors import InputError, check_one_of, check_positive
from jaxveh._core.recording import Recording
from jaxveh.io import CarSpecification, kit
from jaxveh.studies.numbers import flat, with_numbers
from jaxveh.studies.settings import OF_DRIVE, check_drive, speed_and_steer


class Drive(NamedTuple):
    """A drive to simulate: the true `car`, its `driver`, the `sensors`, the `road` (None: level), rows every `dt` (s)."""

    car: Any
    driver: Any
    sensors: Any
    road: Any
    dt: float


def car_of(vehicle: str | CarSpecification, fidelity: str) -> vehicles.AbstractVehicle:
    """The car of this name in `vehicles.kit.CARS`, or of a file, at a fidelity."""
    kit.check_known("fidelity", "fidelity", fidelity, vehicles.kit.FIDELITIES)
    if isinstance(vehicle, CarSpecification):
        return vehicles.specified_car(vehicle, fidelity)
    return vehicles.named_car(vehicle, fidelity)


def specification_of(vehicle: str | CarSpecification) -> CarSpecification:
    """The content of a car's file; for a car by name, the content that its file would have."""
    if isinstance(vehicle, CarSpecification):
        return vehicle
    kit.check_known("vehicle", "car", vehicle, vehicles.kit.CARS)
    with jax.ensure_compile_time_eval():
        return vehicles.specification_of(vehicles.kit.CARS[vehicle]())


def drive_of(settings: Mapping[str, Any], key: jax.Array, duration: float | None = None) -> Drive:
    """The drive that the tables describe. `key` draws the driver and the road, where they are random; `duration` (s) is the
    duration if the file has none.

    The driver and the devices are made for the car as its file describes it, before `car` changes its numbers.
    """
    drive = settings["drive"]
    check_drive(drive)
    with jax.ensure_compile_time_eval():
        nominal = car_of(drive["vehicle"], drive["fidelity"])
        of_car = manoeuvres.options_of_car(drive["manoeuvre"], nominal)
    driver_key, road_key = jax.random.split(key)
    options = {**of_car, **{name: value for name, value in drive.items() if name not in OF_DRIVE}}
    if (length := drive.get("duration", duration)) is not None:
        options["duration"] = length
    speed, steer_deg = speed_and_steer(drive)
    # In the units of the file: the manoeuvre itself would tell of rad.
    manoeuvres.kit.check_speed("drive.speed", speed)
    manoeuvres.kit.check_steer_deg("drive.steer_deg", steer_deg)
    driver = manoeuvres.named_manoeuvre(drive["manoeuvre"], speed, steer_deg * (math.pi / 180), driver_key, **options)
    check_positive("drive.rate", drive["rate"], "Hz")
    return Drive(
        with_numbers("car", nominal, flat(settings["car"])),
        driver,
        sensors_of(settings["sensors"], nominal),
        None if drive["road"] == "level" else roads.named_road(drive["road"], road_key),
        1.0 / drive["rate"],
    )


def sensors_of(told: Mapping[str, Any], car: Any) -> Any:
    """The sensors. If the devices take noise, the other keys are standard deviations by channel, otherwise numbers of the
    devices."""
    numbers = {name: value for name, value in told.items() if name != "devices"}
    check_one_of("sensors.devices", told["devices"], sensors.DEVICES)
    if sensors.DEVICES[told["devices"]].takes_noise:
        return sensors.named_devices(told["devices"], car, numbers)
    found = sensors.named_devices(told["devices"], car)
    if found is None and numbers:
        raise InputError(f'sensors: {", ".join(numbers)} belong to devices that measure nothing; take devices = "esc".')
    return with_numbers("sensors", found, flat(numbers))


def simulate(drive: Drive, key: jax.Array) -> Recording:
    """The recording, with the truth beside it; a drive that fails contains NaN."""
    return simulation.simulate(drive.car, drive.driver, drive.sensors, key, road=drive.road, dt=drive.dt, throw=False)

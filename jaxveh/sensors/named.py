"""Sets of sensors and devices by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from jaxveh._core.errors import check_kind, check_one_of
from jaxveh.sensors.sensor_set import SensorSet, esc
from jaxveh.sensors.suite import Suite
from jaxveh.sensors.typical import production_car, proving_ground_car
from jaxveh.statespace import Gaussian
from jaxveh.vehicles import AbstractVehicle, kit


class NamedDevices(NamedTuple):
    """A named set of sensors or devices.

    `make`: the function that makes them for a car; `help`: one line about them; `takes_noise`: whether standard
    deviations by channel may be given.
    """

    make: Callable[[Any, Mapping[str, Any]], SensorSet | Suite | None]
    help: str
    takes_noise: bool = False


DEVICES: dict[str, NamedDevices] = {
    "none": NamedDevices(lambda car, noise: None, "no sensors, only the true quantities"),
    "esc": NamedDevices(
        lambda car, noise: SensorSet(Gaussian(dict(noise))) if noise else esc(),
        "yaw rate and lateral acceleration in every row, with white noise",
        takes_noise=True,
    ),
    "production": NamedDevices(
        lambda car, noise: production_car(_radius(car)),
        "inertial unit, steering angle, wheel speeds and satellite navigation of a series car, with rates, delays and errors",
    ),
    "proving-ground": NamedDevices(
        lambda car, noise: proving_ground_car(_radius(car)),
        "precise six-axis inertial unit, optical sensor, steering angle, wheel speeds, satellite navigation with position",
    ),
}
"""Sets of sensors and of devices by name, for programs."""


def named_devices(name: str, car: Any, noise: Mapping[str, Any] | None = None) -> SensorSet | Suite | None:
    """The sensors or devices of this name in `DEVICES`, for `car`.

    `noise`: standard deviations by channel, in the channels' units, for sets that take them (default: typical values;
    other channels of the car may be named, too). **Raises** `InputError` for an unknown name.
    """
    check_one_of("devices", name, DEVICES)
    check_kind("car", car, AbstractVehicle, "Such as vehicles.passenger_car().")
    if noise is not None:
        check_kind("noise", noise, Mapping, "Standard deviations by channel.")
    return DEVICES[name].make(car, noise or {})


def _radius(car: Any) -> float | None:
    """The radius of the wheels, m; None for a car whose wheels have no spin, which has no wheel speeds to measure."""
    spins = set(kit.wheel_names("omega")) <= set(car.state_type._fields)
    return float(car.wheel_radius) if spins else None

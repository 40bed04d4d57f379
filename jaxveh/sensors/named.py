"""What can be in a car, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from jaxveh._core.errors import check_one_of
from jaxveh.sensors.sensor_set import SensorSet, esc
from jaxveh.sensors.suite import Suite
from jaxveh.sensors.typical import production_car, proving_ground_car
from jaxveh.statespace import Gaussian
from jaxveh.vehicles import kit


class NamedDevices(NamedTuple):
    """How to make what is in the car, and what to say about it; `takes_noise`: standard deviations by channel may be given."""

    make: Callable[[Any, Mapping[str, Any]], SensorSet | Suite | None]
    help: str
    takes_noise: bool = False


DEVICES: dict[str, NamedDevices] = {
    "none": NamedDevices(lambda car, noise: None, "nothing but the truth"),
    "esc": NamedDevices(
        lambda car, noise: SensorSet(Gaussian(dict(noise))) if noise else esc(),
        "yaw rate and lateral acceleration in every row, with white noise",
        takes_noise=True,
    ),
    "production": NamedDevices(
        lambda car, noise: production_car(_radius(car)),
        "inertial unit, steering angle, wheel speeds, satellite navigation of a series car: rates, delays, steps, offsets",
    ),
    "proving-ground": NamedDevices(
        lambda car, noise: proving_ground_car(_radius(car)),
        "precise inertial unit of six axes, optical sensor, steering angle, wheel speeds, satellite navigation with position",
    ),
}
"""Sets of sensors and of devices by name, for programs."""


def named_devices(name: str, car: Any, noise: Mapping[str, Any] | None = None) -> SensorSet | Suite | None:
    """The sensors or devices of a name in `DEVICES`, for `car`.

    `noise`: standard deviations by channel, in the channels' units, for those that take them (default: the usual ones; other
    channels of the car may be named, too). **Raises** `InputError` for a name that is not there.
    """
    check_one_of("devices", name, DEVICES)
    return DEVICES[name].make(car, noise or {})


def _radius(car: Any) -> float | None:
    """The radius of wheels that spin, m; None for a car without, which has no wheel speeds to measure."""
    spins = set(kit.wheel_names("omega")) <= set(car.state_type._fields)
    return float(car.wheel_radius) if spins else None

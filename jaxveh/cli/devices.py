"""The devices in the car that an option names."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from jaxveh import sensors
from jaxveh._core.errors import check_one_of
from jaxveh.vehicles import kit


class NoiseOption(NamedTuple):
    """Standard deviations of the stability control's sensors: rad/s and m/s^2."""

    yaw_rate: float
    a_y: float


class Fitted(NamedTuple):
    """How to make what is in the car, and what to say about it."""

    make: Callable[[Any, NoiseOption], Any]
    help: str


DEVICES: dict[str, Fitted] = {
    "none": Fitted(lambda car, noise: None, "nothing but the truth"),
    "esc": Fitted(
        lambda car, noise: sensors.esc(yaw_rate=noise.yaw_rate, a_y=noise.a_y),
        "yaw rate and lateral acceleration in every row, with white noise (--yaw-rate-std, --a-y-std)",
    ),
    "production": Fitted(
        lambda car, noise: sensors.production_car(_radius(car)),
        "inertial unit, steering angle, wheel speeds, satellite navigation of a series car: rates, delays, steps, offsets",
    ),
    "proving-ground": Fitted(
        lambda car, noise: sensors.proving_ground_car(_radius(car)),
        "precise inertial unit of six axes, optical sensor, steering angle, wheel speeds, satellite navigation with position",
    ),
}
"""What can be in the car, by name."""


def devices_of(name: str, car: Any, noise: NoiseOption) -> Any:
    """The sensors or devices of a name in `DEVICES`; raises `InputError` for another."""
    check_one_of("--devices", name, DEVICES)
    return DEVICES[name].make(car, noise)


def _radius(car: Any) -> float | None:
    """The radius of wheels that spin, m; None for a car without, which has no wheel speeds to measure."""
    spins = set(kit.wheel_names("omega")) <= set(car.state_type._fields)
    return float(car.wheel_radius) if spins else None

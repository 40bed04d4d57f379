"""Drives: from the driver's torques to the torques of the wheels."""

from __future__ import annotations

import abc
from dataclasses import KW_ONLY
from typing import Any, ClassVar

import equinox as eqx
import jax

from jaxveh._core.errors import check
from jaxveh._core.parameter import parameter, positive
from jaxveh.vehicles.base import AbstractVehicle
from jaxveh.vehicles.wheels import Wheels, front_rear, wheel_names, wheels_of


class AbstractDrive(eqx.Module):
    """A drive: from the inputs to the driving and braking torques of the wheels (N m)."""

    inputs: eqx.AbstractVar[tuple[str, ...]]

    @abc.abstractmethod
    def torques(self, u: Any) -> tuple[Wheels, Wheels]:
        """The driving torque (positive forwards, of either sign) and the braking torque (at least zero, against the rotation) of
        each wheel, N m."""


class AxleDrive(AbstractDrive):
    """One engine with open differentials: `drive_torque` and `brake_torque` are sums over the wheels (N m).

    `front_drive` and `front_brake` (-) are the front axle's shares: with 1 only the front wheels are driven or braked. The two
    wheels of an axle get equal torques.

    **Raises** `InputError` for a share outside 0 to 1.
    """

    front_drive: jax.Array = parameter("-", scale=0.1, default=1.0)
    front_brake: jax.Array = parameter("-", scale=0.1, default=0.65)
    inputs: ClassVar[tuple[str, ...]] = ("drive_torque", "brake_torque")

    def __check_init__(self):
        for name in ("front_drive", "front_brake"):
            check(f"AxleDrive.{name}", getattr(self, name), lambda v: (v >= 0) & (v <= 1), "between 0 and 1")

    def torques(self, u):
        drive = front_rear(0.5 * self.front_drive * u.drive_torque, 0.5 * (1.0 - self.front_drive) * u.drive_torque)
        brake = front_rear(0.5 * self.front_brake * u.brake_torque, 0.5 * (1.0 - self.front_brake) * u.brake_torque)
        return drive, brake


class FourMotors(AbstractDrive):
    """One motor per wheel: `torque_fl`, `torque_fr`, `torque_rl`, `torque_rr` (N m), negative if the motor brakes."""

    inputs: ClassVar[tuple[str, ...]] = wheel_names("torque")

    def torques(self, u):
        return wheels_of(u, "torque"), Wheels(0.0, 0.0, 0.0, 0.0)


class AbstractDriven(AbstractVehicle):
    """A car driven and braked by torques.

    **Parameters** of the drive: `wheel_radius` (m, effective), `drag` (N s^2/m^2, half the air's density times c_d times the
    area), `rolling_resistance` (-), `drive`, the distribution of torques to the wheels (`AxleDrive`, `FourMotors`).
    """

    _: KW_ONLY
    wheel_radius: jax.Array = positive("m", default=0.32)
    drag: jax.Array = parameter("N s^2/m^2", scale=0.4, default=0.0)
    rolling_resistance: jax.Array = parameter("-", scale=0.01, default=0.0)
    drive: AbstractDrive = eqx.field(default_factory=AxleDrive)

"""Speed from brake and motor torques: the wheels' dynamics give the tyre forces, and these the rate of the speed."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh._core.parameter import positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.drive_force import AbstractDriveForce
from jaxveh.estimators.speed.accelerometer import Felt, never_felt
from jaxveh.estimators.speed.free_wheels import AbstractFreeWheels
from jaxveh.estimators.speed.wheels import WHEEL_SPEEDS, Wheels
from jaxveh.vehicles import GRAVITY
from jaxveh.vehicles import kit as vehicles


class Pushed(NamedTuple):
    """Speed `v_x` (m/s); the acceleration that is not in the wheels' dynamics, mainly the road's slope, `rest` (m/s^2); the last
    measured torques, `heard`; and the time since wheels last corrected the speed, `alone` (s)."""

    v_x: Any
    rest: Any
    heard: dict[str, Felt]
    alone: Any


class AbstractForces(AbstractFreeWheels, AbstractDriveForce):
    """`mass dv_x/dt = sum of the wheels' F_x - drag v_x |v_x|`, corrected by wheels that roll freely.

    Where they roll freely, the acceleration that no torque explains (grade, rolling resistance of the road, a wrong mass) is
    learned with `rest_time` (s). The speed is known as long as the integral of an error of `rate_error` (m/s^2) is below
    `agreement` (-) of the speed plus `agreement_speed` (m/s).
    """

    mass: jax.Array = positive("kg", default=1500.0)
    wheel_radius: jax.Array = positive("m", default=0.32)
    rest_time: jax.Array = positive("s", default=3.0)
    rate_error: jax.Array = positive("m/s^2", default=0.2)

    @property
    @abc.abstractmethod
    def torques(self) -> tuple[Need, ...]:
        """The channels of torques and pressures."""

    @abc.abstractmethod
    def force(self, wheels: Wheels, heard: dict[str, Any]) -> Any:
        """Sum of the tyres' longitudinal forces, N, positive forwards, from the last measurements (0 if there is none)."""

    @property
    def needs(self):
        return (*WHEEL_SPEEDS, *self.torques)

    def rolls(self, wheels: Wheels) -> Any:
        """Rolling resistance of all wheels, N, against the direction of travel; it fades out at standstill."""
        return self.rolling_resistance * self.mass * GRAVITY * jnp.tanh(wheels.mean)

    def begin(self, wheels, values):
        del values
        zero = jnp.zeros_like(wheels.t)
        heard = {need.channel: never_felt(wheels.t) for need in self.torques}
        return Pushed(wheels.mean, zero, heard, jnp.where(wheels.spoke, 0.0, jnp.inf))

    def follow(self, own: Pushed, wheels: Wheels, step, values):
        t = wheels.t
        heard = {name: felt.hear(t, values[name]) for name, felt in own.heard.items()}
        speaks = jnp.stack([heard[need.channel].speaks(t) for need in self.torques if not need.optional])
        speaks = jnp.all(speaks) & wheels.spoke
        force = self.force(wheels, {name: jnp.where(f.speaks(t), f.value, 0.0) for name, f in heard.items()})
        rate = (force - self.drag * own.v_x * jnp.abs(own.v_x)) / self.mass + own.rest
        rate = jnp.where(speaks, rate, 0.0)
        v_x, free, strange = self.integrate(own.v_x, wheels, step, rate, wheels.mean_rate)
        rest = own.rest + jnp.where(free & speaks, 1.0 - jnp.exp(-step / self.rest_time), 0.0) * strange
        alone = jnp.where(free, 0.0, own.alone + step)
        return Pushed(v_x, rest, heard, alone), v_x, speaks & self.is_small(self.rate_error * alone, v_x)


class BrakeForces(AbstractForces):
    """Forces from the brake's pressure and the torque on the half shafts, eq 11, summed over the wheels:

        F_x = c_p p / R - M / R + J / R^2 dv_wheel/dt

    which as printed is positive in **braking** (an erratum of the review's list: its text calls F_x the force of drive and
    brake). `brake_torque_per_pressure` (N m/Pa) is c_p of all brakes together; M is the channel `drive_torque`, 0 where it is not
    available.

    Chen, Gao, Xu 2013, section 2.2, refs 2, 94, 95.
    """

    brake_torque_per_pressure: jax.Array = positive("N m/Pa", default=1.6e-3)

    @property
    def torques(self):
        return Need("brake_pressure", "Pa"), Need("drive_torque", "N m", optional=True)

    def force(self, wheels, heard):
        braking = self.brake_torque_per_pressure * heard["brake_pressure"] * jnp.tanh(wheels.mean)
        torque = heard["drive_torque"] - braking
        return torque / self.wheel_radius - self.spin_up(wheels.mean_rate) - self.rolls(wheels)


class MotorForces(AbstractForces):
    """Forces from the torque of each wheel's motor, eq 12, summed: `T_m = F_x R + J domega/dt`.

    Chen, Gao, Xu 2013, section 2.3, refs 34, 83, 96.
    """

    @property
    def torques(self):
        return tuple(Need(f"torque_{at}", "N m") for at in vehicles.CORNERS)

    def force(self, wheels, heard):
        torque = sum(heard[need.channel] for need in self.torques)
        return torque / self.wheel_radius - self.spin_up(wheels.mean_rate) - self.rolls(wheels)

"""Longitudinal motion only: a car on a grade, driven and braked by torques."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.base import AbstractVehicle, Motion, given_or_zero, with_batch_shape
from jaxveh.vehicles.two_track import air_drag
from jaxveh.vehicles.wheels import gravity, travel_direction


class LongitudinalState(NamedTuple):
    """The speed `v_x` (m/s)."""

    v_x: Any


class LongitudinalOutputs(NamedTuple):
    """Speed `v_x` (m/s); `v_x_rate` dv/dt and `a_x`, the signal of an ideal accelerometer (m/s^2); the road's `grade` (rad); the
    forces along the car (N, positive forwards) of drive, brakes, rolling resistance, air and grade; `drive_power` (W)."""

    v_x: Any
    v_x_rate: Any
    a_x: Any
    grade: Any
    drive_force: Any
    brake_force: Any
    rolling_force: Any
    air_force: Any
    grade_force: Any
    drive_power: Any


UNITS = {
    "v_x": "m/s",
    **dict.fromkeys(("a_x", "v_x_rate"), "m/s^2"),
    "grade": "rad",
    **dict.fromkeys(("drive_force", "brake_force", "rolling_force", "air_force", "grade_force"), "N"),
    **dict.fromkeys(("drive_torque", "brake_torque"), "N m"),
    "drive_power": "W",
}


class Longitudinal(AbstractVehicle):
    """A car in straight travel without slip: the plant of speed control, and the model for estimating mass and grade.

    With r the wheel's radius, J_w the inertia of each of four wheels, theta the grade and s the smooth sign of the speed
    (R. Rajamani, Vehicle Dynamics and Control, 2nd ed., sec. 4.1; the wheels turn with the speed):

        (m + 4 J_w / r^2) dv/dt = (T_drive - s T_brake) / r - s f_r m g cos(theta) - drag v |v| - m g sin(theta)

    Brakes and rolling resistance change sign smoothly below 0.94 m/s (`wheels.STANDSTILL`), so that standstill is a regular
    point. A car that is held by its brakes on a slope therefore creeps.

    **Parameters**: `mass` (kg), `wheel_radius` (m), `wheel_inertia` (kg m^2, of one wheel), `drag` (N s^2/m^2, half the air's
    density times c_d times the area), `rolling_resistance` f_r (-).

    **Inputs**: `drive_torque` and `brake_torque` (N m), sums over the wheels; the brake torque is at least zero.

    **Raises** `InputError` for parameters outside their domain.
    """

    mass: jax.Array = positive("kg")
    wheel_radius: jax.Array = positive("m", default=0.32)
    wheel_inertia: jax.Array = positive("kg m^2", default=1.2)
    drag: jax.Array = parameter("N s^2/m^2", scale=0.4, default=0.0)
    rolling_resistance: jax.Array = parameter("-", scale=0.01, default=0.0)

    def __check_init__(self):
        check_parameters(self)

    @property
    def inputs(self):
        return ("drive_torque", "brake_torque")

    @property
    def state_type(self):
        return LongitudinalState

    @property
    def units(self):
        return dict(UNITS)

    @property
    def moving_mass(self) -> jax.Array:
        """The effective mass for a force along the car, kg: the car's mass and the inertia of its turning wheels."""
        return self.mass + 4.0 * self.wheel_inertia / self.wheel_radius**2

    def start(self, t, u, **values):
        """`v_x` is the speed (m/s), 0 unless given."""
        return given_or_zero(LongitudinalState, values, u.drive_torque, self.mass)

    def motion(self, x, u):
        zero = jnp.zeros_like(x.v_x)
        return Motion(0.0, 0.0, zero, x.v_x, zero, zero)

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        del t
        g_x, _, g_z = gravity(ground)
        against = travel_direction(x.v_x)
        drive_force = u.drive_torque / self.wheel_radius
        brake_force = -against * u.brake_torque / self.wheel_radius
        rolling_force = against * self.rolling_resistance * self.mass * g_z
        air_force = -air_drag(self.drag, x.v_x)
        grade_force = self.mass * g_x
        rate = (drive_force + brake_force + rolling_force + air_force + grade_force) / self.moving_mass
        outputs = LongitudinalOutputs(
            v_x=x.v_x,
            v_x_rate=rate,
            a_x=rate - g_x,
            grade=ground.grade,
            drive_force=drive_force,
            brake_force=brake_force,
            rolling_force=rolling_force,
            air_force=air_force,
            grade_force=grade_force,
            drive_power=drive_force * x.v_x,
        )
        return LongitudinalState(rate), with_batch_shape(outputs)

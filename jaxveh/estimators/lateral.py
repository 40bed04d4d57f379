"""Lateral motion of a car at small slip, from the numbers of its file: shared by simple methods of bank, roll and geometry."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax

from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh.estimators.body_motion import BodyMotion, away_from_zero
from jaxveh.estimators.car_file import number_of
from jaxveh.estimators.delays import SHORTEST_DELAY, satellite_lag
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY


class Lateral(eqx.Module):
    """`wheelbase`, `rear_axle_to_cg` (m); `rear_compliance` (rad/(m/s^2)): the rear axle's slip angle per lateral acceleration,
    `m l_f / (l C_r)`; `understeer` (rad/(m/s^2)): the front axle's compliance less the rear axle's; `roll_gradient`
    (rad/(m/s^2))."""

    wheelbase: jax.Array = positive("m")
    rear_axle_to_cg: jax.Array = positive("m")
    rear_compliance: jax.Array = positive("rad/(m/s^2)")
    understeer: jax.Array = parameter("rad/(m/s^2)", scale=0.002)
    roll_gradient: jax.Array = parameter("rad/(m/s^2)", scale=0.006)

    def __check_init__(self):
        check_parameters(self)

    def plane_force(self, a_y: Any) -> Any:
        """Lateral specific force in the road's plane (m/s^2) from a sensor on the rolling body: `a_y / (1 + g R)`."""
        return a_y / (1.0 + GRAVITY * self.roll_gradient)

    def steady_steer(self, v_x: Any, yaw_rate: Any, f_y: Any) -> Any:
        """The steer (rad) of the front wheels in a steady turn with this yaw rate (rad/s) and force (m/s^2), on any bank.

        Backwards the same steer turns the car the other way, and the slip angles have the other sign.
        """
        fast = away_from_zero(v_x)
        return (v_x / fast) * (self.wheelbase * yaw_rate / fast + self.understeer * f_y)

    def rear_speed(self, v_x: Any, yaw_rate: Any, f_y: Any) -> Any:
        """Lateral speed (m/s) at the centre of gravity when the rear axle carries its share of `f_y`."""
        return self.rear_axle_to_cg * yaw_rate - v_x * self.rear_compliance * f_y * (v_x / away_from_zero(v_x))


def lateral_of(car: CarSpecification, who: str) -> Lateral:
    """The model of a car's file. **Raises** `InputError` for a file without `roll_gradient` or stiffnesses."""
    front = number_of(car, "front_cornering_stiffness", who, "N/rad")
    rear = number_of(car, "rear_cornering_stiffness", who, "N/rad")
    rear_compliance = car.mass * car.front_axle_to_cg / (car.wheelbase * rear)
    return Lateral(
        wheelbase=car.wheelbase,
        rear_axle_to_cg=car.rear_axle_to_cg,
        rear_compliance=rear_compliance,
        understeer=car.mass * car.rear_axle_to_cg / (car.wheelbase * front) - rear_compliance,
        roll_gradient=number_of(car, "roll_gradient", who, "rad/(m/s^2)"),
    )


def motion_of(car: CarSpecification, *, wheels_first: bool = False) -> BodyMotion:
    """The cleaning that completes rows, with the car's share of driving torque and the delay of its satellites against its
    inertial unit."""
    front_share = 0.5 if car.front_drive is None else car.front_drive
    return BodyMotion(front_share, delay=max(satellite_lag(car), SHORTEST_DELAY), wheels_first=wheels_first)

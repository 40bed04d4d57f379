"""Conditions on the parameters of the car with fourteen degrees of freedom."""

from __future__ import annotations

import numpy as np

from jaxveh._core.errors import check, check_at_least, is_concrete
from jaxveh.vehicles.fourteen_dof.parameters import AbstractSuspendedTwoTrack
from jaxveh.vehicles.fourteen_dof.suspension import static_loads
from jaxveh.vehicles.steering import Ackermann, IndependentSteering

NOT_NEGATIVE = (
    "damper_front", "damper_rear", "anti_roll_front", "anti_roll_rear", "tyre_damping", "drag", "rolling_resistance",
)  # fmt: skip


def check_fourteen_dof(car: AbstractSuspendedTwoTrack) -> None:
    """Raise `InputError` unless the inertia is positive definite, the tyres can carry the car, and only one of the steering and
    `ackermann` gives the front wheels different angles."""
    kind = type(car).__name__
    if isinstance(car.steering, Ackermann | IndependentSteering):
        told = f"0 with {type(car.steering).__name__}, which sets the angle of each front wheel"
        check(f"{kind}.ackermann", car.ackermann, lambda v: v == 0, told)
    for name in NOT_NEGATIVE:
        check_at_least(f"{kind}.{name}", getattr(car, name), 0)
    if is_concrete(car.roll_inertia, car.yaw_inertia):
        most = np.sqrt(np.asarray(car.roll_inertia) * np.asarray(car.yaw_inertia))
        limit = "below sqrt(roll_inertia yaw_inertia) in size (kg m^2), so that the inertia is positive definite"
        check(f"{kind}.roll_yaw_product", car.roll_yaw_product, lambda v: np.abs(v) < most, limit)
    loads = static_loads(car)
    if is_concrete(loads, car.wheel_radius):
        least = np.maximum(np.asarray(loads.fl), np.asarray(loads.rl)) / np.asarray(car.wheel_radius)
        limit = "above static load / wheel_radius (N/m), or the tyre is compressed to the wheel's centre at rest"
        check(f"{kind}.tyre_stiffness", car.tyre_stiffness, lambda v: v > least, limit)

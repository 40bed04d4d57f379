"""Sideslip from the torque at the steering wheel, through aligning moment, front force and front slip angle."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.car_file import keys_of
from jaxveh.estimators.contract import Need
from jaxveh.estimators.method import AbstractMethod
from jaxveh.estimators.sideslip_methods.common import (
    STEER,
    V_X,
    YAW_RATE,
    Guarded,
    guard,
    sideslip_answer,
    size_of,
)
from jaxveh.estimators.sideslip_methods.single_track import axles_of, single_track
from jaxveh.io import CarSpecification

STEERING_TORQUE = Need("steering_torque", "N m")

TRAIL = 0.05
"""m, for a car of the usual size: distance of the lateral force behind the steering axis, about 0.02 m of caster trail and 0.03 m
of pneumatic trail."""

USED = 0.4
"""Share of the front axle's grip beyond which the pneumatic trail shrinks, and the moment no longer determines the force."""


class SteeringTorque(AbstractMethod):
    """The chain of P. Yih, J. Ryu & C. Gerdes (the review's [37, 38], section 1.2.3), with the yaw rate measured:

        F_f = i (1 + assist) M / trail,    alpha_f = F_f / C_f,    beta = delta - alpha_f - l_f r / v_x

    M (N m) is the driver's torque, `ratio` i (-) the steering ratio, `assist` (-) the steering assistance, and `trail` (m) the
    lever arm of the force about the steering axis. Friction and inertia of the steering are left out. The answer is known up to
    `USED` of the front axle's `grip` (N).
    """

    front_axle_to_cg: jax.Array = positive("m")
    stiffness: jax.Array = positive("N/rad")
    grip: jax.Array = positive("N")
    ratio: jax.Array = positive("-")
    trail: jax.Array = positive("m", default=TRAIL)
    assist: jax.Array = parameter("-", scale=1.0, default=0.0)
    steer_offset: jax.Array = parameter("rad", scale=0.02, default=0.0)

    @property
    def needs(self):
        return (V_X, STEER, YAW_RATE, STEERING_TORQUE)

    def first(self, t, values):
        return self.next((), t, values)

    def next(self, memory, t, values):
        del t
        v_x = values["v_x"]
        force = self.ratio * (1.0 + self.assist) * values["steering_torque"] / self.trail
        slip = jnp.clip(force / self.stiffness, -1.0, 1.0)
        at_front = v_x * numerics.tan(jnp.clip(values["steer"] + self.steer_offset - slip, -1.2, 1.2))
        v_y = at_front - self.front_axle_to_cg * values["yaw_rate"]
        return memory, sideslip_answer(v_y, v_x, jnp.abs(force) <= USED * self.grip)


def steering_torque(car: CarSpecification) -> Guarded:
    """Makes the method from a car's file. **Raises** `InputError` for a file without a steering ratio."""
    keys = keys_of(car, "sideslip: the steering torque", {"steering_ratio": "-"})
    front, _ = axles_of(single_track(car))
    method = SteeringTorque(
        car.front_axle_to_cg, front.stiffness, front.grip, keys["steering_ratio"], TRAIL * size_of(car),
        steer_offset=-(car.steer_offset or 0.0),
    )  # fmt: skip
    return guard(car, method, (YAW_RATE, STEERING_TORQUE), (YAW_RATE, STEERING_TORQUE))

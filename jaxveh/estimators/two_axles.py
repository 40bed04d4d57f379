"""What estimators share that know a car by its two axles."""

from __future__ import annotations

import dataclasses
from dataclasses import KW_ONLY
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.parameter import check_parameters, positive
from jaxveh.estimators.contract import Need
from jaxveh.io import CarSpecification

LATERAL = (Need("v_x", "m/s"), Need("steer", "rad"), Need("yaw_rate", "rad/s"), Need("a_y", "m/s^2"))
"""Speed, steer at the road wheels, yaw rate and lateral acceleration."""

LOWEST = 5.0
"""m/s: below this speed no lateral quantity is known."""

LONGEST = 0.3
"""s: a value that is older than this is no longer known."""


class AbstractTwoAxles(eqx.Module):
    """A car of `mass` (kg), whose axles are `front_axle_to_cg` and `rear_axle_to_cg` (m) away from the centre of gravity."""

    _: KW_ONLY
    mass: jax.Array = positive("kg")
    front_axle_to_cg: jax.Array = positive("m")
    rear_axle_to_cg: jax.Array = positive("m")

    def __check_init__(self):
        check_parameters(self)

    @property
    def wheelbase(self) -> Any:
        """Distance of the axles, m."""
        return self.front_axle_to_cg + self.rear_axle_to_cg


class AbstractLinearAxles(AbstractTwoAxles):
    """A car whose axles have the cornering stiffnesses `front_cornering_stiffness` and `rear_cornering_stiffness` (N/rad)."""

    _: KW_ONLY
    front_cornering_stiffness: jax.Array = positive("N/rad")
    rear_cornering_stiffness: jax.Array = positive("N/rad")


def linear_axles_of(car: CarSpecification) -> dict[str, float]:
    """The parameters of `AbstractLinearAxles` from a car's file, which has the stiffnesses or the axles' coefficients."""
    return {field.name: getattr(car, field.name) for field in dataclasses.fields(AbstractLinearAxles)}


class AbstractAxleForces(AbstractTwoAxles):
    """A car whose `yaw_inertia` (kg m^2) gives the forces of both axles."""

    _: KW_ONLY
    yaw_inertia: jax.Array = positive("kg m^2")

    def axle_forces(self, a_y: Any, yaw_acceleration: Any) -> tuple[Any, Any]:
        """Lateral forces of both axles (N) from the inertial sensors, by equation 15 of the review for small steer (F_yr has no
        cosine of the steer: erratum)."""
        turn = self.yaw_inertia * yaw_acceleration
        lateral = self.mass * a_y
        front = (turn + self.rear_axle_to_cg * lateral) / self.wheelbase
        return front, (self.front_axle_to_cg * lateral - turn) / self.wheelbase


def slip_stiffness(cornering: Any, load: Any) -> Any:
    """Slip stiffness of a tyre over its load (-) from the cornering stiffness of its axle (N/rad) and its load (N).

    A tyre's longitudinal stiffness is about its lateral one, and larger than that of an axle with a compliant steering. It is
    limited to 12 to 25 loads, where most car tyres lie (H. B. Pacejka, Tire and Vehicle Dynamics, 3rd ed., sec. 4.3.1 and
    appendix 3).
    """
    return jnp.clip(0.5 * cornering / load, 12.0, 25.0)

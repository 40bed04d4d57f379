"""Whether steer, yaw rate and lateral acceleration agree as they do while the tyres are linear."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh.estimators.body_motion import SILENCE, hold, steer_heard
from jaxveh.estimators.contract import Need
from jaxveh.estimators.lateral import Lateral, lateral_of
from jaxveh.estimators.rear_steer import rear_angle
from jaxveh.io import CarSpecification

STEER, STEERING_WHEEL = Need("steer", "rad", optional=True), Need("steering_wheel", "rad", optional=True)

PARKING, DRIVING = 4.0, 8.0
"""m/s: below the first speed steer and yaw rate disagree by the geometry of large angles, beyond the second by slip."""


class AgreementMemory(NamedTuple):
    """The last steer (rad) and for how long it has not been measured (s), the low-passed disagreement (rad), and how much it
    lately was (-)."""

    steer: Any
    silence: Any
    slow: Any
    doubt: Any


class SteerAgreement(eqx.Module):
    """How far a car is from the steady turn of linear tyres, in which `l r / v_x = steer - steer_rear - understeer f_y` whatever
    the bank (`Lateral.steady_steer`; H. E. Tseng, Vehicle System Dynamics 36, 2001): an axle that slides has another slip angle
    than that of its force.

    The disagreement through a low-pass of `time` (s), over `usual` (rad). What it was fades within `staying` (s): an axle that
    grips again needs a moment. At the speeds of parking, and where the steer is missing, nothing is said. A car that slides on
    both axles by the same angle is not noticed.

    `ratio` (-): of the steering, None: the log must have the steer of the road wheels. `offset` (rad): the value of that
    channel when the car runs straight.
    """

    car: Lateral
    ratio: jax.Array | None = positive("-", default=None)
    offset: jax.Array = parameter("rad", scale=0.01, default=0.0)
    usual: jax.Array = positive("rad", default=0.003)
    time: jax.Array = positive("s", default=0.15)
    staying: jax.Array = positive("s", default=1.0)

    def __check_init__(self):
        check_parameters(self)

    @property
    def needs(self) -> tuple[Need, ...]:
        """The channels that are read."""
        return (STEER,) if self.ratio is None else (STEER, STEERING_WHEEL)

    def start(self, t: Any) -> AgreementMemory:
        """The memory before the first row: no disagreement."""
        zero = jnp.zeros_like(t)
        return AgreementMemory(zero, zero + SILENCE, zero, zero)

    def next(self, last: AgreementMemory, values: dict[str, Any], heard: dict[str, Any]) -> AgreementMemory:
        """The memory after a row with these channels, completed as `heard` (see `BodyMotion`)."""
        dt, v_x = heard["dt"], heard["v_x"]
        measured = steer_heard(values, self.ratio, self.offset)
        steer = hold(measured, last.steer)
        silence = jnp.where(jnp.isnan(measured), last.silence + dt, 0.0)
        off = (
            steer
            - rear_angle(heard)
            - self.car.steady_steer(v_x, heard["yaw_rate"], self.car.plane_force(heard["a_y"]))
        )
        told = jnp.where(silence < SILENCE, numerics.smooth_step((jnp.abs(v_x) - PARKING) / (DRIVING - PARKING)), 0.0)
        slow = last.slow + dt / (self.time + dt) * (told * off - last.slow)
        doubt = jnp.maximum(jnp.abs(slow) / self.usual, last.doubt * jnp.exp(-dt / self.staying))
        return AgreementMemory(steer, silence, slow, doubt)


def agreement_of(car: CarSpecification, who: str) -> SteerAgreement | None:
    """Makes `SteerAgreement` from a car's file; None for a file without the front axle's stiffness. **Raises** as
    `lateral_of`."""
    if car.front_cornering_stiffness is None:
        return None
    return SteerAgreement(lateral_of(car, who), ratio=car.steering_ratio, offset=car.steer_offset or 0.0)

"""Lateral velocity by integration of what the body feels, as it is and with the roll taken out."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh.estimators.method import AbstractMethod
from jaxveh.estimators.sideslip_methods.common import (
    A_Y,
    ROLL_RATE,
    V_X,
    WIDEST,
    YAW_RATE,
    Guarded,
    guard,
    sideslip_answer,
    size_of,
    slowest_of,
)
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY

OFFSET = 0.1
"""m/s^2: what an accelerometer says too much, by its own offset and by gravity through a body that leans by some 0.01 rad. That
of a series car's inertial unit (`sensors.production_car`). Lateral velocity drifts by so much a second."""

START = 0.5
"""m/s: lateral velocity at the first row, which is taken to be none, is not known better."""

ROLL_TIME = 1.0
"""s: over which the roll angle that the gyroscope's integral gives is drawn to the one that accelerations ask for."""

LEFT = 0.3
"""Of the drift: what is left of it once the roll angle is taken out."""


class Integral(NamedTuple):
    """The row before: `v_y` (m/s), the `rate` that it is integrated from (m/s^2), `roll` (rad) and what it is drawn from, `asked`
    (rad) and `roll_rate` (rad/s); time `t`, and how far v_y may have drifted (m/s)."""

    v_y: Any
    rate: Any
    roll: Any
    asked: Any
    roll_rate: Any
    t: Any
    drift: Any


class AbstractIntegration(AbstractMethod):
    """By trapezia from no lateral velocity at the first row, and anew where the car is slower than `slowest` (m/s), where it
    rolls as its rear axle points (`rear_axle_to_cg`, m). Known as long as `drift` (m/s^2) has not made sideslip uncertain by
    `WIDEST`.
    """

    rear_axle_to_cg: jax.Array = positive("m")
    slowest: jax.Array = positive("m/s")
    drift: jax.Array = parameter("m/s^2", scale=0.1, default=OFFSET)

    def __check_init__(self):
        check_parameters(self)

    @abc.abstractmethod
    def roll_of(self, memory: Integral | None, t: Any, values: dict[str, Any]) -> tuple[Any, Any, Any]:
        """The roll angle (rad) now, the one that accelerations ask for (rad), and the roll rate (rad/s); `memory` of the row
        before, None at the first."""

    def first(self, t, values):
        roll, asked, roll_rate = self.roll_of(None, t, values)
        none = jnp.zeros_like(t)
        return self._said(Integral(none, self._rate(values, roll), roll, asked, roll_rate, t, none + START), values)

    def next(self, memory, t, values):
        roll, asked, roll_rate = self.roll_of(memory, t, values)
        rate, dt = self._rate(values, roll), t - memory.t
        v_y = memory.v_y + 0.5 * dt * (memory.rate + rate)
        return self._said(Integral(v_y, rate, roll, asked, roll_rate, t, memory.drift + dt * self.drift), values)

    def _rate(self, values, roll):
        return values["a_y"] - GRAVITY * numerics.sin(roll) - values["v_x"] * values["yaw_rate"]

    def _said(self, memory: Integral, values):
        v_x = values["v_x"]
        rolls = jnp.abs(v_x) < self.slowest
        anew = memory._replace(
            v_y=jnp.where(rolls, self.rear_axle_to_cg * values["yaw_rate"], memory.v_y),
            drift=jnp.where(rolls, 0.0, memory.drift),
        )
        return anew, sideslip_answer(anew.v_y, v_x, anew.drift <= WIDEST * jnp.abs(v_x))


class DirectIntegration(AbstractIntegration):
    """`v_y = integral of (a_y - v_x r)`, the kinematic method of section 1.1 (its [5]): nothing of the car, and nothing that
    forgets."""

    @property
    def needs(self):
        return (V_X, YAW_RATE, A_Y)

    def roll_of(self, memory, t, values):
        none = jnp.zeros_like(t)
        return none, none, none


class RollCompensated(AbstractIntegration):
    """Integration after the roll angle has been estimated and its gravity taken out of a_y: section 1.1.1, of its [10].

        dphi/dt = p + (phi_a - phi) / T,    sin(phi_a) = (a_y - v_x r) / g,    dv_y/dt = a_y - g sin(phi) - v_x r

    Slowly the roll angle is the one with which the car would turn steadily, quickly it is the integral of the gyroscope: body
    roll, bank and the accelerometer's offset are all in it, so that v_y does not drift; what v_y does in more than `time` T (s)
    is lost. Hac, Nichols & Sygnarowicz also know the suspension; here nothing of the car is asked for.
    """

    time: jax.Array = positive("s", default=ROLL_TIME)

    @property
    def needs(self):
        return (V_X, YAW_RATE, A_Y, ROLL_RATE)

    def roll_of(self, memory, t, values):
        sine = (values["a_y"] - values["v_x"] * values["yaw_rate"]) / GRAVITY
        sine = jnp.clip(sine, -0.5, 0.5)
        asked, roll_rate = numerics.arctan2(sine, numerics.sqrt(1.0 - sine**2)), values["roll_rate"]
        if memory is None:
            return asked, asked, roll_rate
        # Exact for what runs evenly: the filter's steady state is the mean of both rows' wishes.
        kept = jnp.exp(-(t - memory.t) / self.time)
        wished = 0.5 * (memory.asked + asked) + self.time * 0.5 * (memory.roll_rate + roll_rate)
        return kept * memory.roll + (1.0 - kept) * wished, asked, roll_rate


def direct_integration(car: CarSpecification) -> Guarded:
    """Direct integration for a car's file."""
    channels = (YAW_RATE, A_Y)
    return guard(car, DirectIntegration(car.rear_axle_to_cg, slowest_of(car)), channels, channels, anew=True)


def roll_compensated(car: CarSpecification) -> Guarded:
    """Integration with the roll taken out for a car's file."""
    channels = (YAW_RATE, A_Y, ROLL_RATE)
    time = ROLL_TIME * size_of(car) ** 0.5
    inner = RollCompensated(car.rear_axle_to_cg, slowest_of(car), LEFT * OFFSET, time)
    return guard(car, inner, channels, channels, anew=True)

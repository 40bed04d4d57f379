"""Lateral velocity by integration of the measured lateral acceleration, with and without compensation of the roll angle."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter, positive
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
"""m/s^2: error of an accelerometer by its own offset and by gravity in a body that leans by some 0.01 rad, for the inertial unit
of a series car (`sensors.production_car`). Lateral velocity drifts by this amount per second."""

START = 0.5
"""m/s: uncertainty of the lateral velocity at the first row, where it is taken to be zero."""

ROLL_TIME = 1.0
"""s: time constant with which the integral of the roll rate is drawn to the roll angle that the accelerations imply."""

LEFT = 0.3
"""Share of the drift that is left once the roll angle is taken out."""


class Integral(NamedTuple):
    """The previous row: `v_y` (m/s), its `rate` (m/s^2), which is integrated, `roll` (rad) and its sources, `asked` (rad) and
    `roll_rate` (rad/s); the time `t` (s), and the possible `drift` of v_y (m/s)."""

    v_y: Any
    rate: Any
    roll: Any
    asked: Any
    roll_rate: Any
    t: Any
    drift: Any


class AbstractIntegration(AbstractMethod):
    """Trapezoidal integration that starts from zero lateral velocity at the first row.

    It is reset while the car is slower than `slowest` (m/s), where the rear axle, `rear_axle_to_cg` (m) behind the centre of
    gravity, rolls without slip. The answer is known until `drift` (m/s^2) has made sideslip uncertain by `WIDEST`.
    """

    rear_axle_to_cg: jax.Array = positive("m")
    slowest: jax.Array = positive("m/s")
    drift: jax.Array = parameter("m/s^2", scale=0.1, default=OFFSET)

    @abc.abstractmethod
    def roll_of(self, memory: Integral | None, t: Any, values: dict[str, Any]) -> tuple[Any, Any, Any]:
        """The present roll angle (rad), the one that the accelerations imply (rad), and the roll rate (rad/s). `memory` is that
        of the previous row, None at the first row."""

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
    """`v_y = integral of (a_y - v_x r)`, the kinematic method of section 1.1 (its [5]): it needs no model of the car and never
    forgets an error."""

    @property
    def needs(self):
        return (V_X, YAW_RATE, A_Y)

    def roll_of(self, memory, t, values):
        none = jnp.zeros_like(t)
        return none, none, none


class RollCompensated(AbstractIntegration):
    """Integration of a_y after the gravity component of the estimated roll angle is taken out: section 1.1.1, of its [10].

        dphi/dt = p + (phi_a - phi) / T,    sin(phi_a) = (a_y - v_x r) / g,    dv_y/dt = a_y - g sin(phi) - v_x r

    At low frequencies the roll angle is that of a steady turn, at high frequencies it is the integral of the roll rate. It
    contains body roll, bank and the accelerometer's offset, so that v_y does not drift; changes of v_y slower than `time` T (s)
    are lost. Hac, Nichols & Sygnarowicz also use the suspension's parameters; this method does not.
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
        # Exact for constant inputs: the filter's steady state is the mean of both rows' targets.
        kept = jnp.exp(-(t - memory.t) / self.time)
        wished = 0.5 * (memory.asked + asked) + self.time * 0.5 * (memory.roll_rate + roll_rate)
        return kept * memory.roll + (1.0 - kept) * wished, asked, roll_rate


def direct_integration(car: CarSpecification) -> Guarded:
    """Makes direct integration from a car's file."""
    channels = (YAW_RATE, A_Y)
    return guard(car, DirectIntegration(car.rear_axle_to_cg, slowest_of(car)), channels, channels, anew=True)


def roll_compensated(car: CarSpecification) -> Guarded:
    """Makes integration with roll compensation from a car's file."""
    channels = (YAW_RATE, A_Y, ROLL_RATE)
    time = ROLL_TIME * size_of(car) ** 0.5
    inner = RollCompensated(car.rear_axle_to_cg, slowest_of(car), LEFT * OFFSET, time)
    return guard(car, inner, channels, channels, anew=True)

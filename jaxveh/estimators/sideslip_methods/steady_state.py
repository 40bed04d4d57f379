"""Sideslip of a steady turn: two formulas of the linear single track."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter
from jaxveh.estimators.method import AbstractMethod
from jaxveh.estimators.sideslip_methods.common import A_Y, STEER, V_X, YAW_RATE, Guarded, guard, sideslip_answer
from jaxveh.estimators.two_axles import AbstractLinearAxles, linear_axles_of
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY

LINEAR = 0.4
"""Lateral acceleration over gravity up to which a linear single track is good enough on dry road, as section 1.2.1 of the review
says after its [15]. Beyond it the formulas' answers are not known."""

LEAST_STEADINESS = 0.2
"""Smallest trusted value of `1 + K v^2 / l`, the denominator of eq 1: an oversteering car near its critical speed has no steady
turn."""


class AbstractSteadyState(AbstractLinearAxles, AbstractMethod):
    """A formula of the linear single track in a steady turn."""

    def first(self, t, values):
        return self.next((), t, values)


class SteadySteer(AbstractSteadyState):
    """Eq 1 of the review, of its [20]: sideslip from the steer and the speed, in a steady turn of the linear single track.

        beta = (1 - m l_f v^2 / (2 l_r k_r l)) / (1 - m (l_f k_f - l_r k_r) v^2 / (2 l^2 k_f k_r)) (l_r / l) delta

    Erratum: the printed k is that of one tyre, so that an axle has C = 2 k. The answer is known where the lateral acceleration of
    that turn is at most `LINEAR` g. `steer_offset` (rad) is added to the channel.
    """

    steer_offset: jax.Array = parameter("rad", scale=0.02, default=0.0)

    @property
    def needs(self):
        return (STEER, V_X)

    def turn_of_steer(self, v_x, steer):
        """The steer of a neutral car in the same turn (rad), and whether there is a steady turn at all."""
        leverage = (
            self.front_axle_to_cg * self.front_cornering_stiffness
            - self.rear_axle_to_cg * self.rear_cornering_stiffness
        )
        stiff = self.wheelbase**2 * self.front_cornering_stiffness * self.rear_cornering_stiffness
        steadiness = 1.0 - self.mass * jnp.square(v_x) * leverage / stiff
        steady = steadiness >= LEAST_STEADINESS
        return (steer + self.steer_offset) / numerics.or_one(steadiness, steady), steady

    def asked_acceleration(self, v_x, steer):
        """The lateral acceleration of that turn, m/s^2."""
        return jnp.square(v_x) * self.turn_of_steer(v_x, steer)[0] / self.wheelbase

    def next(self, memory, t, values):
        del t
        v_x, steer = values["v_x"], values["steer"]
        length, a, b = self.wheelbase, self.front_axle_to_cg, self.rear_axle_to_cg
        turning, steady = self.turn_of_steer(v_x, steer)
        square = self.mass * jnp.square(v_x)
        sideslip = (1.0 - square * a / (b * self.rear_cornering_stiffness * length)) * (b / length) * turning
        linear = jnp.abs(self.asked_acceleration(v_x, steer)) <= LINEAR * GRAVITY
        bounded = jnp.clip(sideslip, -1.0, 1.0)
        return memory, sideslip_answer(v_x * numerics.tan(bounded), v_x, steady & linear & (bounded == sideslip))


class SteadyTurn(AbstractSteadyState):
    """Eq 2 of the review, of its [28]: sideslip from the yaw rate and the lateral acceleration, in a steady turn.

        beta = l_r r / v_x - m l_f a_y / (2 l k_r)

    Erratum: the printed k_r is that of one tyre. The formula needs no steer, and holds where v_y does not change. It takes the
    axle's force to be linear, so that the answer is known up to `LINEAR` g.
    """

    @property
    def needs(self):
        return (V_X, YAW_RATE, A_Y)

    def next(self, memory, t, values):
        del t
        v_x, a_y = values["v_x"], values["a_y"]
        slip = self.mass * self.front_axle_to_cg / (self.wheelbase * self.rear_cornering_stiffness) * a_y
        v_y = self.rear_axle_to_cg * values["yaw_rate"] - slip * v_x
        return memory, sideslip_answer(v_y, v_x, jnp.abs(a_y) <= LINEAR * GRAVITY)


def steady_steer(car: CarSpecification) -> Guarded:
    """Makes eq 1 from a car's file."""
    return guard(car, SteadySteer(**linear_axles_of(car), steer_offset=-(car.steer_offset or 0.0)))


def steady_turn(car: CarSpecification) -> Guarded:
    """Makes eq 2 from a car's file."""
    return guard(car, SteadyTurn(**linear_axles_of(car)), (YAW_RATE, A_Y), (YAW_RATE, A_Y))

"""The recommended method: the stiffnesses of `WalkingStiffness`, of a car whose mass is estimated, too."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import jax.scipy.linalg

from jaxveh.estimators.method import AbstractSmoothable
from jaxveh.estimators.pulling import OF_THE_TORQUES, Pulling, State, pulling_filter
from jaxveh.estimators.sequential import Belief
from jaxveh.estimators.stiffness.walking import OF_THE_MASS, STATES, WalkingStiffness, WalkMemory, walking_stiffness
from jaxveh.io import CarSpecification

LOG_MASS = State._fields.index("log_mass")
"""The place of ln mass over the file's among the states of `Pulling`."""

OF_THE_LOAD = 0.3
"""Relative standard deviation of a stiffness over that of the load that the file does not have: its place along the car, some
0.4 m of 1.3 m to an axle."""


class WeighedMemory(NamedTuple):
    """The memories of both filters, and the belief about the states of both."""

    walking: WalkMemory
    pulling: Any
    belief: Belief


class WeighedStiffness(AbstractSmoothable):
    """The filters `walking` (stiffness) and `pulling` (grade and mass) side by side.

    How a car turns shows its stiffnesses over its mass: with a mass that is 20 % too small they are found 20 % too small. Where
    the log has torques, `pulling` estimates the mass, and the stiffnesses are those of that mass; its part of their standard
    deviation is first `OF_THE_MASS`, that of the file's mass, and with what `pulling` learns that of its estimate. Where a mass
    that the file does not have lies is unknown (`OF_THE_LOAD`).
    """

    walking: WalkingStiffness
    pulling: Pulling

    @property
    def needs(self):
        own = {need.channel: need for need in self.walking.needs}
        return (*own.values(), *[n._replace(optional=True) for n in self.pulling.needs if n.channel not in own])

    def first(self, t, values):
        memory = _joined(self.walking.first(t, values)[0], self.pulling.first(t, values)[0])
        return memory, self.say(memory)

    def next(self, memory, t, values):
        memory = _joined(
            self.walking.next(memory.walking, t, values)[0], self.pulling.next(memory.pulling, t, values)[0]
        )
        return memory, self.say(memory)

    def ahead(self, memory, t, values):
        walking, pulling = _parted(memory)
        return _both(self.walking.ahead(walking, t, values), self.pulling.ahead(pulling, t, values))

    def say(self, memory):
        walking, pulling = _parted(memory)
        mean, covariance = pulling.belief
        variance, start = covariance[LOG_MASS, LOG_MASS], jnp.square(self.pulling.mass_spread)
        informed = jnp.clip(1.0 - variance / start, 0.0, 1.0)
        of_the_mass = OF_THE_MASS**2 + informed * (variance + OF_THE_TORQUES**2 - OF_THE_MASS**2)
        of_the_load = jnp.square(OF_THE_LOAD * mean[LOG_MASS])
        return self.walking.answer_for(walking, jnp.exp(mean[LOG_MASS]), jnp.sqrt(of_the_mass + of_the_load))


def weighed_stiffness(car: CarSpecification) -> AbstractSmoothable:
    """The method for a car's file; of a file without `wheel_radius`, by which a torque becomes a force, `WalkingStiffness`."""
    walking = walking_stiffness(car)
    return walking if car.wheel_radius is None else WeighedStiffness(walking, pulling_filter(car, "stiffness"))


def _joined(walking: WalkMemory, pulling: Any) -> WeighedMemory:
    return WeighedMemory(walking, pulling, _both(walking.belief, pulling.belief))


def _both(one: Belief, other: Belief) -> Belief:
    """The belief about two states that are independent."""
    return Belief(
        jnp.concatenate([one.mean, other.mean]), jax.scipy.linalg.block_diag(one.covariance, other.covariance)
    )


def _parted(memory: WeighedMemory) -> tuple[WalkMemory, Any]:
    """The memories of both filters, with their parts of the belief."""
    mean, covariance = memory.belief
    part = lambda here: Belief(mean[here], covariance[here, here])
    return (
        memory.walking._replace(belief=part(slice(None, STATES))),
        memory.pulling._replace(belief=part(slice(STATES, None))),
    )

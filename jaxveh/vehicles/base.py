"""The one contract of a vehicle: state and inputs at one instant go in, rates and outputs come out."""

from __future__ import annotations

import abc
from typing import Any

import equinox as eqx

GRAVITY = 9.80665
"""Standard acceleration of free fall, m/s^2."""


class AbstractVehicle(eqx.Module):
    """Equations of motion of one vehicle: array leaves are parameters, states and inputs are NamedTuples of scalars.

    Written for one instant and elementwise: a batch of vehicles, states or parameters has arrays in the fields. Axes
    of ISO 8855 (x forward, y left, z up; yaw, yaw rate and steer positive to the left), SI units.
    """

    @property
    @abc.abstractmethod
    def inputs(self) -> tuple[str, ...]:
        """The fields that `u` must have."""

    @property
    @abc.abstractmethod
    def state_type(self) -> Any:
        """The state's NamedTuple class."""

    @property
    @abc.abstractmethod
    def units(self) -> dict[str, str]:
        """Units of states, inputs and outputs by name."""

    @abc.abstractmethod
    def start(self, t: Any, u: Any, **values: Any) -> Any:
        """The state of straight running at the inputs `u`, with fields replaced by keyword."""

    @abc.abstractmethod
    def evaluate(self, t: Any, x: Any, u: Any) -> tuple[Any, Any]:
        """The state's time derivative (the state's NamedTuple) and the outputs (a NamedTuple), forces computed once."""

    def derivatives(self, t: Any, x: Any, u: Any) -> Any:
        """The state's time derivative, the same NamedTuple."""
        return self.evaluate(t, x, u)[0]

    def outputs(self, t: Any, x: Any, u: Any) -> Any:
        """Everything that can be said about the vehicle at this instant, a NamedTuple."""
        return self.evaluate(t, x, u)[1]

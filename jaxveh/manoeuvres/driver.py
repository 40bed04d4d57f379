"""The contract of a driver who sees the car, and the driver who does not look."""

from __future__ import annotations

import abc
from typing import Any

import equinox as eqx

from jaxveh._core.errors import InputError
from jaxveh._core.names import record_type
from jaxveh._core.parameter import check_parameters
from jaxveh.manoeuvres.base import AbstractManoeuvre
from jaxveh.vehicles import Motion


class AbstractDriver(eqx.Module):
    """A driver who sees the car: from the time, the car's motion and his own state to the car's inputs.

    Array leaves are parameters. States (reaction lag, integrals) are scalars of a NamedTuple whose fields are
    `state_names`; a simulation carries them beside the car's. Elementwise, from t = 0 to `duration` (s).

    **Raises** `InputError` for parameters outside their domain.
    """

    duration: eqx.AbstractVar[float]

    def __check_init__(self):
        check_parameters(self)

    @property
    @abc.abstractmethod
    def state_names(self) -> tuple[str, ...]:
        """The fields of the state."""

    @property
    def fastest_rate(self) -> Any:
        """About how fast the quickest of his loops is, 1/s; None where nobody has said, so that a simulation has to look."""
        return None

    @abc.abstractmethod
    def start(self, t: Any, motion: Motion) -> Any:
        """The state that has settled at a motion."""

    @abc.abstractmethod
    def inputs(self, t: Any, motion: Motion, state: Any) -> Any:
        """The car's inputs, a NamedTuple of arrays."""

    @abc.abstractmethod
    def derivatives(self, t: Any, motion: Motion, state: Any) -> Any:
        """The state's time derivative, the same NamedTuple."""


class OpenLoop(AbstractDriver):
    """The driver who does a manoeuvre with his eyes closed: `inputs(t)`, no states.

    **Raises** `InputError` for what is no manoeuvre.
    """

    manoeuvre: AbstractManoeuvre
    duration: float = eqx.field(static=True)

    def __init__(self, manoeuvre: AbstractManoeuvre):
        if not isinstance(manoeuvre, AbstractManoeuvre):
            raise InputError(f"OpenLoop.manoeuvre = {type(manoeuvre).__name__}: must be a manoeuvre or a driver.")
        self.manoeuvre, self.duration = manoeuvre, manoeuvre.duration

    @property
    def state_names(self):
        return ()

    @property
    def fastest_rate(self):
        return 0.0

    def start(self, t: Any, motion: Motion) -> Any:
        return driver_state(())()

    def inputs(self, t: Any, motion: Motion, state: Any) -> Any:
        return self.manoeuvre.inputs(t)

    def derivatives(self, t: Any, motion: Motion, state: Any) -> Any:
        return driver_state(())()


def driver_state(names: tuple[str, ...]):
    """The NamedTuple class of a driver's state."""
    return record_type("DriverState", names)


def as_driver(what: AbstractDriver | AbstractManoeuvre) -> AbstractDriver:
    """A driver as it is, a manoeuvre as `OpenLoop`; raises `InputError` for anything else."""
    return what if isinstance(what, AbstractDriver) else OpenLoop(what)

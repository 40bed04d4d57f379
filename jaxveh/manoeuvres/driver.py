"""The contract of a closed-loop driver, and the open-loop driver."""

from __future__ import annotations

import abc
from typing import Any

import equinox as eqx

from jaxveh._core.contracts import Checked, contract
from jaxveh._core.errors import InputError, word_for
from jaxveh._core.names import record_type
from jaxveh._core.own_results import named_record, names, states
from jaxveh._core.parameter import check_parameters
from jaxveh.manoeuvres.base import AbstractManoeuvre
from jaxveh.vehicles import Motion


class AbstractDriver(Checked, eqx.Module):
    """A closed-loop driver: the car's inputs as a function of the time, the car's motion and the driver's own state.

    Array leaves are parameters. States (reaction lag, integrals) are scalars of a NamedTuple whose fields are
    `state_names`; a simulation integrates them together with the car's. The driver works elementwise, from t = 0 to
    `duration` (s).

    **Raises** `InputError` for parameters outside their domain.
    """

    duration: eqx.AbstractVar[float]
    _contract = contract(state_names=names, start=states, inputs=named_record, derivatives=states)

    def __check_init__(self):
        check_parameters(self)

    @property
    @abc.abstractmethod
    def state_names(self) -> tuple[str, ...]:
        """The fields of the state."""

    @property
    def fastest_rate(self) -> Any:
        """The approximate rate of the driver's fastest loop, 1/s; None if it is unknown, so that a simulation must
        determine it."""
        return None

    @abc.abstractmethod
    def start(self, t: Any, motion: Motion) -> Any:
        """The settled state at a motion."""

    @abc.abstractmethod
    def inputs(self, t: Any, motion: Motion, state: Any) -> Any:
        """The car's inputs, a NamedTuple of arrays."""

    @abc.abstractmethod
    def derivatives(self, t: Any, motion: Motion, state: Any) -> Any:
        """The state's time derivative, as the same NamedTuple."""


class OpenLoop(AbstractDriver):
    """The open-loop driver, who drives a manoeuvre without feedback: `inputs(t)`, no states.

    **Raises** `InputError` for anything that is not a manoeuvre.
    """

    manoeuvre: AbstractManoeuvre
    duration: float = eqx.field(static=True)

    def __init__(self, manoeuvre: AbstractManoeuvre):
        if not isinstance(manoeuvre, AbstractManoeuvre):
            raise InputError(f"OpenLoop.manoeuvre = {word_for(manoeuvre)}: must be a manoeuvre or a driver.")
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
    """A driver unchanged, or a manoeuvre as `OpenLoop`; raises `InputError` for anything else."""
    return what if isinstance(what, AbstractDriver) else OpenLoop(what)

"""The tyres of a car on one track: one law for all tyres of an axle."""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxveh import numerics
from jaxveh.tyres import AbstractDynamicTyre, AbstractTyre, Contact, Forces
from jaxveh.vehicles.wheels import state_names, state_of

AXLES = ("front", "rear")


class AxleTyres(NamedTuple):
    """The tyres of the front and of the rear axle; all pairs below have this order."""

    front: AbstractTyre
    rear: AbstractTyre

    @property
    def state_names(self) -> tuple[str, ...]:
        """The states of dynamic tyres: `front_<name>`, `rear_<name>`."""
        return tuple(f"{axle}_{name}" for axle, tyre in zip(AXLES, self, strict=True) for name in state_names(tyre))

    def states(self, x: Any) -> tuple[Any, Any]:
        """The tyre state of each axle, taken from the car's state `x`; None for a tyre without states."""
        return state_of("front", self.front, x), state_of("rear", self.rear, x)

    def start(self, contacts: tuple[Contact, Contact]) -> tuple:
        """The steady states, in the order of `state_names`."""
        settled = [t.start(at) for t, at in zip(self, contacts, strict=True) if isinstance(t, AbstractDynamicTyre)]
        return tuple(value for state in settled for value in state)

    @numerics.fence_results
    def forces(self, contacts: tuple[Contact, Contact], states: tuple[Any, Any]) -> tuple[Forces, Forces]:
        """The forces of the road on each axle, in the wheels' axes."""
        front, rear = (tyre.forces(*at) for tyre, *at in zip(self, contacts, states, strict=True))
        return front, rear

    def rates(self, contacts: tuple[Contact, Contact], states: tuple[Any, Any]) -> tuple:
        """The time derivatives of the tyre states, in the order of `state_names`."""
        found = []
        for tyre, contact, state in zip(self, contacts, states, strict=True):
            found += list(tyre.derivatives(contact, state)) if isinstance(tyre, AbstractDynamicTyre) else []
        return tuple(found)

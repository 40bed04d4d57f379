"""The tyres of a car on one track: an axle's tyres together are one law."""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxveh import numerics
from jaxveh.tyres import AbstractDynamicTyre, AbstractTyre, Contact, Forces
from jaxveh.vehicles.wheels import state_names, state_of

AXLES = ("front", "rear")


class AxleTyres(NamedTuple):
    """The tyres of the front and of the rear axle; pairs below are in this order."""

    front: AbstractTyre
    rear: AbstractTyre

    @property
    def state_names(self) -> tuple[str, ...]:
        """The states of dynamic tyres: `front_<name>`, `rear_<name>`."""
        return tuple(f"{axle}_{name}" for axle, tyre in zip(AXLES, self, strict=True) for name in state_names(tyre))

    def states(self, x: Any) -> tuple[Any, Any]:
        """Each axle's tyre state out of the car's, None for a tyre without."""
        return state_of("front", self.front, x), state_of("rear", self.rear, x)

    def start(self, contacts: tuple[Contact, Contact]) -> tuple:
        """The settled states, in the order of `state_names`."""
        settled = [t.start(at) for t, at in zip(self, contacts, strict=True) if isinstance(t, AbstractDynamicTyre)]
        return tuple(value for state in settled for value in state)

    @numerics.fence_results
    def forces(self, contacts: tuple[Contact, Contact], states: tuple[Any, Any]) -> tuple[Forces, Forces]:
        """What the road does to each axle, in the wheels' axes."""
        front, rear = (tyre.forces(*at) for tyre, *at in zip(self, contacts, states, strict=True))
        return front, rear

    def rates(self, contacts: tuple[Contact, Contact], states: tuple[Any, Any]) -> tuple:
        """The time derivatives, in the order of `state_names`."""
        found = []
        for tyre, contact, state in zip(self, contacts, states, strict=True):
            found += list(tyre.derivatives(contact, state)) if isinstance(tyre, AbstractDynamicTyre) else []
        return tuple(found)

"""The one contract of a vehicle: state, inputs and ground at one instant go in, rates and outputs come out."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.names import check_names
from jaxveh._core.parameter_table import WithParameters
from jaxveh.roads import LEVEL, Ground

GRAVITY = 9.80665
"""Standard acceleration of free fall, m/s^2."""


class Motion(NamedTuple):
    """How a car moves, without any force: what a driver sees, and what carries it along the road.

    World position `x`, `y` (m) of the point that the speeds belong to (the centre of gravity, unless the vehicle says
    otherwise), zero for a car that does not know it; `yaw` (rad, unwrapped); `v_x`, `v_y` (m/s) in the car's directions;
    `yaw_rate` (rad/s).
    """

    x: Any
    y: Any
    yaw: Any
    v_x: Any
    v_y: Any
    yaw_rate: Any


OVER_GROUND = {"speed": "m/s", "course": "rad"}
"""Units of what `over_ground` says."""


def over_ground(yaw: Any, v_x: Any, v_y: Any) -> dict[str, Any]:
    """The velocity over ground as satellites tell it: its magnitude `speed` (m/s), and its direction `course` (rad) from the
    world's x axis, `yaw + atan2(v_y, v_x)`, that of the yaw at standstill. It goes on with the yaw, which is unwrapped, and
    jumps by a turn where the car slides backwards; backwards it is the direction in which the car goes."""
    return {"speed": numerics.hypot(v_x, v_y), "course": yaw + numerics.arctan2(v_y, v_x)}


SHARED = "**Parameters** of "
"""How a paragraph on parameters begins that is meant for all classes below."""


def with_shared_parameters(kind: type) -> str:
    """The docstring of a class, with its bases' paragraphs on shared parameters before the one on inputs, or at the end."""
    paragraphs = (kind.__doc__ or "").rstrip().split("\n\n")
    shared = [
        part
        for base in reversed(kind.__mro__[1:])
        for part in (base.__dict__.get("__doc__") or "").rstrip().split("\n\n")
        if part.lstrip().startswith(SHARED) and part not in paragraphs
    ]
    at = next((i for i, part in enumerate(paragraphs) if part.lstrip().startswith("**Inputs**")), len(paragraphs))
    return "\n\n".join([*paragraphs[:at], *shared, *paragraphs[at:]]) + "\n    "


class AbstractVehicle(WithParameters, eqx.Module):
    """Equations of motion of one vehicle: array leaves are parameters, states and inputs are NamedTuples of scalars.

    Written for one instant and elementwise: a batch of vehicles, states or parameters has arrays in the fields. Axes
    of ISO 8855 (x forward, y left, z up; yaw, yaw rate and steer positive to the left), SI units. Speeds and accelerations
    are those of the centre of gravity in the intermediate axes, which lie in the road's plane and turn with the car.

    Parameters that several vehicles share are declared by abstract classes, whose docstrings say of what in a paragraph that
    begins with `SHARED`; the docstring of a vehicle gets these paragraphs, so that `help` shows all.
    """

    drawn_by = "car"
    called = "vehicle"

    def __init_subclass__(cls, **options: Any):
        super().__init_subclass__(**options)
        if not cls.__name__.startswith("Abstract"):
            cls.__doc__ = with_shared_parameters(cls)

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
    def evaluate(self, t: Any, x: Any, u: Any, ground: Ground = LEVEL) -> tuple[Any, Any]:
        """The state's time derivative (the state's NamedTuple) and the outputs (a NamedTuple), forces computed once."""

    @abc.abstractmethod
    def motion(self, x: Any, u: Any) -> Motion:
        """How the car moves; needs no tyre force."""

    @property
    def wheel_positions(self) -> tuple[tuple[Any, Any], ...]:
        """Where the wheels (front left, front right, rear left, rear right) touch the road: (x, y) in m from the point of
        `motion`, in the car's directions; all in that point for a car without wheels."""
        return ((0.0, 0.0),) * 4

    def derivatives(self, t: Any, x: Any, u: Any, ground: Ground = LEVEL) -> Any:
        """The state's time derivative, the same NamedTuple."""
        return self.evaluate(t, x, u, ground)[0]

    def outputs(self, t: Any, x: Any, u: Any, ground: Ground = LEVEL) -> Any:
        """Everything that can be said about the vehicle at this instant, a NamedTuple."""
        return self.evaluate(t, x, u, ground)[1]


def with_batch_shape(outputs: Any) -> Any:
    """The same NamedTuple, each field with the shape of all: a number or a parameter stands for the whole batch."""
    leaves = jax.tree.leaves(outputs)
    shape = jnp.broadcast_shapes(*[jnp.shape(leaf) for leaf in leaves])
    dtype = jnp.result_type(*[leaf for leaf in leaves if hasattr(leaf, "dtype")])
    array = lambda leaf: leaf if hasattr(leaf, "dtype") else jnp.asarray(leaf, dtype)
    return jax.tree.map(lambda leaf: jnp.broadcast_to(array(leaf), shape), outputs)


def given_or_zero(state_type: Any, values: dict[str, Any], like: Any, parameter: Any) -> Any:
    """A state with `values` by name, all else zero in the shape of `like`; of the float type of a `parameter`.

    **Raises** `InputError` for names that the state does not have.
    """
    check_names("start", values, state_type._fields)
    dtype, zero = jnp.result_type(parameter), jnp.zeros(jnp.shape(like))
    return state_type(*[jnp.asarray(values.get(name, zero), dtype) for name in state_type._fields])

"""The interface of all vehicles: from state, inputs and ground at one instant to state derivatives and outputs."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.contracts import Checked, contract
from jaxveh._core.names import check_names
from jaxveh._core.own_results import names, of_kind
from jaxveh._core.parameter import check_parameters
from jaxveh._core.parameter_table import WithParameters
from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles import checked

GRAVITY = 9.80665
"""Standard acceleration of free fall, m/s^2."""


class Motion(NamedTuple):
    """The motion of a car, without forces: the quantities that a driver model sees and that move the car along the road.

    `x`, `y` (m): world position of the reference point of the speeds (the centre of gravity, unless the vehicle documents
    another), zero for a vehicle without a position. `yaw` (rad, unwrapped), `v_x`, `v_y` (m/s, in the car's axes), `yaw_rate`
    (rad/s).
    """

    x: Any
    y: Any
    yaw: Any
    v_x: Any
    v_y: Any
    yaw_rate: Any


OVER_GROUND = {"speed": "m/s", "course": "rad"}
"""The units of the results of `over_ground`."""


def over_ground(yaw: Any, v_x: Any, v_y: Any) -> dict[str, Any]:
    """The velocity over ground as satellite receivers measure it: its magnitude `speed` (m/s) and its direction `course` (rad)
    from the world's x axis, `yaw + atan2(v_y, v_x)`. At standstill the course is the yaw. It is unwrapped like the yaw, but jumps
    by a full turn where v_y changes sign in backward travel; in backward travel it is the direction of travel."""
    return {"speed": numerics.hypot(v_x, v_y), "course": yaw + numerics.arctan2(v_y, v_x)}


SHARED = "**Parameters** of "
"""The beginning of a docstring's paragraph on parameters that all subclasses share."""


def with_shared_parameters(kind: type) -> str:
    """The docstring of a class with the paragraphs of its bases on shared parameters, before the one on inputs or at the end."""
    paragraphs = (kind.__doc__ or "").rstrip().split("\n\n")
    shared = [
        part
        for base in reversed(kind.__mro__[1:])
        for part in (base.__dict__.get("__doc__") or "").rstrip().split("\n\n")
        if part.lstrip().startswith(SHARED) and part not in paragraphs
    ]
    at = next((i for i, part in enumerate(paragraphs) if part.lstrip().startswith("**Inputs**")), len(paragraphs))
    return "\n\n".join([*paragraphs[:at], *shared, *paragraphs[at:]]) + "\n    "


class AbstractVehicle(Checked, WithParameters, eqx.Module):
    """The equations of motion of one vehicle: array leaves are parameters, states and inputs are NamedTuples of scalars.

    The equations hold at one instant and are elementwise: for a batch of vehicles, states or parameters the fields are arrays.
    Axes are those of ISO 8855 (x forward, y left, z up; yaw, yaw rate and steer positive to the left), units are SI. Speeds and
    accelerations are those of the centre of gravity in the intermediate axes, which lie in the road's plane and turn with the
    car.

    Abstract classes declare the parameters that several vehicles share. Each describes them in a paragraph of its docstring that
    begins with `SHARED`. The docstring of a vehicle includes these paragraphs, so that `help` shows all parameters.
    """

    drawn_by = "car"
    called = "vehicle"
    _contract = contract(
        inputs=names,
        state_type=checked.state_type,
        units=checked.units,
        start=checked.state,
        evaluate=checked.rates_and_outputs,
        motion=of_kind(Motion, numbers=False),
    )

    def __init_subclass__(cls, **options: Any):
        super().__init_subclass__(**options)
        if not cls.__name__.startswith("Abstract"):
            cls.__doc__ = with_shared_parameters(cls)

    def __check_init__(self):
        check_parameters(self)

    @property
    @abc.abstractmethod
    def inputs(self) -> tuple[str, ...]:
        """The fields that the inputs `u` must have."""

    @property
    @abc.abstractmethod
    def state_type(self) -> Any:
        """The NamedTuple class of the state."""

    @property
    @abc.abstractmethod
    def units(self) -> dict[str, str]:
        """The units of states, inputs and outputs by name."""

    @abc.abstractmethod
    def start(self, t: Any, u: Any, **values: Any) -> Any:
        """The state of straight running at the inputs `u`, with fields replaced by keyword."""

    @abc.abstractmethod
    def evaluate(self, t: Any, x: Any, u: Any, ground: Ground = LEVEL) -> tuple[Any, Any]:
        """The state's time derivative (the same NamedTuple) and the outputs (a NamedTuple); forces are computed only once."""

    @abc.abstractmethod
    def motion(self, x: Any, u: Any) -> Motion:
        """The motion of the car, for which no tyre force is needed."""

    @property
    def wheel_positions(self) -> tuple[tuple[Any, Any], ...]:
        """The contact points of the wheels (front left, front right, rear left, rear right): (x, y) in m from the reference
        point of `motion`, in the car's axes. Without wheels all lie in that point."""
        return ((0.0, 0.0),) * 4

    def derivatives(self, t: Any, x: Any, u: Any, ground: Ground = LEVEL) -> Any:
        """The state's time derivative, the same NamedTuple."""
        return self.evaluate(t, x, u, ground)[0]

    def outputs(self, t: Any, x: Any, u: Any, ground: Ground = LEVEL) -> Any:
        """All outputs of the vehicle at this instant, a NamedTuple."""
        return self.evaluate(t, x, u, ground)[1]


def with_batch_shape(outputs: Any) -> Any:
    """The same NamedTuple with all fields broadcast to a common shape: numbers and parameters are repeated for the batch."""
    leaves = jax.tree.leaves(outputs)
    shape = jnp.broadcast_shapes(*[jnp.shape(leaf) for leaf in leaves])
    dtype = dtype_of_strong(leaves)
    array = lambda leaf: leaf if is_strong(leaf) else jnp.asarray(leaf, dtype)
    return jax.tree.map(lambda leaf: jnp.broadcast_to(array(leaf), shape), outputs)


def is_strong(leaf: Any) -> bool:
    """Whether a number has a dtype of its own, unlike Python's numbers and what JAX makes of them alone."""
    return hasattr(leaf, "dtype") and not getattr(leaf, "weak_type", False)


def dtype_of_strong(leaves: Any, default: Any = float) -> Any:
    """The common dtype of the numbers that have one of their own; the `default` if none has."""
    return jnp.result_type(*[leaf for leaf in leaves if is_strong(leaf)] or [default])


def given_or_zero(state_type: Any, values: dict[str, Any], like: Any, parameter: Any) -> Any:
    """A state with `values` by name and zeros of the shape of `like` in all other fields, with the dtype of a `parameter`.

    **Raises** `InputError` for names that the state does not have.
    """
    check_names("start", values, state_type._fields)
    dtype, zero = jnp.result_type(parameter), jnp.zeros(jnp.shape(like))
    return state_type(*[jnp.asarray(values.get(name, zero), dtype) for name in state_type._fields])


def innermost_car(car: Any) -> Any:
    """The car itself, of one that is inside others (`AntiLock`, `Steered`, ...); of any other thing, that thing."""
    while isinstance(inner := getattr(car, "vehicle", None), AbstractVehicle):
        car = inner
    return car

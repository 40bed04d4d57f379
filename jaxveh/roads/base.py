"""The interface of all roads: a road returns friction, slopes and height at a given position."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.contracts import Checked, contract
from jaxveh._core.own_results import of_kind
from jaxveh._core.parameter import check_parameters


class Surface(NamedTuple):
    """The surface of a road at one position.

    - `friction` (-): friction of this road over that of the road on which the tyres' parameters hold.
    - `grade` (rad): positive uphill along the road; its tangent is the slope dz/ds.
    - `bank` (rad): positive where the left side is higher; its tangent is the slope dz/dy.
    - `height` (m): height of the unevenness over the plane that grade and bank tilt. It acts on sprung wheels and does not
      tilt the car's gravity.
    """

    friction: Any
    grade: Any
    bank: Any
    height: Any = 0.0


class AbstractRoad(Checked, eqx.Module):
    """A road along the world's x axis. Its array leaves are its parameters.

    Slopes are quasi-static: they tilt gravity at the car's position. Vehicles and devices neglect the car's rotation with a
    changing grade or bank, and the effect of the road's curvature on the loads.

    **Raises** `InputError` for parameters outside their domain.
    """

    _contract = contract(at=of_kind(Surface))

    def __check_init__(self):
        check_parameters(self)

    @abc.abstractmethod
    def at(self, s: Any, y: Any = 0.0) -> Surface:
        """The surface `s` m along the road and `y` m to the left of its centre line, elementwise.

        The fields have the shape to which s, y and the road's parameters broadcast, and the parameters' dtype.
        """


def place(s: Any, y: Any, like: jax.Array) -> tuple[jax.Array, jax.Array]:
    """s and y as arrays of a parameter's dtype."""
    dtype = jnp.result_type(like)
    return jnp.asarray(s, dtype), jnp.asarray(y, dtype)


def surface(
    s: jax.Array, y: jax.Array, friction: Any, grade: Any = None, bank: Any = None, height: Any = None
) -> Surface:
    """A surface whose fields all have the same shape. Slopes and height are zero if not given."""
    zero = jnp.zeros_like(s)
    values = [friction, *[zero if value is None else value for value in (grade, bank, height)]]
    shape = jnp.broadcast_shapes(*[jnp.shape(value) for value in (s, y, *values)])
    return Surface(*[jnp.broadcast_to(value, shape) for value in values])

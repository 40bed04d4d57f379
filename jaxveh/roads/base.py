"""The one contract of a road: a place on it goes in, friction and slopes come out."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.parameter import check_parameters


class Surface(NamedTuple):
    """A road at one place.

    - `friction` (-): over that of the road on which the tyres' parameters hold.
    - `grade` (rad): positive uphill along the road; its tangent is the slope dz/ds.
    - `bank` (rad): positive where the left side is higher; its tangent is the slope dz/dy.
    - `height` (m): of the unevenness over the plane that grade and bank tilt; wheels on springs feel it, it tilts nothing.
    """

    friction: Any
    grade: Any
    bank: Any
    height: Any = 0.0


class AbstractRoad(eqx.Module):
    """A road along the world's x axis; array leaves are its parameters.

    Slopes are quasi-static: they tilt gravity where the car is. That the car turns with a road whose grade or bank changes,
    and what its curvature does to loads, is left out, by vehicles and by devices.

    **Raises** `InputError` for parameters outside their domain.
    """

    def __check_init__(self):
        check_parameters(self)

    @abc.abstractmethod
    def at(self, s: Any, y: Any = 0.0) -> Surface:
        """The surface `s` m along the road and `y` m to the left of its centre line, elementwise.

        Fields have the shape to which s, y and the road's parameters broadcast, and the parameters' type.
        """


def place(s: Any, y: Any, like: jax.Array) -> tuple[jax.Array, jax.Array]:
    """s and y as arrays of a parameter's type."""
    dtype = jnp.result_type(like)
    return jnp.asarray(s, dtype), jnp.asarray(y, dtype)


def surface(
    s: jax.Array, y: jax.Array, friction: Any, grade: Any = None, bank: Any = None, height: Any = None
) -> Surface:
    """A surface whose fields all have one shape; a slope or a height that is not given is zero."""
    zero = jnp.zeros_like(s)
    values = [friction, *[zero if value is None else value for value in (grade, bank, height)]]
    shape = jnp.broadcast_shapes(*[jnp.shape(value) for value in (s, y, *values)])
    return Surface(*[jnp.broadcast_to(value, shape) for value in values])

"""A road from tables over distance."""

from __future__ import annotations

import math
from typing import Any

import equinox as eqx
import jax
import numpy as np

from jaxveh._core.bijectors import Positive
from jaxveh._core.errors import InputError, check, check_one_of, is_concrete
from jaxveh._core.parameter import check_parameters, table
from jaxveh.numerics import interpolate_linear, interpolate_smooth
from jaxveh.roads.base import AbstractRoad, Surface, place, surface

INTERPOLATIONS = {"smooth": interpolate_smooth, "linear": interpolate_linear}
"""How values between the points are interpolated: by monotone cubics or by straight lines."""


class Profile(AbstractRoad):
    """A road whose friction, grade and bank are tables over distance, constant before the first and after the last point.

    `distance` (m): (n,), strictly increasing, n >= 2. `friction` (-), `grade`, `bank` (rad): (n,) each, or one number for
    the whole road. `interpolation`: "smooth" (cubics with continuous slopes that stay within the range of their two points)
    or "linear".

    **Raises** `InputError` for distances that do not increase, tables of another length, or values out of range.
    """

    distance: jax.Array = table("m", scale=1.0)
    friction: jax.Array = table("-", Positive(), default=1.0)
    grade: jax.Array = table("rad", scale=0.05, default=0.0)
    bank: jax.Array = table("rad", scale=0.05, default=0.0)
    interpolation: str = eqx.field(static=True, default="smooth")

    def __check_init__(self):
        check_one_of("Profile.interpolation", self.interpolation, INTERPOLATIONS)
        check_parameters(self)
        count = np.size(self.distance)
        if np.ndim(self.distance) != 1 or count < 2:
            raise InputError(f"Profile.distance has the shape {np.shape(self.distance)}: must be (n,), n at least 2.")
        if is_concrete(self.distance) and not np.all(np.diff(np.asarray(self.distance)) > 0):
            raise InputError(f"Profile.distance = {np.asarray(self.distance)}: must rise from point to point.")
        for name in ("friction", "grade", "bank"):
            shape = np.shape(getattr(self, name))
            if shape not in ((), (count,)):
                raise InputError(
                    f"Profile.{name} has the shape {shape}: must be one number, or ({count},) as distance."
                )
        for name in ("grade", "bank"):
            angle = getattr(self, name)
            check(f"Profile.{name}", angle, lambda v: abs(v) < math.pi / 2, "within a quarter turn", "It is in rad.")

    def at(self, s: Any, y: Any = 0.0) -> Surface:
        s, y = place(s, y, self.distance)
        between = INTERPOLATIONS[self.interpolation]
        tables = (self.friction, self.grade, self.bank)
        return surface(s, y, *[between(s, self.distance, table) if table.ndim else table for table in tables])

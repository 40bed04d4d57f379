"""Paths on the ground for a driver to follow."""

from __future__ import annotations

import abc
import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import check, check_positive
from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh.numerics import smooth_step


class PathTarget(NamedTuple):
    """A point of the path relative to a car: `ahead` and `left` of it, m."""

    ahead: Any
    left: Any


class Beside(NamedTuple):
    """A place relative to the path: its distance `left` of the path (m), and the path's `heading` there (rad, left of
    the x axis)."""

    left: Any
    heading: Any


class AbstractPath(eqx.Module):
    """A smooth curve on the ground, through the world's origin along x unless stated otherwise; elementwise.

    **Raises** `InputError` for parameters outside their domain.
    """

    def __check_init__(self):
        check_parameters(self)

    @abc.abstractmethod
    def beside(self, x: Any, y: Any) -> Beside:
        """The place (x, y) (m) relative to the path."""

    @abc.abstractmethod
    def preview(self, x: Any, y: Any, direction: Any, distance: Any) -> PathTarget:
        """The path's point `distance` (m) further on, relative to the place (x, y) (m) and a `direction` (rad)."""


class AbstractGraph(AbstractPath):
    """A path given by its lateral position at each x: `y(x)`, twice continuously differentiable."""

    @abc.abstractmethod
    def y(self, x: jax.Array) -> jax.Array:
        """The distance of the path to the left of the x axis, m, in the shape of x (m)."""

    def beside(self, x: Any, y: Any) -> Beside:
        """The place relative to the path, to first order in the distance from the path."""
        here, slope = self._slope(x)
        return Beside((y - here) * _cosine(slope), numerics.arctan(slope))

    def preview(self, x: Any, y: Any, direction: Any, distance: Any) -> PathTarget:
        """The point ahead; the distance is taken along the path's tangent beside the place."""
        _, slope = self._slope(x)
        along = distance * _cosine(slope)
        across = self.y(x + along) - y
        return _rotate(along, across, direction)

    def _slope(self, x):
        x = jnp.asarray(x)
        return jax.jvp(self.y, (x,), (jnp.ones_like(x),))


def _cosine(slope):
    return 1.0 / jnp.sqrt(1.0 + slope * slope)


def _rotate(along, across, direction) -> PathTarget:
    cosine, sine = numerics.cos(direction), numerics.sin(direction)
    return PathTarget(along * cosine + across * sine, across * cosine - along * sine)


class Straight(AbstractGraph):
    """A straight line along x, at a distance `left` (m, default 0) to the left of the x axis."""

    left: jax.Array = parameter("m", scale=1.0, default=0.0)

    def y(self, x: jax.Array) -> jax.Array:
        return jnp.broadcast_to(self.left, jnp.shape(x))


class LaneChanges(AbstractGraph):
    """A path to another lane and back: a smooth step of `over` (m, left) and another of `back` (m, left; negative: right).

    `over_from`, `over_to`, `back_from`, `back_to` (m): the x at which the steps begin and end.

    **Raises** `InputError` for a step that does not end after its beginning.
    """

    over: jax.Array = parameter("m", scale=1.0)
    back: jax.Array = parameter("m", scale=1.0)
    over_from: jax.Array = parameter("m", scale=10.0)
    over_to: jax.Array = parameter("m", scale=10.0)
    back_from: jax.Array = parameter("m", scale=10.0)
    back_to: jax.Array = parameter("m", scale=10.0)

    def __check_init__(self):
        check_parameters(self)  # first, so that the message names a field that is not finite
        check_positive("LaneChanges.over_to - over_from", self.over_to - self.over_from, "m")
        check_positive("LaneChanges.back_to - back_from", self.back_to - self.back_from, "m")

    def y(self, x: jax.Array) -> jax.Array:
        over = smooth_step((x - self.over_from) / (self.over_to - self.over_from))
        back = smooth_step((x - self.back_from) / (self.back_to - self.back_from))
        return self.over * over + self.back * back


class Sine(AbstractGraph):
    """A sine of `amplitude` (m, left first) and `wavelength` (m) from `start` (m) on, over `periods` wavelengths.

    It fades in over the first half wavelength and out over the last, so that its first and its last peak have half the
    amplitude. The cones of a slalom stand at the peaks between these, half a wavelength apart, so that the path passes
    them on alternating sides.

    **Raises** `InputError` for a wavelength that is not positive, or less than one period.
    """

    amplitude: jax.Array = parameter("m", scale=1.0)
    wavelength: jax.Array = positive("m")
    start: jax.Array = parameter("m", scale=10.0, default=0.0)
    periods: jax.Array = positive("-", default=3.0)

    def __check_init__(self):
        check("Sine.periods", self.periods, lambda v: v >= 1, "at least 1, so that its ends can fade")

    def y(self, x: jax.Array) -> jax.Array:
        gone = jnp.clip((x - self.start) / self.wavelength, 0.0, self.periods)
        fade = smooth_step(2.0 * gone) * smooth_step(2.0 * (self.periods - gone))
        return self.amplitude * fade * numerics.sin((2 * math.pi) * gone)


class Circle(AbstractPath):
    """A circle of `radius` (m; positive to the left, negative to the right) that leaves the origin along x.

    **Raises** `InputError` for a radius of zero.
    """

    radius: jax.Array = parameter("m", scale=10.0)

    def __check_init__(self):
        check("Circle.radius", self.radius, lambda v: v != 0, "other than 0 m")

    def beside(self, x: Any, y: Any) -> Beside:
        sine, cosine, away = self._angle(x, y)
        return Beside(self.radius - jnp.sign(self.radius) * away, numerics.arctan2(sine, cosine))

    def preview(self, x: Any, y: Any, direction: Any, distance: Any) -> PathTarget:
        """The point ahead; the distance is taken along the circle from the point nearest to the place."""
        sine, cosine, _ = self._angle(x, y)
        further = distance / self.radius
        turn_sine, turn_cosine = numerics.sin(further), numerics.cos(further)
        to_x = self.radius * (sine * turn_cosine + cosine * turn_sine)
        to_y = self.radius * (1.0 - (cosine * turn_cosine - sine * turn_sine))
        return _rotate(to_x - x, to_y - y, direction)

    def _angle(self, x, y):
        """Sine and cosine of the path's heading at the nearest point, and the distance from the centre."""
        from_centre = y - self.radius
        away = numerics.hypot(x, from_centre)
        # At the centre all points are equally near: one of them is taken.
        scale = jnp.sign(self.radius) / numerics.or_one(away, away > 0)
        return x * scale, jnp.where(away > 0, -from_centre * scale, 1.0), away

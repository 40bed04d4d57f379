"""Driving between cones: the lanes of ISO 3888, a slalom, the positions of the cones, and whether a car hits them."""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import (
    InputError,
    check,
    check_finite,
    check_kind,
    check_known,
    check_positive,
    check_single,
    check_whole,
    real_array,
)
from jaxveh.manoeuvres.paths import LaneChanges

CONE_DIAMETER = 0.3
"""The diameter of a cone's base, m: our choice."""


class Lane(NamedTuple):
    """A straight lane between cones, from `start` to `end` (m along x), between `right` and `left` (m along y).

    A side without a limit is infinite.
    """

    start: float
    end: float
    right: float
    left: float

    @property
    def centre(self) -> float:
        """The centre line of the lane, m along y."""
        return (self.left + self.right) / 2


class Course(NamedTuple):
    """The lanes of a test in their order. Each lane limits the car; between them there are no limits."""

    name: str
    lanes: tuple[Lane, ...]


def iso_3888_1(width: float, start: float = 30.0) -> Course:
    """The double lane change of ISO 3888-1 for a car of this `width` (m, without mirrors), from `start` (m) on.

    Sections of 15, 30, 25, 25, 15 and 15 m, 125 m in all (the last two are one lane). Lane widths 1.1 w + 0.25, 1.2 w +
    0.25 and 1.3 w + 0.25 m. y = 0 is the first lane's centre line.

    The numbers are those of ISO 3888-1:2018, figure 1 and table 1, from secondary sources; the standard itself was not
    available. It is assumed that the offset of 3.5 m is from the right limit of the first lane to that of the second,
    and that the right limits of the third and the first lane are in line, so that the third lane is wider on the left
    only. If the offset is between centre lines instead, the second lane lies 0.05 w further right.

    **Raises** `InputError` for a width that is not positive.
    """
    check_known(width=width)
    _check(width, start)
    first, second, third = 1.1 * width + 0.25, 1.2 * width + 0.25, 1.3 * width + 0.25
    right = -first / 2
    lanes = (
        Lane(start, start + 15.0, right, right + first),
        Lane(start + 45.0, start + 70.0, right + 3.5, right + 3.5 + second),
        Lane(start + 95.0, start + 125.0, right, right + third),
    )
    return Course("ISO 3888-1", lanes)


def iso_3888_2(width: float, start: float = 30.0) -> Course:
    """The obstacle avoidance of ISO 3888-2 for a car of this `width` (m, without mirrors), from `start` (m) on.

    Sections of 12, 13.5, 11, 12.5 and 12 m, 61 m in all. Lane widths 1.1 w + 0.25, w + 1 and 1.3 w + 0.25 m, the last at
    least 3 m. y = 0 is the first lane's centre line.

    The numbers are those of ISO 3888-2:2011, figure 1 and table 1, from secondary sources; the standard itself was not
    available. It is assumed that the offset of 1 m is the gap from the first lane's left limit to the second's right
    limit, and that the left limits of the third and the first lane are in line, so that the third lane is wider on the
    right only, and the gap on the way back is the same as on the way out.

    **Raises** `InputError` for a width that is not positive.
    """
    check_known(width=width)
    _check(width, start)
    first, second, third = 1.1 * width + 0.25, width + 1.0, max(1.3 * width + 0.25, 3.0)
    left = first / 2
    lanes = (
        Lane(start, start + 12.0, -left, left),
        Lane(start + 25.5, start + 36.5, left + 1.0, left + 1.0 + second),
        Lane(start + 49.0, start + 61.0, left - third, left),
    )
    return Course("ISO 3888-2", lanes)


def slalom_cones(spacing: float = 18.0, count: int = 6, start: float = 30.0, diameter: float = CONE_DIAMETER) -> Course:
    """The cones of a `slalom_course` with the same `spacing` (m), `count` and `start` (m), as lanes of zero length,
    open on one side.

    Cone k (from 0) stands at x = start + (1.5 + k) spacing, y = 0. The car passes it on its right if k is even,
    otherwise on its left, outside its base of `diameter` (m); the extent of the base along x is neglected.

    **Raises** `InputError` for a spacing or diameter that is not positive, or fewer than 2 cones.
    """
    check_slalom(spacing, count, start)
    check_single(diameter=diameter)
    check_positive("diameter", diameter, "m")
    lanes = []
    for k in range(count):
        x = start + (1.5 + k) * spacing
        sides = (-math.inf, -diameter / 2) if k % 2 == 0 else (diameter / 2, math.inf)
        lanes.append(Lane(x, x, *sides))
    return Course("slalom", tuple(lanes))


def check_slalom(spacing, count, start) -> None:
    """Raise `InputError` unless these are valid for the cones of a slalom."""
    check_single(spacing=spacing, start=start)
    check_positive("spacing", spacing, "m")
    check_finite("start", start)
    check_whole("count", count, 2)


def centre_line(course: Course, lead: float) -> LaneChanges:
    """A smooth path through the middle of a course of three lanes that starts along x.

    `lead` (m): the path leaves each lane's middle this far before its end and reaches it this far after its start,
    which makes the turns wider.

    **Raises** `InputError` for a course that does not have three lanes, or a lead that does not fit into the lanes.
    """
    _check_course(course)
    check_single(lead=lead)
    if len(course.lanes) != 3:
        raise InputError(f"course = {course.name}: {len(course.lanes)} lanes; must have 3.")
    first, second, third = course.lanes
    most = (second.end - second.start) / 2
    check("lead", lead, lambda v: (v >= 0) & (v <= most), f"between 0 and half the length of the second lane, {most} m")
    return LaneChanges(
        over=second.centre - first.centre,
        back=third.centre - second.centre,
        over_from=first.end - lead,
        over_to=second.start + lead,
        back_from=second.end - lead,
        back_to=third.start + lead,
    )


def cones(course: Course, spacing: float = 3.0, diameter: float = CONE_DIAMETER) -> np.ndarray:
    """The centres of the cones, (n, 2) of x and y (m), along both limits of each lane, including its ends.

    The bases of the cones (of `diameter`, m) touch the limits from outside, as in ISO 3888. The cones stand evenly, at
    most `spacing` (m) apart, which is our choice. Sides without a limit have no cones.

    **Raises** `InputError` for a spacing or diameter that is not positive.
    """
    _check_course(course)
    check_known(spacing=spacing, diameter=diameter)
    check_positive("spacing", spacing, "m")
    check_positive("diameter", diameter, "m")
    places = []
    for lane in course.lanes:
        count = math.ceil((lane.end - lane.start) / spacing) + 1
        sides = (lane.right - diameter / 2, lane.left + diameter / 2)
        for side in filter(math.isfinite, sides):
            places += [(x, side) for x in np.linspace(lane.start, lane.end, count)]
    return np.array(places)


def clearance(x: Any, y: Any, yaw: Any, width: Any, length: Any, course: Course, centre: Any = 0.0) -> jax.Array:
    """The least distance, m along y, from the outline of a driven body to the limits of the lanes; negative if it hits a cone.

    `x`, `y` (m), `yaw` (rad): (T,), the position of the centre of gravity and the heading in the rows of a drive.
    `width`, `length` (m): those of the body, a rectangle whose middle is `centre` (m) ahead of the centre of gravity.
    The result is minus infinity if the drive does not go through the whole course. Positions between rows are not
    checked: 0.01 s at 100 km/h is 0.3 m.

    **Raises** `InputError` for a size that is not positive, what is no course, or arrays of several shapes.
    """
    _check_course(course)
    check_single(width=width, length=length, centre=centre)
    check_positive("width", width, "m")
    check_positive("length", length, "m")
    check_finite("centre", centre)
    x, y, yaw = (real_array(name, values) for name, values in (("x", x), ("y", y), ("yaw", yaw)))
    if not x.shape == y.shape == yaw.shape or not x.size:
        raise InputError(
            f"x, y and yaw have the shapes {x.shape}, {y.shape} and {yaw.shape}: must be one, (T,), T at least 1."
        )
    corners = _corners(x, y, yaw, width, length, centre)
    margins = [numerics.smallest(_margin(corners, lane)) for lane in course.lanes]
    whole = (jnp.min(x) <= course.lanes[0].start) & (jnp.max(x) >= course.lanes[-1].end)
    return jnp.where(whole, numerics.smallest(jnp.stack(margins)), -jnp.inf)


def passes(x: Any, y: Any, yaw: Any, width: Any, length: Any, course: Course, centre: Any = 0.0) -> jax.Array:
    """Whether a driven body goes through the whole course without a hit; arguments are those of `clearance`."""
    return clearance(x, y, yaw, width, length, course, centre) >= 0


def _corners(x, y, yaw, width, length, centre):
    """The corners of the outline in order, (x, y) each."""
    cosine, sine = jnp.cos(yaw), jnp.sin(yaw)
    places = [(f * length / 2 + centre, s * width / 2) for f, s in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    return [(x + ahead * cosine - left * sine, y + ahead * sine + left * cosine) for ahead, left in places]


def _margin(corners, lane: Lane):
    """The least distance of the outline within the lane to the lane's limits: at corners in it, and where sides enter
    or leave it."""
    margins = []
    for (x, y), (x_next, y_next) in zip(corners, corners[1:] + corners[:1], strict=True):
        margins.append(_within(y, lane, (x >= lane.start) & (x <= lane.end)))
        for limit in (lane.start, lane.end):
            crosses = (x - limit) * (x_next - limit) < 0
            share = (limit - x) / numerics.or_one(x_next - x, crosses)
            margins.append(_within(y + share * (y_next - y), lane, crosses))
    return functools.reduce(jnp.minimum, margins)


def _within(y, lane: Lane, counts):
    return jnp.where(counts, jnp.minimum(lane.left - y, y - lane.right), jnp.inf)


def _check_course(course: Any) -> None:
    check_kind("course", course, Course, "Such as manoeuvres.iso_3888_1(width=1.8).")


def _check(width, start) -> None:
    check_single(width=width, start=start)
    check_positive("width", width, "m")
    check_finite("start", start)

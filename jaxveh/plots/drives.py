"""The usual figure of a drive, by the manoeuvre's name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import check_one_of
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import drive_channels
from jaxveh.manoeuvres import MANOEUVRES, Course
from jaxveh.plots.braking_drives import braking
from jaxveh.plots.car_outline import footprint
from jaxveh.plots.dwell import sine_with_dwell
from jaxveh.plots.frequency_responses import frequency_response
from jaxveh.plots.handling import handling_diagram
from jaxveh.plots.panels import overview
from jaxveh.plots.step_responses import step_response
from jaxveh.plots.style import new_figure, style
from jaxveh.plots.top_views import top_view, top_view_height
from jaxveh.vehicles import LinearSingleTrack, linear_single_track

OVERVIEW_HEIGHT = 5.2
"""Height of the overview below a top view, inches."""


class Seen(NamedTuple):
    """The arguments of a figure."""

    recording: Recording
    course: Course | None
    car: Any
    wheelbase: float | None
    steer_at_03g: float | None
    figure: Any


def drive(
    recording: Recording,
    manoeuvre: str | None = None,
    *,
    course: Course | None = None,
    car: Any = None,
    wheelbase: float | None = None,
    steer_at_03g: float | None = None,
    figure: Any = None,
) -> Any:
    """Draw the figure of a drive for its `manoeuvre`'s name in `jaxveh.manoeuvres.MANOEUVRES`.

    A step of steer has its step response; sweeps and random steering have the frequency response, beside that of the linearised
    `car`; slow turns have the handling diagram, the sine with dwell its criteria, braking speeds and slips, and lane changes and
    slaloms a top view above the overview. Other drives, and drives without a name, have the overview alone. `course`, `car` and
    `wheelbase` (m; by default the car's) as in `top_view` and `handling_diagram`, `steer_at_03g` (rad) as in `sine_with_dwell`.

    **Returns** the figure. **Raises** `InputError` for an unknown name, or if the drive does not allow its figure.
    """
    if manoeuvre is not None:
        check_one_of("manoeuvre", manoeuvre, MANOEUVRES)
    if wheelbase is None and car is not None:
        feet = footprint(recording, car, None, None)
        wheelbase = feet.front + feet.rear
    return _FIGURES.get(manoeuvre or "", _overview)(Seen(recording, course, car, wheelbase, steer_at_03g, figure))


def _overview(seen: Seen) -> Any:
    return overview(seen.recording, figure=seen.figure)


def _frequency(seen: Seen) -> Any:
    return frequency_response(seen.recording, closed_form=linear_response(seen.recording, seen.car), figure=seen.figure)


def linear_response(recording: Recording, car: Any) -> dict[str, Callable[[np.ndarray], Any]]:
    """Return the frequency response of a car's linear single track at the drive's mean speed, by output.

    It is for `frequency_response`, and empty for a car that cannot be linearised.
    """
    if isinstance(car, LinearSingleTrack):
        linear = car
    elif all(
        hasattr(car, name) for name in ("mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg", "front", "rear")
    ):
        linear = linear_single_track(car)
    else:
        return {}
    system = linear.system(jnp.asarray(np.mean(drive_channels.channel(recording, "v_x")), jnp.result_type(linear.mass)))

    def response(name: str) -> Callable[[np.ndarray], Any]:
        return lambda frequency: getattr(
            system.frequency_response(jnp.asarray(2 * np.pi * frequency, system.a_11.dtype)), name
        )

    return {name: response(name) for name in ("yaw_rate", "a_y")}


def _path(seen: Seen) -> Any:
    if not drive_channels.has(seen.recording, "x", "y", "yaw"):
        return _overview(seen)
    with style():
        heights = [top_view_height(seen.recording, seen.course), OVERVIEW_HEIGHT]
        figure = new_figure(sum(heights)) if seen.figure is None else seen.figure
        above, below = figure.subfigures(2, 1, height_ratios=heights)
        top_view(seen.recording, seen.course, car=seen.car, wheelbase=seen.wheelbase, figure=above)
        overview(seen.recording, figure=below)
    return figure


_FIGURES: dict[str, Callable[[Seen], Any]] = {
    "step-steer": lambda seen: step_response(seen.recording, figure=seen.figure),
    "swept-sine": _frequency,
    "random-steering": _frequency,
    "ramp-steer": lambda seen: handling_diagram(seen.recording, seen.wheelbase, figure=seen.figure),
    "steady-circle": lambda seen: handling_diagram(seen.recording, seen.wheelbase, figure=seen.figure),
    "sine-with-dwell": lambda seen: sine_with_dwell(seen.recording, steer_at_03g=seen.steer_at_03g, figure=seen.figure),
    "braking-in-a-turn": lambda seen: braking(seen.recording, figure=seen.figure),
    "mu-jump-braking": lambda seen: braking(seen.recording, figure=seen.figure),
    "double-lane-change": _path,
    "slalom": _path,
    "iso-lane-change": _path,
    "iso-obstacle-avoidance": _path,
    "slalom-course": _path,
}

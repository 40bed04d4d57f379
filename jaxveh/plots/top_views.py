"""A drive from above: the path, the car along it, the forces of its tyres, and the cones."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from jaxveh._core.errors import check_one_of, check_positive
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import drive_channels
from jaxveh.manoeuvres import Course, cones
from jaxveh.plots.car_outline import WHEEL, Footprint, footprint, rotate, wheel_angles, wheel_forces
from jaxveh.plots.panels import round_number
from jaxveh.plots.style import CYCLE, PAGE_WIDTH, SHADE, label_above, new_figure, style

SNAPSHOTS = 12
"""Approximate default number of drawn cars."""

MOST_ROWS = 4
TALL = 4.6
"""A long and narrow drive is split along x into rows, as long as they stay within this height in inches."""

BESIDE, BENEATH, EACH = 0.6, 0.95, 0.4
"""Space for labels beside the rows, for labels and colour bar below them, and for the ticks of each row, inches."""

NEAR = 2.0
"""A car that has moved by less is not drawn again, m."""

FLAT = 0.4
"""Height over width of the rows below which times are written along their lower edge, clear of arrows."""

FORCE = CYCLE[1]


def top_view(
    recording: Recording,
    course: Course | None = None,
    *,
    car: Any = None,
    wheelbase: float | None = None,
    track: float | None = None,
    every: float | None = None,
    colour: str = "speed",
    figure: Any = None,
) -> Any:
    """Draw the path over the ground with equal axes, coloured by `"speed"` or `"time"`, and the car on it `every` few seconds.

    Arrows at the wheels are the road's forces on the tyres (at the axles for a single track), with one arrow for scale. With
    a `course` (`jaxveh.manoeuvres.Course`) its lanes are shaded and its cones drawn. `car`: the vehicle whose axles and
    tracks are drawn; by default `wheelbase` and `track` (m), otherwise those of an ordinary passenger car. Overhangs are assumed.
    A long and narrow drive is split along x into rows.

    **Returns** the figure. **Raises** `InputError` if position or yaw is missing, or an argument is out of range.
    """
    check_one_of("colour", colour, ("speed", "time"))
    feet = footprint(recording, car, wheelbase, track)
    time, x, y = (
        drive_channels.seconds(recording),
        drive_channels.channel(recording, "x"),
        drive_channels.channel(recording, "y"),
    )
    every = round_number(max(time[-1] - time[0], 1e-3) / SNAPSHOTS * 1.5) if every is None else every
    check_positive("every", every, "s")
    at = _snapshots(time, x, y, every)
    boxes, height = _rows(x, y, course, feet)
    with style():
        figure = new_figure(height) if figure is None else figure
        axes = figure.subplots(len(boxes), 1, squeeze=False)[:, 0]
        coloured = drive_channels.channel(recording, "v_x") if colour == "speed" else time
        forces = wheel_forces(recording, feet)
        scale = _metres_per_newton(forces, feet)
        for ax, (left, right, low, high) in zip(axes, boxes, strict=True):
            ax.set(xlim=(left, right), ylim=(low, high), aspect="equal")
            _course(ax, course)
            path = _path(ax, x, y, coloured)
            for k in at:
                _car(ax, recording, feet, k, every)
            _forces(ax, recording, feet, forces, at, scale)
        _label(figure, axes, path, colour, scale)
    return figure


def _snapshots(time: np.ndarray, x: np.ndarray, y: np.ndarray, every: float) -> list[int]:
    """Return the rows at which the car is drawn; a standing car is drawn once."""
    shown: list[int] = []
    for k in np.searchsorted(time, np.arange(time[0], time[-1] + 1e-9, every) - 1e-9):
        if not shown or math.hypot(x[k] - x[shown[-1]], y[k] - y[shown[-1]]) > NEAR:
            shown.append(int(k))
    return shown


def top_view_height(recording: Recording, course: Course | None = None) -> float:
    """Return the natural height of the top view, inches."""
    feet = footprint(recording, None, None, None)
    return _rows(drive_channels.channel(recording, "x"), drive_channels.channel(recording, "y"), course, feet)[1]


def _rows(x: np.ndarray, y: np.ndarray, course: Course | None, car: Footprint) -> tuple[list, float]:
    """Return the part of the ground (left, right, low, high; m) of each row, and the figure's height in inches."""
    margin = max(car.front, car.rear) + 2.0
    left, right = float(np.min(x)) - margin, float(np.max(x)) + margin
    limits = [side for lane in course.lanes for side in (lane.left, lane.right)] if course else []
    sides = [*y, *filter(math.isfinite, limits)]
    low, high = float(np.min(sides)) - 3.0, float(np.max(sides)) + 3.0
    inches = lambda count: count * ((PAGE_WIDTH - BESIDE) * (high - low) * count / (right - left) + EACH)
    count = 1
    while count < MOST_ROWS and inches(count + 1) <= TALL:
        count += 1
    edges = np.linspace(left, right, count + 1)
    rows = [(a, b, low, high) for a, b in itertools.pairwise(edges.tolist())]
    return rows, inches(count) + BENEATH


def _course(ax: Any, course: Course | None) -> None:
    if course is None:
        return
    from matplotlib.patches import Rectangle

    for lane in course.lanes:
        if not (math.isfinite(lane.left) and math.isfinite(lane.right)):
            continue
        corner, size = (lane.start, lane.right), (lane.end - lane.start, lane.left - lane.right)
        ax.add_patch(Rectangle(corner, *size, facecolor=SHADE, edgecolor="none", zorder=0.5))
    places = cones(course)
    ax.plot(places[:, 0], places[:, 1], "^", color=CYCLE[4], markersize=3.2, markeredgewidth=0, zorder=2)


def _path(ax: Any, x: np.ndarray, y: np.ndarray, coloured: np.ndarray) -> Any:
    from matplotlib.collections import LineCollection

    points = np.stack([x, y], axis=1)
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    path = LineCollection(list(pieces), cmap="viridis", linewidth=1.8, zorder=1.5)
    path.set_array((coloured[:-1] + coloured[1:]) / 2)
    low, high = float(np.min(coloured)), float(np.max(coloured))
    # A steady speed has one colour; its noise is not shown.
    if high - low < 0.02 * max(abs(high), 1e-9):
        middle = (low + high) / 2
        low, high = middle - 0.01 * abs(middle), middle + 0.01 * abs(middle)
    path.set_clim(low, high)
    return ax.add_collection(path)


def _car(ax: Any, recording: Recording, car: Footprint, k: int, every: float) -> None:
    """Draw body and wheels at row `k`, with the time."""
    from matplotlib.patches import Polygon

    place, yaw = _place(recording, k)
    body = place + rotate(car.body, yaw)
    ax.add_patch(Polygon(body, facecolor="#ffffff", alpha=0.55, edgecolor="none", zorder=1.6))
    ax.add_patch(Polygon(body, fill=False, edgecolor="#444444", linewidth=0.7, zorder=2.2))
    angles = wheel_angles(recording, car)
    for name, position in car.wheels.items():
        ends = rotate([(-WHEEL / 2, 0.0), (WHEEL / 2, 0.0)], float(angles[name][k])) + np.array(position)
        ends = place + rotate(ends, yaw)
        ax.plot(ends[:, 0], ends[:, 1], color="#222222", linewidth=1.6, solid_capstyle="butt", zorder=2.3)
    decimals = max(0, -math.floor(math.log10(every) + 1e-9))
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    flat = high - low < FLAT * (right - left)
    under = low + 0.2 if flat else float(np.max(body[:, 1])) + 0.25
    if left <= place[0] <= right:
        label = f"{drive_channels.seconds(recording)[k]:.{decimals}f} s"
        ax.text(place[0], under, label, fontsize=6.5, color="#666666", ha="center", va="bottom", clip_on=True)


def _place(recording: Recording, k: int) -> tuple[np.ndarray, float]:
    return np.array([drive_channels.channel(recording, name)[k] for name in ("x", "y")]), float(
        drive_channels.channel(recording, "yaw")[k]
    )


def _metres_per_newton(forces: dict[str, np.ndarray], car: Footprint) -> float:
    """Return the scale of the arrows: the largest force is about as long as the car."""
    most = max((float(np.max(np.hypot(*force.T))) for force in forces.values()), default=0.0)
    return (car.front + car.rear) / most if most > 0 else 0.0


def _forces(ax: Any, recording: Recording, car: Footprint, forces: dict, at: list[int], scale: float) -> None:
    if scale == 0.0:
        return
    starts, arrows = [], []
    for k in at:
        place, yaw = _place(recording, k)
        for name, position in car.wheels.items():
            starts.append(place + rotate([position], yaw)[0])
            arrows.append(rotate([forces[name][k]], yaw)[0] * scale)
    starts, arrows = np.array(starts), np.array(arrows)
    ax.quiver(*starts.T, *arrows.T, angles="xy", scale_units="xy", scale=1.0, color=FORCE, width=0.012, units="inches", zorder=3,
              headwidth=5, headlength=6, headaxislength=5.5, minlength=0)  # fmt: skip


def _label(figure: Any, axes: Any, path: Any, colour: str, scale: float) -> None:
    label_above(axes[0], "y [m]")
    axes[-1].set_xlabel("x [m]")
    bar = figure.colorbar(path, ax=list(axes), location="bottom", fraction=0.04, shrink=0.4, aspect=32, pad=0.02)
    bar.set_label("speed [m/s]" if colour == "speed" else "time [s]")
    bar.outline.set_visible(False)
    if scale > 0.0:
        _scale_arrow(axes[0], round_number(2.0 / scale), scale)


def _scale_arrow(ax: Any, newtons: float, scale: float) -> None:
    """Draw an arrow for scale above the axes on the right, where there is no car."""
    from matplotlib.transforms import ScaledTranslation

    above = ax.transData + ScaledTranslation(0.0, 7 / 72, ax.figure.dpi_scale_trans)
    right, high = ax.get_xlim()[1], ax.get_ylim()[1]
    tail = right - newtons * scale
    arrow = {"arrowstyle": "-|>", "color": FORCE, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 8}
    ax.annotate(
        "", (right, high), (tail, high), xycoords=above, textcoords=above, annotation_clip=False, arrowprops=arrow
    )
    ax.annotate(f"{newtons / 1e3:g} kN", (tail, high), (-4, 0), xycoords=above, textcoords="offset points",
                annotation_clip=False, fontsize=7.5, color=FORCE, ha="right", va="center")  # fmt: skip

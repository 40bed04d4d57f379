"""Lateral force over slip angle of both axles: the truth, the prior's band, and what estimators made of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from jaxveh._core.errors import InputError, check_one_of
from jaxveh.plots.style import COLOURS, colour, legend, new_figure, style
from jaxveh.tyres import Contact

POINTS = 200
AXLES = ("front", "rear")


def force_curves(
    cars: Mapping[str, Any],
    slips: Mapping[str, Any],
    *,
    draws: Any = None,
    errors: bool = True,
    figure: Any = None,
) -> Any:
    """Each axle's lateral force over the slip angles that were visited and, beneath, the error against the truth.

    **Arguments**: `cars`: label to a car with `front` and `rear` tyres; one labelled `truth` is black, and errors refer
    to it and to its greatest force there. `slips`: `front` and `rear`, the visited slip angles (T,) in radians, shown
    as a rug. `draws`: a car whose tyres have a leading axis of draws of the prior, shown as a band of 95 %.
    `errors=False`, or no truth, leaves the lower row out. Loads are static. `figure`: where to draw.

    **Returns** the figure. **Raises** `InputError` where an axle's slips are missing.
    """
    for axle in AXLES:
        check_one_of("axle", axle, tuple(slips))
    errors = errors and "truth" in cars and len(cars) > 1
    with style():
        figure = new_figure(4.6 if errors else 3.0) if figure is None else figure
        ratios = [2, 1] if errors else [1]
        axes = figure.subplots(len(ratios), 2, sharex="col", sharey="row", squeeze=False, height_ratios=ratios)
        for column, axle in enumerate(AXLES):
            _curves(axes[0, column], axle, cars, slips[axle], draws)
            axes[0, column].set_title(f"{axle} axle")
            if errors:
                _errors(axes[1, column], axle, cars, slips[axle])
            axes[-1, column].set_xlabel("slip angle [°]")
        axes[0, 0].set_ylabel("lateral force [kN]")
        if errors:
            axes[1, 0].set_ylabel("error [% of peak]")
        figure.align_ylabels(axes[:, 0])
        legend(figure, axes)
    return figure


def _curves(ax: Any, axle: str, cars: Mapping[str, Any], visited: Any, draws: Any) -> None:
    slip, degrees = _grid(visited)
    if draws is not None:
        low, high = _band(draws, axle, slip)
        ax.fill_between(
            degrees, low / 1e3, high / 1e3, color=COLOURS["prior"], alpha=0.18, lw=0, label="prior, 95 % band"
        )
    for index, (label, car) in enumerate(cars.items()):
        _line(ax, degrees, lateral_force(car, axle, slip) / 1e3, label, index)
    _rug(ax, np.degrees(np.asarray(visited)))


def _rug(ax: Any, degrees: np.ndarray) -> None:
    """Where the car has been: what the measurements can know of."""
    ax.plot(degrees, np.full(degrees.shape, 0.025), "|", color="#444444", ms=6, mew=0.4, alpha=0.3, zorder=1,
            transform=ax.get_xaxis_transform())  # fmt: skip
    ax.text(0.99, 0.06, "slip angles visited", transform=ax.transAxes, ha="right", va="bottom", fontsize=7.5,
            color="#666666")  # fmt: skip


def _errors(ax: Any, axle: str, cars: Mapping[str, Any], visited: Any) -> None:
    slip, degrees = _grid(visited)
    truth = lateral_force(cars["truth"], axle, slip)
    peak = np.max(np.abs(truth))
    worst = 0.0
    for index, (label, car) in enumerate(cars.items()):
        error = 100 * (lateral_force(car, axle, slip) - truth) / peak
        _line(ax, degrees, error, label, index)
        if label not in ("truth", "prior"):
            worst = max(worst, float(np.max(np.abs(error))))
    # The prior's errors run off the panel on purpose: the estimators' are what it is about.
    reach = max(1.5 * worst, 1.0)
    ax.set_ylim(-reach, reach)


def _line(ax: Any, degrees: np.ndarray, values: np.ndarray, label: str, index: int) -> None:
    weight = {"truth": 2.2, "prior": 1.1}.get(label, 1.2)
    # Estimators that agree lie on each other: dashes let the one beneath be seen.
    dashes = {"prior": "--", "MAP": (0, (4, 2))}.get(label, "-")
    order = {"truth": 2.0, "prior": 2.1}.get(label, 2.5 + 0.01 * index)
    ax.plot(degrees, values, linestyle=dashes, color=colour(label, index), lw=weight, zorder=order, label=label)


def _grid(visited: Any) -> tuple[np.ndarray, np.ndarray]:
    """Slip angles over the visited range, in radians and degrees."""
    visited = np.asarray(visited, dtype=np.float64)
    if not np.isfinite(visited).any():
        raise InputError("plots.force_curves: no finite slip angle to show.")
    slip = np.linspace(np.nanmin(visited), np.nanmax(visited), POINTS)
    return slip, np.degrees(slip)


def lateral_force(car: Any, axle: str, slip: np.ndarray) -> np.ndarray:
    """The axle's lateral force over slip angles (S,) at its static load, N: (S,)."""
    load = car.static_loads()[AXLES.index(axle)]
    contact = Contact(slip_angle=jax.numpy.asarray(slip, load.dtype), load=load)
    return np.asarray(getattr(car, axle).forces(contact).F_y, dtype=np.float64)


def _band(draws: Any, axle: str, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The central 95 % of the draws' forces at each slip angle, N."""
    load = draws.static_loads()[AXLES.index(axle)]
    at = Contact(slip_angle=jax.numpy.asarray(slip, load.dtype), load=load)
    forces = jax.vmap(lambda tyre: tyre.forces(at).F_y)(getattr(draws, axle))
    low, high = np.quantile(np.asarray(forces, dtype=np.float64), (0.025, 0.975), axis=0)
    return low, high

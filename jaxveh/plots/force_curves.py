"""Lateral force over slip angle of both axles: the truth, the prior's band, and the estimates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from jaxveh._core.errors import InputError, check_flags, check_kind, check_one_of
from jaxveh.plots.style import COLOURS, colour, legend, new_figure, style
from jaxveh.plots.tyres import check_tyre
from jaxveh.tyres import Contact
from jaxveh.vehicles import kit as vehicles

POINTS = 200


def force_curves(
    cars: Mapping[str, Any],
    slips: Mapping[str, Any],
    *,
    draws: Any = None,
    errors: bool = True,
    figure: Any = None,
) -> Any:
    """Draw each axle's lateral force over the visited slip angles and, below it, the error against the truth.

    **Arguments**: `cars`: label to a car with `front` and `rear` tyres; the one labelled `truth` is black, and errors refer
    to it, in per cent of its largest force there. `slips`: `front` and `rear`, the visited slip angles (T,) in radians, shown
    as a rug. `draws`: a car whose tyres have a leading axis of draws of the prior, shown as a band of 95 %.
    With `errors=False`, or without a truth, there is no lower row. Loads are static. `figure`: the figure to draw into.

    **Returns** the figure. **Raises** `InputError` if an axle's slips are missing.
    """
    check_flags(errors=errors)
    check_kind("plots.force_curves: cars", cars, Mapping, "Such as {'truth': car}.")
    check_kind("plots.force_curves: slips", slips, Mapping, "Such as {'front': slips, 'rear': slips}.")
    for axle in vehicles.AXLES:
        check_one_of("axle", axle, tuple(slips))
    for label, car in cars.items():
        for axle in vehicles.AXLES:
            check_tyre(f"plots.force_curves: {label}.{axle}", getattr(car, axle, None))
    errors = errors and "truth" in cars and len(cars) > 1
    with style():
        figure = new_figure(4.6 if errors else 3.0) if figure is None else figure
        ratios = [2, 1] if errors else [1]
        axes = figure.subplots(len(ratios), 2, sharex="col", sharey="row", squeeze=False, height_ratios=ratios)
        for column, axle in enumerate(vehicles.AXLES):
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
    """Mark the visited slip angles, about which the measurements have information."""
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
    # The prior's errors leave the panel on purpose: its scale is that of the estimators' errors.
    reach = max(1.5 * worst, 1.0)
    ax.set_ylim(-reach, reach)


def _line(ax: Any, degrees: np.ndarray, values: np.ndarray, label: str, index: int) -> None:
    weight = {"truth": 2.2, "prior": 1.1}.get(label, 1.2)
    # Lines of estimators that agree coincide: dashes keep the lower line visible.
    dashes = {"prior": "--", "MAP": (0, (4, 2))}.get(label, "-")
    order = {"truth": 2.0, "prior": 2.1}.get(label, 2.5 + 0.01 * index)
    ax.plot(degrees, values, linestyle=dashes, color=colour(label, index), lw=weight, zorder=order, label=label)


def _grid(visited: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return slip angles over the visited range, in radians and degrees."""
    visited = np.asarray(visited, dtype=np.float64)
    if not np.isfinite(visited).any():
        raise InputError("plots.force_curves: no finite slip angle to show.")
    slip = np.linspace(np.nanmin(visited), np.nanmax(visited), POINTS)
    return slip, np.degrees(slip)


def lateral_force(car: Any, axle: str, slip: np.ndarray) -> np.ndarray:
    """Return the axle's lateral force (S,), N, at slip angles (S,) and its static load."""
    load = car.static_loads()[vehicles.AXLES.index(axle)]
    contact = Contact(slip_angle=jax.numpy.asarray(slip, load.dtype), load=load)
    return np.asarray(getattr(car, axle).forces(contact).F_y, dtype=np.float64)


def _band(draws: Any, axle: str, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the limits of the central 95 % of the draws' forces at each slip angle, N."""
    load = draws.static_loads()[vehicles.AXLES.index(axle)]
    at = Contact(slip_angle=jax.numpy.asarray(slip, load.dtype), load=load)
    forces = jax.vmap(lambda tyre: tyre.forces(at).F_y)(getattr(draws, axle))
    low, high = np.quantile(np.asarray(forces, dtype=np.float64), (0.025, 0.975), axis=0)
    return low, high

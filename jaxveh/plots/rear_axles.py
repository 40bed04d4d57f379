"""The rear axle of a calibration: lateral force over load, over slip angle, with the points that a log visited."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import check_has
from jaxveh._core.parameter import put
from jaxveh._core.recording import Recording, check_recording
from jaxveh.estimators import Calibration, RearAxle, sideslip
from jaxveh.estimators import kit as estimators
from jaxveh.plots.style import COLOURS, CYCLE, legend, new_figure, style

POINTS = 241
DRAWS = 200
"""Number of random curves for the band."""
EDGE = 0.95
"""The share of the grip up to which the filter follows the curve: beyond it a force does not determine the slip angle."""
TURNING_ALONE = 0.97
"""The share of its grip that an axle has left for turning above which the curve without longitudinal force applies."""


class AxlePoints(NamedTuple):
    """An axle's curve and the points that a log visited.

    `slip` (S,), rad, and `share` (S,), lateral force over load, of the calibrated curve without longitudinal force; `low`, `high`
    (S,): the band of 95 % from the uncertainty of the fitted parameters, None if there is none. `visited_slip`, `visited_share`
    (N,): of the log's rows; `turning` (N,): whether at most a little of the grip is used for driving or braking.
    """

    slip: np.ndarray
    share: np.ndarray
    low: np.ndarray | None
    high: np.ndarray | None
    visited_slip: np.ndarray
    visited_share: np.ndarray
    turning: np.ndarray


def rear_axle(source: Any, estimate: Any, recording: Recording, *, least_speed: float = 3.0, figure: Any = None) -> Any:
    """Draw the calibrated curve with its band, and the visited points.

    **Arguments**: as `rear_axle_points`. `figure`: the figure to draw into. **Returns** the figure.
    """
    found = rear_axle_points(source, estimate, recording, least_speed=least_speed)
    with style():
        figure = new_figure(4.2) if figure is None else figure
        ax = figure.subplots()
        for which, shade, label in (
            (~found.turning, "#b5b5b5", "visited while driving or braking hard"),
            (found.turning, CYCLE[4], "visited"),
        ):
            if which.any():
                x, y = np.degrees(found.visited_slip[which]), found.visited_share[which]
                ax.plot(
                    x, y, ".", color=shade, markersize=2.6, alpha=0.5, markeredgewidth=0, label=label, rasterized=True
                )
        degrees = np.degrees(found.slip)
        if found.low is not None:
            ax.fill_between(
                degrees, found.low, found.high, color=CYCLE[0], alpha=0.25, lw=0, label="calibrated curve, 95 % band"
            )
        words = "curve of the car file" if found.low is None else "calibrated curve"
        ax.plot(degrees, found.share, color=CYCLE[0], linewidth=1.6, label=words)
        for line in (ax.axhline, ax.axvline):
            line(0.0, color=COLOURS["truth"], linewidth=0.6)
        ax.set_xlabel("slip angle of the rear axle [°]")
        ax.set_ylabel("lateral force over load [1]")
        marks = legend(figure, ax)
        for handle in [] if marks is None else marks.legend_handles:
            if handle is not None and hasattr(handle, "set_markersize"):
                handle.set_alpha(1.0)
                handle.set_markersize(6.0)
    return figure


def rear_axle_points(source: Any, estimate: Any, recording: Recording, *, least_speed: float = 3.0) -> AxlePoints:
    """Return the rear axle's curve and the visited points.

    **Arguments**: `source`: a `Calibration` of sideslip, its model, or a car whose values are used. `estimate`: its estimate for
    the `recording` (T rows each). Rows slower than `least_speed` (m/s) are left out.
    """
    needed = ("slip_angle_rear", "F_yr")
    advice = "estimators.sideslip.estimate without a method returns such an estimate."
    check_has("plots.rear_axle: estimate", estimate, ("mean",), advice)
    check_has("plots.rear_axle: estimate.mean", estimate.mean, needed, advice)
    check_recording("plots.rear_axle", recording)
    system = estimators.model_of(sideslip.NAME, source, sideslip.model, RearAxle).system
    a_x = np.nan_to_num(np.asarray(recording["a_x"])) if "a_x" in recording else np.zeros(len(recording))
    u = SimpleNamespace(a_x=jnp.asarray(a_x), v_x=jnp.asarray(recording["v_x"]))
    slip, load = np.asarray(estimate.mean.slip_angle_rear), np.asarray(system.loads(u)[1])
    share, left = np.asarray(estimate.mean.F_yr) / load, np.asarray(system.left_for_turning(u))
    there = np.isfinite(slip) & np.isfinite(share) & (np.asarray(recording["v_x"]) >= least_speed)
    slip, share, left = slip[there], share[there], left[there]
    reach = 1.1 * float(np.max(np.abs(slip), initial=np.radians(2.0)))
    at = np.linspace(-reach, reach, POINTS)
    low, high = _band(source, at) if isinstance(source, Calibration) else (None, None)
    return AxlePoints(at, _at(at, eqx.filter_jit(_curve)(system)), low, high, slip, share, left >= TURNING_ALONE)


def _curve(system: RearAxle) -> tuple[Any, Any]:
    """Return slip angles (rad) and lateral forces over load up to `EDGE`, (S,) each, without longitudinal force.

    The system gives slip angles as a function of forces.
    """
    # The points are denser near the limit of grip, where slip angles grow quickly.
    share = EDGE * system.grip * jnp.sin(jnp.linspace(-jnp.pi / 2, jnp.pi / 2, 4 * POINTS))
    zero = jnp.zeros_like(share)
    load = system.loads(SimpleNamespace(a_x=zero))[1]
    felt = share * load * system.wheelbase / (system.front_axle_to_cg * system.mass)
    u = SimpleNamespace(
        a_y_smooth=felt * system.a_y_gain + system.a_y_offset,
        yaw_rate_smooth=zero,
        yaw_acceleration=zero,
        a_x=zero,
        v_x=zero,
    )
    state: Any = SimpleNamespace(stiffening=zero)
    return system.slip_angle(state, u)[0], share


def _at(slip: np.ndarray, curve: tuple[Any, Any]) -> np.ndarray:
    """Return a curve's forces over load at slip angles (S,), NaN beyond its end."""
    return np.interp(slip, *(np.asarray(values, np.float64) for values in curve), left=np.nan, right=np.nan)


def _band(source: Calibration, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the limits (S,) between which 95 % of the curves lie that are drawn from the fit's covariance."""
    fit = source.fit
    points = np.random.default_rng(0).multivariate_normal(
        np.asarray(fit.unconstrained, np.float64), np.asarray(fit.covariance, np.float64), DRAWS
    )

    def curve(point):
        values = [p.domain.forward(value) for p, value in zip(fit.chosen, point, strict=True)]
        return _curve(put(fit.model, fit.chosen, values).system)

    curves = eqx.filter_jit(eqx.filter_vmap(curve))(jnp.asarray(points, fit.unconstrained.dtype))
    angles, shares = map(np.asarray, curves)
    low, high = np.nanquantile([_at(slip, one) for one in zip(angles, shares, strict=True)], (0.025, 0.975), axis=0)
    return low, high

"""Between the programs' words and the estimators of sideslip: the one place that knows both."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from jaxveh import Recording, filters, vehicles
from jaxveh._core.progress import Progress
from jaxveh.estimators import Calibration, sideslip
from jaxveh.estimators import open_loop as drive_open_loop
from jaxveh.io import CarSpecification

SCORED = ("v_y", "sideslip")
"""Channels that `--truth` can name."""


def filter_of(name: str, particles: int) -> filters.AbstractFilter:
    """The filter of an option's name."""
    if name in ("ekf", "ukf"):
        return filters.Extended() if name == "ekf" else filters.Unscented()
    return (filters.AuxiliaryParticleFilter if name == "apf" else filters.ParticleFilter)(particles)


def calibrate(car: CarSpecification, part: Recording, uses: tuple[str, ...], progress: Progress) -> Calibration:
    """The rear axle, noises and sensor offsets fitted on a span."""
    return sideslip.calibrate(car, part, uses=uses, progress=progress)


def why_not_calibrated(part: Recording) -> str | None:
    """Why a log cannot calibrate itself, None where it can."""
    if "a_y" not in part or not np.isfinite(np.asarray(part["a_y"])).any():
        return "the log has no a_y"
    length = float(part.time[-1] - part.time[0])
    return None if length >= sideslip.SHORTEST else f"{length:.3g} s are too few ({sideslip.SHORTEST:g} s needed)"


def estimate(
    source: Calibration | CarSpecification,
    part: Recording,
    kind: str = "ekf",
    particles: int = 1000,
    seed: int = 0,
) -> filters.Estimate | filters.SmoothedEstimate:
    """The states along the rows of `part`, of a calibration or of a car's file taken at its word."""
    return sideslip.estimate(source, part, filter=filter_of(kind, particles), key=jax.random.key(seed))


def truth_of(seen: Recording, name: str) -> dict[str, np.ndarray]:
    """What the truth channel, one of `SCORED`, says of the quantities that are shown, by name (T,)."""
    v_x, values = np.asarray(seen["v_x"]), np.asarray(seen[name])
    if name == "v_y":
        return {"v_y": values, "sideslip": np.arctan2(values, v_x)}
    return {"sideslip": values, "v_y": v_x * np.tan(values)}


def score(
    car: CarSpecification, found: filters.Estimate | filters.SmoothedEstimate, seen: Recording, name: str
) -> dict[str, float]:
    """RMSEs and the coverage of the 95 % band, next to the open-loop linear model's, by the names of the JSON file."""
    return sideslip.score(car, found, seen.replace(v_y=truth_of(seen, name)["v_y"]))


def open_loop(car: CarSpecification, seen: Recording) -> dict[str, np.ndarray]:
    """What a linear single track makes of steer and speed alone, by name (T,)."""
    return drive_open_loop(vehicles.from_specification(car), seen)


def fitted_parameters(calibration: Calibration | None) -> dict[str, Any]:
    """The fitted parameters by name (value, std, unit) and the choice of the reference's weight, for the JSON file."""
    if calibration is None:
        return {}
    tried = [{"weight": weight, "sideslip_rmse_deg": rmse} for weight, rmse in calibration.validation]
    return {
        "fitted": calibration.summary(),
        "calibration_span": calibration.span,
        "reference_weight": calibration.weight,
        "validation_inside_span": tried,
    }


def fitted_car(calibration: Calibration, car: CarSpecification, part: Recording) -> CarSpecification:
    """The specification with the values fitted to `part` in place."""
    return sideslip.fitted_car(calibration, car, recording=part)


def curves(calibration: Calibration, car: CarSpecification, part: Recording) -> tuple[dict, dict]:
    """Cars before and after, and the slip angles that the span visited, for `plots.force_curves`."""
    fitted = fitted_car(calibration, car, part)
    cars = {"car file": vehicles.from_specification(car), "fitted": vehicles.from_specification(fitted)}
    found = estimate(calibration, part)
    v_x, yaw_rate = np.asarray(part["v_x"]), np.asarray(part["yaw_rate"])
    turned = np.arctan2(np.asarray(found.mean.v_y) + car.front_axle_to_cg * yaw_rate, v_x)
    front = np.asarray(part["steer"]) - (fitted.steer_offset or 0.0) - turned
    fast = np.isfinite(front) & (v_x >= sideslip.least_speed_of(car))
    return cars, {"front": front[fast], "rear": np.asarray(found.mean.slip_angle_rear)[fast]}

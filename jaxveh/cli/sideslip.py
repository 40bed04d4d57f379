"""The link between the programs' options and the estimators of sideslip; no other module uses both."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jaxveh import InputError, Recording, estimators, filters, vehicles
from jaxveh._core.progress import Progress
from jaxveh.estimators import Calibration, sideslip
from jaxveh.io import CarSpecification
from jaxveh.io import kit as io

NAME = sideslip.NAME

SCORED = ("v_y", "sideslip")
"""The channels that `--truth` can name."""


def filter_of(name: str, particles: int) -> filters.AbstractFilter:
    """Return the filter that the option names."""
    if name in ("ekf", "ukf"):
        return filters.Extended() if name == "ekf" else filters.Unscented()
    return (filters.AuxiliaryParticleFilter if name == "apf" else filters.ParticleFilter)(particles)


def calibrate(
    car: CarSpecification, parts: Sequence[Recording], uses: tuple[str, ...], progress: Progress
) -> Calibration:
    """Fit the rear axle, noises and sensor offsets on spans of a car's logs."""
    return sideslip.calibrate(car, parts, uses=uses, progress=progress)


def read_calibration(path: Path, car: CarSpecification | None) -> Calibration:
    """Read a calibration of sideslip from its file.

    **Raises** `InputError` for a calibration of another estimator, or if `car` is given and is not the calibrated car.
    """
    found = estimators.read_calibration(path)
    if found.estimator != sideslip.NAME:
        raise InputError(
            f"--calibration {path}: is a calibration of {found.estimator}; must be one of {sideslip.NAME}."
        )
    assert found.told is not None  # a file always has it
    if car is not None and car != found.told.car:
        names = [entry.name for entry in dataclasses.fields(car)]
        name = next(name for name in names if getattr(car, name) != getattr(found.told.car, name))
        raise InputError(
            f"--calibration {path}: is of another car: its {name} is {getattr(found.told.car, name)}, but that of --vehicle is "
            f"{getattr(car, name)}. Leave --vehicle out, or calibrate this car."
        )
    return found


def why_not_calibrated(part: Recording) -> str | None:
    """Return why a log cannot calibrate itself; None if it can."""
    if "a_y" not in part or not np.isfinite(np.asarray(part["a_y"])).any():
        likely = io.likely_words(["a_y"], part.names).removesuffix(".")
        return "the log has no a_y" + (f" ({likely})" if likely else "")
    length = float(part.time[-1] - part.time[0])
    return None if length >= sideslip.SHORTEST else f"{length:.3g} s are too short ({sideslip.SHORTEST:g} s are needed)"


def estimate(
    source: Calibration | CarSpecification,
    part: Recording,
    kind: str = "ekf",
    particles: int = 1000,
    seed: int = 0,
    smoothed: bool = True,
) -> filters.Estimate | filters.SmoothedEstimate:
    """Estimate the states along the rows of `part`, with a calibration or with the values of a car file."""
    filter = filter_of(kind, particles)
    return sideslip.estimate(source, part, filter=filter, key=jax.random.key(seed), smoothed=smoothed)


def least_speed_of(car: CarSpecification) -> float:
    """Return the speed (m/s) below which sideslip is not scored."""
    return sideslip.least_speed_of(car)


def _reference(seen: Recording, name: str) -> Recording:
    """Return the log with the truth channel, one of `SCORED`, as its v_y at the place of the sensor."""
    return seen if name == "v_y" else seen.replace(v_y=np.asarray(seen["v_x"]) * np.tan(np.asarray(seen[name])))


def check_truth(car: CarSpecification, seen: Recording, name: str | None) -> None:
    """Raise `InputError`, before any work, if the truth channel, one of `SCORED`, has no row that can be scored."""
    if name is None:
        return
    floor = least_speed_of(car)
    if not (np.isfinite(np.asarray(seen[name])) & (np.asarray(seen["v_x"]) >= floor)).any():
        raise InputError(
            f"--truth {name}: no row has both a value of it and a speed v_x of at least {floor:g} m/s, so nothing can be scored: "
            "leave --truth out, or this log."
        )


def truth_of(car: CarSpecification, seen: Recording, name: str) -> dict[str, np.ndarray]:
    """Return the true values of the displayed quantities from the truth channel, by name (T,), at the centre of gravity."""
    v_x, v_y = np.asarray(seen["v_x"]), np.asarray(sideslip.at_centre(car, _reference(seen, name))["v_y"])
    return {"v_y": v_y, "sideslip": np.arctan2(v_y, v_x)}


def score(
    car: CarSpecification, found: filters.Estimate | filters.SmoothedEstimate, seen: Recording, name: str
) -> dict[str, float]:
    """Return RMSEs and the coverage of the 95 % band, and those of the open-loop linear model, by the names of the JSON file."""
    return sideslip.score(car, found, _reference(seen, name))


def fitted_parameters(calibration: Calibration | None) -> dict[str, Any]:
    """Return the fitted parameters by name (value, std, unit) and the choice of the reference's weight, for the JSON file."""
    if calibration is None:
        return {}
    tried = [{"weight": weight, "sideslip_rmse_deg": rmse} for weight, rmse in calibration.validation]
    return {
        "fitted": calibration.summary(),
        "little_told": sideslip.little_told(calibration),
        "calibrated_on": [span._asdict() for span in calibration.spans],
        "reference_weight": calibration.weight,
        "validation_inside_span": tried,
    }


def reference_in_words(calibration: Calibration, uses: tuple[str, ...]) -> str | None:
    """Describe how validation decided on the reference; None if there was no reference."""
    if not uses:
        return None
    if calibration.weight is None:
        return f"{uses[0]} was not used: the fit without it was the best on the second half of the calibration span."
    return f"{uses[0]} was followed to within {np.degrees(calibration.weight):.1f} degrees, which was best on the second half."


def untold_in_words(calibration: Calibration) -> str | None:
    """Describe the parameters about which the logs contain little information; None if there are none."""
    names = [estimators.kit.in_words(name) for name in sideslip.little_told(calibration)]
    if not names:
        return None
    # A blind fit knows nothing of the reference's angle, which `little_told` leaves out.
    if len(names) >= len(calibration.fit.chosen) - 1:
        return (
            "The logs contain too little information for a calibration: all values are hardly known better than from the car's "
            "file. Calibrate on a drive through bends of different length and sharpness."
        )
    return f"The logs contain little information about {', '.join(names)}; the bands allow for it."


def fitted_car(calibration: Calibration, car: CarSpecification, parts: Sequence[Recording]) -> CarSpecification:
    """Return the specification with the values fitted to `parts`."""
    return sideslip.fitted_car(calibration, car, recording=parts)


def curves(
    calibration: Calibration, car: CarSpecification, fitted: CarSpecification, part: Recording
) -> tuple[dict, dict]:
    """Return the cars before and after the fit, and the slip angles that a log covers, for `plots.force_curves`."""
    cars = {"car file": vehicles.from_specification(car), "fitted": vehicles.from_specification(fitted)}
    found = estimate(calibration, part)
    v_x, yaw_rate = np.asarray(part["v_x"]), np.asarray(part["yaw_rate"])
    turned = np.arctan2(np.asarray(found.mean.v_y) + car.front_axle_to_cg * yaw_rate, v_x)
    front = np.asarray(part["steer"]) - (fitted.steer_offset or 0.0) - turned
    fast = np.isfinite(front) & (v_x >= sideslip.least_speed_of(car))
    return cars, {"front": front[fast], "rear": np.asarray(found.mean.slip_angle_rear)[fast]}

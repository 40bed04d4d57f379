"""Between the programs' words and `jaxveh.estimators`: the one place that knows both."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from jaxveh import InputError, Recording, estimators, filters, vehicles
from jaxveh._core.progress import Progress
from jaxveh.io import CarSpecification

SCORED = ("v_y", "sideslip")
"""Channels that `--truth` can name."""


def filter_of(name: str, particles: int) -> Any:
    """The filter of an option's name."""
    if name == "ukf":
        return filters.Unscented()
    return (filters.AuxiliaryParticleFilter if name == "apf" else filters.ParticleFilter)(particles)


def calibrate(part: Recording, car: CarSpecification, uses: tuple[str, ...], progress: Progress) -> Any:
    """Tyres, noises and steering offset fitted on a span."""
    return estimators.calibrate(part, car, uses=uses, progress=progress)


def estimate(
    part: Recording, car: CarSpecification, calibration: Any, kind: str, particles: int, seed: int, progress: Progress
) -> Any:
    """The states along the rows of `part`: an `Estimate`."""
    progress(0, 1, "estimating (compiling first)")
    return estimators.estimate(part, calibration or car, filter=filter_of(kind, particles), key=jax.random.key(seed))


def truth_of(seen: Recording, name: str) -> dict[str, np.ndarray]:
    """What the truth channel says of the quantities that are shown, by name (T,)."""
    if name not in SCORED:
        raise InputError(f"--truth {name}: must be one of {', '.join(SCORED)}, from which sideslip follows.")
    v_x, values = np.asarray(seen["v_x"]), np.asarray(seen[name])
    if name == "v_y":
        return {"v_y": values, "sideslip": np.arctan2(values, v_x)}
    return {"sideslip": values, "v_y": v_x * np.tan(values)}


def score(found: Any, seen: Recording, name: str, car: CarSpecification, calibration: Any) -> dict[str, Any]:
    """RMSEs and the coverage of the 95 % band, next to the open-loop linear model's, by the names of the JSON file."""
    return dict(estimators.score(found, seen.replace(**truth_of(seen, name)), calibration or car))


def fitted(calibration: Any) -> dict[str, Any]:
    """The fitted parameters by name: value, std, unit; nothing without a calibration."""
    return {} if calibration is None else {"fitted": calibration.summary()}


def fitted_car(calibration: Any, car: CarSpecification) -> CarSpecification:
    """The specification with the fitted values in place."""
    return calibration.specification(car)


def curves(calibration: Any, car: CarSpecification, part: Recording) -> tuple[dict, dict]:
    """Cars before and after, and the slips visited, for `plots.force_curves`."""
    cars = {
        "before": vehicles.from_specification(car),
        "fitted": vehicles.from_specification(fitted_car(calibration, car)),
    }
    reach = np.radians(8.0)
    return cars, dict.fromkeys(("front", "rear"), np.linspace(-reach, reach, 3))

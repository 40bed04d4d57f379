"""The methods on a real log with a measured v_y: calibrated blind on its first half, scored on its second."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import estimators, filters, io
from jaxveh._core.progress import Progress, part, silent
from jaxveh._core.recording import Recording
from jaxveh.estimators import kit
from jaxveh.experiments.sideslip_review.contestants import WHAT, groups, pseudo_integrated, switch, weighted_mean
from jaxveh.experiments.sideslip_review.contestants import Found as Estimated
from jaxveh.experiments.sideslip_review.drives import Drive
from jaxveh.experiments.sideslip_review.handling_cleaning import clean
from jaxveh.experiments.sideslip_review.handling_fit import fitted_model, handling_car
from jaxveh.experiments.sideslip_review.models import Cars, Models, models_of
from jaxveh.experiments.sideslip_review.settings import Noise, Study
from jaxveh.fitting import prediction_error
from jaxveh.statespace import StateSpace
from jaxveh.vehicles import LinearSingleTrack

BEST = 0.2312
"""Degrees: the RMSE of the handling model, calibrated blind, on the Ferrari log, rows 13750 on, without v_y. The model was
developed while the score of these rows was known."""

READY = ("ready-made, as told", "ready-made, calibrated blind")
"""The library's `estimators.sideslip`, causal, with the car as told and calibrated."""

SMOOTHED = "handling, smoothed"
"""The smoother: every row from all rows."""

SPREAD = 1.0
"""Standard deviation of the logarithms of the noise levels before the fit."""

EVERY = 10
"""Rows between those of the courses that are kept."""


class Logged(NamedTuple):
    """Results of the methods on a log's second half: `rmse` (degrees) and `failed` by name, READY first; `halves`: RMSE on
    the first and the second half of those rows; the `time` (s) and the `courses` of sideslip (rad), `true` among them; the
    fitted `noise`."""

    source: str
    rows: int
    rmse: dict[str, float]
    failed: dict[str, bool]
    halves: dict[str, tuple[float, float]]
    time: np.ndarray
    courses: dict[str, np.ndarray]
    noise: Noise

    @property
    def best(self) -> str:
        """The best causal method, without the library's ready-made ones.

        The rows that score it also choose it: a small lead of the best of so many methods means little.
        """
        return self._least(self.rmse)

    @property
    def choices(self) -> tuple[str, str]:
        """The methods that are scored on the first and on the second half: each is the best on the other half."""
        first, second = (self._least({name: both[i] for name, both in self.halves.items()}) for i in (0, 1))
        return second, first

    @property
    def crossed_rmse(self) -> float:
        """The RMSE (degrees) of all rows, with equal weight of both halves; each is scored with the method that the other
        half chose."""
        errors = [self.halves[name][i] for i, name in enumerate(self.choices)]
        return float(np.sqrt(np.mean(np.square(errors))))

    def _least(self, errors: dict[str, float]) -> str:
        own = {name: value for name, value in errors.items() if name not in (*READY, "handling", SMOOTHED)}
        return min(own, key=lambda name: own[name])


def read(log: Any, car: Any) -> tuple[Recording, io.CarSpecification]:
    """A log and a car, given as paths or as objects."""
    recording = io.read_recording(log) if isinstance(log, str | Path) else log
    return recording, io.read_car(car) if isinstance(car, str | Path) else car


def on_log(study: Study, log: Any, car: Any, progress: Progress = silent) -> Logged:
    """Every method on the second half of a log, whose v_y is only used for scoring; cars and noises are fitted blind to the
    first."""
    recording, told = read(log, car)
    half = len(recording) // 2
    blind = recording.select(["steer", "v_x", "a_x", "a_y", "yaw_rate"])
    first, rest = blind.rows(slice(0, half)), blind.rows(slice(half, None))
    fit = estimators.sideslip.calibrate(told, first, progress=part(progress, 0.0, 0.1, "calibration"))
    handling = fitted_model(told, first, part(progress, 0.1, 0.6, "handling model"))
    progress(0.6, 1.0, "noises")
    cars, speed = log_cars(told, handling), float(np.mean(np.asarray(first["v_x"])))
    noise = fitted_noise(cars, study.noise, clean(first), speed)
    made = models_of(cars, noise, float(rest["v_x"][0]))._replace(handling=handling)
    drive = drive_of(rest, recording.rows(slice(half, None)))
    progress(0.8, 1.0, "methods")
    found = _ready(rest, told, fit) | _run_estimators(dataclasses.replace(study, speed=speed), cars, made, drive)
    found[SMOOTHED] = _smooth(handling, rest)
    return _score(recording.source, found, drive, noise)


def log_cars(told: io.CarSpecification, model: StateSpace) -> Cars:
    """The file's linear car, and the calibrated handling model with its single track."""
    car = handling_car(told).car
    linear = LinearSingleTrack(
        mass=told.mass, yaw_inertia=told.yaw_inertia,
        front_axle_to_cg=told.front_axle_to_cg, rear_axle_to_cg=told.rear_axle_to_cg,
        front_stiffness=car.front.cornering_stiffness, rear_stiffness=car.rear.cornering_stiffness,
    )  # fmt: skip
    return Cars(linear, model.system.car, model.system)


def drive_of(blind: Recording, whole: Recording) -> Drive:
    """A log as a `Drive`: cleaned, with repeated measurements marked as old; the truth from its v_y."""
    cleaned = clean(blind)
    seen = {name: jnp.asarray(cleaned[name]) for name in ("steer", "v_x", "a_x")}
    sideslip = jnp.arctan2(jnp.asarray(whole["v_y"]), jnp.asarray(whole["v_x"]))
    # Integration uses the values that the logger holds, filters only new ones.
    a_y, yaw_rate = jnp.asarray(blind["a_y"]), jnp.asarray(blind["yaw_rate"])
    fresh = jnp.isfinite(jnp.asarray(cleaned["yaw_rate"]))
    return Drive(
        jnp.asarray(blind.time), **seen, a_y=a_y, yaw_rate=yaw_rate, fresh=fresh, sideslip=sideslip, lateral=a_y
    )


def fitted_noise(cars: Cars, start: Noise, log: Recording, speed: float) -> Noise:
    """The noise levels with the greatest posterior on pieces of a cleaned log, with wide priors."""
    pieces, warm_up = kit.cut_pieces(log)
    # The kinematics takes accelerations as inputs, which must be there.
    held, _ = kit.cut_pieces(log.fill("a_y", "hold", max_gap=1.0).fill("yaw_rate", "hold", max_gap=1.0))
    models, found = models_of(cars, start, speed), {}
    for name, method in (
        ("linear", filters.Kalman()),
        ("nonlinear", filters.Extended()),
        ("kinematic", filters.Kalman()),
    ):
        model, given = getattr(models, name), held if name == "kinematic" else pieces
        levels = lambda m: (*m.process_noise.law.std, *m.measurement_noise.std)
        fit = prediction_error(method, model, given, levels, prior=SPREAD, warm_up=warm_up, throw=False)
        found[name] = tuple(
            (key, float(value)) for (key, _), value in zip(getattr(start, name), levels(fit.model), strict=True)
        )
    return dataclasses.replace(start, **found)


def _run_estimators(study: Study, cars: Cars, models: Models, drive: Drive) -> dict[str, Estimated]:
    key = jax.random.key(0)
    found = {}
    for group in groups(study, cars, models):
        found |= eqx.filter_jit(group.run)(drive, key)
    found = {name: found[name] for name in WHAT}
    slow, fast = found["handling"], found["kinematic Kalman"]
    return found | {
        "handling, switch": switch(study.switch_at, slow, drive),
        "handling, pseudo-integration": pseudo_integrated(study.pseudo_time, slow, drive),
        "handling, weighted": weighted_mean(fast, slow),
    }


def _ready(rest: Recording, told, fit) -> dict[str, Estimated]:
    made = [estimators.sideslip.estimate(source, rest, smoothed=False) for source in (told, fit)]
    return {name: Estimated(e.mean.v_y, e.std.v_y, e.result) for name, e in zip(READY, made, strict=True)}


def _smooth(model: StateSpace, rest: Recording) -> Estimated:
    made = filters.smooth(filters.Unscented(), model, clean(rest))
    return Estimated(made.mean.v_y, made.std.v_y, made.filtered.result)


def _score(source: str, found: dict[str, Estimated], drive: Drive, noise: Noise) -> Logged:
    true, rmse, failed, halves, courses = np.asarray(drive.sideslip), {}, {}, {}, {}
    rms = lambda wrong: float(np.degrees(np.sqrt(np.nanmean(wrong**2))))
    middle = len(true) // 2
    for name, estimate in found.items():
        sideslip = np.arctan2(np.asarray(estimate.v_y), np.asarray(drive.v_x))
        wrong = sideslip - true
        rmse[name], halves[name] = rms(wrong), (rms(wrong[:middle]), rms(wrong[middle:]))
        failed[name] = bool(np.asarray(estimate.result) != 0) or not np.isfinite(sideslip).all()
        courses[name] = sideslip[::EVERY]
    courses["true"] = true[::EVERY]
    return Logged(source, len(true), rmse, failed, halves, np.asarray(drive.time)[::EVERY], courses, noise)

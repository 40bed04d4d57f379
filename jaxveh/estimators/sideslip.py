"""Sideslip from an ordinary log: calibrate a car on a span, estimate the rest, score against a reference."""

from __future__ import annotations

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_one_of
from jaxveh._core.progress import Progress, silent
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import Score, score_band
from jaxveh.estimators.cleaning import BLIND, HandlingCleaning, clean
from jaxveh.estimators.contract import Calibration, Need, check_needs, cut_pieces, model_of, span_of
from jaxveh.estimators.handling import Handling, handling_model
from jaxveh.estimators.linear_baseline import open_loop
from jaxveh.estimators.live import Live
from jaxveh.filters import AbstractFilter, Estimate, Unscented, run
from jaxveh.fitting import Fit, Target, prediction_error
from jaxveh.io import AxleTyre, CarSpecification
from jaxveh.statespace import StateSpace
from jaxveh.tyres import MagicFormula, kit
from jaxveh.vehicles import from_specification

NAME = "sideslip"

needs = BLIND
"""Steer, speed and longitudinal acceleration in every row; lateral acceleration and yaw rate where they were measured."""

START = kit.GenericTyre(friction=1.1, E=0.0)
"""Of axles that a car's file gives a cornering stiffness alone. More friction and a rounder peak than `kit.GENERIC_TYRE`, with
which cars are drawn: at the file's word, on the second halves of two logs, 0.30 degrees instead of 0.42 (Ferrari) and 48 instead
of 65 (F1TENTH)."""

GENERIC_CG_HEIGHT = 0.45
"""m above ground, where a car's file is silent."""

PRIOR = {
    "B": 0.3, "D": 0.15, "E": 0.25, "cg_height": 0.22, "yaw_inertia": 0.2, "steer_offset": 0.15, "steer_gain": 0.03,
    "yaw_rate_offset": 1.0, "a_y_gain": 0.03, "brake_share": 1.0, "ellipse": 0.3, "force_offset": 1.0,
    "front_asymmetry": 1.0, "rear_asymmetry": 1.0, "heading_offset": 1.0, "force_time": 0.7, "bias_time": 0.7,
    "v_y": 0.7, "yaw_rate": 0.7, "front_error": 0.5, "rear_error": 0.5, "a_y_error": 0.7, "a_y": 0.5,
}  # fmt: skip
"""Relative prior spreads by name, on each parameter's own line (unbounded ones in units of their declared scale)."""

SHORTEST = 20.0
"""s: a span shorter than this holds too few corners to calibrate a car on."""

TARGET_WEIGHTS = (0.05, 0.02)
"""rad: how closely the estimate is asked to follow a sideslip reference; the choice is made inside the span."""

TARGET_BEND = 0.0035
"""rad: errors beyond it count less than by their square (INS alignment, tyres that warm up)."""


def chosen_parameters(model: Any):
    """The parameters and noise levels that a calibration fits."""
    s, car = model.system, model.system.car
    axles = [leaf for tyre in (car.front, car.rear) for leaf in (tyre.B, tyre.D, tyre.E)]
    body = [car.cg_height, car.yaw_inertia, car.steer_offset]
    sensors = [s.steer_gain, s.yaw_rate_offset, s.a_y_gain, s.heading_offset]
    forces = [s.brake_share, s.ellipse, s.force_offset, s.front_asymmetry, s.rear_asymmetry, s.force_time, s.bias_time]
    return (*axles, *body, *sensors, *forces, *model.process_noise.law.std, *model.measurement_noise.std)


def fitted_car(calibration: Calibration, car: CarSpecification) -> CarSpecification:
    """The car's file with the fitted values in place, as far as a car file can say them."""
    fitted = calibration.model.system.car
    offset = float(fitted.steer_offset) / float(calibration.model.system.steer_gain)
    return dataclasses.replace(
        car,
        yaw_inertia=float(fitted.yaw_inertia),
        cg_height=float(fitted.cg_height),
        steer_offset=-offset,
        front=_axle(fitted.front),
        rear=_axle(fitted.rear),
        front_cornering_stiffness=float(fitted.front.cornering_stiffness),
        rear_cornering_stiffness=float(fitted.rear.cornering_stiffness),
    )


def _axle(tyre: MagicFormula) -> AxleTyre:
    return AxleTyre(**{n: float(getattr(tyre, n)) for n in ("B", "C", "D", "E", "S_h", "S_v", "nominal_load")})


def handling_car(car: CarSpecification) -> Handling:
    """The handling model of a car file: its own tyres where it has them, generic ones of its cornering stiffness else."""
    known = from_specification(dataclasses.replace(car, cg_height=car.cg_height or GENERIC_CG_HEIGHT))
    loads = known.static_loads()
    axles = [
        tyre if given is not None and given.nominal_load is not None else _generic(tyre, load, given is not None)
        for tyre, load, given in zip((known.front, known.rear), loads, (car.front, car.rear), strict=True)
    ]
    return Handling(eqx.tree_at(lambda c: (c.front, c.rear), known, axles))


def _generic(tyre: MagicFormula, load, told: bool) -> MagicFormula:
    """An axle that scales with load: as told, at its static load, or generic with the tyre's cornering stiffness."""
    if told:
        return MagicFormula(tyre.B, tyre.C, tyre.D, tyre.E, tyre.S_h, tyre.S_v, nominal_load=load)
    return START.magic_formula(tyre.cornering_stiffness, load)


def model(car: CarSpecification | Handling) -> StateSpace:
    """The state space of a car's file taken at its word, or of a `Handling` car: see `handling_model`."""
    return handling_model(car if isinstance(car, Handling) else handling_car(car))


def calibrate(
    car: CarSpecification | Handling,
    recording: Recording,
    *,
    filter: AbstractFilter | None = None,
    progress: Progress = silent,
    uses: tuple[str, ...] = (),
) -> Calibration:
    """Fit tyres, noise levels and sensor offsets of a car to a span of a log, by maximum posterior of a filter.

    Blind (`uses=()`) it reads steer, v_x, a_x, a_y and yaw_rate alone. With `uses=("v_y",)` the span's v_y supervises the
    fit as a reference for sideslip; how strongly is chosen by fitting on the span's first half and looking at the second, where
    "not at all" is among the choices: a reference with slow errors of its own makes a car worse. Start values and priors
    come from the car's file and `PRIOR`, and nothing outside the recording is looked at. `validation` of what is returned is the
    sideslip RMSE in degrees on the span's second half by the reference's weight (rad), fitted on its first.

    **Raises** `InputError` for missing channels, or a span shorter than `SHORTEST`; `FilterError` where the fit fails.
    """
    for name in uses:
        check_one_of("uses", name, ("v_y",))
    span = span_of(NAME, recording, SHORTEST, "corners")
    check_needs(NAME, (*needs, *(Need(name, "m/s") for name in uses)), recording)
    filter, log = filter or Unscented(), clean(recording)
    start = model(car)
    if not uses:
        return Calibration(NAME, _fit(filter, start, log, None, progress), span)
    half = len(log) // 2
    first = _blank(log, slice(half, len(log)))
    parts = [_part(progress, i, 3 + len(TARGET_WEIGHTS)) for i in range(3 + len(TARGET_WEIGHTS))]
    blind = _fit(filter, start, first, None, parts[0])
    validation = [(None, _validate(filter, blind.model, log, half))]
    for i, weight in enumerate(TARGET_WEIGHTS):
        fit = _fit(filter, blind.model, first, weight, parts[1 + i], centre=start)
        validation.append((weight, _validate(filter, fit.model, log, half)))
    weight = min(validation, key=lambda one: one[1])[0]
    fit = _fit(filter, blind.model, log, None, parts[-2], centre=start)
    if weight is not None:
        fit = _fit(filter, fit.model, log, weight, parts[-1], centre=start)
    return Calibration(NAME, fit, span, weight, tuple(validation))


def _part(progress: Progress, index: int, count: int) -> Progress:
    return lambda done, total, stage: progress(index + done / max(total, 1), count, stage)


def _blank(log: Recording, rows: slice) -> Recording:
    """The log with nothing measured in some rows: the fit of a part is compiled once with that of the whole."""
    hidden = np.zeros(len(log), bool)
    hidden[rows] = True
    return log.replace(
        **{n: np.where(hidden, np.nan, np.asarray(log[n])) for n in ("yaw_rate", "a_y", "v_y") if n in log}
    )


def _fit(filter, model, log, weight, progress, centre=None) -> Fit:
    pieces, warm_up = cut_pieces(log)
    # A blind fit has a reference without values: one compiled function serves all fits.
    silent_one = lambda piece: jnp.full(len(piece), jnp.nan)
    values = tuple(map(silent_one if weight is None else reference_sideslip, pieces))
    target = Target("reference_sideslip", values, 1.0 if weight is None else weight, TARGET_BEND)
    return prediction_error(
        filter,
        model,
        pieces,
        chosen_parameters,
        prior=PRIOR,
        centre=centre,
        target=target,
        warm_up=warm_up,
        progress=progress,
    )


def reference_sideslip(recording: Recording) -> jax.Array:
    """atan2(v_y, v_x) of a recording that has v_y, rad, (T,)."""
    return jnp.arctan2(recording["v_y"], recording["v_x"])


def _validate(filter, model, log, start: int) -> float:
    """Sideslip RMSE in degrees over the rows from `start`, the filter having run from the first row."""
    found = run(filter, model, log, throw=False)
    error = np.degrees(np.asarray(found.mean.reference_sideslip) - np.asarray(reference_sideslip(log)))[start:]
    return float(np.sqrt(np.nanmean(error**2))) if np.isfinite(error).any() else float("inf")


def estimate(
    source: Calibration | StateSpace | CarSpecification | Handling,
    recording: Recording,
    *,
    filter: AbstractFilter | None = None,
    key=None,
) -> Estimate:
    """States of the car along a log from steer, v_x, a_x, a_y and yaw_rate: see `handling.HandlingReport` for the names.

    `source`: a `Calibration`, a model, or a car taken at its word. **Raises** as `run` and `clean` do.
    """
    return run(filter or Unscented(), model_of(NAME, source, model), clean(recording), key=key)


def live(
    source: Calibration | StateSpace | CarSpecification | Handling, *, filter: AbstractFilter | None = None, key=None
) -> Live:
    """The same a row at a time, cleaning included."""
    return Live(filter or Unscented(), model_of(NAME, source, model), HandlingCleaning(), key)


def least_speed_of(car: CarSpecification) -> float:
    """Speed (m/s) below which sideslip is not scored unless one says otherwise: 3, and 0.5 for cars of less than a metre between
    their axles. Slower, it is the quotient of two small numbers."""
    return 3.0 if car.wheelbase >= 1.0 else 0.5


def score(
    car: CarSpecification, found: Estimate, recording: Recording, *, least_speed: float | None = None
) -> dict[str, float]:
    """Errors of an estimate against a reference recording with `v_y`, next to the open-loop linear model's: the car's file with
    linear tyres, steered from rest, which is the do-nothing baseline.

    Over the rows where the reference is finite and `v_x` at least `least_speed` (m/s, default `least_speed_of`). **Returns** by
    name, for sideslip in degrees (`sideslip_rmse_deg`) and for v_y in m/s, what `diagnostics.Score` has: the
    error as measured, its constant part and the rest (an INS that is turned against the car by half a degree says so in every
    row), the largest, coverage of the bands, CRPS; the errors of the baseline as `open_loop_sideslip_...`; `rows` and
    `least_speed`.

    **Raises** `InputError` where no row is left.
    """
    v_y, v_x = np.asarray(recording["v_y"]), np.asarray(recording["v_x"])
    floor = least_speed_of(car) if least_speed is None else least_speed
    fast = v_x >= floor
    if not (fast & np.isfinite(v_y)).any():
        raise InputError(
            f"score: no row has both a reference v_y and a speed of at least {floor:g} m/s; there is nothing to score against."
        )
    truth = {"sideslip": np.degrees(np.arctan2(v_y, v_x)), "v_y": v_y}
    baseline = np.degrees(open_loop(from_specification(car), recording)["sideslip"])
    units = {"sideslip": np.degrees(1.0), "v_y": 1.0}
    scores = {
        name: score_band(true, units[name] * found[name], units[name] * np.asarray(getattr(found.std, name)), fast)
        for name, true in truth.items()
    }
    named = _named("sideslip", "_deg", scores["sideslip"]) | _named("v_y", "", scores["v_y"])
    plain = _named("open_loop_sideslip", "_deg", score_band(truth["sideslip"], baseline, which=fast))
    without_bands = {name: value for name, value in plain.items() if not np.isnan(value)}
    return named | without_bands | {"rows": scores["sideslip"].rows, "least_speed": floor}


def _named(quantity: str, unit: str, found: Score) -> dict[str, float]:
    """A score's numbers by the names of the JSON file; shares have no unit."""
    numbers = found._asdict()
    del numbers["rows"]
    return {f"{quantity}_{name}{'' if name.startswith('coverage') else unit}": value for name, value in numbers.items()}

"""Sideslip of a real car: calibrated on a span of a log, then estimated on another span without any reference (blind).

The measurements are those of every production car: speed, yaw rate and accelerations. Lateral velocity is integrated from them
and corrected by the slip angle at which the rear axle has its force: see `rear_axle`. All other methods for sideslip of the
review (Chen, Gao & Xu 2013) are in `METHODS` by name.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, overload

import numpy as np

from jaxveh._core.errors import InputError, check_flags, check_kind, check_one_of, is_concrete
from jaxveh._core.parameter import pick, prior_spread
from jaxveh._core.progress import Progress, silent
from jaxveh._core.recording import Recording
from jaxveh.estimators.alignment import a_y_delay, on_time
from jaxveh.estimators.cleaning import BLIND, RearAxleCleaning, clean
from jaxveh.estimators.coarse_log import coarse_logs
from jaxveh.estimators.contract import Calibration, Need, Span, check_needs, model_of, spans_of, start_of
from jaxveh.estimators.fitted_car import fitted_car
from jaxveh.estimators.following import follow
from jaxveh.estimators.linear_baseline import do_nothing
from jaxveh.estimators.live import Live
from jaxveh.estimators.method import AbstractMethod, Answers, LiveMethod
from jaxveh.estimators.method_of_car import method_of
from jaxveh.estimators.parameter_bands import Members, estimate_with_members, members_of_fit, members_of_prior
from jaxveh.estimators.prepared import Chained
from jaxveh.estimators.rear_axle import STEERED, RearAxle, rear_axle_model
from jaxveh.estimators.rear_axle_fit import Reference, fit_rear_axle
from jaxveh.estimators.rear_axle_prior import SPREADS, car_of, chosen_parameters, unfitted_spreads
from jaxveh.estimators.rear_steer import with_rear_angle
from jaxveh.estimators.sideslip_methods import METHODS
from jaxveh.estimators.sideslip_score import (
    at_centre,
    is_measured,
    least_speed_of,
    reference_sideslip,
    score,
    speak_apart,
)
from jaxveh.estimators.standing import offsets_at_standstill
from jaxveh.filters import AbstractFilter, Estimate, Extended, SmoothedEstimate, run, smooth
from jaxveh.io import CarSpecification
from jaxveh.statespace import Smoothing, StateSpace, kit

NAME = "sideslip"

SHOWN = {"v_y": "m/s", "sideslip": "rad"}
"""The outputs of all methods, and their units."""

RECOMMENDED = "rear_axle"
"""The method of `METHODS` that `live` uses by default."""

__all__ = [
    "METHODS", "NAME", "RECOMMENDED", "REFERENCES", "SHOWN", "at_centre", "calibrate", "car_of", "chosen_parameters",
    "do_nothing", "estimate", "fitted_car", "least_speed_of", "little_told", "live", "model", "needs", "reference_sideslip",
    "score", "speak_apart",
]  # fmt: skip

needs = BLIND
"""Speed in every row; yaw rate and accelerations where they were measured."""

REFERENCES = {"v_y": "m/s", "sideslip": "rad"}
"""Channels that may serve as the reference of a calibration, and their units."""

SHORTEST = 5.0
"""s: a shorter span contains too little information. Parameters that it does not determine stay at the prior. Pieces of 12 s,
each calibrated and scored on itself, had 0.3 (31 simulated drives), 0.5 (9 of the Ferrari), 0.75 (9 of the Genesis) and 0.5
(4 of the F1TENTH) times the error of the car's file without calibration, in medians; two of the 53 had a larger error, by a
factor of up to 1.23. Pieces of 6 s, with five more parameters, 7 of each car, had 0.7 (Ferrari) and 0.76 (Genesis) times the
error, none a larger one."""

TARGET_WEIGHTS = (0.05, 0.02)
"""rad: candidates for how closely the estimate follows a sideslip reference; the choice is made inside the span."""

LITTLE = 0.8
"""A parameter counts as little determined if its standard deviation is still this share of the prior's, or more."""


def model(car: CarSpecification | RearAxle, *, a_y_delay: float | None = None) -> StateSpace:
    """The state space of a car's file without calibration, or of a `RearAxle`: see `rear_axle_model`. `a_y_delay` (s): the
    delay of the accelerometer in its logs, in place of the `RearAxle`'s."""
    system = car_of(car)
    if a_y_delay is not None:
        system = dataclasses.replace(system, a_y_delay=a_y_delay)
    return rear_axle_model(system)


def calibrate(
    car: CarSpecification | RearAxle,
    recording: Recording | Sequence[Recording],
    *,
    filter: AbstractFilter | None = None,
    progress: Progress = silent,
    uses: tuple[str, ...] = (),
) -> Calibration:
    """Fit the rear axle, noise levels and sensor offsets of a car to one span of a log or to several together, by the greatest
    posterior density of a filter.

    A blind calibration (`uses=()`) reads only v_x, a_x, a_y and yaw_rate, and the angle of steered rear wheels. With
    `uses=("v_y",)`, or `("sideslip",)`, that channel is a reference for the fit. Its weight is chosen by fitting on the first
    half of each span and validating on the second; no weight at all is among the choices, since a reference with slow errors of
    its own makes a car worse. Start values and priors come from the car's file and `rear_axle_prior.SPREADS`; nothing outside
    the recordings is used.
    `validation` of the result is the sideslip RMSE in degrees on the second halves by the reference's weight (rad), for fits
    on the first halves.

    The axle's noises, `force_noise` and `slip_noise`, are twice the fitted ones, because neighbouring rows are alike
    (`rear_axle_fit.ALIKE`). Each half of the recordings is fitted, too: where the halves contradict each other, the parameters'
    covariance is larger and the bands of an estimate are wider (`rear_axle_fit.disagreement`).

    A log that moves the car at few frequencies, such as a slalom or a slow ramp of steer, says little of it: its rows count less
    against the car's file (`rear_axle_fit.VARIED`), and the bands are wider. `little_told` names what remained open.

    An a_y that is late, judged by the fitted car and the yaw rate, is shifted, and the car fitted again (`alignment`).

    **Raises** `InputError` for missing channels (including a_y), or a span shorter than `SHORTEST`; `FilterError` if the fit
    fails.
    """
    for name in uses:
        check_one_of("uses", name, tuple(REFERENCES))
    if len(uses) > 1:
        raise InputError(f"sideslip: uses = {uses}: must be one reference; v_y and sideslip hold the same information.")
    recordings, spans = spans_of(NAME, recording, SHORTEST, "corners")
    for one in recordings:
        check_needs(NAME, (*needs, *(Need(name, REFERENCES[name]) for name in uses)), one)
    recordings = [with_rear_angle(NAME, car_of(car).rear_steer, one) for one in recordings]
    for one in recordings:
        _check_measured(one)
    fit = lambda **options: _fit(car, recordings, spans, filter or Extended(), uses, progress, options)
    found = fit()
    late = a_y_delay(fitted_car(found, car), car, recordings) if isinstance(car, CarSpecification) else 0.0
    return fit(a_y_delay=late) if late else found


def _fit(
    car: CarSpecification | RearAxle, recordings: Sequence[Recording], spans: tuple[Span, ...], filter: AbstractFilter,
    uses: tuple[str, ...], progress: Progress, options: dict[str, float],
) -> Calibration:  # fmt: skip
    """The calibration that `calibrate` returns, with options of `model`."""
    start = model(car, **options)
    seen = [on_time(_seen(one, uses), start.system) for one in recordings]
    seen = [at_centre(car, one) for one in seen] if uses else seen
    logs = coarse_logs(seen, _wheelbase(start))
    stood = offsets_at_standstill(seen, _wheelbase(start))
    search = lambda logs, reference, progress, halves=True: fit_rear_axle(
        filter, start, logs, reference, progress, stood, halves=halves
    )
    if not uses:
        return Calibration(NAME, search(logs, None, progress), spans, told=start_of(car, options))
    late = [np.asarray(log.time) >= (span.start + span.end) / 2 for log, span in zip(logs, spans, strict=True)]
    early = [_blank(log, rows, start.channels) for log, rows in zip(logs, late, strict=True)]
    count = 2 + len(TARGET_WEIGHTS)
    fits = [
        search(early, _reference(early, weight), _part(progress, i, count), halves=False)
        for i, weight in enumerate((None, *TARGET_WEIGHTS))
    ]
    errors = [_validate(filter, fit.model, logs, late) for fit in fits]
    validation = tuple(zip((None, *TARGET_WEIGHTS), errors, strict=True))
    weight = min(validation, key=lambda one: one[1])[0]
    fit = search(logs, _reference(logs, weight), _part(progress, count - 1, count))
    return Calibration(NAME, fit, spans, weight, validation, start_of(car, options))


def _check_measured(recording: Recording) -> None:
    if not is_measured(recording, "yaw_rate"):
        raise InputError("sideslip: yaw_rate (rad/s) is NaN in every row: there is nothing to calibrate on.")
    if not is_measured(recording, "a_y"):
        raise InputError(
            "sideslip: a_y (m/s^2) is missing from the log: without an accelerometer no tyre can be calibrated. Estimate "
            "with the car's file without calibration, or calibrate on another log of the car."
        )
    _check_one_clock(recording)


def _check_one_clock(recording: Recording) -> None:
    if is_concrete(recording) and speak_apart(recording):
        raise InputError(
            "sideslip: yaw_rate and a_y are hardly ever measured in the same row: their devices have clocks of their own. "
            'Resample all channels to the rows of one: io.resample(recording, "yaw_rate", max_gap=0.1).'
        )


def _seen(recording: Recording, uses: tuple[str, ...]) -> Recording:
    if "sideslip" in uses:
        recording = recording.replace(v_y=np.asarray(recording["v_x"]) * np.tan(np.asarray(recording["sideslip"])))
        uses = ("v_y",)
    wanted = (*[need.channel for need in needs], STEERED[0], *uses)
    return recording.select([name for name in wanted if name in recording])


def _wheelbase(model: StateSpace) -> Any:
    """The wheelbase in m; a float, unless it is traced."""
    wheelbase = model.system.wheelbase
    return float(wheelbase) if is_concrete(wheelbase) else wheelbase


def _part(progress: Progress, index: int, count: int) -> Progress:
    return lambda done, total, stage: progress(index + done / max(total, 1), count, stage)


def _blank(log: Recording, hidden: np.ndarray, channels: tuple[str, ...]) -> Recording:
    """The log without measurements in some rows: it is as long as the whole log, so that both fits share a compiled program."""
    return log.replace(**{n: np.where(hidden, np.nan, np.asarray(log[n])) for n in (*channels, "v_y") if n in log})


def _reference(logs: Sequence[Recording], weight: float | None) -> Reference | None:
    return None if weight is None else Reference([reference_sideslip(log) for log in logs], weight)


def _validate(filter, model, logs: Sequence[Recording], counted: Sequence[np.ndarray]) -> float:
    """Sideslip RMSE in degrees over the counted rows, with the filter run from the first row of each log."""
    errors = []
    for log, rows in zip(logs, counted, strict=True):
        found = run(filter, model, log.without("v_y"), throw=False)
        error = np.asarray(found.mean.reference_sideslip) - np.asarray(reference_sideslip(log))
        errors.append(np.degrees(error)[rows])
    error = np.concatenate(errors)
    return float(np.sqrt(np.nanmean(error**2))) if np.isfinite(error).any() else float("inf")


def little_told(source: Calibration) -> tuple[str, ...]:
    """Names of the parameters that the calibration's logs hardly determine: their standard deviation is still `LITTLE` of the
    prior's, or more; the bands allow for it. A value may still be far from the prior's: the fit uses it to explain what the model
    lacks."""
    check_kind("little_told: source", source, Calibration, "estimators.sideslip.calibrate returns one.")
    chosen = source.fit.chosen
    prior = np.stack([np.asarray(one) for one in prior_spread(chosen, pick(source.model, chosen), SPREADS)])
    left = np.sqrt(np.diag(np.asarray(source.fit.covariance)))
    # A blind fit has no information on how the reference is turned; so this parameter is not listed.
    asked = lambda name: name != "heading_offset" or source.weight is not None
    return tuple(
        p.name for p, one, old in zip(chosen, left, prior, strict=True) if one > LITTLE * old and asked(p.name)
    )


Known = Calibration | StateSpace | CarSpecification | RearAxle
"""Sources that `estimate` and `live` accept without a `method`."""


@overload
def estimate(
    source: Known, recording: Recording, *, filter: AbstractFilter | None = None, key: Any = None, smoothed: bool = True,
    method: None = None,
) -> Estimate | SmoothedEstimate: ...  # fmt: skip
@overload
def estimate(source: AbstractMethod, recording: Recording) -> Answers: ...
@overload
def estimate(source: CarSpecification | AbstractMethod, recording: Recording, *, method: str) -> Answers: ...
def estimate(
    source: Any,
    recording: Recording,
    *,
    filter: AbstractFilter | None = None,
    key: Any = None,
    smoothed: bool = True,
    method: str | None = None,
) -> Estimate | SmoothedEstimate | Answers:
    """Sideslip of the car along a log from v_x, a_x, a_y and yaw_rate, and the angle of the rear wheels if the car's file says
    that they are steered: see `rear_axle.RearAxleReport` for the names.

    `source`: a `Calibration`, a model, or a car's file without calibration. Every row is estimated from all rows (a
    smoother). With `smoothed=False`, and for filters without a Gaussian smoother, it is estimated from the rows up to it, as
    `live` does. The bands of Gaussian filters include the uncertainty of the parameters of a calibration or a car's file
    (`parameter_bands`); the parameters of a model count as known. **Raises** as `run` and `clean` do.

    Where every row is estimated from all rows, an accelerometer that the calibration found to be late is shifted, and so are
    all channels behind the `low_pass` of the car's file; a live estimate cannot do this.

    `method`: a name of `METHODS`. Then `source` is a car's file, or a method with numbers of one's own, and the result is the
    `Answers` of that method, looking back only; it uses its own filter, and nothing is smoothed. **Raises** as `follow` does.
    """
    check_flags(smoothed=smoothed)
    if method is not None or isinstance(source, AbstractMethod):
        _check_alone(filter, key)
        return follow(NAME, method_of(NAME, METHODS, source, method or RECOMMENDED), recording)
    check_needs(NAME, needs, recording)
    _check_one_clock(recording)
    one = model_of(NAME, source, model, RearAxle)
    recording = with_rear_angle(NAME, one.system.rear_steer, recording)
    if smoothed:
        recording = on_time(recording, one.system)
    used, log = filter or Extended(), clean(recording, _cleaning(one))
    gaussian = kit.smoothing_of(used) is Smoothing.gaussian
    members = _members(source, one) if gaussian else None
    if members is not None:
        return estimate_with_members(used, one, members, log, smoothed)
    return smooth(used, one, log) if smoothed and gaussian else run(used, one, log, key=key)


def _check_alone(filter: AbstractFilter | None, key: Any) -> None:
    if filter is not None or key is not None:
        raise InputError("sideslip: a method has its own filter and key: give a method, or a filter and a key.")


def _members(source: Calibration | StateSpace | CarSpecification | RearAxle, model: StateSpace) -> Members | None:
    """Models that represent the uncertainty of the parameters; None where the parameters count as known."""
    if isinstance(source, Calibration):
        return members_of_fit(source.fit, unfitted_spreads(model.system))
    if isinstance(source, StateSpace):
        return None
    return members_of_prior(model, chosen_parameters, SPREADS, unfitted_spreads(model.system))


@overload
def live(source: Known, *, filter: AbstractFilter | None = None, key: Any = None, method: None = None) -> Live: ...
@overload
def live(source: AbstractMethod) -> LiveMethod: ...
@overload
def live(source: CarSpecification | AbstractMethod, *, method: str) -> LiveMethod: ...
def live(
    source: Any, *, filter: AbstractFilter | None = None, key: Any = None, method: str | None = None
) -> Live | LiveMethod:
    """The same as `estimate`, one row at a time, cleaning and bands included. A late accelerometer is not corrected, since
    future rows are not available. `method` as in `estimate`, with a `LiveMethod` that gives the same answers."""
    if method is not None or isinstance(source, AbstractMethod):
        _check_alone(filter, key)
        return LiveMethod(method_of(NAME, METHODS, source, method or RECOMMENDED))
    one, used = model_of(NAME, source, model, RearAxle), filter or Extended()
    members = _members(source, one) if kit.smoothing_of(used) is Smoothing.gaussian else None
    rear_steer, cleaning = one.system.rear_steer, _cleaning(one)
    return Live(used, one, cleaning if rear_steer is None else Chained(rear_steer, cleaning), key, members)


def _cleaning(model: StateSpace) -> RearAxleCleaning:
    """The cleaning of a log whose rows have the angle of the rear wheels, if they are steered."""
    return RearAxleCleaning(_wheelbase(model), model.system.rear_steer is not None)

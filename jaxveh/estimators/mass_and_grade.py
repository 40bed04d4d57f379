"""Mass and road grade of a car from its speed and the torque at its wheels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp

from jaxveh._core.bijectors import AbstractBijector
from jaxveh._core.errors import InputError, check, check_positive
from jaxveh._core.names import record_type
from jaxveh._core.progress import Progress, silent
from jaxveh._core.recording import Recording
from jaxveh.estimators.car_file import number_of, numbers_in
from jaxveh.estimators.contract import Calibration, Need, check_needs, model_of, spans_of, start_of
from jaxveh.estimators.live import AsItIs, Live
from jaxveh.filters import AbstractFilter, Estimate, Unscented, run
from jaxveh.fitting import prediction_error
from jaxveh.io import CarSpecification
from jaxveh.roads import LEVEL, Ground
from jaxveh.statespace import Continuous, Gaussian, Heun, Prior, Propagate, StateSpace, kit, with_parameters
from jaxveh.vehicles import Longitudinal

NAME = "mass_and_grade"

ACCELEROMETER = "a_x"

__all__ = [
    "ACCELEROMETER",
    "NAME",
    "SHORTEST",
    "calibrate",
    "car_of",
    "chosen_parameters",
    "estimate",
    "live",
    "model",
    "needs",
]

needs = (
    Need("drive_torque", "N m", throughout=True),
    Need("brake_torque", "N m", throughout=True),
    Need("v_x", "m/s"),
    Need(ACCELEROMETER, "m/s^2", optional=True),
)
"""Torques at the wheels, summed, in every row; speed where it was measured; an accelerometer where the model has one."""

DRAG_SPREAD, NOISE_SPREAD = 0.5, 0.7
"""Prior standard deviations of the fitted parameters: of the drag in units of its scale, of each noise level on its
logarithm."""

SHORTEST = 30.0
"""s: in a shorter span the pedals move too seldom to distinguish the noises from the grade."""


def car_of(car: CarSpecification | Longitudinal) -> Longitudinal:
    """The car in straight motion from a car's file; for values missing from the file, the vehicle's defaults.

    **Raises** `InputError` for a file without `wheel_radius`, which converts a torque into a force.
    """
    if isinstance(car, Longitudinal):
        return car
    radius = number_of(car, "wheel_radius", "mass_and_grade", "m")
    return Longitudinal(car.mass, wheel_radius=radius, **numbers_in(car, "wheel_inertia", "drag", "rolling_resistance"))


def model(
    car: CarSpecification | Longitudinal,
    *,
    v_x: float = 0.02,
    a_x: float | None = None,
    a_x_bias: float | None = None,
    start_speed: float = 20.0,
    mass_spread: float = 0.4,
    mass_walk: float = 0.0,
    mass_domain: AbstractBijector | None = None,
    grade_spread: float = 0.03,
    grade_walk: float = 0.0,
    grade_rate_walk: float | None = 1e-3,
    speed_noise: float = 0.002,
    input_path: str = "linear",
    more_inputs: tuple[str, ...] = (),
) -> StateSpace:
    """The state space [v_x, grade, (grade_rate), (bias), mass] of a car in straight motion, for any filter.

    The car's mass is the first guess. From speed and torque alone, mass and grade can be distinguished only by how the speed
    responds to moving pedals: the torque's part of the acceleration goes with 1 / mass, the grade's does not. If the grade is a
    random walk, its changes absorb what the mass should explain; if its **rate** walks, the grade is smooth over seconds and
    leaves the fast responses to the mass. An accelerometer measures force over mass without the grade, and separates the two.

    **Arguments** (standard deviations): `v_x` (m/s) of the measured speed; `a_x` (m/s^2) of the accelerometer, None if there is
    none; `a_x_bias` (m/s^2): the prior's spread of its constant offset, a further state, None for no such state; `start_speed`
    (m/s): the prior's mean, with a standard deviation of 20 m/s; `mass_spread` (-) of the mass's logarithm, and its `mass_walk`
    (1/sqrt(s)); `mass_domain`: `Real()` for a mass that may become negative, as in papers, with spreads still relative;
    `grade_spread` (rad); `grade_walk` (rad/sqrt(s)); `grade_rate_walk` (rad/s per sqrt(s)), None for no rate among the states;
    `speed_noise` (m/s per sqrt(s)): for effects missing from the model. `input_path`: torques are `linear` between rows or
    `held`; held torques are late by half a step, which gives a wrong mass when the pedals move quickly. `more_inputs`: names of
    channels that a filter's wrapper reads (`Paused`, `VaryingNoise`).

    **Inputs** and **channels**: `needs`. **Reported**: `v_x`, `grade` (rad), `mass` (kg) and the other states.

    **Raises** `InputError` for spreads out of range, and as `car_of` does.
    """
    car = car_of(car)
    _check_spreads({"v_x": v_x, "grade_spread": grade_spread}, {"a_x": a_x, "a_x_bias": a_x_bias})
    if a_x_bias is not None and a_x is None:
        raise InputError("mass_and_grade: a_x_bias: there is no accelerometer; give its noise, a_x.")
    check("mass_and_grade: grade_walk", grade_walk, lambda v: v >= 0, "at least 0 rad per root second")
    check_positive("mass_and_grade: speed_noise", speed_noise, "m/s per root second")
    states, noise = {"v_x": (start_speed, 20.0), "grade": (0.0, grade_spread)}, {"v_x": speed_noise}
    if not (isinstance(grade_walk, float | int) and grade_walk == 0):
        noise["grade"] = grade_walk
    if grade_rate_walk is not None:
        check_positive("mass_and_grade: grade_rate_walk", grade_rate_walk, "rad/s per root second")
        # The standard deviation of the rate after half a minute of the walk.
        states["grade_rate"], noise["grade_rate"] = (0.0, grade_rate_walk * 30.0**0.5), grade_rate_walk
    states |= {} if a_x_bias is None else {"bias": (0.0, a_x_bias)}
    kind = record_type("MassAndGradeState", states)
    model = StateSpace(
        system=car, transition=Propagate(_rates, Heun()), observation=_observation, process_noise=Continuous(Gaussian(noise)),
        measurement_noise=Gaussian({"v_x": v_x} | ({} if a_x is None else {ACCELEROMETER: a_x})),
        prior=Prior(kind(*(mean for mean, _ in states.values())), {name: std for name, (_, std) in states.items()}),
        inputs=(*car.inputs, *more_inputs), input_path=input_path,
    )  # fmt: skip
    return with_parameters(model, lambda model: (model.system.mass,), mass_spread, mass_walk, domain=mass_domain)


def _check_spreads(needed: Mapping[str, Any], optional: Mapping[str, Any]) -> None:
    """Raise `InputError` unless the standard deviations are positive; an optional one may be None."""
    fitted = {name: value for name, value in optional.items() if value is not None}
    for name, value in {**needed, **fitted}.items():
        check_positive(f"mass_and_grade: {name}", value)


def chosen_parameters(model: Any):
    """The parameters and noise levels that a calibration fits: the air's drag, and all noise levels."""
    kit.check_model("mass_and_grade: chosen_parameters", model)
    return (model.system.drag, *model.process_noise.law.std, *model.measurement_noise.std)


def calibrate(
    car: CarSpecification | Longitudinal,
    recording: Recording | Sequence[Recording],
    *,
    filter: AbstractFilter | None = None,
    progress: Progress = silent,
    **options: Any,
) -> Calibration:
    """Fit drag and noise levels to a span of a log, by maximum posterior of a filter in which mass and grade remain states.

    Several logs must have the same number of rows. `options`: those of `model`, including the start values. Rolling resistance
    is not fitted: it cannot be distinguished from a constant grade.

    **Raises** `InputError` for missing channels, or a span shorter than `SHORTEST`; `FilterError` where the fit fails.
    """
    start = model(car, **options)
    recordings, spans = spans_of(NAME, recording, SHORTEST, "pedals that move")
    for one in recordings:
        check_needs(NAME, needs, one, start)
    assert start.process_noise is not None  # `model` always sets it
    prior = {"drag": DRAG_SPREAD} | dict.fromkeys((*start.process_noise.law.names, *start.channels), NOISE_SPREAD)
    fit = prediction_error(filter or Unscented(), start, recordings, chosen_parameters, prior=prior, progress=progress)
    return Calibration(NAME, fit, spans, told=start_of(car, options))


def estimate(
    source: Calibration | StateSpace | CarSpecification | Longitudinal,
    recording: Recording,
    *,
    filter: AbstractFilter | None = None,
    key=None,
) -> Estimate:
    """Speed, grade (rad), mass (kg) and the other states of the model, along a log of speed and torques.

    `source`: a `Calibration`, a model (`model(car, a_x=0.05)` with an accelerometer), or a car's file without calibration.

    **Raises** `InputError` for missing channels, and as `run` does.
    """
    found = model_of(NAME, source, model)
    check_needs(NAME, needs, recording, found)
    return run(filter or Unscented(), found, recording, key=key)


def live(
    source: Calibration | StateSpace | CarSpecification | Longitudinal,
    *,
    filter: AbstractFilter | None = None,
    key=None,
) -> Live:
    """The same as `estimate`, one row at a time."""
    return Live(filter or Unscented(), model_of(NAME, source, model), AsItIs(), key)


def _ground(x: Any) -> Ground:
    return LEVEL._replace(grade=x.grade)


def _rates(car: Longitudinal, t, x, u):
    rate = car.derivatives(t, car.state_type(x.v_x), u, _ground(x)).v_x
    moves = {"v_x": rate, "grade": getattr(x, "grade_rate", jnp.zeros_like(x.grade))}
    return type(x)(**{name: moves.get(name, jnp.zeros_like(x.grade)) for name in x._fields})


def _observation(car: Longitudinal, t, x, u):
    felt = car.outputs(t, car.state_type(x.v_x), u, _ground(x)).a_x
    return record_type("MassAndGradeOutputs", ("v_x", ACCELEROMETER))(x.v_x, felt + getattr(x, "bias", 0.0))

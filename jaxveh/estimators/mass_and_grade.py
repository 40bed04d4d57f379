"""Mass and road grade of a car from its speed and the torque at its wheels."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from jaxveh._core.bijectors import AbstractBijector
from jaxveh._core.errors import InputError, check, check_positive
from jaxveh._core.names import record_type
from jaxveh.roads import LEVEL, Ground
from jaxveh.statespace import Continuous, Gaussian, Heun, Prior, Propagate, StateSpace, with_parameters
from jaxveh.vehicles import Longitudinal

ACCELEROMETER = "a_x"


def model(
    car: Longitudinal,
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
    """The state space [v_x, grade, (grade_rate), (bias), mass] of a car that goes straight, for any filter.

    The car's mass is the first guess. From speed and torque alone mass and grade can be told apart only by how the speed
    answers pedals that move: the torque's part of the acceleration goes with 1 / mass, the grade's does not. With a grade that
    is a random walk its changes take up what the mass should explain; a grade whose **rate** walks is smooth over seconds, and
    leaves the fast answers to the mass. An accelerometer feels force over mass without the grade, and tells both at once.

    **Arguments** (standard deviations): `v_x` (m/s) of the measured speed; `a_x` (m/s^2) of the accelerometer, None without
    one; `a_x_bias` (m/s^2): the prior's spread of its constant offset, a further state, None for none; `start_speed` (m/s): the
    prior's mean, known to 20 m/s; `mass_spread` (-) on the mass's logarithm, and its `mass_walk` (1/sqrt(s)); `mass_domain`:
    `Real()` for a mass that may become negative, as papers have it, its spreads relative still; `grade_spread` (rad);
    `grade_walk` (rad/sqrt(s)); `grade_rate_walk` (rad/s per sqrt(s)), None leaves the rate out; `speed_noise` (m/s per
    sqrt(s)): what the model leaves out. `input_path`: torques run `linear` between rows or are `held`; held ones are late by
    half a step, which a lively pedal turns into a wrong mass. `more_inputs`: names of channels that a filter's wrapper reads
    (`Paused`, `VaryingNoise`).

    **Inputs** `drive_torque` and `brake_torque` (N m). **Channels** `v_x` and `a_x`. **Reported**: `v_x`, `grade` (rad), `mass`
    (kg) and what else is a state.

    **Raises** `InputError` for spreads out of range.
    """
    for name, value in (("v_x", v_x), ("a_x", a_x), ("a_x_bias", a_x_bias), ("grade_spread", grade_spread)):
        check_positive(f"mass_and_grade: {name}", value)
    if a_x_bias is not None and a_x is None:
        raise InputError("mass_and_grade: a_x_bias: there is no accelerometer; give its noise, a_x.")
    check("mass_and_grade: grade_walk", grade_walk, lambda v: v >= 0, "at least 0 rad per root second")
    check_positive("mass_and_grade: speed_noise", speed_noise, "m/s per root second")
    states, noise = {"v_x": (start_speed, 20.0), "grade": (0.0, grade_spread)}, {"v_x": speed_noise}
    if not (isinstance(grade_walk, float | int) and grade_walk == 0):
        noise["grade"] = grade_walk
    if grade_rate_walk is not None:
        check_positive("mass_and_grade: grade_rate_walk", grade_rate_walk, "rad/s per root second")
        # What the walk makes of the rate in half a minute.
        states["grade_rate"], noise["grade_rate"] = (0.0, grade_rate_walk * 30.0**0.5), grade_rate_walk
    states |= {} if a_x_bias is None else {"bias": (0.0, a_x_bias)}
    kind = record_type("MassAndGradeState", states)
    model = StateSpace(
        system=car, transition=Propagate(_rates, Heun()), observation=_seen, process_noise=Continuous(Gaussian(noise)),
        measurement_noise=Gaussian({"v_x": v_x} | ({} if a_x is None else {ACCELEROMETER: a_x})),
        prior=Prior(kind(*(mean for mean, _ in states.values())), {name: std for name, (_, std) in states.items()}),
        inputs=(*car.inputs, *more_inputs), input_path=input_path,
    )  # fmt: skip
    return with_parameters(model, lambda model: (model.system.mass,), mass_spread, mass_walk, domain=mass_domain)


def _ground(x: Any) -> Ground:
    return LEVEL._replace(grade=x.grade)


def _rates(car: Longitudinal, t, x, u):
    rate = car.derivatives(t, car.state_type(x.v_x), u, _ground(x)).v_x
    moves = {"v_x": rate, "grade": getattr(x, "grade_rate", jnp.zeros_like(x.grade))}
    return type(x)(**{name: moves.get(name, jnp.zeros_like(x.grade)) for name in x._fields})


def _seen(car: Longitudinal, t, x, u):
    felt = car.outputs(t, car.state_type(x.v_x), u, _ground(x)).a_x
    return record_type("MassAndGradeOutputs", ("v_x", ACCELEROMETER))(x.v_x, felt + getattr(x, "bias", 0.0))

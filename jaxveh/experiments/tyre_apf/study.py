"""The paper's double lane change as an honest study: prior, particle filters, unscented filter and MAP fit side by side."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import estimators, filters, manoeuvres, numerics, sensors, vehicles
from jaxveh._core.parameter import pick, prior_spread, put, resolve
from jaxveh._core.recording import Recording
from jaxveh.experiments.tyre_apf.settings import Study, StudyNoise, tyres
from jaxveh.simulation import simulate

ESTIMATORS = ("prior", "PF", "APF", "UKF", "MAP")
FIELDS = tuple(f"{axle}_{name}" for axle in ("front", "rear") for name in "BCDE")
"""The eight coefficients, as states of a filter."""


class Outcome(NamedTuple):
    """One seed's result. Every mapping is by estimator name.

    `drive`: the simulated recording; `guess`: the prior's mean, a car; `parameters` (8,) in the order of `FIELDS` and
    `spread` (8,) their standard deviations, physical; `curve_error`: (2,) RMSE of front and rear force over the visited
    slips, as a share of the true D; `states`: RMSE of v_y (m/s) and yaw rate (rad/s); `log_likelihood`; `result`.
    """

    drive: Any
    guess: Any
    parameters: dict
    spread: dict
    curve_error: dict
    states: dict
    log_likelihood: dict
    result: dict


def drive_once(study: Study, key) -> Recording:
    """The paper's double lane change with the swapped geometry, as measured by the sensors."""
    manoeuvre = manoeuvres.double_lane_change(speed=study.speed, steer=study.steer, duration=study.duration)
    devices = sensors.esc(yaw_rate=study.yaw_rate_std, a_y=study.a_y_std)
    return simulate(vehicles.passenger_car(), manoeuvre, devices, key=key, dt=1 / study.rate, throw=False)


def guess_once(study: Study, key, where=tyres):
    """A car whose parameters `where` are a draw around the truth: an example of an honest prior's mean."""
    car = vehicles.passenger_car()
    parameters = resolve(car, where)
    values = pick(car, parameters)
    spreads = prior_spread(parameters, values, study.prior)
    draws = numerics.normal(key, (len(parameters),), values[0].dtype)
    moved = [
        p.domain.forward(p.domain.inverse(v) + s * z)
        for p, v, s, z in zip(parameters, values, spreads, draws, strict=True)
    ]
    return put(car, parameters, moved)


def model_of(study: Study, car, noise: StudyNoise, where=tyres, input_path: str = "held", solver=None):
    """The state space of an estimator of the study, with its noise; it estimates `where`."""
    return estimators.state_space(
        car,
        sensors.esc(yaw_rate=study.yaw_rate_std, a_y=study.a_y_std),
        estimate=where,
        prior=study.prior,
        walk=noise.walk,
        input_path=input_path,
        solver=solver,
        process_noise={"v_y": noise.v_y, "yaw_rate": noise.yaw_rate},
    )


def filter_of(study: Study, name: str):
    """The filter called `PF`, `APF` or `UKF`, and the noise of its model."""
    if name == "UKF":
        return filters.Unscented(), study.gaussian
    plain = filters.ParticleFilter(study.particles)
    return plain if name == "PF" else auxiliary(study.particles), study.particle


def auxiliary(particles: int, resampling=numerics.systematic) -> filters.AuxiliaryParticleFilter:
    """The paper's auxiliary filter: it looks ahead to a point of each particle's future."""
    return filters.AuxiliaryParticleFilter(particles, resampling, lookahead=filters.PointLookahead())


def with_tyres(values):
    """The study's car with these eight parameters, in the order of `FIELDS`."""
    car = vehicles.passenger_car()
    return put(car, resolve(car, tyres), list(values))


def curve_error(car, drive: Recording) -> jax.Array:
    """(2,) RMSE of each axle's force over the true slips of the drive, front and rear, as a share of the true D."""
    truth = vehicles.passenger_car()
    errors = []
    for axle in ("front", "rear"):
        slip = drive[f"true.slip_angle_{axle}"]
        here, there = getattr(car, axle), getattr(truth, axle)
        difference = force(here, slip) - force(there, slip)
        errors.append(jnp.sqrt(jnp.mean(difference**2)) / there.D)
    return jnp.stack(errors)


def force(tyre, slip):
    """The lateral force of an axle without load dependence, at these slip angles, N."""
    from jaxveh.tyres import Contact

    return tyre.forces(Contact(slip_angle=slip)).F_y


def open_loop(study: Study, car) -> Recording:
    """The lane change driven by `car` without any measurement: a recording of inputs and truth only."""
    manoeuvre = manoeuvres.double_lane_change(speed=study.speed, steer=study.steer, duration=study.duration)
    return simulate(car, manoeuvre, None, dt=1 / study.rate, throw=False)


def state_errors(found, drive: Recording) -> jax.Array:
    """(2,) RMSE of v_y (m/s) and yaw rate (rad/s) against the drive's truth; `found`: (T,) by name, mapping or NamedTuple."""
    estimate = lambda name: found[name] if isinstance(found, dict) else getattr(found, name)
    rms = lambda name: jnp.sqrt(jnp.mean((estimate(name) - drive[f"true.{name}"]) ** 2))
    return jnp.stack([rms("v_y"), rms("yaw_rate")])

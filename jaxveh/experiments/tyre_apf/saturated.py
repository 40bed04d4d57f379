"""Drives in which both axles pass the peak of their curves: D and B can be identified, all eight parameters hardly.

Two drives that differ from the lane change at 25 m/s: a lane change at 40 m/s, and a sine sweep of 15 degrees at the road
wheels. Beyond the peak a small error of the tyres affects the motion for long: that is why these drives contain so much
information. For the same reason, estimates with steering that is held between two rows, and so is late by half a step, miss
the truth by thirty times the bound: here the steering is linear between rows.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from jaxveh import estimators, filters, manoeuvres, sensors, sweeps, vehicles
from jaxveh._core.parameter import pick, resolve
from jaxveh._core.progress import Progress, part, silent
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import Observability
from jaxveh.estimators import predict_measurements
from jaxveh.experiments.tyre_apf.settings import Study, tyres
from jaxveh.experiments.tyre_apf.study import guess_once, model_of
from jaxveh.fitting import kit as fitting_kit
from jaxveh.fitting import pose_shooting, solve
from jaxveh.simulation import simulate
from jaxveh.statespace import Row, StateSpace
from jaxveh.statespace import kit as statespace_kit
from jaxveh.sweeps import IN_MEMORY, Stores

SWEEP = "sweep of 15 degrees"


def stiffness_and_peak(car):
    """D and B of both axles; C and E are known."""
    return (car.front.B, car.front.D, car.rear.B, car.rear.D)


UNKNOWN = {"D and B": stiffness_and_peak, "all eight": tyres}
"""The estimated parameters."""


class Saturated(NamedTuple):
    """`found`: errors by estimator, unknowns, case and seed on the parameters' real line, (..., p); `bounds`: by unknowns,
    then by case, the information in the drive; `cases`: their names."""

    cases: tuple[str, ...]
    found: dict[str, sweeps.Swept]
    bounds: dict[str, dict[str, Observability]]


def cases_of(study: Study) -> dict[str, manoeuvres.AbstractManoeuvre]:
    """The drives by name."""
    return {
        "lane change at 40 m/s": manoeuvres.double_lane_change(speed=40.0, steer=study.steer, duration=study.duration),
        SWEEP: manoeuvres.swept_sine(
            speed=study.speed,
            steer=math.radians(15.0),
            from_frequency=0.2,
            to_frequency=1.0,
            duration=study.duration,
        ),
    }


def run_saturated(
    study: Study,
    seeds: int,
    key,
    *,
    unknown: tuple[str, ...] = tuple(UNKNOWN),
    only: tuple[str, ...] | None = None,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Saturated:
    """UKF and MAP (or `only` these) on both drives, with D and B `unknown`; with all eight only the UKF, because a fit takes
    long to find that they cannot be distinguished."""
    cases = cases_of(study)
    progress(0.0, 1.0, "drives")
    drives = [
        _drives(study, manoeuvre, seeds, key, stores.under(f"case-{i}")) for i, manoeuvre in enumerate(cases.values())
    ]
    data = jax.tree.map(lambda *leaves: np.stack(leaves), *drives)
    found, bounds = {}, {}
    for i, name in enumerate(unknown):
        where = UNKNOWN[name]
        bounds[name] = {case: _bounds(study, manoeuvre, where) for case, manoeuvre in cases.items()}
        every = _estimators(study, where)
        chosen = only or (("prior", "UKF") if where is tyres else tuple(every))
        design = sweeps.Design(estimator={one: every[one] for one in chosen}, case=range(len(cases)))
        run = lambda point, key, drive: point.estimator(key, drive)
        told = part(progress, i / len(unknown), (i + 1) / len(unknown), name)
        # Optimistix' linear solves cannot be split over devices.
        found[name] = stores.under(name.replace(" ", "-")).sweep(
            "estimates", run, design, seeds, key, data=data, devices=jax.devices()[:1], progress=told
        )
    return Saturated(tuple(cases), found, bounds)


def _record(study: Study, manoeuvre, key, throw: bool = False) -> Recording:
    devices = sensors.esc(yaw_rate=study.yaw_rate_std, a_y=study.a_y_std)
    return simulate(vehicles.passenger_car(), manoeuvre, devices, key=key, dt=1 / study.rate, throw=throw)


def _drives(study: Study, manoeuvre, seeds: int, key, stores: Stores) -> dict[str, np.ndarray]:
    """The channels that filters may use, (seeds, T)."""

    def run(point, key):
        drive = _record(study, manoeuvre, jax.random.fold_in(key, 1))
        return {"time": drive.time} | {name: drive[name] for name in ("yaw_rate", "a_y", "steer", "v_x")}

    return dict(stores.sweep("drives", run, sweeps.Design(), seeds, key).values)


def _bounds(study: Study, manoeuvre, where) -> Observability:
    car = vehicles.passenger_car()
    return estimators.observe(
        model_of(study, car, study.saturated, where, "linear"), _record(study, manoeuvre, jax.random.key(0), True)
    )


def _estimators(study: Study, where) -> dict:
    chosen = resolve(vehicles.passenger_car(), where)
    truth = pick(vehicles.passenger_car(), chosen)
    error = lambda values: jnp.stack(
        [p.domain.inverse(v) - p.domain.inverse(t) for p, v, t in zip(chosen, values, truth, strict=True)]
    )

    guess_of = lambda key: guess_once(study, jax.random.fold_in(key, 2), where)

    def started(key, drive, noise):
        model = model_of(study, guess_of(key), noise, where, "linear")
        channels = {name: value for name, value in drive.items() if name != "time"}
        return model, model.rows(Recording(drive["time"], channels, {}))

    def prior(key, drive):
        return {"error": error(pick(guess_of(key), chosen)), "result": jnp.int32(0)}

    def unscented(key, drive):
        model, rows = started(key, drive, study.saturated)
        estimate = filters.scan(filters.Unscented(), model, rows)
        values = [one[-1] for one in estimate.parameters.values()]
        return {"error": error(values), "result": estimate.result.astype(jnp.int32)}

    def fitted(key, drive):
        # Short, loosely tied pieces find the valley, the whole drive its lowest point.
        model, rows = started(key, drive, study.gaussian)
        segments = fitting_kit.cut_rows(rows, round(study.window * study.rate))
        fit = solve(pose_shooting(model, segments), max_steps=100, standard_errors=False)
        found, converged = single_shooting(model, rows, fit.unconstrained)
        return {
            "error": error([p.domain.forward(v) for p, v in zip(chosen, found, strict=True)]),
            "result": jnp.where(converged, 0, 1).astype(jnp.int32),
        }

    return {"prior": prior, "UKF": unscented, "MAP": fitted}


def single_shooting(model: StateSpace, rows: Row, start) -> tuple[jax.Array, jax.Array]:
    """The parameters (p,) on the real line whose undisturbed course from the prior's first state fits best, the prior
    included (output error, Ljung 1999, ch. 4), by Levenberg-Marquardt from `start`; and whether it converged."""
    mean = jnp.stack(model.prior.mean)
    n = mean.size - start.size
    spread = jnp.sqrt(jnp.diagonal(model.prior.covariance()))[n:]

    def residuals(z, args):
        state = type(model.prior.mean)(*mean.at[n:].set(z))
        predicted, present = predict_measurements(model, rows, state)
        wrong = {
            name: jnp.where(present[name], getattr(rows.y, name), 0.0) - predicted[name] for name in model.channels
        }
        white = statespace_kit.whiten(model.measurement_noise, wrong, present)
        return jnp.concatenate([*(white[name] for name in model.channels), (z - mean[n:]) / spread])

    solver = optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8)
    solution = optx.least_squares(residuals, solver, start, max_steps=60, throw=False, options={"jac": "fwd"})
    return solution.value, solution.result == optx.RESULTS.successful


def over_bound(result: Saturated, unknown: str, estimator: str, case: str) -> np.ndarray:
    """(p,) root mean square over seeds of each parameter's error, divided by its Cramer-Rao bound."""
    error = result.found[unknown].at("error", estimator=estimator)[result.cases.index(case)]
    return np.sqrt(np.mean(error**2, axis=0)) / result.bounds[unknown][case].bounds.array()

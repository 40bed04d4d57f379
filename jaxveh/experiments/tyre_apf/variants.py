"""The lane change as the paper has it and the study does not: low-passed sensors, a swept sine, longitudinal forces, a_x as input.

Each drive is estimated with the study's settings, whose noise was chosen without any of that.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import estimators, filters, manoeuvres, sensors, sweeps, vehicles
from jaxveh._core.parameter import put, resolve
from jaxveh._core.progress import Progress, silent
from jaxveh._core.recording import Recording
from jaxveh.experiments.report import interval, spread
from jaxveh.experiments.tyre_apf.settings import Study, tyres
from jaxveh.experiments.tyre_apf.study import auxiliary, curve_error, guess_once, state_errors
from jaxveh.simulation import simulate
from jaxveh.statespace import StateSpace
from jaxveh.sweeps import IN_MEMORY, Stores, Table, compare
from jaxveh.vehicles import SingleTrack, SingleTrack3DOF, sets

PARTICLES = 300
"""As printed."""

SPEED_NOISE, A_X_NOISE = 0.1, 0.1
"""m/s and m/s^2 of the optical speed sensor and the accelerometer, where the speed is a state."""


class Variant(NamedTuple):
    """`drive(study, key) -> Recording`, `model(study, guess, noise) -> StateSpace`, and what it is."""

    drive: Callable[..., Recording]
    model: Callable[..., StateSpace]
    what: str


def driven_car(car: SingleTrack) -> SingleTrack3DOF:
    """The same car with its speed as a state: eq 12 of the paper in the car's axes, `F_L = torque / radius` by eq 14.

    The engine drives the front axle; height and radius are our own estimate, and no tyre depends on its load.
    """
    numbers = sets.passenger_car()
    return SingleTrack3DOF(
        mass=car.mass, yaw_inertia=car.yaw_inertia, front_axle_to_cg=car.front_axle_to_cg,
        rear_axle_to_cg=car.rear_axle_to_cg, front=car.front, rear=car.rear, cg_height=numbers.cg_height,
        wheel_radius=numbers.wheel_radius,
    )  # fmt: skip


def _devices(study: Study, **options: Any) -> sensors.SensorSet:
    return sensors.esc(yaw_rate=study.yaw_rate_std, a_y=study.a_y_std, **options)


def _lane_change(study: Study):
    return manoeuvres.double_lane_change(speed=study.speed, steer=study.steer, duration=study.duration)


def _simulate(study: Study, car, manoeuvre, devices, key) -> Recording:
    return simulate(car, manoeuvre, devices, key=key, dt=1 / study.rate, throw=False)


def _model(study: Study, car, noise, devices, **options: Any) -> StateSpace:
    process = {"v_y": noise.v_y, "yaw_rate": noise.yaw_rate} | options.pop("more_noise", {})
    return estimators.state_space(
        car, devices, estimate=tyres, prior=study.prior, walk=noise.walk, process_noise=process, **options
    )


def _low_pass(study: Study) -> sensors.LowPass:
    return sensors.LowPass(study.low_pass)


def _driven_drive(study: Study, key) -> Recording:
    devices = _devices(study, a_x=A_X_NOISE, v_x=SPEED_NOISE)
    return _simulate(study, driven_car(vehicles.passenger_car()), _lane_change(study), devices, key)


def _driven_model(study: Study, car, noise) -> StateSpace:
    devices = _devices(study, a_x=A_X_NOISE, v_x=SPEED_NOISE)
    return _model(study, driven_car(car), noise, devices, start={"v_x": study.speed}, more_noise={"v_x": noise.v_y})


def _speed_of_a_x(study: Study, key) -> Recording:
    """The driven car, whose speed is told as the integral of the measured a_x: what it lacks of `v_y r`, the filter is not told."""
    drive = _driven_drive(study, key)
    gained = jnp.cumsum(drive["a_x"][:-1]) / study.rate
    return drive.replace(v_x=study.speed + jnp.concatenate([jnp.zeros(1), gained]))


def variants() -> dict[str, Variant]:
    """All of them by name; the study's own first."""
    plain = lambda study, car, noise: _model(study, car, noise, _devices(study))
    lane = lambda study, key: _simulate(study, vehicles.passenger_car(), _lane_change(study), _devices(study), key)
    slow = lambda study, key: _simulate(
        study, vehicles.passenger_car(), _lane_change(study), _devices(study, low_pass=_low_pass(study)), key
    )
    told = lambda study, car, noise: _model(study, car, noise, _devices(study, low_pass=_low_pass(study)))
    swept = lambda study, key: _simulate(
        study, vehicles.passenger_car(),
        manoeuvres.swept_sine(
            speed=study.speed, steer=study.steer, from_frequency=0.2, to_frequency=2.0, duration=study.duration
        ),
        _devices(study), key,
    )  # fmt: skip
    return {
        "as the study": Variant(lane, plain, "double lane change, speed told, no longitudinal force"),
        "low-pass, not told": Variant(slow, plain, "sensors through a low-pass of `Study.low_pass`, the filter knows of none"),
        "low-pass, told": Variant(slow, told, "the same, the low-pass in the filter's model"),
        "swept sine": Variant(swept, plain, "0.2 to 2 Hz with the lane change's amplitude"),
        "drive torque, not told": Variant(_driven_drive, plain, "the engine holds the speed; the filter is told v_x alone"),
        "a_x as input": Variant(_speed_of_a_x, plain, "the same; the filter is told the integral of the measured a_x for v_x"),
        "drive torque, told": Variant(_driven_drive, _driven_model, "eqs 12 and 14: F_L = torque / radius; v_x a state"),
    }


ESTIMATORS = ("prior", "EKF", "UKF", "APF")
"""The extended filter of the parameters is M. Best's (2010), reference 3 of the paper; its noise is the unscented one's."""


def run_variants(
    study: Study,
    seeds: int,
    key,
    *,
    only: tuple[str, ...] | None = None,
    kinds: tuple[str, ...] = ESTIMATORS,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> sweeps.Swept:
    """Every variant (or `only` these) by every estimator over `seeds` seeds, each on the same drives and from the same guesses:
    `curve_error` (share of D, front and rear), `state_error` (v_y, m/s, and yaw rate, rad/s; NaN of the prior), `result`."""
    every = variants()
    design = sweeps.Design(
        variant={name: every[name] for name in (every if only is None else only)},
        estimator={name: _estimator(study, name) for name in kinds},
    )
    run = lambda point, key: point.estimator(point.variant, key)
    return stores.sweep("variants", run, design, seeds, key, progress=progress)


def _estimator(study: Study, name: str) -> Callable[[Variant, Any], dict[str, Any]]:
    kinds = {"EKF": filters.Extended, "UKF": filters.Unscented, "APF": lambda: auxiliary(PARTICLES)}
    noise = study.particle if name == "APF" else study.gaussian

    def run(variant: Variant, key):
        keys = jax.random.split(key, 3)
        drive, guess = variant.drive(study, keys[0]), guess_once(study, keys[1])
        if name == "prior":
            nothing = jnp.full(2, jnp.nan)
            return {"curve_error": curve_error(guess, drive), "state_error": nothing, "result": jnp.int32(0)}
        model = variant.model(study, guess, noise)
        found = filters.scan(kinds[name](), model, model.rows(drive), keys[2])
        car = put(guess, resolve(guess, tyres), [one[-1] for one in found.parameters.values()])
        return {
            "curve_error": curve_error(car, drive),
            "state_error": state_errors(found.mean, drive),
            "result": found.result.astype(jnp.int32),
        }

    return run


def variants_table(found: sweeps.Swept, seeds: int) -> Table:
    """What each variant does to each estimator; ratios are to the study's own drive on the same seeds."""
    every, rows = variants(), []
    names = found.design.axis("variant").labels
    for variant in names:
        for name in found.design.axis("estimator").labels:
            at = lambda metric, which=variant, name=name: found.at(metric, variant=which, estimator=name)
            curves, states = at("curve_error"), at("state_error")
            own = np.sqrt(np.mean(curves**2, axis=-1))
            first = np.sqrt(np.mean(at("curve_error", names[0]) ** 2, axis=-1))
            cells = [spread(100 * curves[:, i]) for i in (0, 1)]
            cells += ["", ""] if name == "prior" else [spread(states[:, i]) for i in (0, 1)]
            lost = int((at("result") != 0).sum())
            rows.append((variant, name, *cells, interval(compare(own, first).ratio), lost, every[variant].what))
    return Table(
        f"The lane change in other ways: RMSE, median [quartiles] over {seeds} seeds, and over the first variant's [95 %]",
        ("drive", "estimator", "front F_y, % of D", "rear F_y, % of D", "v_y, m/s", "yaw rate, rad/s", "curves over the first's",
         "lost", "what it is"),
        rows,
        2,
    )  # fmt: skip

"""The paper's lane change with parts that the study leaves out: low-passed sensors, a sweep, longitudinal forces, a_x as
input.

Each is estimated with the study's settings, whose noise was chosen without these parts.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import estimators, filters, manoeuvres, sensors, sweeps, vehicles
from jaxveh._core.parameter import put, resolve
from jaxveh._core.progress import Progress, part, silent
from jaxveh._core.recording import Recording
from jaxveh.experiments.report import interval, spread
from jaxveh.experiments.tyre_apf.settings import Study, StudyNoise, tyres
from jaxveh.experiments.tyre_apf.study import auxiliary, curve_error, guess_once, state_errors
from jaxveh.simulation import simulate
from jaxveh.statespace import StateSpace
from jaxveh.sweeps import IN_MEMORY, Stores, Table, compare
from jaxveh.vehicles import SingleTrack, SingleTrack3DOF, sets

PARTICLES = 300
"""The printed number."""

SPEED_NOISE, A_X_NOISE = 0.1, 0.1
"""m/s and m/s^2 of the optical speed sensor and the accelerometer, if the speed is a state."""


class Variant(NamedTuple):
    """`drive`: the name of its drive in `drives_by_name`; `model`: the name of the filter's model; `what`: a description."""

    drive: str
    model: str
    what: str


VARIANTS = {
    "as the study": Variant("lane change", "plain", "double lane change, speed told, no longitudinal force"),
    "low-pass, not told": Variant(
        "low-pass", "plain", "sensors through a low-pass of 20 Hz, which is not in the filter's model"
    ),
    "low-pass, told": Variant("low-pass", "low-pass", "the same, with the low-pass in the filter's model"),
    "swept sine": Variant("swept sine", "plain", "0.2 to 2 Hz with the lane change's amplitude"),
    "drive torque, not told": Variant(
        "driven", "plain", "the engine holds the speed; the filter is told only a measured v_x"
    ),
    "a_x as input": Variant("driven by a_x", "plain", "the same, but told the integral of the measured a_x as v_x"),
    "drive torque, told": Variant(
        "driven", "driven", "eqs 12 and 14: F_L = torque / radius; v_x a state, a_x and v_x measured"
    ),
}
"""All variants, beginning with the study's own."""

ESTIMATORS = ("EKF", "UKF", "APF")
"""The estimators besides the prior. The extended filter of the parameters is that of M. Best (2010), reference 3 of the
paper; its noise is that of the unscented filter."""

CHANNELS = ("steer", "v_x", "yaw_rate", "a_y", "a_x", "drive_torque", "brake_torque")
TRUTH = ("v_y", "yaw_rate", "slip_angle_front", "slip_angle_rear")
"""Channels and truths of a drive that are kept; channels that it does not have are zero."""


def driven_car(car: SingleTrack) -> SingleTrack3DOF:
    """The same car with its speed as a state: eq 12 of the paper in the car's axes, `F_L = torque / radius` by eq 14.

    The engine drives the front axle; height and radius are our own estimate, and the tyres do not depend on their load.
    """
    numbers = sets.passenger_car()
    return SingleTrack3DOF(
        mass=car.mass, yaw_inertia=car.yaw_inertia, front_axle_to_cg=car.front_axle_to_cg,
        rear_axle_to_cg=car.rear_axle_to_cg, front=car.front, rear=car.rear, cg_height=numbers.cg_height,
        wheel_radius=numbers.wheel_radius,
    )  # fmt: skip


def _devices(study: Study, **options: Any) -> sensors.SensorSet:
    return sensors.esc(yaw_rate=study.yaw_rate_std, a_y=study.a_y_std, **options)


def drives_by_name(study: Study) -> dict[str, Callable[[Any], Recording]]:
    """The drives, each a function of a key."""
    lane = manoeuvres.double_lane_change(speed=study.speed, steer=study.steer, duration=study.duration)
    swept = manoeuvres.swept_sine(
        speed=study.speed, steer=study.steer, from_frequency=0.2, to_frequency=2.0, duration=study.duration
    )
    car = vehicles.passenger_car()
    go = lambda car, manoeuvre, **options: (
        lambda key: simulate(car, manoeuvre, _devices(study, **options), key=key, dt=1 / study.rate, throw=False)
    )
    return {
        "lane change": go(car, lane),
        "low-pass": go(car, lane, low_pass=sensors.LowPass(study.low_pass)),
        "swept sine": go(car, swept),
        "driven": go(driven_car(car), lane, a_x=A_X_NOISE, v_x=SPEED_NOISE),
    }


def model_by_name(study: Study, name: str, guess: SingleTrack, noise: StudyNoise) -> StateSpace:
    """The filter's model: the study's single track (`plain`), with the sensors' `low-pass`, or `driven` by its torques."""
    process = {"v_y": noise.v_y, "yaw_rate": noise.yaw_rate}
    told: dict[str, Any] = dict(estimate=tyres, prior=study.prior, walk=noise.walk)
    if name == "driven":
        return estimators.state_space(
            driven_car(guess), _devices(study, a_x=A_X_NOISE, v_x=SPEED_NOISE), start={"v_x": study.speed},
            process_noise=process | {"v_x": noise.v_y}, **told,
        )  # fmt: skip
    slow = {"low_pass": sensors.LowPass(study.low_pass)} if name == "low-pass" else {}
    return estimators.state_space(guess, _devices(study, **slow), process_noise=process, **told)


def run_variants(
    study: Study,
    seeds: int,
    key,
    *,
    only: tuple[str, ...] = tuple(VARIANTS),
    kinds: tuple[str, ...] = ESTIMATORS,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> dict[str, sweeps.Swept]:
    """Variants by the model of their filters, each on the same drives and from the same guesses: over estimator (the prior
    first), variant and seed `curve_error` (share of D, front and rear), `state_error` (v_y, m/s, and yaw rate, rad/s; NaN
    for the prior), `result`."""
    wanted = dict.fromkeys(VARIANTS[name].drive.removesuffix(" by a_x") for name in only)
    every = {name: go for name, go in drives_by_name(study).items() if name in wanted}
    drives = _drives(every, seeds, key, part(progress, 0.0, 0.2, "drives"), stores)
    if "driven" in drives:
        drives["driven by a_x"] = drives["driven"] | {"v_x": _integrated(study, drives["driven"]["a_x"])}
    models = list(dict.fromkeys(VARIANTS[name].model for name in only))
    found = {}
    for i, model in enumerate(models):
        names = [name for name in only if VARIANTS[name].model == model]
        data = jax.tree.map(lambda *leaves: np.stack(leaves), *[drives[VARIANTS[name].drive] for name in names])
        # Particles only with the study's own model: with the others they take long and give the same result.
        chosen = [name for name in kinds if model == "plain" or name != "APF"]
        runs = {name: _estimator(study, name, model) for name in ("prior", *chosen)}
        design = sweeps.Design(estimator=runs, variant=range(len(names)))
        told = part(progress, 0.2 + 0.8 * i / len(models), 0.2 + 0.8 * (i + 1) / len(models), f"{model} model")
        run = lambda point, key, drive: point.estimator(key, drive)
        own = stores.under(f"model-{i}")
        found[model] = own.sweep("estimates", run, design, seeds, key, data=data, progress=told)
    return found


def _drives(every: dict, seeds: int, key, progress: Progress, stores: Stores) -> dict[str, dict[str, np.ndarray]]:
    """The channels and truths by the drive's name, (seeds, T) each."""

    def run(point, key):
        drive = point.drive(jax.random.fold_in(key, 1))
        nothing = jnp.zeros_like(drive["steer"])
        seen = {name: drive[name] if name in drive.names else nothing for name in CHANNELS}
        return {"time": drive.time} | seen | {f"true.{name}": drive[f"true.{name}"] for name in TRUTH}

    found = stores.sweep("drives", run, sweeps.Design(drive=every), seeds, key, progress=progress)
    return {name: {what: found.at(what, drive=name) for what in found.values} for name in every}


def _integrated(study: Study, a_x: np.ndarray) -> np.ndarray:
    """Speeds (seeds, T) from the measured a_x, without the `v_y r` that is also in the a_x of a turning car."""
    return (
        study.speed + np.concatenate([np.zeros((len(a_x), 1)), np.cumsum(a_x[:, :-1], axis=-1)], axis=-1) / study.rate
    )


def _estimator(study: Study, name: str, model: str) -> Callable[[Any, Any], dict[str, Any]]:
    kinds = {"EKF": filters.Extended, "UKF": filters.Unscented, "APF": lambda: auxiliary(PARTICLES)}
    noise = study.particle if name == "APF" else study.gaussian

    def run(key, drive):
        recording = Recording(drive["time"], {what: value for what, value in drive.items() if what != "time"}, {})
        guess = guess_once(study, jax.random.fold_in(key, 2))
        if name == "prior":
            nothing = jnp.full(2, jnp.nan)
            return {"curve_error": curve_error(guess, recording), "state_error": nothing, "result": jnp.int32(0)}
        believed = model_by_name(study, model, guess, noise)
        found = filters.scan(kinds[name](), believed, believed.rows(recording), jax.random.fold_in(key, 3))
        car = put(guess, resolve(guess, tyres), [one[-1] for one in found.parameters.values()])
        return {
            "curve_error": curve_error(car, recording),
            "state_error": state_errors(found.mean, recording),
            "result": found.result.astype(jnp.int32),
        }

    return run


def at_variant(found: dict[str, sweeps.Swept], metric: str, variant: str, estimator: str) -> np.ndarray:
    """A metric of an estimator in a variant, over seeds."""
    model = VARIANTS[variant].model
    there = [name for name in VARIANTS if VARIANTS[name].model == model]
    return found[model].at(metric, estimator=estimator)[there.index(variant)]


def variants_table(found: dict[str, sweeps.Swept]) -> Table:
    """The effect of each variant on each estimator; ratios are to the study's own drive on the same seeds."""
    rows, seeds = [], next(iter(found.values())).seeds
    for variant, (_, model, what) in VARIANTS.items():
        for name in found[model].design.axis("estimator").labels:
            at = lambda metric, which=variant, name=name: at_variant(found, metric, which, name)
            curves, states = at("curve_error"), at("state_error")
            own, first = (_both_axles(at("curve_error", one)) for one in (variant, "as the study"))
            cells = [spread(100 * curves[:, i]) for i in (0, 1)]
            cells += ["", ""] if name == "prior" else [spread(states[:, i]) for i in (0, 1)]
            lost = int((at("result") != 0).sum())
            rows.append((variant, name, *cells, interval(compare(own, first).ratio), lost, what))
    return Table(
        f"The lane change in other ways: RMSE, median [quartiles] over {seeds} seeds, and over the first variant's [95 %]",
        ("drive", "estimator", "front F_y, % of D", "rear F_y, % of D", "v_y, m/s", "yaw rate, rad/s", "curves over the first's",
         "lost", "what it is"),
        rows,
        2,
    )  # fmt: skip


def _both_axles(curve_error: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(np.square(curve_error), axis=-1))

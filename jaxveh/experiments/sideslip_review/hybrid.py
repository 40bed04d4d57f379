"""A network inside the filter compared with physics alone, by the amount of data for training.

    python -m jaxveh.experiments.sideslip_review.hybrid --minutes 1,5 --cars passenger_car,sedan --seeds 2

The truth is a single track on Magic Formulas whose force falls beyond its peak, which the filter's brush tyres cannot
reproduce; the brush stiffnesses are wrong by 13 to 15 % before the fit. Two models are fitted to drives of the given number
of minutes by the likelihood of an extended filter (`estimators.learned.train`): the brushes alone, and the brushes with one
network each. They are judged by the sideslip of an unscented filter on drives to which nothing was fitted, beside the model
before the fit and the true tyre law. Model and truth differ only in the tyres: it is the best case for both. Some minutes
per line on two cores. Needs the extra `learn`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import numpy as np

from jaxveh import filters, sensors, tyres, vehicles
from jaxveh._core.progress import Progress, part, silent
from jaxveh._core.recording import Recording
from jaxveh.estimators import learned, state_space
from jaxveh.manoeuvres import random_steering
from jaxveh.simulation import simulate
from jaxveh.statespace import StateSpace
from jaxveh.sweeps import Table

SLOPES = (12.0, 17.0)
"""Cornering stiffness over load of the true axles, front and rear, 1/rad."""

GRIP = (0.85, 1.05)
"""Largest lateral force over load of the true axles: the front one slides first, so that the car does not spin."""

WRONG = (1.15, 0.87)
"""Ratio of the stiffnesses before the fit to the true ones, front and rear."""

SHAPE = {"C": 1.6, "E": -1.5}
"""Shape of the true Magic Formulas: their peak is at 6 to 7 degrees of slip, and at 25 degrees a quarter of the force is
lost."""

SPEED, STEER, STEP, SETTLED = 25.0, 0.05, 0.02, 2.0
"""m/s; rad, standard deviation at the road wheels; s between rows; s at the beginning of a judged drive that do not count."""

JUDGED, LENGTH = 2, 60.0
"""Number of drives for judging, and s of each."""

DEVICE = sensors.esc(yaw_rate=0.002, a_y=0.05)

PRIOR = {
    "cornering_stiffness": 0.3, "friction": 0.3, "v_y": 0.5, "yaw_rate": 0.5, "inner": 0.5, "bias": 1.0, "outer": 1.0,
    "load_share": 1.0,
}  # fmt: skip

COLUMNS = ("car", "minutes", "seed", "nothing fitted", "physics", "with networks", "true law", "networks over physics")


def true_and_told(name: str) -> tuple[Any, Any]:
    """A car on the true tyres, and the same car on the brushes that the filter is told."""
    car = vehicles.named_car(name, "single-track")
    slopes = [slope * load for slope, load in zip(SLOPES, car.static_loads(), strict=True)]
    formula = lambda slope, most: tyres.MagicFormula(B=slope / (SHAPE["C"] * most), D=most, **SHAPE)
    brush = lambda slope, wrong: tyres.Brush(wrong * slope, wrong * slope, friction=1.0)
    where = lambda c: (c.front, c.rear)
    most = [grip * load for grip, load in zip(GRIP, car.static_loads(), strict=True)]
    true = [formula(slope, one) for slope, one in zip(slopes, most, strict=True)]
    told = [brush(slope, wrong) for slope, wrong in zip(slopes, WRONG, strict=True)]
    return eqx.tree_at(where, car, tuple(true)), eqx.tree_at(where, car, tuple(told))


def drive(car: Any, seconds: float, key: jax.Array) -> Recording:
    """A drive with random steering."""
    steer_key, noise_key = jax.random.split(key)
    wander = random_steering(SPEED, STEER, steer_key, lowest=0.1, highest=1.0, duration=seconds)
    return simulate(car, wander, DEVICE, noise_key, dt=STEP)


def model_of(car: Any) -> StateSpace:
    """The filters' state space."""
    return state_space(car, DEVICE, process_noise={"v_y": 0.05, "yaw_rate": 0.02})


def sideslip_errors(model: StateSpace, drives: Sequence[Recording]) -> float:
    """Root mean square error over the drives, degrees."""
    first = round(SETTLED / STEP)
    errors = []
    for log in drives:
        found = filters.run(filters.Unscented(), model, log, keep=("mean",))
        errors.append((np.asarray(found.mean.sideslip) - np.asarray(log["true.sideslip"]))[first:])
    return float(np.degrees(np.sqrt(np.mean(np.square(errors)))))


def _brushes(model: StateSpace) -> tuple:
    """The parameters that physics alone has to fit: both tyres and the process noise."""
    car = model.system.vehicle
    inner = [getattr(tyre, "tyre", tyre) for tyre in (car.front, car.rear)]
    numbers = [getattr(tyre, name) for tyre in inner for name in ("cornering_stiffness", "friction")]
    noise: Any = model.process_noise
    return (*numbers, *noise.law.std)


def compare_networks(
    name: str, minutes: float, seed: int, key: jax.Array, *, steps: int = 300, progress: Progress = silent
) -> tuple:
    """One line of the table."""
    true, told = true_and_told(name)
    fit_key, judge_key, net_key, walk_key = jax.random.split(jax.random.fold_in(key, seed), 4)
    log = drive(true, 60.0 * minutes, fit_key)
    judged = [drive(true, LENGTH, key) for key in jax.random.split(judge_key, JUDGED)]
    options = dict(prior=PRIOR, learning_rate=0.03, batch=8, key=walk_key)
    physics = learned.train(
        filters.Extended(),
        model_of(told),
        log,
        _brushes,
        steps=steps,
        progress=part(progress, 0.0, 0.4, "physics"),
        **options,
    )
    wide = model_of(learned.with_residual_tyres(told, net_key))
    both = lambda model: (*_brushes(model), *learned.network_weights(model))
    hybrid = learned.train(
        filters.Extended(), wide, log, both, steps=steps, progress=part(progress, 0.4, 1.0, "networks"), **options
    )
    errors = [sideslip_errors(model, judged) for model in (model_of(told), physics.model, hybrid.model, model_of(true))]
    return (name, minutes, seed, *errors, errors[2] / errors[1])


def hybrid_table(
    cars: Sequence[str],
    minutes: Sequence[float],
    seeds: int,
    key: jax.Array,
    *,
    steps: int = 300,
    progress: Progress = silent,
) -> Table:
    """The lines of all cars, minutes and seeds."""
    every = [(name, length, seed) for name in cars for length in minutes for seed in range(seeds)]
    rows = []
    for i, one in enumerate(every):
        told = part(progress, i / len(every), (i + 1) / len(every), f"{one[0]}, {one[1]:g} min, seed {one[2]}")
        rows.append(compare_networks(*one, key, steps=steps, progress=told))
    return Table(
        "Sideslip RMSE [deg] on drives to which nothing was fitted, by minutes of the fitted drives", COLUMNS, rows
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the program that the module's docstring describes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    listed = lambda text: tuple(text.split(","))
    parser.add_argument("--minutes", type=lambda text: tuple(float(one) for one in text.split(",")), default=(1.0, 5.0))
    parser.add_argument("--cars", type=listed, default=("passenger_car",))
    parser.add_argument("--seeds", type=int, default=2)
    given = parser.parse_args(arguments)
    jax.config.update("jax_enable_x64", True)
    for name in given.cars:
        for length in given.minutes:
            for row in hybrid_table((name,), (length,), given.seeds, jax.random.key(46)).rows:
                print(dict(zip(COLUMNS, row, strict=True)), flush=True)


if __name__ == "__main__":
    main()

"""The study's figures: force curves, parameters, states of one seed."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics, plots, vehicles
from jaxveh._core.parameter import pick, prior_spread, put, resolve
from jaxveh.experiments.tyre_apf.course_figures import lane_change_figure, step_figure, tracks_figure
from jaxveh.experiments.tyre_apf.reproduction import Reproduction
from jaxveh.experiments.tyre_apf.settings import Study, tyres
from jaxveh.experiments.tyre_apf.staged import Staged
from jaxveh.experiments.tyre_apf.study import ESTIMATORS, FIELDS, Outcome, with_tyres
from jaxveh.experiments.tyre_apf.sweep_figures import saturated_figure, sharpness_figure

NAMES = tuple(field.replace("_", ".") for field in FIELDS)
"""The parameters as they are written in text, `front.B`."""


def figures(result: Reproduction) -> dict[str, Any]:
    """Every figure by the name of its file."""
    return {
        "force_curves": curves_figure(result.outcome, result.study),
        "parameters": parameters_figure(result.outcome, result.study),
        "beyond_the_peak": saturated_figure(result.saturated),
        "sharpness": sharpness_figure(result.sharpness),
        "tracks": tracks_figure(result.tracks, truth()),
        "lane_change": lane_change_figure(result),
        "step_steer": step_figure(result),
    }


def truth() -> np.ndarray:
    """The true parameters (8,) in the order of `FIELDS`."""
    car = vehicles.passenger_car()
    return np.asarray(jnp.stack(pick(car, resolve(car, tyres))))


def true_spread(study: Study) -> np.ndarray:
    """The prior's standard deviations at the truth (8,), physical: the scale for comparing parameters."""
    car = vehicles.passenger_car()
    chosen = resolve(car, tyres)
    values = pick(car, chosen)
    spreads = prior_spread(chosen, values, study.prior)
    return np.asarray([p.domain.slope(v) * s for p, v, s in zip(chosen, values, spreads, strict=True)])


def prior_draws(study: Study, guess, key, count: int = 400) -> Any:
    """`count` cars drawn from the prior around `guess`: its tyres with a leading axis."""
    chosen = resolve(guess, tyres)
    values = pick(guess, chosen)
    spreads = prior_spread(chosen, values, study.prior)
    noise = numerics.normal(key, (len(chosen), count), values[0].dtype)
    moved = [
        p.domain.forward(p.domain.inverse(v) + s * z) for p, v, s, z in zip(chosen, values, spreads, noise, strict=True)
    ]
    # Every leaf of a tyre needs the axis, also those that are not drawn.
    wide = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (count, *leaf.shape)), (guess.front, guess.rear))
    return put(eqx.tree_at(lambda car: (car.front, car.rear), guess, wide), chosen, moved)


def curves_figure(outcome: Outcome, study: Study, seed: int = 0, figure: Any = None) -> Any:
    """Force curves of seed number `seed`: truth, prior with its band, and every estimator, over the visited slips."""
    guess = jax.tree.map(lambda leaf: leaf[seed], outcome.guess)
    cars = {"truth": vehicles.passenger_car()}
    cars |= {name: with_tyres(outcome.parameters[name][seed]) for name in ESTIMATORS}
    slips = {axle: outcome.drive[f"true.slip_angle_{axle}"][seed] for axle in ("front", "rear")}
    draws = prior_draws(study, guess, jax.random.key(0))
    return plots.force_curves(cars, slips, draws=draws, figure=figure)


def parameters_figure(outcome: Outcome, study: Study, seed: int = 0, figure: Any = None) -> Any:
    """Parameters of seed number `seed` against the truth, in units of the prior's standard deviation."""
    named = lambda values: dict(zip(NAMES, values, strict=True))
    mean = {name: named(outcome.parameters[name][seed]) for name in ESTIMATORS}
    std = {name: named(outcome.spread[name][seed]) for name in ESTIMATORS}
    return plots.parameters(named(truth()), mean, std, scale=named(true_spread(study)), figure=figure)


def states_figure(found: Staged, seed: int = 0, labels: tuple[str, ...] = ("UKF", "APF"), figure: Any = None) -> Any:
    """States of seed number `seed`: the filters' means and bands, the truth, and the prior's tyres without measurements."""
    pick_seed = lambda tree: jax.tree.map(lambda leaf: leaf[seed], tree)
    drive = found.outcome.drive
    names = ("v_y", "sideslip", "yaw_rate")
    seen = {name: drive[f"true.{name}"][seed] for name in names}
    others = {"prior, open loop": {name: found.open_loop["prior"][name][seed] for name in names}}
    estimates = {label: pick_seed(found.estimates[label]) for label in labels}
    return plots.estimate(estimates, seen, names, others=others, errors=True, figure=figure)

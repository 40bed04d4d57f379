"""One friction or four: the estimators on roads with several frictions, and what each of them is told."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from jaxveh import filters, numerics, sweeps
from jaxveh._core.names import record_type
from jaxveh._core.progress import Progress, silent
from jaxveh.experiments.federated_ckf.drives import FRICTIONS, Drive, times
from jaxveh.experiments.federated_ckf.model import INPUTS, planar, rows_of, states_model
from jaxveh.experiments.federated_ckf.road_drives import road_cases
from jaxveh.experiments.federated_ckf.settings import OTHER_START, PARAMETERS, Study
from jaxveh.experiments.federated_ckf.study import Raced
from jaxveh.statespace import Row, StateSpace, kit, with_parameters
from jaxveh.sweeps import IN_MEMORY, Stores
from jaxveh.vehicles import kit as vehicles_kit
from jaxveh.vehicles import sets

ROAD_START = dataclasses.replace(OTHER_START, friction=0.5)
"""The nearer start, but with a friction that none of these roads has."""


class RoadFound(NamedTuple):
    """Estimates over time, (T,): speeds (m/s), `mass` (kg); (T, 4) `friction` under each wheel, and the filter's `variance`
    of its logarithm, zero if it takes it as certain."""

    v_x: Any
    v_y: Any
    mass: Any
    friction: Any
    variance: Any


class RoadContestant(NamedTuple):
    """`run(study, drive) -> RoadFound` from `ROAD_START`, and a description of what it is told, `what`."""

    run: Callable[[Study, Drive], RoadFound]
    what: str


def road_contestants(study: Study) -> dict[str, RoadContestant]:
    """All estimators by name, beginning with the one that does nothing."""
    walk, slow = study.friction_walk, study.walk
    pace = lambda one: f"walks by {100 * one:g} % in a second"
    one, four = "one friction for all wheels", "a friction for each wheel"
    return {
        "first guess": RoadContestant(_guess, "parameters stay at the first guess; states by a cubature filter"),
        "one mu": RoadContestant(_joint(False, slow), f"the joint filter: {one}, which {pace(slow)}"),
        "one mu, walking": RoadContestant(
            _joint(False, walk), f"{one}, which {pace(walk)}: it is told that friction changes"
        ),
        "four mu": RoadContestant(_joint(True, slow), f"{four}, which {pace(slow)}: it is told that wheels may differ"),
        "four mu, walking": RoadContestant(_joint(True, walk), f"{four}, which {pace(walk)}: it is told both"),
        "told the friction": RoadContestant(
            _told, "is told the true friction under each wheel, as in no real car: the remaining error"
        ),
    }


def _joint(each_wheel: bool, walk: float):
    """The joint cubature filter with one friction or four, which walk by `walk` (relative, per sqrt(s))."""

    def run(study, drive):
        car = planar(study, ROAD_START)
        if each_wheel:
            car = eqx.tree_at(lambda c: c.friction, car, vehicles_kit.Wheels(*[car.friction] * 4))
        names = [f"friction.{corner}" for corner in vehicles_kit.Wheels._fields] if each_wheel else ["friction"]
        mus = lambda car: tuple(car.friction) if each_wheel else (car.friction,)
        spreads = dict.fromkeys(names, study.friction_spread) | _body_spreads(study)
        walks = dict.fromkeys(names, walk) | dict.fromkeys(PARAMETERS[1:], study.walk)
        where = lambda model: (*mus(model.system), *_body(model.system))
        model = with_parameters(states_model(study, car, drive), where, spreads, walks)
        mean, covariance = _follow(model, rows_of(study, drive))
        at = slice(3, 3 + len(names))
        variance = jnp.diagonal(covariance, axis1=1, axis2=2)[:, at]
        wide = lambda values: jnp.broadcast_to(values, (values.shape[0], 4))
        return RoadFound(mean[:, 0], mean[:, 1], jnp.exp(mean[:, at.stop]), wide(jnp.exp(mean[:, at])), wide(variance))

    return run


def _body(car: Any) -> tuple:
    return tuple(getattr(car, name) for name in PARAMETERS[1:])


def _body_spreads(study: Study) -> dict[str, float]:
    return dict(zip(PARAMETERS[1:], (study.mass_spread, study.inertia_spread, study.cg_spread), strict=True))


def _follow(model: StateSpace, rows: Row) -> tuple[Any, Any]:
    keep = lambda belief: (jnp.stack(belief.mean), belief.covariance)
    return kit.scan_and_keep(filters.Cubature(), model, rows, None, keep)[1]


def _guess(study, drive):
    model = states_model(study, planar(study, ROAD_START), drive)
    mean, _ = _follow(model, rows_of(study, drive))
    same = jnp.ones_like(mean[:, 0])
    friction = jnp.broadcast_to(ROAD_START.friction * same[:, None], (same.shape[0], 4))
    return RoadFound(mean[:, 0], mean[:, 1], ROAD_START.mass * same, friction, jnp.zeros_like(friction))


def _told(study, drive):
    """The true friction as an input."""
    rows = rows_of(study, drive)
    names = (*INPUTS, *FRICTIONS)
    u = record_type("Inputs", names)(*rows.u, *drive.true_friction.T)
    states = states_model(study, planar(study, ROAD_START), drive, names)
    where = lambda model: _body(model.system)
    model = with_parameters(states, where, _body_spreads(study), study.walk)
    mean, _ = _follow(model, rows._replace(u=u))
    mass, friction = jnp.exp(mean[:, 3]), drive.true_friction
    return RoadFound(mean[:, 0], mean[:, 1], mass, friction, jnp.zeros_like(friction))


def road_metrics(study: Study, found: RoadFound, drive: Drive) -> dict[str, Any]:
    """Errors of a run from `settled` on: RMSE of `v_x`, `v_y` (m/s) and `sideslip` (degrees), root mean square errors of the
    friction's logarithm under all wheels (`friction_error`) and on each side; its squared error over the filter's variance
    (`friction_nees`); the relative error of the `mass` at the end. Ten estimates per second.
    """
    later = times(study) >= study.settled
    count = jnp.sum(jnp.where(later, 1.0, 0.0))
    mean = lambda values: jnp.sum(jnp.where(later, values, 0.0)) / count
    rms = lambda error: jnp.sqrt(mean(error**2))
    sideslip = jnp.rad2deg(numerics.arctan2(found.v_y, found.v_x) - drive.true_sideslip)
    off = jnp.log(found.friction / drive.true_friction)
    side = lambda *wheels: jnp.sqrt(mean(jnp.mean(off[:, jnp.array(wheels)] ** 2, axis=1)))
    seen = slice(None, None, round(0.1 / study.dt))
    return {
        "v_x_rmse": rms(found.v_x - drive.true_v_x),
        "v_y_rmse": rms(found.v_y - drive.true_v_y),
        "sideslip_rmse": rms(sideslip),
        "friction_error": side(0, 1, 2, 3),
        "friction_error_left": side(0, 2),
        "friction_error_right": side(1, 3),
        "friction_nees": mean(jnp.mean(jnp.where(found.variance > 0, off**2 / found.variance, jnp.inf), axis=1)),
        "mass_error": jnp.abs(found.mass[-1] / _true_mass() - 1.0),
        "friction": found.friction[seen],
        "v_x": found.v_x[seen],
        "v_y": found.v_y[seen],
    }


def _true_mass() -> float:
    mass = sets.ev().mass
    assert mass is not None
    return mass


def race_on_roads(
    study: Study,
    drives: Drive,
    *,
    only: tuple[str, ...] | None = None,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Raced:
    """Every estimator (or `only` these) on the drives of every road."""
    every, cases = road_contestants(study), tuple(road_cases(study))

    def of(contestant):
        return lambda drive: road_metrics(study, contestant.run(study, drive), drive)

    chosen = {name: of(every[name]) for name in (every if only is None else only)}
    design = sweeps.Design(estimator=chosen, case=range(len(cases)))
    run = lambda point, drive: point.estimator(drive)
    found = stores.sweep("road-race", run, design, data=drives, progress=progress)
    return Raced(study, cases, drives, found)

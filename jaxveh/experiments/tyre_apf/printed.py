"""The paper's experiment with its printed settings, errata included: it starts at the truth, and uses the truth again."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import estimators, filters, manoeuvres, numerics, sensors, vehicles
from jaxveh._core.bijectors import Real
from jaxveh._core.parameter import pick, resolve
from jaxveh.experiments.tyre_apf.settings import tyres
from jaxveh.experiments.tyre_apf.study import auxiliary
from jaxveh.simulation import simulate
from jaxveh.statespace import Continuous, Gaussian
from jaxveh.sweeps import IN_MEMORY, Stores


@dataclasses.dataclass(frozen=True)
class Printed:
    """The printed settings: P0 = Q = I(11), R = 0.01, N = 300, Runge-Kutta 4 with 0.09 s over 7 s, 25 m/s.

    `spread`: 1 is the printed I(11), in the units of each parameter; `share`: the final rule's 20 per cent. The steering
    amplitude (rad) and the measured outputs are not printed: ours, as in the other studies. `as_printed_geometry`: the printed
    axle distances, which are almost surely swapped; with the literal spread the car spins in both geometries.
    """

    particles: int = 300
    step: float = 0.09
    duration: float = 7.0
    speed: float = 25.0
    steer: float = math.radians(7.0)
    measurement_std: float = 0.1
    spread: float = 1.0
    share: float = 0.2
    as_printed_geometry: bool = True


class PrintedOutcome(NamedTuple):
    """By estimator (`PF`, `APF`, `walk`): estimates (8, T), plain final value (8,), final value by the rule (8,).

    `walk` filters nothing: it starts at the truth and walks 0.5 per cent away. `ess` is the median effective sample size
    of the particle filters, `truth` (8,).
    """

    truth: Any
    series: dict
    last: dict
    by_rule: dict
    ess: dict


def closest_share(series, truth, share: float):
    """The paper's final rule: the mean of the `share` of the estimates (8, T) closest to the truth, which is unknown in
    practice."""
    kept = max(1, round(share * series.shape[-1]))
    order = jnp.argsort(jnp.abs(series - truth[:, None]), axis=-1)[:, :kept]
    return jnp.mean(jnp.take_along_axis(series, order, axis=-1), axis=-1)


def run_printed(printed: Printed, seeds: int, key, *, stores: Stores = IN_MEMORY) -> PrintedOutcome:
    """The printed experiment over `seeds` seeds, in one batch; with stores, in chunks of seeds."""
    if stores.folder is not None:
        return stores.each("printed", lambda key: one_printed_run(printed, key), jax.random.split(key, seeds))
    return _every_seed(printed, jax.random.split(key, seeds))


@eqx.filter_jit
def _every_seed(printed: Printed, keys) -> PrintedOutcome:
    return jax.vmap(lambda key: one_printed_run(printed, key))(keys)


def one_printed_run(printed: Printed, key) -> PrintedOutcome:
    """One seed of the printed experiment. Pure: `vmap` it over keys."""
    car = vehicles.passenger_car_as_printed() if printed.as_printed_geometry else vehicles.passenger_car()
    chosen = resolve(car, tyres)
    truth = jnp.stack(pick(car, chosen))
    drive_key, pf_key, apf_key, walk_key = jax.random.split(key, 4)
    devices = sensors.esc(yaw_rate=printed.measurement_std, a_y=printed.measurement_std)
    manoeuvre = manoeuvres.double_lane_change(speed=printed.speed, steer=printed.steer, duration=printed.duration)
    drive = simulate(car, manoeuvre, devices, key=drive_key, dt=printed.step, throw=False)
    # The printed identity, for any unit: a standard deviation of one newton, and of one per radian.
    relative = {p.name: printed.spread / float(p.scale or 1.0) for p in chosen}
    ones = {p.name: relative[p.name] / (1.0 if p.scale else v) for p, v in zip(chosen, truth, strict=True)}
    per_root_second = 1 / math.sqrt(printed.step)
    model = estimators.state_space(
        car,
        devices,
        estimate=tyres,
        prior=ones,
        walk={name: value * per_root_second for name, value in ones.items()},
        domain=Real(),
        process_noise=Continuous(Gaussian(dict.fromkeys(("v_y", "yaw", "yaw_rate"), printed.spread * per_root_second))),
        start={"yaw": 0.05},
        start_spread=dict.fromkeys(("v_y", "yaw", "yaw_rate"), printed.spread),
        minimum_speed=0.0,
    )
    rows = model.rows(drive)
    series, ess = {}, {}
    for name, kind, k in (
        ("PF", filters.ParticleFilter(printed.particles, numerics.multinomial), pf_key),
        ("APF", auxiliary(printed.particles, numerics.multinomial), apf_key),
    ):
        estimate = filters.scan(kind, model, rows, k)
        series[name] = jnp.stack([estimate.parameters[p.name] for p in chosen])
        ess[name] = jnp.median(estimate.info.ess)
    steps = numerics.normal(walk_key, (8, rows.t.shape[0]), truth.dtype)
    series["walk"] = truth[:, None] * (1 + 0.005 / math.sqrt(rows.t.shape[0]) * jnp.cumsum(steps, axis=-1))
    return PrintedOutcome(
        truth=truth,
        series=series,
        last={name: value[:, -1] for name, value in series.items()},
        by_rule={name: closest_share(value, truth, printed.share) for name, value in series.items()},
        ess=ess,
    )

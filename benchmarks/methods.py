"""One step of every estimator of `jaxveh.estimators`, on a drive of a 14-DOF car with all devices."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from types import ModuleType

import jax
import jax.numpy as jnp

from jaxveh import InputError, estimators
from jaxveh.estimators import kit
from jaxveh.experiments.sideslip_review.chapters.fleet import built_cars, told_cars
from jaxveh.experiments.sideslip_review.chapters.fleet_drives import drive_once
from jaxveh.experiments.sideslip_review.chapters.scenarios import scenario_at

from .measure import Case, Contestant, Skipped

__all__ = ["cases"]

CAR = ("sedan",)
STEP, SECONDS = 0.01, 20.0


def cases(smoke: bool) -> list[Case]:
    """Return a case per quantity: its methods beside the recommended one, float64, one run.

    None for a small run: the drive alone compiles for half a minute, and each method for seconds.
    """
    modules = [one for one in (vars(estimators)[name] for name in estimators.__all__) if hasattr(one, "METHODS")]
    return [
        Case(
            name=f"methods/{module.NAME}",
            title=f"Methods of {module.NAME}, looking back",
            unit="us a row",
            build=functools.partial(_methods, module),
            base=module.RECOMMENDED,
        )
        for module in ([] if smoke else modules)
    ]


@functools.cache
def _drive() -> dict[str, jax.Array]:
    """The channels of an ordinary drive, (T,) each."""
    built = jax.tree.map(lambda leaf: leaf[0], built_cars(CAR))
    drive = jax.jit(lambda key: drive_once(built, scenario_at(0.0), key, duration=SECONDS))
    return {name: jnp.asarray(values) for name, values in drive(jax.random.key(0)).items()}


def _methods(module: ModuleType) -> Sequence[Contestant | Skipped]:
    drive = _drive()
    found: list[Contestant | Skipped] = []
    rows = drive["true.v_x"].shape[0]
    # No car measures its speed: methods of other quantities are given the true one.
    channels, time = drive | {"v_x": drive["true.v_x"]}, STEP * jnp.arange(float(rows))
    for name, kind in module.METHODS.items():
        try:
            method = kind.make(told_cars(CAR)[0])
        except InputError as error:
            found.append(Skipped(name, str(error)))
            continue
        lacking = [need.channel for need in method.needs if not need.optional and need.channel not in channels]
        if lacking:
            found.append(Skipped(name, f"the drive has no {', '.join(lacking)}"))
            continue
        none = jnp.full(rows, jnp.nan)
        values = {need.channel: channels.get(need.channel, none) for need in method.needs}
        found.append(Contestant(name, _following(method, time, values), rows))
    return found


def _following(method: estimators.AbstractMethod, time: jax.Array, values: dict) -> Callable[[int], object]:
    run = jax.jit(lambda time, values: kit.follow_rows(method, time, values))
    return lambda index: jax.block_until_ready(run(time, values))

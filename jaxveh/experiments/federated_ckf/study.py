"""The runs: each drive once, then every estimator on the same drives."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import sweeps
from jaxveh._core.errors import check_whole
from jaxveh._core.progress import Progress, silent
from jaxveh.experiments.federated_ckf.contestants import Contestant, contestants, metrics
from jaxveh.experiments.federated_ckf.drives import Drive, drive_once, times
from jaxveh.experiments.federated_ckf.settings import OTHER_START, PARAMETERS, PRINTED_START, Start, Study
from jaxveh.sweeps import IN_MEMORY, Stores
from jaxveh.vehicles import sets

OTHER_NOISE = (0.01, 0.01, 1e-3)
"""The noises of the greatest likelihood on drives of other keys with other tyres, within a factor of three."""


class Case(NamedTuple):
    """A drive and a first guess (`start`), with a `bias` (rad/s) of the yaw rate for a while, or on the tyres of a
    `magic_formula`; and the filters' process `noise` (`speed_noise`, `yaw_noise`, `walk`; None: the study's)."""

    start: Start
    bias: float = 0.0
    magic_formula: bool = False
    noise: tuple[float, float, float] | None = None


def cases(study: Study) -> dict[str, Case]:
    """The cases for every estimator."""
    return {
        "printed start": Case(PRINTED_START),
        "nearer start": Case(OTHER_START),
        "fault": Case(OTHER_START, bias=study.bias),
        "other tyres": Case(OTHER_START, magic_formula=True, noise=OTHER_NOISE),
    }


ALIKE = 6
"""Runs of an estimator at a time: it is one program in all parts of the report. So few are not written out, which saves a fifth
to a third of the time of compiling; that is more than the runs take."""

ALIKE_DRIVES = 20
"""Drives at a time: they are one program, too."""


class Raced(NamedTuple):
    """One study: `drives` by case, (cases, seeds, T, ...), and the results of the estimators, `found`, with the axes
    estimator, case (by number) and seed."""

    study: Study
    cases: tuple[str, ...]
    drives: Drive
    found: sweeps.Swept

    def at(self, name: str, estimator: str, case: str) -> np.ndarray:
        """Values of one estimator in one case, (seeds, ...)."""
        return self.found.at(name, estimator=estimator, case=float(self.cases.index(case)))


def truth(study: Study) -> np.ndarray:
    """The true parameters, (4,)."""
    numbers = sets.ev()
    return np.array([study.friction, *[getattr(numbers, name) for name in PARAMETERS[1:]]])


def drives_of(
    study: Study,
    steer,
    speed_std,
    seeds: int,
    key,
    *,
    magic_formula: bool = False,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Drive:
    """Drives with each steer amplitude (rad) and standard deviation of the speed (m/s), one per seed: (steers, spreads,
    seeds, T, ...)."""
    check_whole("seeds", seeds, 2)
    run = lambda point, key: drive_once(study, point.amplitude, point.speed_std, key, magic_formula=magic_formula)
    # The design's axis cannot be called steer, as a drive has a `steer` of its own.
    design = sweeps.Design(amplitude=steer, speed_std=speed_std)
    found = stores.sweep("drives", run, design, seeds, key, alike=ALIKE_DRIVES, progress=progress)
    return Drive(**{name: found[name] for name in Drive._fields})


def drives_by_case(
    study: Study,
    names: tuple[str, ...],
    seeds: int,
    key,
    *,
    known: Drive | None = None,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Drive:
    """The drives of the cases, (cases, seeds, T, ...): the same seeds for all, with the fault added. `known`, (seeds, T,
    ...): drives on Dugoff's tyres with the same key, if they are already there."""
    wanted, made = cases(study), {} if known is None else {False: known}
    for magic in {wanted[name].magic_formula for name in names} - set(made):
        found = drives_of(
            study, (study.steer,), (study.speed_std,), seeds, key, magic_formula=magic, progress=progress,
            stores=stores.under("other-tyres" if magic else "own-tyres"),
        )  # fmt: skip
        made[magic] = jax.tree.map(lambda leaf: leaf[0, 0], found)
    t = np.asarray(times(study))
    wrong = (t >= study.fault_at) & (t < study.fault_at + study.fault_time)
    own = []
    for name in names:
        drive = made[wanted[name].magic_formula]
        own.append(drive._replace(yaw_rate=drive.yaw_rate + np.where(wrong, wanted[name].bias, 0.0)))
    return jax.tree.map(lambda *leaves: np.stack(leaves), *own)


def race(
    study: Study,
    drives: Drive,
    names: tuple[str, ...],
    *,
    only: tuple[str, ...] | None = None,
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> Raced:
    """Every estimator (or `only` these) on the drives of the cases."""
    every = contestants(study)
    chosen = {name: every[name] for name in (every if only is None else only)}
    here = [cases(study)[name] for name in names]
    set_to = [Setting.of(study, case.start, case.noise) for case in here]
    design = sweeps.Design(
        estimator={name: run_of(study, contestant) for name, contestant in chosen.items()}, case=range(len(names))
    )
    run = lambda point, data: point.estimator(data)
    data = (jax.tree.map(lambda *leaves: np.stack(leaves)[:, None], *set_to), drives)
    found = stores.sweep("race", run, design, data=along_drives(data), alike=ALIKE, progress=progress)
    return Raced(study, tuple(names), drives, found)


class Setting(NamedTuple):
    """What an estimator starts with: `start` (4,) and process `noise` (3,), as in `Case`."""

    start: Any
    noise: Any

    @classmethod
    def of(cls, study: Study, start: Start, noise: tuple[float, float, float] | None = None) -> Setting:
        """This start with this noise, or the study's."""
        usual = (study.speed_noise, study.yaw_noise, study.walk)
        return cls(np.array(dataclasses.astuple(start)), np.array(usual if noise is None else noise))


def along_drives(data: tuple[Setting, Drive]) -> tuple[Setting, Drive]:
    """The data with the setting repeated for each of the drives."""
    setting, drives = data
    lead = np.shape(drives.yaw_rate)[:-1]
    return jax.tree.map(lambda leaf: np.broadcast_to(leaf, (*lead, leaf.shape[-1])), setting), drives


def run_of(study: Study, contestant: Contestant) -> Callable[[tuple[Setting, Drive]], dict[str, Any]]:
    """The metrics of an estimator on a drive; its setting is data, so that it is one program for every case."""
    right = truth(study)

    def run(data: tuple[Setting, Drive]) -> dict[str, Any]:
        setting, drive = data
        speed_noise, yaw_noise, walk = setting.noise
        own = dataclasses.replace(study, speed_noise=speed_noise, yaw_noise=yaw_noise, walk=walk)
        return metrics(study, contestant.run(own, Start(*setting.start), drive), drive, jnp.asarray(right))

    return run


def race_over(
    study: Study,
    drives: Drive,
    steers,
    spreads,
    estimator: str = "joint",
    progress: Progress = silent,
    stores: Stores = IN_MEMORY,
) -> sweeps.Swept:
    """One estimator from the nearer start on drives (steers, spreads, seeds, T, ...): a sweep with the axes steer,
    speed_std."""
    run = run_of(study, contestants(study)[estimator])
    data = along_drives((Setting.of(study, OTHER_START), drives))
    design = sweeps.Design(steer=steers, speed_std=spreads)
    found = stores.sweep("race-over", lambda point, data: run(data), design, data=data, alike=ALIKE, progress=progress)
    shown = (*[f"{name}_error" for name in PARAMETERS], "spread", "sideslip_rmse")
    return dataclasses.replace(found, values={name: found.values[name] for name in shown})

"""The stages of a fit to rig data in their order; a long table is fitted in some of its rows first."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from jaxveh.fitting.rig_data import RigData, StageReport
from jaxveh.fitting.rig_stages import Stage
from jaxveh.tyres import AbstractTyre

MANY, SOME = 10_000, 3_000
"""A table with more than `MANY` rows that count is fitted in at most `SOME` rows of each stage first. A rig writes 50 to 100 rows
a second, of which neighbours are nearly copies."""


def fit_in_turn(
    data: RigData, law: AbstractTyre, plan: Sequence[Stage], told: Callable[[int, str], None]
) -> tuple[AbstractTyre, list[StageReport]]:
    """Fit the stages of `plan`, of which the last has all rows and coefficients, each from the end of the one before; `told(k,
    name)` is called before stage k. Of a long table, all stages are fitted in some of its rows, and the last one then in all."""
    reports, chosen = [], some_rows(data, plan)
    some = data if chosen is None else data.take(chosen)
    for k, stage in enumerate(plan):
        own = stage if chosen is None else stage._replace(rows=stage.rows[chosen])
        if not some.counts(own).any():
            continue
        told(k, stage.name)
        law, report = some.fit(law, own)
        reports.append(report)
    if chosen is not None:
        told(len(plan) - 1, plan[-1].name)
        law, report = data.fit(law, plan[-1])
        reports.append(report)
    return law, reports


def some_rows(data: RigData, plan: Sequence[Stage]) -> np.ndarray | None:
    """Indices of rows that stand for all, or None if there are few rows. Those of each stage are drawn at random (every tenth row
    might have the same load), and always the same ones."""
    if data.present.any(axis=0).sum() <= MANY:
        return None
    rank = np.random.default_rng(0).permutation(data.present.shape[1])
    chosen = np.zeros(rank.shape, bool)
    for stage in plan:
        rows = np.flatnonzero(data.counts(stage).any(axis=0))
        chosen[rows[np.argsort(rank[rows])[:SOME]]] = True
    return np.flatnonzero(chosen)

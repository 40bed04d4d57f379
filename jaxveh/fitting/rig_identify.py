"""After a fit to rig data: selects one of the ends that the noise does not distinguish, and holds unidentified coefficients.

A coefficient that the data do not identify would end anywhere along a valley, together with the coefficients that it is
confounded with. It is held at its start, one coefficient after the other, the least known first, as long as that costs no more
than the noise explains; the others are fitted again.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from jaxveh.fitting.rig_canonical import canonical
from jaxveh.fitting.rig_data import RigData, StageReport, leaf_of, with_leaf
from jaxveh.fitting.rig_problem import of_common_length, spread_at_start, start_of
from jaxveh.fitting.rig_stages import Stage
from jaxveh.tyres import AbstractTyre, MFTyre

REJECTED = 2.0
"""Standard deviations from its start beyond which a coefficient keeps its fitted value, however uncertain: the data reject the
start."""

TIE = 3.84
"""Two ends whose sums of squares, in units of the noise's variance, differ by less are not distinguished (95 %, one degree)."""

OTHER_SIDE = {"longitudinal.RCX1": "longitudinal.REX1", "lateral.RCY1": "lateral.REY1"}
"""Shapes C of combined slip, whose fit has an end on either side of 1, and their curvatures E."""

SIDE, CURVATURE = 0.9, 0.5
"""Start of the search for the end with a shape below 1."""


class Settled(NamedTuple):
    """A `tyre` whose coefficients `held` (p,) are at their start, and the `report` of the stage that ended there."""

    tyre: AbstractTyre
    held: np.ndarray
    report: StageReport


def settle(
    data: RigData, start: AbstractTyre, tyre: AbstractTyre, joint: Stage, aside: Collection[str], report: StageReport
) -> Settled:
    """The tyre of a joint fit in its canonical form, with unidentified coefficients at their start and the others fitted again.

    `joint`: the stage with all coefficients, including those `aside`, which are held whatever the data show.
    """
    names = joint.coefficients
    held = np.array([name in aside for name in names])
    fixed = _fixed_signs(data, without(joint, held, names))
    if isinstance(tyre, MFTyre) and isinstance(start, MFTyre):
        found, steps = _below_one(data, tyre, without(joint, held, names))
        assert isinstance(found, MFTyre)
        start, tyre = canonical(start, fixed), canonical(found, fixed)
        report = report._replace(steps=report.steps + steps)
    kept = np.zeros(held.shape, bool)
    while True:
        found = _unidentified_coefficients(data, start, tyre, joint, held, kept)
        if not found:
            break
        tyre, held, kept, report = _hold(data, start, tyre, joint, (held, kept), found, report)
    after = data.share(tyre, joint)
    return Settled(tyre, held, report._replace(coefficients=int((~held).sum()), after=after))


def without(stage: Stage, held: np.ndarray, names: tuple[str, ...]) -> Stage:
    """The stage without the held coefficients; `held` is a mask over `names`."""
    still = {name for name, one in zip(names, held, strict=True) if one}
    return stage._replace(coefficients=tuple(name for name in stage.coefficients if name not in still))


def _fixed_signs(data: RigData, joint: Stage) -> list[str]:
    """Coefficients that may not change their sign: those that are not fitted, and those with bounds."""
    from_file = [f"{section}.{name}" for section, part in _sections() for name in part]
    return [name for name in from_file if name not in joint.coefficients or name in data.chosen.bounds]


def _sections():
    from jaxveh.tyres import mf_tyre

    for name, kind in (
        ("longitudinal", mf_tyre.LongitudinalCoefficients), ("lateral", mf_tyre.LateralCoefficients),
        ("aligning", mf_tyre.AligningCoefficients), ("overturning", mf_tyre.OverturningCoefficients),
    ):  # fmt: skip
        yield name, kind.__dataclass_fields__


def _below_one(data: RigData, tyre: AbstractTyre, joint: Stage) -> tuple[AbstractTyre, int]:
    """The end with the shapes of combined slip below 1, where a weight keeps its sign, if the data do not distinguish it."""
    steps = 0
    for shape, curvature in OTHER_SIDE.items():
        if shape not in joint.coefficients or shape in data.chosen.bounds or float(leaf_of(tyre, shape)) <= 1:
            continue
        other = with_leaf(with_leaf(tyre, shape, SIDE), curvature, CURVATURE)
        other, more, _ = data.descend(other, joint)
        steps += more
        noise = data.noise(tyre)
        if data.loss(other, joint, noise) - data.loss(tyre, joint, noise) < TIE and float(leaf_of(other, shape)) <= 1:
            tyre = other
    return tyre, steps


def _unidentified_coefficients(
    data: RigData, start, tyre, joint: Stage, held: np.ndarray, kept: np.ndarray
) -> list[int]:
    """The coefficients that the data do not identify, the least known first; each next one with those before held.

    Uses the Gauss-Newton matrix: holding one conditions the others on it, which may identify those confounded with it.
    """
    free = without(joint, held, joint.coefficients)
    problem = data.problem(tyre, free, data.noise(tyre))
    spread = np.array(spread_at_start(of_common_length(problem)))
    scale = np.asarray(start_of(tyre, data.parameters(tyre))[1])
    away = np.asarray(problem.origin - start_of(start, data.parameters(start))[0]) / scale
    open_ = ~held & ~kept
    found: list[int] = []
    while True:
        size = np.sqrt(np.maximum(np.diag(spread), 1e-300))
        unseen = open_ & (size > 1.0) & (np.abs(away) < REJECTED * size)
        if not unseen.any():
            return found
        i = int(np.argmax(np.where(unseen, size, 0.0)))
        found.append(i)
        open_[i] = False
        away = away - spread[:, i] / spread[i, i] * away[i]
        spread = spread - np.outer(spread[:, i], spread[i]) / spread[i, i]


def _hold(data: RigData, start, tyre, joint: Stage, masks, found: list[int], report: StageReport):
    """Hold as many of those found as the noise allows, the first ones; if not even the first one is allowed, it keeps its
    value."""
    held, kept = (mask.copy() for mask in masks)
    noise = data.noise(tyre)
    before, names = data.loss(tyre, joint, noise), joint.coefficients
    while found:
        tried = held.copy()
        tried[found] = True
        moved = tyre
        for i in found:
            moved = with_leaf(moved, names[i], leaf_of(start, names[i]))
        moved, steps, converged = data.descend(moved, without(joint, tried, names))
        report = report._replace(steps=report.steps + steps)
        if data.loss(moved, joint, noise) - before <= len(found) + 2 * np.sqrt(2 * len(found)):
            return moved, tried, kept, report._replace(converged=converged)
        if len(found) == 1:
            kept[found] = True
        found = found[: len(found) // 2]
    return tyre, held, kept, report

"""Bands that include the uncertainty of the parameters: a few models of equally plausible cars are run in parallel."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import block_diag

from jaxveh._core.parameter import Parameter, Where, pick, prior_spread, put, strong
from jaxveh._core.recording import Recording
from jaxveh.filters import AbstractFilter, Estimate, SmoothedEstimate
from jaxveh.filters import kit as filters
from jaxveh.fitting import Fit
from jaxveh.fitting import kit as fitting
from jaxveh.statespace import Row, StateSpace, kit

WIDER = 1.04
"""The bands' width over that from the members and their filters, since no member has other equations (a load that shifts
within the axle, a curve that depends on it, a body that rolls). Chosen together with `rear_axle_fit.OVERCONFIDENCE` on 94
simulated cars that were calibrated on their own drives (`benchmarks.accuracy`), and on the Ferrari and the F1TENTH in five
settings each. The table has the width with which the 95 % bands contain 98 and 97.5 % of the drives' rows, and the ones that the
logs need for 88 and 89 % in every setting:

| OVERCONFIDENCE | drives, 98 and 97.5 % | Ferrari, 88 and 89 % | F1TENTH, 88 and 89 % |
| --- | --- | --- | --- |
| 8 | 1.25, 1.17 | 1.13, 1.18 | 1.23, 1.27 |
| 12 | 1.20, 1.12 | 1.09, 1.14 | 1.12, 1.15 |
| 16 | 1.17, 1.09 | 1.07, 1.11 | 1.05, 1.09 |
| 24 | 1.12, 1.05 | 1.03, 1.08 | 0.97, 1.00 |

No pair has both 97.5 and 89 %; 16 with 1.1 had 97.6 % on the drives, 88.7 % or more on the Ferrari, 89.4 % or more on the
F1TENTH. That was before `rear_axle_fit.ALIKE`, with which the same pair has 98.2 % on 92 other drives (97.9 before), 90 % or more
on the Ferrari and 87.6 % or more on the F1TENTH; 24 with 1.05 has 98.0 %, and 1.04, which was taken, 89.4 % or more and 88.4 % or
more on the logs. Without the F1TENTH any `OVERCONFIDENCE` does as well (8 with 1.175: 86.4 % on the F1TENTH). Without the halves'
`disagreement`, at 8, the drives allow 1.37, the F1TENTH needs 1.61."""


TOLD = 1.2
"""The same for cars without calibration, whose parameters are known much less well. The 95 % bands then contain 100 % of the rows
of 30 simulated drives (the 50 % bands 83 to 100 %) and of the Ferrari's, 79 % of the F1TENTH's and 78 % of the AV-21's, which has
no accelerometer. They are too wide on the simulated drives because noise levels count as unknown, too. With known noise levels
(and 1.0) they contained 95 and 62 % there, but on three real logs 32 to 71 %."""


class Members(eqx.Module):
    """Models of equally plausible cars, on a leading axis; `wider`: the factor on the standard deviation."""

    models: StateSpace
    wider: float = eqx.field(static=True)

    def about(self, centre: Any, means: Any, stds: Any) -> Any:
        """Standard deviations about a `centre` (fields of any shape) from all members (on a leading axis): the standard
        deviation of each, and its distance from the centre. A member that fails where the centre does not is ignored."""
        size = lambda std, away: self.wider * jnp.sqrt(jnp.nanmean(jnp.square(std) + jnp.square(away), axis=0))
        return jax.tree.map(lambda mean, std, at: size(std, mean - at), means, stds, centre)


def members_of_fit(fit: Fit, unfitted: Mapping[str, float] | None = None) -> Members:
    """Models around a fit, whose parameters have its covariance. `unfitted`: names of parameters of the system that
    were not fitted and are not known either, and their standard deviations."""
    centre, covariance = np.asarray(fit.unconstrained), np.asarray(fit.covariance)
    return Members(_spread(fit.model, fit.chosen, centre, covariance, unfitted or {}), WIDER)


def members_of_prior(
    model: StateSpace, where: Where, prior: Mapping[str, float], unfitted: Mapping[str, float] | None = None
) -> Members:
    """Models around one that was not fitted to any log: its parameters have the prior's relative spreads. `unfitted` as in
    `members_of_fit`."""
    chosen = fitting.scalar_parameters(model, where)
    values = pick(model, chosen)
    spread = np.stack([np.asarray(one) for one in prior_spread(chosen, values, prior)])
    centre = np.asarray(fitting.on_line(chosen, values))
    return Members(_spread(model, chosen, centre, np.diag(spread**2), unfitted or {}), TOLD)


def _spread(
    model: StateSpace, chosen: tuple[Parameter, ...], centre: np.ndarray, covariance: np.ndarray, unfitted: Mapping[str, float]
) -> StateSpace:  # fmt: skip
    """Models on a leading axis whose `chosen` parameters, on the real line, have this mean and covariance, and whose `unfitted`
    ones vary independently of them about the model's: `z + L h`, where h are rows of signs with orthogonal columns, so that both
    are exact and no member lies far out."""
    root = np.linalg.cholesky(covariance + 1e-12 * np.trace(covariance) * np.eye(len(centre)))
    if unfitted:
        more = fitting.scalar_parameters(model, lambda model: [getattr(model.system, name) for name in unfitted])
        chosen = chosen + more
        centre = np.append(centre, fitting.on_line(more, pick(model, more)))
        root = block_diag(root, np.diag([*unfitted.values()]))
    points = jnp.asarray(centre + _signs(len(centre)) @ root.T, centre.dtype)
    return eqx.filter_vmap(lambda point: put(model, chosen, fitting.in_units(chosen, point)))(points)


def _signs(columns: int) -> np.ndarray:
    """Signs (n, columns), n little more than `columns`, whose columns are orthogonal to each other and to a constant: the squares
    modulo a prime that is 3 modulo 4, shifted from row to row (R. Paley 1933; R. Plackett & J. Burman 1946)."""
    primes = (q for q in itertools.count(3, 4) if all(q % k for k in range(2, math.isqrt(q) + 1)))
    prime = next(q for q in primes if q >= columns)
    first = np.where(np.isin(np.arange(prime), np.arange(prime) ** 2 % prime), 1.0, -1.0)
    return np.stack([*(np.roll(first, k) for k in range(prime)), -np.ones(prime)])[:, :columns]


def estimate_with_members(
    filter: AbstractFilter, model: StateSpace, members: Members, log: Recording, smoothed: bool
) -> Estimate | SmoothedEstimate:
    """The estimate of a model, from all rows or from those up to each, with standard deviations that include its `members`."""
    if not smoothed:
        scan = lambda model, rows: kit.of_common_length(_followed_with_members, rows, filter, model, members)
        return kit.run_by(scan, filter, model, log)
    model = strong(model)
    filter.check(model)
    found = kit.of_common_length(_smoothed_with_members, model.rows(log), filter, model, members)
    found = dataclasses.replace(found, time=log.time, filtered=dataclasses.replace(found.filtered, time=log.time))
    kit.raise_failure(found.filtered, filter, model, log)
    return found


@eqx.filter_jit
def _smoothed_with_members(
    filter: AbstractFilter, model: StateSpace, members: Members, rows: Row, count: Any
) -> SmoothedEstimate:
    # One batch: the model's smoother alone would be another program, and take ten times as long to compile as to run.
    put_first = lambda one, many: jnp.concatenate([jnp.asarray(one, many.dtype)[None], many])
    (single, rest), several = eqx.partition(model, eqx.is_array), eqx.filter(members.models, eqx.is_array)
    every = eqx.combine(jax.tree.map(put_first, single, several), rest)
    part = lambda at, tree: jax.tree.map(lambda leaf: leaf[at], tree)

    def joined(moments):
        centre, others = part(0, moments[0]), part(slice(1, None), moments)
        return centre, members.about(centre, *others)

    return filters.smooth_together(filter, every, rows, joined, count)


@eqx.filter_jit
def _followed_with_members(
    filter: AbstractFilter, model: StateSpace, members: Members, rows: Row, count: Any
) -> Estimate:
    found, _ = kit.scan_in_form(filter, model, rows, None, lambda belief: None, kit.SHOWN, kit.Steps.whole, count)
    return dataclasses.replace(found, std=_std_of_members(filter, members, rows, found.mean))


def _std_of_members(filter: AbstractFilter, members: Members, rows: Row, centre: Any) -> Any:
    """The standard deviations about the means `centre` of a filter."""
    moments = eqx.filter_vmap(lambda model, belief: belief.moments(model))
    about = lambda beliefs, centre: members.about(centre, *moments(members.models, beliefs))

    # Identical to a live loop to the last bit, for its steps are the same; nothing of a member is kept.
    def body(beliefs, given):
        row, centre = given
        beliefs = eqx.filter_vmap(lambda model, belief: filter.step(model, belief, row)[0])(members.models, beliefs)
        return beliefs, about(beliefs, centre)

    first, rest = (jax.tree.map(lambda leaf, at=at: leaf[at], (rows, centre)) for at in (0, slice(1, None)))
    beliefs = eqx.filter_vmap(lambda model: filter.init(model, first[0], None)[0])(members.models)
    _, stds = kit.scan_by(kit.Steps.whole, body, beliefs, rest)
    return jax.tree.map(lambda one, more: jnp.concatenate([one[None], more]), about(beliefs, first[1]), stds)

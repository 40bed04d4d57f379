"""The observability of parameters from a recording: Fisher information, Cramer-Rao bounds, unobservable directions."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np

from jaxveh._core.errors import FilterError, InputError, check_positive
from jaxveh._core.host import AFTER, check_on_host, on_host
from jaxveh._core.parameters import Parameters

UNOBSERVABLE = 1e9
"""Prior-scaled condition number of the information above which the report calls the parameters unobservable."""


class Observability(NamedTuple):
    """Fisher information of named parameters, whitened by noise and scaled by the prior's standard deviations.

    By name, as `Parameters` like those of an estimate (`.front.B`): `spread`, the prior's standard deviations; `bounds`,
    Cramer-Rao bounds of the standard deviations if all parameters are unknown, in the parameters' own units on the real line
    (0.05: five per cent for a positive parameter); `bounds_alone`, each with the others known; `bounds_with_prior`, with
    the prior's information added.

    In the order of `names` (p,): `information` (p, p) in units of the prior (1 on the diagonal: as much as in the
    prior); `singular_values` (p,) of the scaled sensitivities, descending; `condition_number`: of the information, the
    square of the ratio of the extreme singular values; `directions` (p, p): rows are the right singular vectors in units
    of the prior, the last the least observable.
    """

    names: tuple[str, ...]
    spread: Parameters
    information: np.ndarray
    singular_values: np.ndarray
    condition_number: float
    bounds: Parameters
    bounds_alone: Parameters
    bounds_with_prior: Parameters
    directions: np.ndarray

    def observable(self, share: float = 0.1) -> tuple[str, ...]:
        """Return the parameters whose Cramer-Rao bound, with all others unknown, is at most `share` of the prior's spread."""
        return tuple(name for name in self.names if self.bounds[name] <= share * self.spread[name])

    def unobservable(self, share: float = 1.0) -> tuple[str, ...]:
        """Return the parameters whose bound is above `share` of the prior's spread: the recording adds no information."""
        return tuple(name for name in self.names if not self.bounds[name] <= share * self.spread[name])

    def trade(self) -> str:
        """Describe the least observable direction in words."""
        direction = self.directions[-1]
        order = np.argsort(-np.abs(direction))
        share = np.abs(direction[order]) / np.abs(direction[order[0]])
        main = [i for i, s in zip(order, share, strict=True) if s >= 0.3][:4]
        first = self.names[main[0]]
        if len(main) == 1:
            return f"{first} alone has no effect on the measurements"
        up = [self.names[i] for i in main[1:] if direction[i] * direction[main[0]] > 0]
        down = [self.names[i] for i in main[1:] if direction[i] * direction[main[0]] < 0]
        parts = [f"{_list(up)} rising with it" if up else "", f"{_list(down)} falling" if down else ""]
        return f"{first} trades against {_list([self.names[i] for i in main[1:]])}: {first} rising, " + " and ".join(
            part for part in parts if part
        )

    def report(self) -> str:
        """Return the findings in words, one line each."""
        lines = [f"condition number of the information, scaled by the prior: {self.condition_number:.1e}"]
        for name in self.names:
            bound, alone, spread = self.bounds[name], self.bounds_alone[name], self.spread[name]
            verdict = (
                "observable" if bound <= 0.1 * spread else "weakly observable" if bound <= spread else "unobservable"
            )
            lines.append(f"{name}: bound {bound:.2g} (prior {spread:.2g}; others known {alone:.2g}): {verdict}")
        if self.condition_number > UNOBSERVABLE:
            lines.append(f"together these {len(self.names)} parameters are unobservable here: {self.trade()}")
        else:
            lines.append(f"least observable: {self.trade()}")
        return "\n".join(lines)


def _list(names) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]


def observability_at(
    predict: Callable[[jax.Array], jax.Array], at: jax.Array, names: tuple[str, ...], spread, nuisance: int = 0
) -> Observability:
    """Compute the observability of parameters from whitened predictions.

    **Arguments**: `predict(z) -> (R,)`: every predicted measurement over its noise's standard deviation, for
    parameters `z` (p + nuisance,) on the real line; `at`: the point of the sensitivities; `names` (p,); `spread`
    (p + nuisance,): the prior's standard deviations. The last `nuisance` entries of z (start states) are also unknown,
    with the prior's uncertainty, and are marginalised.

    **Raises** `InputError` for shapes that do not agree; `FilterError` if the prediction diverges. Use float64:
    condition numbers above 1e7 have no meaning in float32.
    """
    check_on_host("observability_at", at, spread, advice=AFTER)
    spread, count = np.asarray(spread, dtype=np.float64), len(names)
    if at.shape != (count + nuisance,) or spread.shape != at.shape:
        raise InputError(f"at {at.shape}, spread {spread.shape}: must be ({count + nuisance},) for {', '.join(names)}.")
    check_positive("spread", spread)
    slopes = jax.jacfwd(predict)(at)
    check_on_host("observability_at: predict", slopes, advice=AFTER)
    jacobian = np.asarray(slopes, dtype=np.float64) * spread
    if not np.isfinite(jacobian).all():
        raise FilterError("observability: a sensitivity is not finite; the simulation diverges for these parameters.")
    return from_sensitivities(_marginal(jacobian, count), names, spread[:count])


def _marginal(jacobian: np.ndarray, count: int) -> np.ndarray:
    """Return the sensitivities of the first `count` columns; the others, uncertain as in the prior, are projected out."""
    nuisance = jacobian.shape[1] - count
    if nuisance == 0:
        return jacobian
    known = np.hstack([np.zeros((nuisance, count)), np.eye(nuisance)])
    rows = np.vstack([jacobian, known])
    root = np.asarray(np.linalg.qr(np.hstack([rows[:, count:], rows[:, :count]]), mode="r"))
    return root[nuisance:, nuisance:]


@on_host
def from_sensitivities(jacobian: np.ndarray, names: tuple[str, ...], spread: np.ndarray) -> Observability:
    """Compute the result from prior-scaled, whitened sensitivities (R, p)."""
    # With fewer measurements than parameters, rows of zeros are added for the directions without any measurement.
    jacobian = np.vstack([jacobian, np.zeros((max(0, len(names) - len(jacobian)), len(names)))])
    # From the singular values of the sensitivities, because those of the information would square the condition number.
    _, values, directions = np.linalg.svd(jacobian, full_matrices=False)
    floor = np.finfo(np.float64).tiny
    safe = np.maximum(values, floor)
    alone = np.linalg.norm(jacobian, axis=0)
    with np.errstate(over="ignore"):  # a direction without any effect has an infinite bound
        ratio, reach = (safe[0] / safe[-1]) ** 2, np.sum((directions / safe[:, None]) ** 2, axis=0)
    by_name = lambda values: Parameters(dict(zip(names, values, strict=True)))
    return Observability(
        names=tuple(names),
        spread=by_name(spread),
        information=jacobian.T @ jacobian,
        singular_values=values,
        condition_number=float(min(ratio, np.finfo(np.float64).max)),
        bounds=by_name(spread * np.sqrt(reach)),
        bounds_alone=by_name(spread / np.maximum(alone, floor)),
        bounds_with_prior=by_name(spread * np.sqrt(np.sum(directions**2 / (1 + values[:, None] ** 2), axis=0))),
        directions=directions,
    )

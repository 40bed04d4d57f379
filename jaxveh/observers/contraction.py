"""Stability of an observer of a nonlinear model in the region of its use."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.host import on_host
from jaxveh._core.names import as_several
from jaxveh.observers.base import check_gain
from jaxveh.observers.luenberger import array
from jaxveh.observers.poles import slopes_without
from jaxveh.statespace import StateSpace, kit


@on_host
def contraction_rate(
    model: StateSpace, gain: Any, points: Iterable[tuple[Any, Any]], *, dt: float, leave: tuple[str, ...] = ()
) -> float:
    """The rate (1/s) at which a `Luenberger` observer's error decays at the slowest of the points, in one quadratic form.

    `V = e^T P e` solves Lyapunov's equation at the first point, weighted by the prior's covariance; `V` falls at least by the
    factor `exp(-2 rate dt)` per step at each of them. A positive rate over a convex region that the estimate and the truth do
    not leave is a proof (contraction in a constant metric, W. Lohmiller & J.-J. Slotine, Automatica 34, 1998); over `points`
    it is evidence. A rate of zero or below does not show that the observer is unstable, only that this form proves nothing.

    **Arguments**: `gain` (n, m); `points`, pairs of a state, its NamedTuple, and inputs by name; `dt` (s); `leave` as in
    `place_poles`.

    **Raises** `InputError` if the observer is not stable at the first point.
    """
    kit.check_model("contraction_rate", model)
    check_positive("dt", dt, "s")
    points, gain = as_several(points, "points"), array(gain)
    if any(not isinstance(point, tuple) or len(point) != 2 for point in points):
        raise InputError("points: each must be a pair, a state (its NamedTuple) and inputs by name.")
    if not points:
        raise InputError("contraction_rate: there is no point; give at least one.")
    check_gain("gain", gain, model)
    errors = []
    for x, u in points:
        F, H, kept = slopes_without(model, dt, x, u, leave)
        errors.append((np.eye(len(F)) - np.asarray(gain)[kept] @ H) @ F)
    fastest = np.max(np.abs(np.linalg.eigvals(errors[0])))
    if fastest >= 1:
        raise InputError(
            f"contraction_rate: at the first point a step multiplies the error by {fastest:.6g}: must be below 1."
        )
    # SciPy comes with JAX; imported here so that importing the package does not wait for it.
    from scipy import linalg

    weight = np.linalg.inv(np.asarray(model.prior.covariance(), float)[np.ix_(kept, kept)])
    factor = np.linalg.cholesky(linalg.solve_discrete_lyapunov(errors[0].T, weight))
    # |e|_P of a step is the largest singular value of L^T M L^-T.
    shrinks = [np.linalg.norm(np.linalg.solve(factor, (factor.T @ M).T), 2) for M in errors]
    return float(-np.log(max(shrinks)) / dt)

"""A warning where rows are too far apart for the steps between them."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from jaxveh._core.errors import is_concrete, warn
from jaxveh.statespace.model import Row, StateSpace
from jaxveh.statespace.solvers import Propagate

FAR = 0.03
"""s: rows closer than this are not looked at, because the look compiles a program, and steps are rarely too long for them: for a
car of given speed below 2 m/s."""

GROWS = 2.0
"""The growth of an error from row to row beyond which steps are too long; an unstable car multiplies it by 1.6 in 0.1 s."""

SHARES = (0.0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)
"""Of the rows in the order of an input's size: those that are looked at."""


def warn_of_far_rows(model: StateSpace, rows: Row) -> None:
    """Warn if the explicit steps from row to row (`Propagate`) multiply errors, as they do where they are too long.

    Looked at are rows before short, usual and long steps, and rows with small, usual and large inputs, at the prior's mean.
    """
    if len(rows.t) < 2 or not _integrates(model.transition_function) or not is_concrete(model, rows):
        return
    times = np.asarray(rows.t, float)
    if np.max(np.diff(times)) <= FAR:
        return
    some = _sample(np.diff(times), rows.u)
    at = jax.tree.map(lambda leaf: leaf[some], rows.u)
    growth = _largest(np.asarray(_slopes(model, rows.t[some], rows.t[some + 1], at), float))
    worst = int(np.argmax(growth))
    if growth[worst] > GROWS:
        step = times[some[worst] + 1] - times[some[worst]]
        warn(
            f"run: rows {step:.3g} s apart are too far for one step at t = {times[some[worst]]:g} s: it multiplies errors by "
            f"{growth[worst]:.3g}, and the estimate may be wrong there. Take more steps between rows, e.g. "
            "state_space(..., steps=4), or solver=statespace.StabilisedRK4(); split the recording at a gap."
        )


def _integrates(function: Any) -> bool:
    """Whether a transition, or one that it wraps, takes the steps of a solver."""
    while not isinstance(function, Propagate):
        function = getattr(function, "function", getattr(function, "transition", None))
        if function is None:
            return False
    return True


def _sample(steps: np.ndarray, u: Any) -> np.ndarray:
    """Rows, but not the last one, whose step or an input is small to large: always equally many, for one program."""
    places = np.array([round(share * (len(steps) - 1)) for share in SHARES])
    sizes = [steps, *(np.abs(np.asarray(leaf)[: len(steps)]) for leaf in jax.tree.leaves(u))]
    return np.concatenate([places, *(np.argsort(size, kind="stable")[places] for size in sizes)])


def _largest(slopes: np.ndarray) -> np.ndarray:
    """The size of the largest eigenvalue of each matrix (k, n, n); 0 for one that is not finite."""
    finite = np.asarray(np.isfinite(slopes).all(axis=(1, 2)))
    return np.abs(np.linalg.eigvals(np.where(finite[:, None, None], slopes, 0.0))).max(axis=1)


@eqx.filter_jit
def _slopes(model: StateSpace, t0, t1, u) -> jax.Array:
    """The slopes (k, n, n) of the state after a step by that before it."""
    flat, shaped = ravel_pytree(model.prior.mean)

    def slope(at):
        begin, end, u = at
        return jax.jacfwd(lambda x: ravel_pytree(model.transition(begin, end, shaped(x), u))[0])(flat)

    return jax.lax.map(slope, (jnp.asarray(t0), jnp.asarray(t1), u))

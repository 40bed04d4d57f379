"""Gains from poles."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy import signal

from jaxveh._core.errors import InputError
from jaxveh._core.names import record
from jaxveh.observers.base import observed
from jaxveh.statespace import Row, StateSpace


def place_poles(model: StateSpace, poles: Any, *, dt: float, x: Any = None, u: Any = None) -> np.ndarray:
    """The gain (n, m) of a `Luenberger` observer whose error dies out with these `poles` (n,), 1/s, on the model linearised.

    **Arguments**: `poles`, continuous: real negative numbers or conjugate pairs, none repeated more often than there are
    channels; `dt` (s), the step; `x`, the state about which the model is linearised (the prior's mean), a NamedTuple; `u`, its
    inputs by name (zeros). The steps' poles are exp(pole dt). By SciPy's `place_poles` (A. Tits & Y. Yang 1996).

    **Raises** `InputError` for poles that are not stable, and for a model that is not observable.
    """
    poles = np.asarray(poles)
    n = len(model.states)
    if poles.shape != (n,):
        raise InputError(f"poles have shape {poles.shape}: must be ({n},), one for each of {', '.join(model.states)}.")
    if not (poles.real < 0).all():
        raise InputError(f"poles = {poles}: must have negative real parts (1/s).")
    F, H = linearised_step(model, dt, x, u)
    seen = np.linalg.matrix_rank(np.vstack([H @ np.linalg.matrix_power(F, k) for k in range(n)]))
    if seen < n:
        raise InputError(
            f"the model is not observable there: {seen} of {n} directions of the state reach the channels."
        )
    # The error after a correction obeys (I - L H) F: the dual of placing the poles of F^T - (H F)^T L^T.
    found = signal.place_poles(F.T, (H @ F).T, np.exp(poles * dt))
    return found.gain_matrix.T


def linearised_step(model: StateSpace, dt: float, x: Any = None, u: Any = None) -> tuple[np.ndarray, np.ndarray]:
    """Slopes of a step of `dt` seconds (n, n) and of the observation (m, n), at the state `x` and the inputs `u` (see above)."""
    dtype = model.prior.mean[0].dtype
    x = model.prior.mean if x is None else x
    given = dict(u or {})
    inputs = record("Inputs", {name: jnp.asarray(given.get(name, 0.0), dtype) for name in model.inputs})
    zero, end, kind = jnp.zeros((), dtype), jnp.asarray(dt, dtype), type(model.prior.mean)
    vector = jnp.stack([jnp.asarray(value, dtype) for value in x])

    def move(vector):
        moved = model.transition(zero, end, kind(*vector), model.step_inputs(zero, end, inputs, inputs))
        return jnp.stack([jnp.asarray(value, dtype) for value in moved])

    row = Row(zero, inputs, None)
    return np.asarray(jax.jacfwd(move)(vector)), np.asarray(jax.jacfwd(lambda v: observed(model, row, v))(vector))

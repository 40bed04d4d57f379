"""The bootstrap: fits to data sets resampled from the data, all in one program."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxveh._core.errors import InputError, check_at_least, check_key, check_kind, check_whole
from jaxveh._core.parameters import Parameters
from jaxveh.fitting.problem import AbstractProblem, by_name, in_units
from jaxveh.fitting.solve import MOST_STEPS, optimum

LEAST_UNITS = 5
"""With fewer parts than this, resampling gives hardly any new data sets."""


class Bootstrap(NamedTuple):
    """Fits to `count` resampled data sets: `parameters` with the names of the fit's, (count,) each; `parameters_std`, their
    standard deviation, which is the standard error; `converged` (count,): fits that did not converge are left out of it."""

    parameters: Parameters
    parameters_std: Parameters
    converged: Any


def bootstrap(
    problem: AbstractProblem,
    key,
    *,
    count: int = 200,
    groups=None,
    max_steps: int = MOST_STEPS,
    tolerance: float = 1e-8,
) -> Bootstrap:
    """Standard errors from `count` fits to parts of the data drawn with replacement (B. Efron and R. J. Tibshirani, An
    Introduction to the Bootstrap, 1993, sec. 9.5: pairs): under `jit`, all fits in one program.

    Parts are rows of rig data, or whole recordings. No law of the noise is assumed, but the parts are assumed independent.
    `groups` (rows,): numbers of the groups that are drawn as a whole, such as the run of each row. Each fit starts at the
    optimum for all the data. `max_steps`, `tolerance` as in `solve`.

    **Raises** `InputError` for fewer than two fits, fewer than five parts, or `max_steps` below one.
    """
    check_kind("problem", problem, AbstractProblem, "fitting.pose_rig, pose_likelihood and their like make one.")
    check_whole("count", count, 2)
    check_at_least("tolerance", tolerance, 0)
    check_whole("max_steps", max_steps)
    check_key("bootstrap", key)
    parts = problem.units()
    group = np.arange(parts) if groups is None else np.unique(np.asarray(groups), return_inverse=True)[1]
    if group.shape != (parts,):
        raise InputError(f"groups has shape {group.shape}: must be ({parts},), one number per part of the data.")
    if group.max() + 1 < LEAST_UNITS:
        raise InputError(
            f"bootstrap: the data have {group.max() + 1} parts to resample (rows, runs or recordings): must be at least "
            f"{LEAST_UNITS}."
        )
    return _bootstrap(problem, key, jnp.asarray(group), int(group.max()) + 1, count, max_steps, tolerance)


@eqx.filter_jit
def _bootstrap(problem, key, group, groups: int, count: int, max_steps: int, tolerance: float) -> Bootstrap:
    fit = lambda problem, start: optimum(problem, start, max_steps=max_steps, tolerance=tolerance)
    whole = fit(problem, lax.stop_gradient(problem.start())).z

    def once(key):
        drawn = jax.random.randint(key, (groups,), 0, groups)
        times = jnp.zeros(groups, whole.dtype).at[drawn].add(1)
        found = fit(problem.with_counts(times[group]), whole)
        return jnp.stack(in_units(problem.chosen, problem.line(found.z))), found.converged

    values, converged = jax.vmap(once)(jax.random.split(key, count))
    counted = converged.astype(values.dtype)
    kept, many = jnp.where(converged[:, None], values, 0), jnp.sum(counted)
    mean = counted @ kept / many
    std = jnp.sqrt(counted @ (kept - mean) ** 2 / (many - 1))
    return Bootstrap(by_name(problem.chosen, values.T), by_name(problem.chosen, std), converged)

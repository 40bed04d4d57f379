"""A row's measurements: which are present, and whether they are valid."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxveh._core.names import record
from jaxveh._core.result import Result, code, first_failure, with_reason
from jaxveh.statespace.model import Row, StateSpace


def presence(model: StateSpace, row: Row) -> tuple[dict, dict]:
    """Measurements with missing ones replaced by zero, and which are present: two mappings by channel.

    NaN means missing; infinity also counts as missing here, and `input_result` reports it.
    """
    values = {name: getattr(row.y, name) for name in model.channels}
    present = {name: jnp.isfinite(value) for name, value in values.items()}
    filled = {name: jnp.where(present[name], value, jnp.zeros_like(value)) for name, value in values.items()}
    return filled, present


def input_result(model: StateSpace, row: Row):
    """`non_finite_input` where an input or the time is not finite, or a measurement is infinite."""
    bad = [~jnp.isfinite(leaf) for leaf in jax.tree.leaves((row.t, row.u))]
    bad += [jnp.isinf(getattr(row.y, name)) for name in model.channels]
    return jnp.where(jnp.any(jnp.stack(bad)), code(Result.non_finite_input), code(Result.successful))


def likelihood_result(result, log_likelihood):
    """The result code, `measurement_too_far` where it is successful but the log-likelihood is not finite."""
    return with_reason(result, ~jnp.isfinite(log_likelihood), Result.measurement_too_far)


def result_of_parts(results, log_likelihood):
    """The result code of a mixture with this log-likelihood, from those of its parts (r,): a part that is too far from the
    measurement has no weight, and is no failure."""
    first, _ = first_failure(jnp.where(results == int(Result.measurement_too_far), 0, results))
    return likelihood_result(first, log_likelihood)


def by_channel(model: StateSpace, values, present: dict):
    """A NamedTuple by channel, NaN where the channel is missing; `values` in the order of the channels."""
    pairs = zip(model.channels, values, strict=True)
    return record("Measurements", {name: jnp.where(present[name], value, jnp.nan) for name, value in pairs})

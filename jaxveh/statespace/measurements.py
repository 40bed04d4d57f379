"""A row's measurements: which are present, and whether they are valid."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxveh._core.names import record
from jaxveh._core.result import Result, code
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


def by_channel(model: StateSpace, values, present: dict):
    """A NamedTuple by channel, NaN where the channel is missing; `values` in the order of the channels."""
    pairs = zip(model.channels, values, strict=True)
    return record("Measurements", {name: jnp.where(present[name], value, jnp.nan) for name, value in pairs})

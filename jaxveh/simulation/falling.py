"""Where a function falls through zero: bisection that ends in any precision."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx

HALVINGS = 60
"""Enough halvings to shrink any interval to the resolution of a double."""


class _Interval(NamedTuple):
    lower: Any
    upper: Any
    halvings: Any


class Falling(optx.AbstractRootFinder):
    """The end of the interval in which a function falls through zero; the interval is at most `tolerance` long, or as short as
    the precision allows.

    The options `lower` and `upper` are its first beginning and end. The fall is taken to lie between them without a test of the
    function's signs there, which rounding may have changed since the interval was found. The length of the interval alone
    decides when the search ends, so the function may have any unit. The result is the interval's end, after the fall.
    """

    tolerance: float = eqx.field(static=True)
    # optimistix requires these fields of every root finder; this one uses no residual.
    rtol: float = eqx.field(static=True, default=0.0)
    atol: float = eqx.field(static=True, default=0.0)
    norm: Any = eqx.field(static=True, default=jnp.abs)

    def init(self, fn, y, args, options, f_struct, aux_struct, tags) -> _Interval:
        return _Interval(options["lower"], options["upper"], jnp.zeros((), jnp.int32))

    def step(self, fn, y, args, options, state: _Interval, tags):
        middle = state.lower + 0.5 * (state.upper - state.lower)
        value, aux = fn(middle, args)
        before = value >= 0
        lower, upper = jnp.where(before, middle, state.lower), jnp.where(before, state.upper, middle)
        return upper, _Interval(lower, upper, state.halvings + 1), aux

    def terminate(self, fn, y, args, options, state: _Interval, tags) -> tuple[jax.Array, optx.RESULTS]:
        least = 2 * jnp.finfo(state.upper.dtype).eps * jnp.abs(state.upper)
        short = state.upper - state.lower <= jnp.maximum(jnp.asarray(self.tolerance, least.dtype), least)
        return short | (state.halvings >= HALVINGS), optx.RESULTS.successful

    def postprocess(self, fn, y, aux, args, options, state, tags, result):
        return y, aux, {}

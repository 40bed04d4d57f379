"""Where a function falls through zero: bisection that ends in any precision."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx

HALVINGS = 60
"""More than any interval needs to shrink to what a double resolves."""


class _Interval(NamedTuple):
    lower: Any
    upper: Any
    halvings: Any


class Falling(optx.AbstractRootFinder):
    """The end of the interval, at most `tolerance` long or as short as the precision allows, in which a function falls through
    zero.

    Its beginning and end are the options `lower` and `upper`, which are believed to have the fall between them: rounding may
    make the function's sign at one of them another than it was when the interval was found. The interval alone says when it
    is enough, so that the function may have any unit; its end is given, where the fall is over.
    """

    tolerance: float = eqx.field(static=True)
    # What optimistix asks of every root finder; nothing here measures a residual.
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

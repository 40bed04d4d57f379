"""Damped Fisher scoring with secant corrections, as a minimiser of optimistix."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import optimistix as optx

from jaxveh import numerics
from jaxveh.fitting.levenberg_marquardt import Quadratic, termination

FIRST_DAMPING, RAISED, LOWERED, LEAST_RAISED = 1e-2, 5.0, 0.2, 1e-3
"""Levenberg's damping at the start, its factors after a step that raised and one that lowered the cost, and its least value
after a step that raised it."""

SECANTS = 10
"""The number of last steps that correct the curvature."""

LONGEST_STEP = 2.0
"""The largest change of a parameter in one step, in the parameters' units."""

LEAST_STEP = 1e-3
"""In the parameters' units: if a refused step is shorter, no smaller step can gain."""


class _Search(NamedTuple):
    """The state of a search: the `Quadratic` `at` the point, the `trial` to be evaluated next, the last steps and the changes
    of the gradient over them (S, n), oldest first, zero where there is none; `small`: how many steps in a row gained
    little."""

    at: Quadratic
    trial: Any
    moves: Any
    changes: Any
    damping: Any
    small: Any
    steps: Any
    done: Any


class FisherScoring(optx.AbstractMinimiser):
    """Newton steps with the expected information as curvature (Ljung 1999, ch. 10; Gupta & Mehra 1974), with Levenberg's
    damping, and corrected by the observed changes of the gradient (BFGS). The expected information is the curvature only on
    average; where they differ, plain scoring creeps.

    `quadratic(y, args)`: the `Quadratic` of the cost at y (n,), whose matrix is the information. The search ends when two
    steps in a row gain less than `atol` of cost, or cannot gain. `options` of `optimistix.minimise`: `unit` (n,), the unit of
    each coordinate in which steps are limited, by default one; `limit`, the most steps as an array; `state`, a search to
    continue.
    """

    atol: float
    quadratic: Callable = eqx.field(static=True)
    rtol: float = 0.0
    norm: Callable = eqx.field(static=True, default=optx.max_norm)

    def init(self, fn, y, args, options, f_struct, aux_struct, tags):
        """The first state; nothing is computed before the first step, which evaluates the start."""
        if "state" in options:
            return options["state"]
        return self.begin(y)

    def begin(self, y) -> _Search:
        """The state of a search before its first evaluation."""
        # With the types of the returned state: weak types would compile another program.
        none, past = jnp.zeros((), int), jnp.zeros((SECANTS, y.size), y.dtype)
        at = Quadratic(jnp.full((), jnp.inf, y.dtype), jnp.zeros_like(y), jnp.zeros((y.size, y.size), y.dtype))
        damping = jnp.full((), FIRST_DAMPING, y.dtype)
        return _Search(at, y, past, past, damping, none, none - 1, jnp.asarray(False))

    def step(self, fn, y, args, options, state, tags):
        """Evaluate the trial, accept it if it is better, and choose the next trial."""
        first = state.steps < 0
        unit = options.get("unit", jnp.ones_like(y))
        found, move = self.quadratic(state.trial, args), state.trial - y
        seen = jnp.all(jnp.isfinite(found.gradient))
        last = lambda past, new: jnp.where(seen & ~first, jnp.concatenate([past[1:], new[None]]), past)
        moves, changes = last(state.moves, move), last(state.changes, found.gradient - state.at.gradient)
        better = seen & jnp.all(jnp.isfinite(found.matrix)) & (found.cost < state.at.cost)
        # Without a finite cost there is nothing to compare with: this does not count as a small gain.
        still = jnp.isfinite(state.at.cost) & (jnp.max(jnp.abs(move / unit)) < LEAST_STEP)
        little = jnp.where(better, state.at.cost - found.cost < self.atol, still)
        small = jnp.where(little, state.small + 1, 0)
        damped = jnp.where(better, state.damping * LOWERED, jnp.maximum(state.damping * RAISED, LEAST_RAISED))
        damping = jnp.where(first, state.damping, damped)
        at = Quadratic(*(jnp.where(better, new, old) for new, old in zip(found, state.at, strict=True)))
        y = jnp.where(better, state.trial, y)
        trial = y + _step(at, moves, changes, damping, unit)
        state = _Search(at, trial, moves, changes, damping, small, state.steps + 1, small == 2)
        return y, state, None

    def terminate(self, fn, y, args, options, state, tags):
        """Whether the search has ended, or has taken `limit` steps."""
        return termination(state, options)

    def postprocess(self, fn, y, aux, args, options, state, tags, result):
        """The best point, which is the last one."""
        return y, aux, {}


def _step(at: Quadratic, moves, changes, damping, unit):
    """The damped step from a point, no longer than `LONGEST_STEP`."""
    curvature = with_secants(at.matrix, moves, changes)
    damped = curvature + damping * jnp.diag(jnp.diagonal(curvature))
    move = -jnp.linalg.lstsq(damped, at.gradient)[0]
    return move * jnp.minimum(1.0, LONGEST_STEP / jnp.maximum(numerics.largest(jnp.abs(move / unit)), 1e-12))


def with_secants(curvature, moves, changes):
    """A curvature (n, n) corrected by steps (S, n) and the changes of the gradient over them, oldest first (BFGS); zero steps
    are ignored."""
    for move, change in zip(moves, changes, strict=True):
        along = curvature @ move
        fits = change @ move > 1e-2 * move @ along
        raised = jnp.outer(change, change) / numerics.or_one(change @ move, fits)
        lowered = jnp.outer(along, along) / numerics.or_one(move @ along, fits)
        curvature = jnp.where(fits, curvature + raised - lowered, curvature)
    return curvature

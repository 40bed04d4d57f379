"""Second derivatives of every method of every quantity: finite on every kind of log, and those of the gradient."""

import equinox as eqx
import jax
import jax.numpy as jnp
import method_logs
import numpy as np
import pytest
from test_every_method import QUANTITIES, a_sixth, draws, every, made, stacked, total_of

KINDS = ("gaps", "standing", "reverse", "falls silent")
FIRST, ROWS = 50, 60
"""In these rows channels fall silent and return."""


@pytest.mark.seldom
@a_sixth
@every
def test_second_derivatives_are_finite_and_those_of_the_gradient(quantity, name):
    module, method = QUANTITIES[quantity], made(quantity, name)
    logs = method_logs.variants(method.needs)
    time, values = stacked({kind: logs[kind] for kind in KINDS}, method.needs)
    time, values = time[:ROWS], jax.tree.map(lambda leaf: leaf[:, FIRST : FIRST + ROWS], values)
    numbers, rest = eqx.partition(method, eqx.is_inexact_array)
    # In proportion to the numbers themselves: each counts, whatever its unit.
    direction = jax.tree.map(lambda leaf: jnp.where(jnp.isfinite(leaf), leaf, 0.0), numbers)

    total = total_of(module, rest, time)

    def with_change(numbers, values):
        return jax.jvp(lambda numbers: jax.grad(total)(numbers, values), (numbers,), (direction,))

    # One program for the derivatives and for the differences.
    compute = jax.jit(jax.vmap(with_change, in_axes=(None, 0)))
    slopes, changes = compute(numbers, values)
    for path, change in jax.tree_util.tree_leaves_with_path(changes):
        bad = [kind for kind, one in zip(KINDS, np.asarray(change), strict=True) if not np.isfinite(one).all()]
        assert not bad, (jax.tree_util.keystr(path), bad)
    if draws(method):  # the value itself jumps where other particles are chosen
        return

    def misses(step):
        """By how much a change of the gradient is outside those to both sides, over the tolerance: the worst number and this.

        A filter that stops trusting a wheel bends sharply: the changes to both sides differ, and the derivative is between.
        """
        moved = lambda sign: jax.tree.map(lambda leaf, d: leaf + sign * step * d, numbers, direction)
        ahead, behind = compute(moved(1.0), values)[0], compute(moved(-1.0), values)[0]
        worst = {}
        for (path, slope), change, a, b, size in zip(
            jax.tree_util.tree_leaves_with_path(slopes),
            *map(jax.tree.leaves, (changes, ahead, behind, direction)),
            strict=True,
        ):
            size = np.abs(np.asarray(size)).max(initial=0.0)
            here, change = np.asarray(slope), np.asarray(change)
            sides = np.stack([np.asarray(a) - here, here - np.asarray(b)]) / step
            outside = np.maximum(np.maximum(sides.min(0) - change, change - sides.max(0)), 0.0)
            scale = (np.abs(change) + 1e-3 * np.abs(here).max(initial=0.0)) * size + 1e-6
            worst[jax.tree_util.keystr(path)] = (outside * size / (1e-4 * scale)).max(initial=0.0)
        return max(worst.items(), key=lambda one: one[1])

    # Where a filter amplifies its rounding, a longer difference is the better one.
    tried = {}
    for step in (1e-6, 1e-5):
        tried[step] = misses(step)
        if tried[step][1] <= 1.0:
            return
    raise AssertionError(tried)

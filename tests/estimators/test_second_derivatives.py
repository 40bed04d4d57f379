"""Second derivatives of every method of every quantity: finite on every kind of log, and those of the gradient."""

import equinox as eqx
import jax
import jax.numpy as jnp
import method_logs
import numpy as np
from test_every_method import QUANTITIES, a_sixth, draws, every, made, stacked

from jaxveh.estimators import kit

KINDS = ("gaps", "standing", "reverse", "falls silent")
FIRST, ROWS = 50, 60
"""In these rows channels fall silent and return."""


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

    def total(numbers, values):
        said = kit.follow_rows(eqx.combine(numbers, rest), time, values)
        shown = [getattr(said.mean, field) for field in module.SHOWN]
        return sum(jnp.mean(jnp.where(jnp.isfinite(one), one, 0.0) * jnp.cos(time)) for one in shown)

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
        """By how much changes of the gradient and differences of it differ, over the tolerance, of all numbers."""
        moved = lambda sign: jax.tree.map(lambda leaf, d: leaf + sign * step * d, numbers, direction)
        ahead, behind = compute(moved(1.0), values)[0], compute(moved(-1.0), values)[0]
        worst = {}
        for (path, slope), change, a, b, size in zip(
            jax.tree_util.tree_leaves_with_path(slopes),
            *map(jax.tree.leaves, (changes, ahead, behind, direction)),
            strict=True,
        ):
            size = np.abs(np.asarray(size)).max(initial=0.0)
            error = np.abs((np.asarray(a) - np.asarray(b)) / (2.0 * step) - np.asarray(change)) * size
            scale = (np.abs(np.asarray(change)) + 1e-3 * np.abs(np.asarray(slope)).max(initial=0.0)) * size + 1e-6
            worst[jax.tree_util.keystr(path)] = (error / (1e-4 * scale)).max(initial=0.0)
        return worst

    short = misses(1e-6)
    if max(short.values()) > 1.0:  # where a filter amplifies its rounding, a longer difference is the better one
        long = misses(1e-5)
        assert max(long.values()) <= 1.0, max(long.items(), key=lambda one: one[1])

"""A wrapper of friction methods that allows for another curve than the file's."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.estimators.friction.laws import LEAST_FRICTION, PlanarCar
from jaxveh.estimators.friction.tyre_doubt import AbstractTyreDoubt
from jaxveh.estimators.method import AbstractMethod

SHARES = (0.0, 1.0)
"""Shares of the brush model's curve in the copies."""


class CurveDoubt(AbstractTyreDoubt):
    """Two copies of a method in parallel: with the file's curves, and with the brush model's of the same stiffness and peak.

    Below the peak, a curve that saturates late on a road with high friction and one that saturates early on a road with less have
    equal forces: the file's curve alone can be sure of a friction that is wrong by a third. At the peak they agree. The answer is
    the geometric mean of the two. Its variance is the mean of theirs and the square of their distance from it. It is `known`
    where both are known and their ratio is at most 1 + `agree` (-). Of a tyre whose curve is known well, `inner` alone knows
    more.
    """

    inner: AbstractMethod
    agree: jax.Array = positive("-", default=0.1)

    def _tyres(self):
        return jnp.asarray(SHARES, self.agree.dtype)

    def _with(self, share) -> AbstractMethod:
        """The method with axles whose curves have this share of the brush model's."""

        def other(node):
            if isinstance(node, PlanarCar):
                return eqx.tree_at(lambda car: (car.front.brush, car.rear.brush), node, (share, share))
            return node

        return jax.tree.map(other, self.inner, is_leaf=lambda node: isinstance(node, PlanarCar))

    def _together(self, each):
        memory, said = each
        both = jnp.maximum(said.mean.friction, LEAST_FRICTION)
        friction = numerics.sqrt(both[0] * both[1])
        apart = 0.5 * jnp.abs(jnp.log(both[0] / both[1]))
        relative = numerics.sqrt(jnp.mean(jnp.square(said.std.friction / both)) + jnp.square(apart))
        known = jnp.all(said.known.friction) & (2.0 * apart <= jnp.log1p(self.agree))
        together = jax.tree.map(lambda leaf: leaf[0], said)
        of = lambda answers, value: answers._replace(friction=value)
        return memory, together._replace(
            mean=of(said.mean, friction), std=of(said.std, friction * relative), known=of(said.known, known),
            result=jnp.max(said.result),
        )  # fmt: skip

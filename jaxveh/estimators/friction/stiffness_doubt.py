"""A method of friction that takes its tyres' stiffness for what a file can know of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.estimators.friction.laws import SimilarCurve
from jaxveh.estimators.method import AbstractMethod, Answer
from jaxveh.tyres import LuGre

LEAST = 1e-3
"""The least friction whose logarithm is taken."""


class StiffnessDoubt(AbstractMethod):
    """A method three times side by side: with the file's stiffness, and with that less and more by the `spread` of its logarithm.

    A tyre that is stiffer in the file than on the car foretells more force than there is, as a slippery road does, and softer
    ones hide it. Only where the curve has bent do both answers come together. So the answer is that of the file's stiffness; its
    variance is the mean one of the three about it, where the method claims any; and it is `known` where all three know, and
    differ by a spread of less than `widest` (of the logarithm, what the method claims itself included).
    """

    inner: AbstractMethod
    spread: jax.Array = positive("-", default=0.2)
    widest: jax.Array = positive("-", default=0.15)

    @property
    def needs(self):
        return self.inner.needs

    def first(self, t, values):
        return self._together(jax.vmap(lambda factor: self._with(factor).first(t, values))(self._factors()))

    def next(self, memory, t, values):
        step = lambda factor, memory: self._with(factor).next(memory, t, values)
        return self._together(jax.vmap(step)(self._factors(), memory))

    def _factors(self):
        return jnp.exp(self.spread * jnp.asarray([-1.0, 0.0, 1.0], self.spread.dtype))

    def _with(self, factor) -> AbstractMethod:
        """The method of tyres that are so many times as stiff."""
        return _on_tyres(self.inner, factor)

    def _together(self, each: tuple[Any, Answer]) -> tuple[Any, Answer]:
        memory, said = each
        middle = jax.tree.map(lambda leaf: leaf[1], said)
        logs = jax.tree.map(lambda mu: jnp.log(jnp.maximum(mu, LEAST)), said.mean)
        apart = jax.tree.map(lambda x: jnp.mean(jnp.square(x - x[1])), logs)
        own = jax.tree.map(lambda std, mu: jnp.mean(jnp.square(std / jnp.maximum(mu, LEAST))), said.std, said.mean)
        wide = jax.tree.map(lambda apart, own: numerics.sqrt(apart + jnp.where(jnp.isnan(own), 0.0, own)), apart, own)
        known = jax.tree.map(lambda known, wide: jnp.all(known) & (wide < self.widest), said.known, wide)
        claims = jax.tree.map(
            lambda mu, wide, std: jnp.where(jnp.isnan(std), std, mu * wide), middle.mean, wide, middle.std
        )
        return memory, middle._replace(std=claims, known=known, result=jnp.max(said.result))


def _on_tyres(method: AbstractMethod, factor) -> AbstractMethod:
    is_tyre = lambda node: isinstance(node, SimilarCurve | LuGre)

    def stiffer(node):
        if isinstance(node, SimilarCurve):
            return eqx.tree_at(lambda curve: curve.stiffness, node, node.stiffness * factor)
        if isinstance(node, LuGre):
            both = (node.stiffness_x * factor, node.stiffness_y * factor)
            return eqx.tree_at(lambda law: (law.stiffness_x, law.stiffness_y), node, both)
        return node

    return jax.tree.map(stiffer, method, is_leaf=is_tyre)


def doubting(make: Callable[..., AbstractMethod]) -> Callable[..., StiffnessDoubt]:
    """What makes the method of a car's file, wary of the file's stiffness."""
    return lambda car: StiffnessDoubt(make(car))

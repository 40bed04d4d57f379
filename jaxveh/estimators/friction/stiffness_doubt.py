"""A method of friction that takes its tyres' stiffness for what a file can know of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.estimators.friction.laws import PlanarCar
from jaxveh.estimators.method import AbstractMethod, Answer
from jaxveh.tyres import LuGre

LEAST = 1e-3
"""The least friction whose logarithm is taken."""


class StiffnessDoubt(AbstractMethod):
    """A method five times side by side: with the file's stiffness, and with that of each axle less or more by the `spread` of its
    logarithm.

    A tyre that is stiffer in the file than on the car foretells more force than there is, as a slippery road does, and softer
    ones hide it. Only where the curve has bent do the answers come together. So the answer is that of the file's stiffness; its
    variance is the mean one of the five about it, where the method claims any; and it is `known` where all five know, and differ
    by a spread of less than `widest` (of the logarithm, what the method claims itself included).
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
        """(5, 2): of front and rear stiffness."""
        signs = ((0.0, 0.0), (1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0))
        return jnp.exp(self.spread * jnp.asarray(signs, self.spread.dtype))

    def _with(self, factor) -> AbstractMethod:
        """The method of tyres that are so many times as stiff."""
        return _on_tyres(self.inner, factor)

    def _together(self, each: tuple[Any, Answer]) -> tuple[Any, Answer]:
        memory, said = each
        middle = jax.tree.map(lambda leaf: leaf[0], said)
        logs = jax.tree.map(lambda mu: jnp.log(jnp.maximum(mu, LEAST)), said.mean)
        apart = jax.tree.map(lambda x: jnp.mean(jnp.square(x - x[0])), logs)
        own = jax.tree.map(lambda std, mu: jnp.mean(jnp.square(std / jnp.maximum(mu, LEAST))), said.std, said.mean)
        wide = jax.tree.map(lambda apart, own: numerics.sqrt(apart + jnp.where(jnp.isnan(own), 0.0, own)), apart, own)
        known = jax.tree.map(lambda known, wide: jnp.all(known) & (wide < self.widest), said.known, wide)
        claims = jax.tree.map(
            lambda mu, wide, std: jnp.where(jnp.isnan(std), std, mu * wide), middle.mean, wide, middle.std
        )
        return memory, middle._replace(std=claims, known=known, result=jnp.max(said.result))


def _on_tyres(method: AbstractMethod, factors) -> AbstractMethod:
    """The method of axles that are so many times as stiff, (2,) front and rear."""

    def stiffer(node):
        if isinstance(node, PlanarCar):
            both = (node.front.stiffness * factors[0], node.rear.stiffness * factors[1])
            return eqx.tree_at(lambda car: (car.front.stiffness, car.rear.stiffness), node, both)
        if isinstance(node, LuGre):
            # Its numbers are those of the front axle.
            both = (node.stiffness_x * factors[0], node.stiffness_y * factors[0])
            return eqx.tree_at(lambda law: (law.stiffness_x, law.stiffness_y), node, both)
        return node

    return jax.tree.map(stiffer, method, is_leaf=lambda node: isinstance(node, PlanarCar | LuGre))


def with_doubt(make: Callable[..., AbstractMethod]) -> Callable[..., StiffnessDoubt]:
    """What makes the method of a car's file, wary of the file's stiffness."""
    return lambda car: StiffnessDoubt(make(car))

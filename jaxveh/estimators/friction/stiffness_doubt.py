"""A wrapper of friction methods that allows for errors of the file's cornering stiffnesses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.estimators.friction.laws import PlanarCar
from jaxveh.estimators.friction.tyre_doubt import AbstractTyreDoubt
from jaxveh.estimators.method import AbstractMethod, Answer
from jaxveh.tyres import LuGre

LEAST = 1e-3
"""Lower limit of a friction before its logarithm is taken."""


class StiffnessDoubt(AbstractTyreDoubt):
    """Five copies of a method in parallel: with the file's stiffnesses, and with those of front and rear smaller or larger by the
    `spread` (-) of their logarithms.

    If the file's tyre is stiffer than the car's, the predicted force is too large, as on a slippery road; if it is softer, it
    hides low friction. The five answers only agree where the curve has bent. The answer is that with the file's stiffnesses. Its
    variance is the mean square of the five about it plus the mean of their own variances, if the method gives any. It is `known`
    where all five are known and the standard deviation of the logarithm is less than `widest` (-).
    """

    inner: AbstractMethod
    spread: jax.Array = positive("-", default=0.2)
    widest: jax.Array = positive("-", default=0.15)

    def _tyres(self):
        """Factors of front and rear stiffness, (5, 2)."""
        signs = ((0.0, 0.0), (1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0))
        return jnp.exp(self.spread * jnp.asarray(signs, self.spread.dtype))

    def _with(self, factor) -> AbstractMethod:
        """The method with tyres whose stiffness is multiplied by `factor`."""
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
    """The method with axles whose stiffnesses are multiplied by `factors` (2,), front and rear."""

    def stiffer(node):
        if isinstance(node, PlanarCar):
            both = (node.front.stiffness * factors[0], node.rear.stiffness * factors[1])
            return eqx.tree_at(lambda car: (car.front.stiffness, car.rear.stiffness), node, both)
        if isinstance(node, LuGre):
            # Its parameters are those of the front axle.
            both = (node.stiffness_x * factors[0], node.stiffness_y * factors[0])
            return eqx.tree_at(lambda law: (law.stiffness_x, law.stiffness_y), node, both)
        return node

    return jax.tree.map(stiffer, method, is_leaf=lambda node: isinstance(node, PlanarCar | LuGre))


def with_doubt(make: Callable[..., AbstractMethod]) -> Callable[..., StiffnessDoubt]:
    """A function that makes the method from a car's file, wrapped in `StiffnessDoubt`."""
    return lambda car: StiffnessDoubt(make(car))

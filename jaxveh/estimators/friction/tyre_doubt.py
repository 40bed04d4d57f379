"""The base of friction methods that run copies of a method with other tyres side by side."""

from __future__ import annotations

import abc
from typing import Any

import equinox as eqx
import jax

from jaxveh.estimators.method import AbstractMethod, Answer


class AbstractTyreDoubt(AbstractMethod):
    """Copies of the method `inner` in parallel, each with its own tyres; what they say together is the answer."""

    inner: eqx.AbstractVar[AbstractMethod]

    @property
    def needs(self):
        return self.inner.needs

    def first(self, t, values):
        return self._together(jax.vmap(lambda tyres: self._with(tyres).first(t, values))(self._tyres()))

    def next(self, memory, t, values):
        step = lambda tyres, memory: self._with(tyres).next(memory, t, values)
        return self._together(jax.vmap(step)(self._tyres(), memory))

    @abc.abstractmethod
    def _tyres(self) -> jax.Array:
        """What distinguishes the copies, along the first axis."""

    @abc.abstractmethod
    def _with(self, tyres: jax.Array) -> AbstractMethod:
        """The method with the tyres of one copy."""

    @abc.abstractmethod
    def _together(self, each: tuple[Any, Answer]) -> tuple[Any, Answer]:
        """The memories of all copies, and the one answer to theirs."""

"""Bijectors: the domain of each parameter. Random walks and optimisers work on the real line."""

from __future__ import annotations

import abc
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check, is_concrete


class AbstractBijector(eqx.Module):
    """A smooth monotone map from the real line to a parameter's domain, elementwise."""

    @abc.abstractmethod
    def forward(self, unconstrained) -> Any:
        """Return the physical value; same shape."""

    @abc.abstractmethod
    def inverse(self, physical) -> Any:
        """Return the unconstrained value; same shape. Raises `InputError` if a concrete value lies outside the domain."""

    @abc.abstractmethod
    def slope(self, physical) -> Any:
        """Return d physical / d unconstrained at a physical value, which converts standard deviations."""


class Real(AbstractBijector):
    """The whole real line: the identity."""

    def forward(self, unconstrained):
        return unconstrained

    def inverse(self, physical):
        return physical

    def slope(self, physical):
        return jnp.ones_like(physical)


class Positive(AbstractBijector):
    """The positive reals through the exponential: a standard deviation of 0.1 means ten per cent."""

    def forward(self, unconstrained):
        return jnp.exp(unconstrained)

    def inverse(self, physical):
        check("value", physical, lambda v: v > 0, "positive (its domain)")
        return jnp.log(physical)

    def slope(self, physical):
        return physical


class Interval(AbstractBijector):
    """An open interval (low, high) through the logistic function."""

    low: float = eqx.field(static=True)
    high: float = eqx.field(static=True)

    def __check_init__(self):
        if (is_concrete(self.low, self.high) and not np.isfinite(self.high - self.low)) or self.low >= self.high:
            raise InputError(f"Interval({self.low}, {self.high}): low must be less than high, and both finite.")

    def forward(self, unconstrained):
        return self.low + (self.high - self.low) / (1 + jnp.exp(-unconstrained))

    def inverse(self, physical):
        check("value", physical, lambda v: (v > self.low) & (v < self.high), f"inside ({self.low}, {self.high})")
        return jnp.log((physical - self.low) / (self.high - physical))

    def slope(self, physical):
        return (physical - self.low) * (self.high - physical) / (self.high - self.low)

"""Beliefs that contain the belief of another filter."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh.statespace import AbstractBelief


class AbstractOuterBelief(AbstractBelief):
    """A belief around that of another filter, `inside`; its time, inputs and count of rows are those of `inside`."""

    # No postponed annotations in this file: equinox does not recognise an AbstractVar in a string.
    inside: eqx.AbstractVar[Any]

    @property
    def t(self):
        """Time of the newest row, s."""
        return self.inside.t

    @property
    def u(self):
        """Inputs of the newest row."""
        return self.inside.u

    @property
    def count(self):
        """The number of rows so far, late ones included."""
        return self.inside.count


class AbstractTransparentBelief(AbstractOuterBelief):
    """A belief whose state and report are those of the belief `inside`."""

    @property
    def mean(self):
        """The state's mean."""
        return self.inside.mean

    @property
    def std(self):
        """The state's standard deviations."""
        return self.inside.std

    @property
    def covariance(self):
        """The covariance (n, n), in the order of the state's fields."""
        return self.inside.covariance

    def sample(self, key, draws):
        return self.inside.sample(key, draws)

    def moments(self, model):
        return self.inside.moments(model)


def either(condition: Any, a: Any, b: Any) -> Any:
    """The belief `a` where the condition is true, otherwise `b`."""
    return jax.tree.map(lambda x, y: jnp.where(condition, x, y), a, b)

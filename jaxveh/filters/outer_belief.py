"""Beliefs that hold another filter's belief."""

from typing import Any

import equinox as eqx

from jaxveh.statespace import AbstractBelief


class AbstractOuterBelief(AbstractBelief):
    """A belief around that of another filter, `inside`, whose time, inputs and count of rows are its own."""

    # No postponed annotations in this file: equinox does not see an AbstractVar in a string.
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
        """Rows so far, those that came late included."""
        return self.inside.count


class AbstractTransparentBelief(AbstractOuterBelief):
    """A belief that says of the state and of the report what the one `inside` says."""

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
        """(n, n) in the order of the state's fields."""
        return self.inside.covariance

    def sample(self, key, draws):
        return self.inside.sample(key, draws)

    def moments(self, model):
        return self.inside.moments(model)

"""The base of smoothers for particle filters."""

from __future__ import annotations

import abc
from typing import Any

import equinox as eqx

from jaxveh.filters.particle import AbstractParticleFilter
from jaxveh.filters.smoothing.smoothed import SmoothedEstimate
from jaxveh.statespace import Row, StateSpace


class AbstractPathSmoother(eqx.Module):
    """A smoother for particle filters: the `method` of `smooth`."""

    @abc.abstractmethod
    def check(self, filter: AbstractParticleFilter, model: StateSpace) -> None:
        """Raise `InputError` if the filter or the model does not meet this smoother's needs."""

    @abc.abstractmethod
    def smooth(self, filter: AbstractParticleFilter, model: StateSpace, rows: Row, key: Any) -> SmoothedEstimate:
        """Paths over rows with (T,) leaves, and the estimate of each row from them."""

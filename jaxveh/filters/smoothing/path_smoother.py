"""What a smoother of particle filters is."""

from __future__ import annotations

import abc
from typing import Any

import equinox as eqx

from jaxveh.filters.particle import AbstractParticleFilter
from jaxveh.filters.smoothing.smoothed import SmoothedEstimate
from jaxveh.statespace import Row, StateSpace


class AbstractPathSmoother(eqx.Module):
    """How a particle filter is smoothed: the `method` of `smooth`."""

    @abc.abstractmethod
    def check(self, filter: AbstractParticleFilter, model: StateSpace) -> None:
        """Raise `InputError` early, by name, where filter or model has not what this needs."""

    @abc.abstractmethod
    def smooth(self, filter: AbstractParticleFilter, model: StateSpace, rows: Row, key: Any) -> SmoothedEstimate:
        """Paths over rows with (T,) leaves, and what they say of each."""

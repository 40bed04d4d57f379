"""The common part of fits by a filter's likelihood."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from jaxveh._core.parameter import pick, put
from jaxveh.filters import AbstractFilter
from jaxveh.fitting.problem import AbstractProblem, in_units, on_line
from jaxveh.statespace import StateSpace


class AbstractFilterProblem(AbstractProblem):
    """A cost of leaves of a filter's model; its coordinates are the parameters (p,) on the real line of their bijectors.

    `rows` of the recordings; `counts` (recordings,): how many times each counts. `centre`, `spread` (p,): mean and standard
    deviation of the prior on that line; infinite for no prior.
    """

    filter: AbstractFilter
    model: StateSpace
    rows: Any
    counts: jax.Array
    centre: jax.Array
    spread: jax.Array

    def start(self):
        return on_line(self.chosen, pick(self.model, self.chosen))

    def line(self, z):
        return z

    def model_at(self, z):
        return put(self.model, self.chosen, in_units(self.chosen, z))

    def prior_cost(self, z):
        """The prior's negative logarithm at z, up to a constant: a scalar."""
        return 0.5 * jnp.sum(((z - self.centre) / self.spread) ** 2)

    def with_counts(self, counts):
        return dataclasses.replace(self, counts=counts)

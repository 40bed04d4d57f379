"""The belief of a Gaussian filter."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.filters.gaussian.rules import AbstractRule, spread_of, times
from jaxveh.statespace import AbstractBelief


class GaussianBelief(AbstractBelief):
    """A Gaussian over the state, in the order of the state's fields. `vector`: the mean (n,); `factor`: a factor F (n, n) of the
    covariance P = F F^T; `matrix`: P if the filter's form stores it, otherwise None."""

    vector: jax.Array
    factor: jax.Array
    matrix: jax.Array | None
    t: Any
    u: Any
    count: Any
    state_type: Any = eqx.field(static=True)
    rule: AbstractRule

    @property
    def mean(self):
        """The state's mean (parameters on the real line), as the state's NamedTuple."""
        return self.state_type(*self.vector)

    @property
    def std(self):
        """The state's standard deviations, as the state's NamedTuple."""
        return self.state_type(*jnp.sqrt(self.variances))

    @property
    def variances(self):
        """The variances (n,), in the order of the state's fields."""
        return jnp.diagonal(self.matrix) if self.matrix is not None else jnp.sum(jnp.square(self.factor), axis=-1)

    @property
    def covariance(self):
        """The covariance (n, n), in the order of the state's fields."""
        return self.matrix if self.matrix is not None else times(self.factor, self.factor.T)

    def inflate(self, factor: Any) -> GaussianBelief:
        """The belief with its covariance multiplied by `factor`."""
        matrix = None if self.matrix is None else factor * self.matrix
        root = numerics.sqrt(factor) * self.factor
        return GaussianBelief(self.vector, root, matrix, self.t, self.u, self.count, self.state_type, self.rule)

    def moments(self, model):
        if model.report_function is None:
            return self.mean, self.std
        names = []

        def shown(rows):
            report = model.report(self.t, self.state_type(*rows), self.u)
            names.append(type(report))
            return rows_of(report, rows)

        image = self.rule.image(shown, self.vector, self.factor)
        spread = spread_of(image)
        kind = names[0]
        # A weight may be negative, so that rounding can leave a variance a little below zero.
        return kind(*image.mean), kind(*numerics.sqrt(jnp.maximum(spread, 0.0)))


def rows_of(values, like):
    """The fields of a NamedTuple as rows (m, ...); a field that does not depend on the state is repeated."""
    return jnp.stack([jnp.broadcast_to(field, like.shape[1:]) for field in values])

"""A row's innovation and its variances, before the update."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxveh.filters.gaussian.filter import AbstractGaussianFilter, measurements_of, wrapped_innovation
from jaxveh.filters.gaussian.noises import covariance_in, law_at
from jaxveh.filters.gaussian.rules import spread_of
from jaxveh.statespace import Row, StateSpace


class Innovation(NamedTuple):
    """By channel, (m,): the innovation `error` (zero where missing), the variance `expected` of the prediction, the
    variance `noise` of the measurement noise, and whether the channel is `here`."""

    error: Any
    expected: Any
    noise: Any
    here: Any


def innovation(filter: AbstractGaussianFilter, model: StateSpace, belief: Any, row: Row) -> Innovation:
    """The innovation of `row` under the belief before it."""
    image = filter.observe(model, belief, row)
    given, here = measurements_of(model, row)
    error = given - image.mean
    own = filter.adapted_model(model, belief)
    law = law_at(own, row, lambda: belief.mean)
    noise = jnp.diagonal(covariance_in(law, model.channels, error.dtype))
    return Innovation(wrapped_innovation(model, error, here), spread_of(image), noise, here)

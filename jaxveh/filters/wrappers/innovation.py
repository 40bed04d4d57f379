"""What a row says against its prediction, before anything is believed of it."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxveh.filters.gaussian.filter import AbstractGaussianFilter, wrapped_innovation
from jaxveh.filters.gaussian.noises import covariance_in, law_at
from jaxveh.filters.gaussian.rules import spread_of
from jaxveh.statespace import Row, StateSpace, kit


class Innovation(NamedTuple):
    """By channel, (m,): the `error` of the prediction (zero where missing), the prediction's own variance `expected`, that of
    the measurement noise `noise`, and whether the channel is `here`."""

    error: Any
    expected: Any
    noise: Any
    here: Any


def innovation(filter: AbstractGaussianFilter, model: StateSpace, belief: Any, row: Row) -> Innovation:
    """What `row` says against the belief before it."""
    image = filter.observe(model, belief, row)
    measured, present = kit.presence(model, row)
    here = jnp.stack([present[name] for name in model.channels])
    error = jnp.stack([measured[name] for name in model.channels]) - image.mean
    own = filter.adapted_model(model, belief)
    law = law_at(own, row, lambda: belief.mean)
    noise = jnp.diagonal(covariance_in(law, model.channels, error.dtype))
    return Innovation(wrapped_innovation(model, error, here), spread_of(image), noise, here)

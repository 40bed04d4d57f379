"""Covariances and factors of noise laws, in the order of given fields."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp

from jaxveh.filters.gaussian.rules import times
from jaxveh.statespace import AbstractNoise, Gaussian, Row, StateDependent, StateSpace


def law_at(model: StateSpace, row: Row, mean: Callable[[], Any]) -> AbstractNoise:
    """The law of the measurement noise in a row; if it depends on the state, it is taken at the state `mean()`."""
    if isinstance(model.measurement_noise, StateDependent):
        return model.measurement_law(row.t, mean(), row.u)
    return model.measurement_noise


def covariance_in(law: AbstractNoise, fields: tuple[str, ...], dtype) -> Any:
    """A law's covariance in the order of `fields`, with zeros for fields without noise: (n, n)."""
    if isinstance(law, Gaussian):
        std = law.std._asdict()
        variances = jnp.stack([std[name] ** 2 if name in std else jnp.zeros((), dtype) for name in fields])
        return jnp.where(jnp.eye(len(fields), dtype=bool), variances[:, None], jnp.zeros((), dtype))
    embed = _embedding_matrix(law, fields, dtype)
    return times(times(embed, law.covariance()), embed.T)


def factor_in(law: AbstractNoise, fields: tuple[str, ...], dtype) -> Any:
    """A factor N (n, q) of the law's covariance N N^T, with one column for each of the q fields with noise."""
    embed = _embedding_matrix(law, fields, dtype)
    if isinstance(law, Gaussian):
        return embed * jnp.stack(law.std)
    return times(embed, law.factor())


def _embedding_matrix(law: AbstractNoise, fields: tuple[str, ...], dtype) -> Any:
    return jnp.asarray([[name == other for other in law.names] for name in fields], dtype)

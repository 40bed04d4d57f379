"""The result of a filter's step: the belief, and information about the row."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError
from jaxveh.statespace.model import StateSpace


class Info(NamedTuple):
    """Information about one step of a filter.

    `log_likelihood`: the increment, log p(y_k | y_0..k-1). `innovation`, `innovation_std`: measurement less prediction and
    its predicted standard deviation, NamedTuples by channel, NaN where missing. `nis`: normalised innovation squared over the
    channels present (Gaussian filters; expected value: their number). `ess`: effective sample size after the measurement
    (particle filters, otherwise NaN). `result`: code, see `jaxveh.Result`. `whitened`, `log_scale`: innovations decorrelated
    in the order of the channels and the logarithm of the divisor of each, zero where missing (Gaussian filters, otherwise
    None): the sum of `-0.5 whitened^2 - log_scale - 0.5 log(2 pi)` over the channels present is the log-likelihood. `remark`
    (particle filters, otherwise None): the code of a warning with which the filter went on, otherwise zero.
    """

    log_likelihood: Any
    innovation: Any
    innovation_std: Any
    nis: Any
    ess: Any
    result: Any
    whitened: Any = None
    log_scale: Any = None
    remark: Any = None


class AbstractBelief(eqx.Module):
    """A filter's belief after a row: all that the next step needs, including its `t`, `u` and the `count` of rows."""

    @abc.abstractmethod
    def moments(self, model: StateSpace) -> tuple[Any, Any]:
        """Mean and standard deviation of `model.report` under the belief: two NamedTuples of scalars."""

    @property
    def mean(self) -> Any:
        """The state's mean, the state's NamedTuple (parameters on the real line)."""
        raise self._lacks("mean")

    @property
    def covariance(self) -> Any:
        """The state's covariance (n, n) in the order of the state's fields."""
        raise self._lacks("covariance")

    def sample(self, key, draws: int) -> Any:
        """Draws as the state's NamedTuple with (draws,) in each field; from a Gaussian unless a subclass has another law."""
        mean = jnp.stack(self.mean)
        white = numerics.normal(key, (mean.shape[0], draws), mean.dtype)
        return type(self.mean)(*(mean[:, None] + numerics.cholesky(self.covariance) @ white))

    def _lacks(self, what: str) -> InputError:
        return InputError(f"{type(self).__name__} has no {what} of the state: take a filter whose belief has one.")

"""The scatter of a particle filter's log-likelihood from key to key."""

from __future__ import annotations

import math
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np

from jaxveh._core.errors import InputError, check_flags, check_key, check_positive, check_whole
from jaxveh._core.parameter import strong
from jaxveh._core.progress import Progress, silent
from jaxveh._core.recording import Recording
from jaxveh.filters.calibration.batches import in_batches
from jaxveh.filters.calibration.monte_carlo import raise_failed
from jaxveh.statespace import AbstractFilter, StateSpace, kit, scan

GOOD_STD = (1.0, 1.7)
"""The range in which the standard deviation of the log-likelihood should lie for particle marginal Metropolis-Hastings
(A. Doucet, M. Pitt, G. Deligiannidis & R. Kohn 2015): about 1.0 where the chain with the exact likelihood would mix
well, about 1.7 where it would not."""


class LogLikelihoodSpread(NamedTuple):
    """Log-likelihoods (R,) of one recording from R keys, with their `mean`, their `std` and its `standard_error` (that
    of a Gaussian sample).

    `log_mean_likelihood`: the logarithm of the mean of the likelihoods, which are unbiased. The log-likelihoods
    themselves are on average about std^2 / 2 too low.
    """

    log_likelihoods: np.ndarray
    mean: float
    std: float
    standard_error: float
    log_mean_likelihood: float

    @property
    def good_for_pmmh(self) -> bool:
        """Whether std is from 1.0 to 1.7 (`GOOD_STD`): a larger one wastes iterations, a smaller one particles."""
        return GOOD_STD[0] <= self.std <= GOOD_STD[1]

    def particles_for(self, particles: int, std: float = 1.2) -> int:
        """The number of particles that would give about this `std`, if `particles` gave `self.std`: the variance goes as 1 / N.

        It holds for a `std` well below 2 or 3; above that, go in several steps. 1.2 is a good choice if it is unknown
        how the chain mixes.
        """
        check_positive("std", std)
        check_positive("particles", particles)
        return max(2, math.ceil(particles * (self.std / std) ** 2))


def log_likelihood_spread(
    filter: AbstractFilter,
    model: StateSpace,
    recording: Recording,
    key,
    runs: int = 50,
    *,
    batch: int | None = None,
    progress: Progress = silent,
    throw: bool = True,
) -> LogLikelihoodSpread:
    """The scatter over keys of a filter's log-likelihood of one recording.

    `batch`, `progress` and `throw` as in `monte_carlo`. For particle Metropolis-Hastings, compute it near the
    posterior's mean. `runs`: at least two (50 give the standard deviation to 10 %).

    **Raises** `InputError` where the arguments do not agree or the filter draws nothing; `FilterError` where runs fail.
    """
    check_flags(throw=throw)
    check_whole("runs", runs, 2)
    check_key("log_likelihood_spread", key)
    kit.check_told(filter, model)
    model = strong(model)
    filter.check(model)
    rows = model.rows(recording)
    found, results = in_batches(
        lambda keys: _runs(filter, model, rows, keys), key, runs, batch, progress, "log-likelihoods"
    )
    if throw:
        raise_failed(filter, results)
    if np.ptp(found) == 0:
        raise InputError(f"log_likelihood_spread: {type(filter).__name__} has the same log-likelihood for every key.")
    std, top = float(np.std(found, ddof=1)), found.max()
    log_mean = float(top + np.log(np.mean(np.exp(found - top))))
    return LogLikelihoodSpread(found, float(np.mean(found)), std, std / math.sqrt(2 * (runs - 1)), log_mean)


@eqx.filter_jit
def _runs(filter: AbstractFilter, model: StateSpace, rows, keys):
    def one(key):
        estimate = scan(filter, model, rows, key)
        return estimate.log_likelihood, estimate.result

    return jax.vmap(one)(keys)

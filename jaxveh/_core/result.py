"""Result codes: a failure is a value that is passed on with the results through jit, vmap and scan."""

from __future__ import annotations

from enum import IntEnum

import jax.numpy as jnp


class Result(IntEnum):
    """The outcome of a computation; 0 is success, and the first failure of a run is kept.

    `lookahead_misled` and `transport_not_converged` are remarks about a row (`filters.Info.remark`), after which a run continues.
    """

    successful = 0
    not_positive_definite = 1
    all_particles_dead = 2
    non_finite_input = 3
    non_finite_state = 4
    not_converged = 5
    too_stiff = 6
    measurement_too_late = 7
    lookahead_misled = 8
    transport_not_converged = 9
    measurement_too_far = 10

    @property
    def message(self) -> str:
        """The problem and the remedy, in words."""
        return _MESSAGES[self]


_MESSAGES = {
    Result.successful: "successful",
    Result.not_positive_definite: "a covariance lost positive definiteness (give each state process noise, unless others move "
    "it; raise process noise or the prior's spread, or use float64)",
    Result.all_particles_dead: "every particle has zero weight: no particle explains the measurement (widen measurement "
    "noise or the prior, use a heavy-tailed noise law, or more particles)",
    Result.non_finite_input: "an input or a measurement is infinite, or an input is NaN (fill gaps with recording.fill)",
    Result.non_finite_state: "the state is no longer finite: the model diverged (take more steps between rows, such as "
    "state_space(..., steps=4), and check parameters and signs)",
    Result.not_converged: "the solver stopped before its tolerance was met (use more steps, or better start values)",
    Result.too_stiff: "the step is too long for the model's fastest pole (shorten the step or choose an implicit solver)",
    Result.measurement_too_late: "a measurement is older than the rows that are kept, and was not used (increase depth)",
    Result.lookahead_misled: "the measurement contradicts the lookahead: weights vary at least twice as much as "
    "without it, and the log-likelihood is low (look ahead with the process noise, PredictiveLikelihood, or not at all, "
    "ParticleFilter)",
    Result.transport_not_converged: "the transport plan did not converge, and particles were resampled systematically "
    "instead (use more iterations, or a larger epsilon)",
    Result.measurement_too_far: "a measurement is so far from its prediction that their log-likelihood is not finite (look for a "
    "spike or another unit in it: NaN is missing, and filters.Gated leaves out what does not fit; float64 reaches further)",
}


def code(result: Result):
    """Return the int32 scalar of a result inside jit."""
    return jnp.int32(int(result))


def with_reason(result, failed, reason: Result):
    """The code `result`, or that of `reason` where `failed` and nothing went wrong before."""
    return jnp.where((result == 0) & failed, code(reason), result)


def first_failure(codes):
    """Return the first non-zero code along axis 0 and its index (-1 if all succeeded); codes: (T,) int32."""
    failed = codes != 0
    index = jnp.argmax(failed)
    any_failed = jnp.any(failed)
    return jnp.where(any_failed, codes[index], 0), jnp.where(any_failed, index, -1)

"""The common part of fits to recordings: the recordings, and the prior of the fitted parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError
from jaxveh._core.names import as_several
from jaxveh._core.parameter import Parameter, prior_spread
from jaxveh._core.recording import Recording, check_recording


def as_list(recordings: Recording | Sequence[Recording]) -> list[Recording]:
    """One recording or several, as a list; raises `InputError` for an empty list."""
    recordings = [recordings] if isinstance(recordings, Recording) else list(as_several(recordings, "recordings"))
    for recording in recordings:
        check_recording("recordings", recording)
    if not recordings:
        raise InputError("recordings: empty; give at least one recording.")
    return recordings


def spread_on_line(parameters: tuple[Parameter, ...], values, prior: float | Mapping[str, float] | None) -> jax.Array:
    """The prior's standard deviations (p,) on the real line of each parameter's bijector, infinite without a prior."""
    if prior is None:
        return jnp.full((len(parameters),), jnp.inf, jnp.result_type(*values))
    return jnp.stack(prior_spread(parameters, values, prior))

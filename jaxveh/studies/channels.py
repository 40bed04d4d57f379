"""The channels that an estimator reads from a recording, under its own names, with inputs known in every row."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import jax
import jax.numpy as jnp

from jaxveh._core.recording import Recording
from jaxveh.io import kit


def renamed_channels(recording: Recording, names: Mapping[str, Any]) -> Recording:
    """The recording with further channels. `names`: the estimator's name of a channel to its name in the recording.

    **Raises** `InputError` for a channel that is not in the recording.
    """
    for name in names.values():
        kit.check_known("channels", "recorded channel", str(name), recording.names)
    return recording.replace(**{own: recording[name] for own, name in names.items()})


def hold(recording: Recording, names: Iterable[str]) -> Recording:
    """The recording with these channels held from row to row, as far as it has them: each row has the last measured value, and
    the rows before the first measurement have the first one."""
    return recording.replace(**{name: _last_known(recording[name]) for name in names if name in recording})


def _last_known(values: Any) -> Any:
    """(T,) without gaps; NaN if there is no measurement at all."""
    values = jnp.asarray(values)
    known = ~jnp.isnan(values)
    last = jax.lax.cummax(jnp.where(known, jnp.arange(len(values)), -1))
    return values[jnp.where(last < 0, jnp.argmax(known), last)]

"""What an estimator reads of a recording: channels by its own names, and inputs known in every row."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import jax
import jax.numpy as jnp

from jaxveh._core.recording import Recording
from jaxveh.io import kit


def renamed_channels(recording: Recording, names: Mapping[str, Any]) -> Recording:
    """The recording with further channels: what the estimator calls a channel, and which of the recording it is.

    **Raises** `InputError` for one that is not there.
    """
    for name in names.values():
        kit.check_known("channels", "recorded channel", str(name), recording.names)
    return recording.replace(**{own: recording[name] for own, name in names.items()})


def hold(recording: Recording, names: Iterable[str]) -> Recording:
    """Those of the channels that are there, each row with the last value that a device has said, NaN no more; before the first
    it is the first."""
    return recording.replace(**{name: _last_known(recording[name]) for name in names if name in recording})


def _last_known(values: Any) -> Any:
    """(T,) without gaps; NaN where nothing is known at all."""
    values = jnp.asarray(values)
    known = ~jnp.isnan(values)
    last = jax.lax.cummax(jnp.where(known, jnp.arange(len(values)), -1))
    return values[jnp.where(last < 0, jnp.argmax(known), last)]

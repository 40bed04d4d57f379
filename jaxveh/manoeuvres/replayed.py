"""The replay of a recording's inputs."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, is_concrete
from jaxveh._core.names import as_names, check_names, record_type
from jaxveh._core.recording import Recording, check_recording
from jaxveh.manoeuvres.base import AbstractManoeuvre
from jaxveh.vehicles import kit


class Replay(AbstractManoeuvre):
    """Recorded channels as inputs, linear between the rows and constant beyond the ends; t is the time from the first row.

    `time` and each of `values` are (T,); `names` are the fields of the inputs.
    """

    time: jax.Array
    values: tuple[jax.Array, ...]
    names: tuple[str, ...] = eqx.field(static=True)
    duration: float = eqx.field(static=True)

    def inputs(self, t: Any) -> Any:
        t = jnp.asarray(t, self.time.dtype)
        after = jnp.clip(jnp.searchsorted(self.time, t, side="right"), 1, self.time.shape[0] - 1)
        start, end = self.time[after - 1], self.time[after]
        share = jnp.clip((t - start) / (end - start), 0.0, 1.0)
        between = [v[after - 1] + share * (v[after] - v[after - 1]) for v in self.values]
        return record_type("RecordedInputs", self.names)(*between)


def replay(recording: Recording, channels: tuple[str, ...] | None = None) -> Replay:
    """Replay the inputs of a recording: `channels`, by default `steer`, `v_x` and, if the recording has them, `a_x`,
    and `steer_rear` and `steer_fl` ... of cars that also steer other wheels.

    **Raises** `InputError` for a missing channel, fewer than two rows, or a channel that is not finite throughout (fill
    its gaps first; checked outside jit).
    """
    check_recording("replay", recording)
    if channels is None:
        more = ("a_x", *(name for name in kit.STEER_UNITS if name != "steer"))
        channels = ("steer", "v_x", *(name for name in more if name in recording))
    names = as_names(channels, "replay: channels")
    check_names("replay", names, recording.names)
    if len(recording) < 2:
        raise InputError(f"replay: the recording has {len(recording)} row(s); at least 2 are needed.")
    if not is_concrete(recording.time):
        raise InputError("replay: the recording's time is traced; make the replay outside jit (it sets the duration).")
    for name in names:
        _check_finite(recording, name)
    values = tuple(jnp.asarray(recording[name]) for name in names)
    stamps = np.asarray(recording.time, dtype=np.float64)
    # The time of the first row is subtracted before rounding, so that float32 resolves the steps of a long recording.
    time = jnp.asarray(stamps - stamps[0], values[0].dtype)
    return Replay(duration=float(stamps[-1] - stamps[0]), time=time, values=values, names=names)


def _check_finite(recording: Recording, name: str) -> None:
    values = recording[name]
    if not is_concrete(values):
        return
    finite = np.isfinite(np.asarray(values))
    if not finite.all():
        first = int(np.argmin(finite))
        raise InputError(
            f"replay: {name} = {float(values[first])} at t = {recording.time[first]} s (row {first}), and not finite in "
            f'{int((~finite).sum())} rows: every input must be known. Fill it first: recording.fill("{name}", "linear").'
        )

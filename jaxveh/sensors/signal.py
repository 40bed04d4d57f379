"""The errors of one measured channel, from the physical value to the number that is sent."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError
from jaxveh._core.names import check_names
from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh.sensors.randomness import gauss_markov, subkey, walk, white

_NOISE, _DRIFT = 0, 1


class Signal(eqx.Module):
    """The errors of one channel: it sends `(1 + scale) value + bias + drift + noise`, limited and rounded.

    Values are in the channel's unit unless stated otherwise; None means no such error. The model is that of a gyroscope or
    accelerometer in Groves, Principles of GNSS, Inertial and Multisensor Integrated Navigation Systems, 2nd ed., chapter 4.

    - `noise`: standard deviation of each sample, white. For a density d (unit per root Hz) it is `d sqrt(rate / 2)`.
    - `bias`: a constant offset. `scale`: relative error of the gain.
    - `drift` (unit per root second): a random walk from 0 at the first sample, with variance `drift^2 t`. With
      `drift_time` (s) it is a Gauss-Markov process, whose standard deviation tends to `drift sqrt(drift_time / 2)`.
    - `saturation`: the largest absolute value that the channel can send. `quantisation`: the step to which values are
      rounded; the largest value is then the largest multiple within `saturation`. The derivative of a rounded number
      with respect to everything but the step is zero.

    **Raises** `InputError` for a number out of range, or a `drift_time` without `drift`.
    """

    noise: jax.Array | None = positive("unit", default=None)
    bias: jax.Array = parameter("unit", default=0.0)
    scale: jax.Array = parameter("-", scale=0.01, default=0.0)
    drift: jax.Array | None = positive("unit/sqrt(s)", default=None)
    drift_time: jax.Array | None = positive("s", default=None)
    saturation: jax.Array | None = positive("unit", default=None)
    quantisation: jax.Array | None = positive("unit", default=None)

    def __check_init__(self):
        check_parameters(self)
        if self.drift_time is not None and self.drift is None:
            raise InputError(f"Signal.drift_time = {self.drift_time}: needs drift, the rate of the random walk.")

    def apply(self, value: jax.Array, period: float, key: Any = None) -> jax.Array:
        """The values that are sent for true values (n,), `period` (s) apart; without a key there are no random errors."""
        said = (1 + self.scale) * value + self.bias
        if self.drift is not None:
            said = said + self._drift(subkey(key, _DRIFT), value.shape[0], period, value.dtype)
        if self.noise is not None:
            said = said + self.noise * white(subkey(key, _NOISE), value.shape[0], value.dtype)
        if self.quantisation is not None:
            return self.quantisation * self._limit(jnp.round(said / self.quantisation), self.quantisation)
        return self._limit(said, None)

    def _limit(self, said, step):
        """The values limited to the saturation, if there is one; with a `step`, numbers of steps limited to the whole
        steps within it."""
        if self.saturation is None:
            return said
        most = self.saturation
        if step is not None:
            # By rounding, a ratio that should be a whole number may lie just below it.
            most = jnp.floor(self.saturation / step * (1 + 4 * jnp.finfo(said.dtype).eps))
        return jnp.clip(said, -most, most)

    def _drift(self, key, n, period, dtype):
        if self.drift_time is None:
            return walk(key, n, self.drift, period, dtype)
        return gauss_markov(key, n, self.drift, self.drift_time, period, dtype)


def as_signals(signals) -> dict[str, Signal]:
    """A mapping from channel to `Signal`, made from such a mapping or from names, whose channels then have no errors."""
    if isinstance(signals, str):
        signals = (signals,)
    if isinstance(signals, Mapping):
        return dict(signals)
    if isinstance(signals, Iterable):
        return {name: Signal() for name in signals}
    raise InputError(f"signals = {signals!r}: must be a mapping from channel to Signal, or names of channels.")


def check_signals(name: str, signals: Mapping[str, Signal], allowed: Iterable[str]) -> None:
    """Raise `InputError` unless there is a channel, all channels are `allowed`, and each has a `Signal`."""
    if not signals:
        raise InputError(f"{name} is empty: name at least one channel; there are: {', '.join(allowed)}.")
    check_names(name, signals, allowed)
    for channel, signal in signals.items():
        if not isinstance(signal, Signal):
            raise InputError(f"{name}: {channel} = {signal!r}: must be a Signal(noise=..., bias=...).")


def apply_all(signals: Mapping[str, Signal], order: Iterable[str], values: Mapping, period: float, key: Any) -> dict:
    """The values that are sent for the true values, by channel, in this order; each channel has a key by its name."""
    return {
        channel: signals[channel].apply(values[channel], period, subkey(key, channel))
        for channel in order
        if channel in signals
    }

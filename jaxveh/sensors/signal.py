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
    """What one channel makes of its true value: `(1 + scale) value + bias + drift + noise`, limited and rounded.

    In the channel's unit unless said otherwise; an error that is absent is None. A gyroscope's or accelerometer's
    model as in Groves, Principles of GNSS, Inertial and Multisensor Integrated Navigation Systems, 2nd ed., chapter 4.

    - `noise`: standard deviation of each sample, white. A density d (unit per root Hz) is `d sqrt(rate / 2)`.
    - `bias`: constant. `scale`: relative error of the gain.
    - `drift` (unit per root second): the bias walks from 0 at the first sample, with variance `drift^2 t`. With
      `drift_time` (s) it is a Gauss-Markov process, whose standard deviation ends at `drift sqrt(drift_time / 2)`.
    - `saturation`: the most the channel can say, of either sign. `quantisation`: its step; the most is then the largest
      multiple within `saturation`. The derivative of a rounded number with respect to everything but the step is zero.

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
            raise InputError(f"Signal.drift_time = {self.drift_time}: needs drift, the rate at which the bias walks.")

    def apply(self, value: jax.Array, period: float, key: Any = None) -> jax.Array:
        """What is sent of the true values (n,), `period` s apart; without a key nothing is random."""
        said = (1 + self.scale) * value + self.bias
        if self.drift is not None:
            said = said + self._drift(subkey(key, _DRIFT), value.shape[0], period, value.dtype)
        if self.noise is not None:
            said = said + self.noise * white(subkey(key, _NOISE), value.shape[0], value.dtype)
        if self.quantisation is not None:
            return self.quantisation * self._limit(jnp.round(said / self.quantisation), self.quantisation)
        return self._limit(said, None)

    def _limit(self, said, step):
        """Within the saturation, where there is one; of numbers of steps, within as many whole ones as are in it."""
        if self.saturation is None:
            return said
        most = self.saturation
        if step is not None:
            # A ratio of decimal numbers that should be whole may lie just below.
            most = jnp.floor(self.saturation / step * (1 + 4 * jnp.finfo(said.dtype).eps))
        return jnp.clip(said, -most, most)

    def _drift(self, key, n, period, dtype):
        if self.drift_time is None:
            return walk(key, n, self.drift, period, dtype)
        return gauss_markov(key, n, self.drift, self.drift_time, period, dtype)


def as_signals(signals) -> dict[str, Signal]:
    """A mapping from channel to `Signal`, or names alone, whose channels then have no errors."""
    if isinstance(signals, str):
        signals = (signals,)
    if isinstance(signals, Mapping):
        return dict(signals)
    if isinstance(signals, Iterable):
        return {name: Signal() for name in signals}
    raise InputError(f"signals = {signals!r}: must be a mapping from channel to Signal, or names of channels.")


def check_signals(name: str, signals: Mapping[str, Signal], allowed: Iterable[str]) -> None:
    """Raise unless there is a channel, all are among `allowed`, and each has a `Signal`."""
    if not signals:
        raise InputError(f"{name} is empty: name at least one channel; there are: {', '.join(allowed)}.")
    check_names(name, signals, allowed)
    for channel, signal in signals.items():
        if not isinstance(signal, Signal):
            raise InputError(f"{name}: {channel} = {signal!r}: must be a Signal(noise=..., bias=...).")


def apply_all(signals: Mapping[str, Signal], order: Iterable[str], values: Mapping, period: float, key: Any) -> dict:
    """What is sent of the true values by channel, in this order; the key's part of a channel is by its name."""
    return {
        channel: signals[channel].apply(values[channel], period, subkey(key, channel))
        for channel in order
        if channel in signals
    }

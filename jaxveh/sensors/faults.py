"""Faults of devices: each wraps a device and acts on its samples (after delay, limits and rounding)."""

# No postponed annotations here: equinox does not recognise an AbstractVar in a string.

import abc
from collections.abc import Iterable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.contracts import contract
from jaxveh._core.errors import InputError, check, check_kind, is_concrete
from jaxveh._core.names import as_names, check_names
from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh.sensors.device import AbstractDevice, check_samples, name_of
from jaxveh.sensors.randomness import subkey
from jaxveh.sensors.spans import as_spans, check_spans, inside, since
from jaxveh.sensors.wrapper import AbstractDeviceWrapper, check_device

Channels = dict[str, jax.Array]


def _names(channel) -> tuple[str, ...]:
    check_kind("channel", channel, Iterable, "A channel's name, or several.")
    return as_names(channel)


def _names_or_none(channel) -> tuple[str, ...] | None:
    return None if channel is None else _names(channel)


def _spoilt(who: str, fault: Any, given: tuple, said: Any) -> None:
    """Raise `InputError` unless a fault returned the channels that it was given."""
    check_samples(who, tuple(given[1]), given[0].shape, said)


class AbstractFault(AbstractDeviceWrapper):
    """A fault in some of a device's channels (None: in all); times are the device's sample times, s."""

    channel: eqx.AbstractVar[tuple[str, ...] | None]
    _contract = contract(spoil=_spoilt)

    def __check_init__(self):
        check_device(self)
        check_names(f"{name_of(self)}.channel", self.channel or (), self.device.channels)
        check_parameters(self)

    @abc.abstractmethod
    def spoil(self, times: jax.Array, said: Channels, key: Any) -> Channels:
        """The faulty channels with their fault, a mapping to (n,) arrays."""

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels of the inner device."""
        return self.device.channels

    @property
    def units(self) -> dict[str, str]:
        """The units of the inner device's channels."""
        return self.device.units

    def say(self, times: jax.Array, outputs: Mapping[str, jax.Array], key: Any) -> Channels:
        """The samples of the inner device, with the fault in the faulty channels."""
        said = self.device.say(times, outputs, key)
        faulty = self.channels if self.channel is None else self.channel
        return said | self.spoil(times, {name: said[name] for name in faulty}, self.own_key(key))


class BiasStep(AbstractFault):
    """From `at` (s) on, `size` (the channel's unit) is added to `channel` (a name or several)."""

    device: AbstractDevice
    channel: tuple[str, ...] = eqx.field(static=True, converter=_names)
    at: jax.Array = parameter("s")
    size: jax.Array = parameter("unit")

    def spoil(self, times: jax.Array, said: Channels, key: Any) -> Channels:
        """The channels with the step."""
        step = jnp.where(since(times, self.at), self.size, 0.0)
        return {name: value + step for name, value in said.items()}


class Stuck(AbstractFault):
    """From `start` to before `end` (s; None: for good), `channel` (a name or several) repeats its last value before `start`.

    A channel without a sample before `start` is stuck at its first value. A channel whose last sample was NaN stays NaN.

    **Raises** `InputError` for an end that is not after the start.
    """

    device: AbstractDevice
    channel: tuple[str, ...] = eqx.field(static=True, converter=_names)
    start: jax.Array = parameter("s")
    end: jax.Array | None = parameter("s", default=None)

    def __check_init__(self):
        if self.end is not None and is_concrete(self.start):
            check("Stuck.end", self.end, lambda end: end > self.start, f"after start = {self.start} s")

    def spoil(self, times: jax.Array, said: Channels, key: Any) -> Channels:
        """The channels, stuck."""
        late = since(times, self.start)
        stuck = late if self.end is None else late & ~since(times, self.end)
        last = jnp.maximum(jnp.sum(~late) - 1, 0)
        return {name: jnp.where(stuck, value[last], value) for name, value in said.items()}


class Spikes(AbstractFault):
    """Each sample of `channel` (a name or several) is off by `size`, of random sign, with `probability`.

    Each channel has its own spikes. Without a key there are none.

    **Raises** `InputError` for a probability outside 0 to 1 or a size that is not positive.
    """

    device: AbstractDevice
    channel: tuple[str, ...] = eqx.field(static=True, converter=_names)
    probability: jax.Array = parameter("-")
    size: jax.Array = positive("unit")

    def __check_init__(self):
        check("Spikes.probability", self.probability, lambda p: (p >= 0) & (p <= 1), "between 0 and 1")

    def spoil(self, times: jax.Array, said: Channels, key: Any) -> Channels:
        """The channels with their spikes."""
        if key is None:
            return said
        return {name: value + self._spikes(subkey(key, name), value) for name, value in said.items()}

    def _spikes(self, key: Any, like: jax.Array) -> jax.Array:
        u = numerics.uniform(key, like.shape, like.dtype)
        # The sign depends on the half of the probability into which the number falls.
        spike = jnp.where(u < 0.5 * self.probability, -self.size, self.size)
        return jnp.where(u < self.probability, spike, 0.0)


class Dropout(AbstractFault):
    """`channel` (a name, several, or None for all) has no samples (NaN) in `spans`, and loses each sample with `probability`.

    `spans`: ((start, end), ...) in s. The channels are lost together, as when a message is lost; for gaps at different
    times, wrap it once more. Without a key, only the spans have gaps.

    **Raises** `InputError` for reversed spans, a probability outside 0 to 1, or neither of the two.
    """

    device: AbstractDevice
    channel: tuple[str, ...] | None = eqx.field(static=True, converter=_names_or_none, default=None)
    spans: tuple[tuple[float, float], ...] = eqx.field(static=True, converter=as_spans, default=())
    probability: jax.Array | None = parameter("-", default=None)

    def __check_init__(self):
        check_spans("Dropout.spans", self.spans)
        if self.probability is not None:
            check("Dropout.probability", self.probability, lambda p: (p >= 0) & (p <= 1), "between 0 and 1")
        if not self.spans and self.probability is None:
            raise InputError("Dropout: has neither spans nor a probability; give at least one of them.")

    def spoil(self, times: jax.Array, said: Channels, key: Any) -> Channels:
        """The channels with their gaps."""
        silent = inside(times, self.spans)
        if self.probability is not None and key is not None:
            silent = silent | (numerics.uniform(key, times.shape, times.dtype) < self.probability)
        return {name: jnp.where(silent, jnp.nan, value) for name, value in said.items()}

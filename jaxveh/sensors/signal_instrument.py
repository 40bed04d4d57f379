"""Devices that send some of their known channels, each with its own errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax

from jaxveh._core.parameter import check_parameters
from jaxveh.sensors.device import AbstractInstrument, name_of
from jaxveh.sensors.signal import Signal, apply_all, as_signals, check_signals


class AbstractSignalInstrument(AbstractInstrument):
    """A device that sends the channels of `signals`, a mapping to their errors, from the `known` channels of its class.

    **Raises** `InputError` for unknown channels or numbers out of range.
    """

    known: eqx.AbstractClassVar[dict[str, str]]
    """Units of the channels that the device can send, by name."""
    signals: dict[str, Signal] = eqx.field(converter=as_signals)

    def __check_init__(self):
        check_signals(f"{name_of(self)}.signals", self.signals, self.known)
        check_parameters(self)

    @property
    def channels(self) -> tuple[str, ...]:
        """The measured channels, in the order of `known`."""
        return tuple(name for name in self.known if name in self.signals)

    @property
    def units(self) -> dict[str, str]:
        """The units of the measured channels."""
        return {name: self.known[name] for name in self.channels}

    def sent_values(self, true: Mapping[str, jax.Array], key: Any) -> dict[str, jax.Array]:
        """The values that are sent for the true values, by channel, (n,) each."""
        return apply_all(self.signals, self.known, true, self.period, key)

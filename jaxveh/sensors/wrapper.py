"""Devices that wrap another device and change some of its properties."""

# No postponed annotations here: equinox does not recognise an AbstractVar in a string.

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax

from jaxveh._core.errors import InputError
from jaxveh._core.names import as_pairs, check_names
from jaxveh.sensors.device import AbstractDevice, name_of
from jaxveh.sensors.randomness import subkey

_OWN_TAG = 1000
"""Larger than every tag of a device: the draws of a wrapper do not change those of the inner device."""


class AbstractDeviceWrapper(AbstractDevice):
    """A device around another, with the vehicle outputs and the sample times of the inner device."""

    device: eqx.AbstractVar[AbstractDevice]

    @property
    def rate(self) -> float:
        """The rate of the inner device, Hz."""
        return self.device.rate

    @property
    def delay(self) -> float:
        """The delay of the inner device, s."""
        return self.device.delay

    @property
    def phase(self) -> float:
        """The phase of the inner device, s."""
        return self.device.phase

    @property
    def needs(self) -> tuple[str, ...]:
        """The vehicle outputs that the inner device requires."""
        return self.device.needs

    @property
    def may_use(self) -> tuple[str, ...]:
        """Further vehicle outputs that the inner device uses if the car has them."""
        return self.device.may_use

    def own_key(self, key: Any) -> Any:
        """The key for the wrapper's own draws, different for each wrapper around one device."""
        return subkey(key, _OWN_TAG + _depth(self))


class Renamed(AbstractDeviceWrapper):
    """A device whose channels have other names: `names` maps old names to new ones; other channels keep their names.

    It is needed if a suite has two devices of one class: `Renamed(optical, {"v_x": "optical_v_x"})`.

    **Raises** `InputError` for a name that is not a channel of the device, or a new name that occurs twice.
    """

    device: AbstractDevice
    names: tuple[tuple[str, str], ...] = eqx.field(
        static=True, converter=lambda names: as_pairs(names, "Renamed.names")
    )

    def __check_init__(self):
        check_device(self)
        check_names("Renamed.names", dict(self.names), self.device.channels)
        if len(set(self.channels)) < len(self.channels):
            raise InputError(
                f"Renamed.names = {dict(self.names)}: gives two channels the same name: {', '.join(self.channels)}."
            )

    @property
    def channels(self) -> tuple[str, ...]:
        """The new names."""
        return tuple(dict(self.names).get(name, name) for name in self.device.channels)

    @property
    def units(self) -> dict[str, str]:
        """The units by the new names."""
        return {dict(self.names).get(name, name): unit for name, unit in self.device.units.items()}

    def say(self, times: jax.Array, outputs: Mapping[str, jax.Array], key: Any) -> dict[str, jax.Array]:
        """The samples of the inner device, under the new names."""
        said = self.device.say(times, outputs, key)
        return {dict(self.names).get(name, name): value for name, value in said.items()}


def check_device(wrapper: AbstractDeviceWrapper) -> None:
    """Raise `InputError` unless there is a device inside; call it before the inner device is used."""
    if not isinstance(wrapper.device, AbstractDevice):
        raise InputError(f"{name_of(wrapper)}.device = {wrapper.device!r}: must be a device, such as IMU(rate=100.0).")


def innermost(device: AbstractDevice) -> AbstractDevice:
    """The device inside all wrappers."""
    return innermost(device.device) if isinstance(device, AbstractDeviceWrapper) else device


def _depth(device: AbstractDevice) -> int:
    return 1 + _depth(device.device) if isinstance(device, AbstractDeviceWrapper) else 0

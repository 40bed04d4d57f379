"""Devices around a device: what they do not change is the inner one's."""

# No postponed annotations here: equinox does not see an AbstractVar in a string.

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax

from jaxveh._core.errors import InputError
from jaxveh._core.names import check_names
from jaxveh.sensors.device import AbstractDevice, name_of
from jaxveh.sensors.randomness import subkey

_OWN_TAG = 1000
"""Beyond every tag of a device: a wrapper draws beside the inner device, whose numbers stay what they were."""


class AbstractDeviceWrapper(AbstractDevice):
    """A device around another: it looks at what that one looks at, and speaks when that one speaks."""

    device: eqx.AbstractVar[AbstractDevice]

    @property
    def rate(self) -> float:
        """The inner device's, Hz."""
        return self.device.rate

    @property
    def delay(self) -> float:
        """The inner device's, s."""
        return self.device.delay

    @property
    def phase(self) -> float:
        """The inner device's, s."""
        return self.device.phase

    @property
    def needs(self) -> tuple[str, ...]:
        """The inner device's."""
        return self.device.needs

    @property
    def may_use(self) -> tuple[str, ...]:
        """The inner device's."""
        return self.device.may_use

    def own_key(self, key: Any) -> Any:
        """The key of what the wrapper draws itself: another for each wrapper around one device."""
        return subkey(key, _OWN_TAG + _depth(self))


class Renamed(AbstractDeviceWrapper):
    """A device whose channels have other names: `names` maps old to new, what it leaves out stays.

    Two devices of a kind in one suite need it: `Renamed(optical, {"v_x": "optical_v_x"})`.

    **Raises** `InputError` for a name that the device does not say, or a new name that it has twice.
    """

    device: AbstractDevice
    names: tuple[tuple[str, str], ...] = eqx.field(static=True, converter=lambda names: tuple(dict(names).items()))

    def __check_init__(self):
        check_device(self)
        check_names("Renamed.names", dict(self.names), self.device.channels)
        if len(set(self.channels)) < len(self.channels):
            raise InputError(
                f"Renamed.names = {dict(self.names)}: gives two channels one name: {', '.join(self.channels)}."
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
        """What the inner device says, under the new names."""
        said = self.device.say(times, outputs, key)
        return {dict(self.names).get(name, name): value for name, value in said.items()}


def check_device(wrapper: AbstractDeviceWrapper) -> None:
    """Raise unless there is a device inside; to be called before anything is asked of it."""
    if not isinstance(wrapper.device, AbstractDevice):
        raise InputError(f"{name_of(wrapper)}.device = {wrapper.device!r}: must be a device, such as IMU(rate=100.0).")


def innermost(device: AbstractDevice) -> AbstractDevice:
    """The device within all wrappers."""
    return innermost(device.device) if isinstance(device, AbstractDeviceWrapper) else device


def _depth(device: AbstractDevice) -> int:
    return 1 + _depth(device.device) if isinstance(device, AbstractDeviceWrapper) else 0

"""All the devices of a car: when to look at the car, and one table of what was said."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, is_concrete
from jaxveh._core.names import as_mapping
from jaxveh.sensors.device import AbstractDevice, check_outputs, name_of
from jaxveh.sensors.randomness import subkey
from jaxveh.sensors.wrapper import innermost

_NAME = "jaxveh.sensors.Suite"

_SAME = 1e-9
"""Instants closer than this, in s, are one."""


class Measured(NamedTuple):
    """`times` (T,) in s, `channels` by name, (T,) each, NaN where a device did not speak, and their `units`."""

    times: np.ndarray
    channels: dict[str, jax.Array]
    units: dict[str, str]


class Suite(eqx.Module):
    """The devices of one car, each with its own rate, delay and errors.

    Simulate the car and save its outputs at `look_times`; `record` says what the devices make of them.

    **Raises** `InputError` where there is no device, or two say a channel of one name.
    """

    devices: tuple[AbstractDevice, ...] = eqx.field(converter=lambda devices: _as_tuple(devices))

    def __check_init__(self):
        if not self.devices:
            raise InputError("Suite: no device; give at least one.")
        said: dict[str, str] = {}
        for place, device in enumerate(self.devices):
            if not isinstance(device, AbstractDevice):
                raise InputError(f"Suite: device {place} = {device!r}: must be a device, such as IMU(rate=100.0).")
            for channel in device.channels:
                if channel in said:
                    raise InputError(
                        f"Suite: {said[channel]} and {name_of(device)} both say {channel}: every channel needs a name of "
                        f'its own. Rename one: Renamed({name_of(device)}(...), {{"{channel}": "second_{channel}"}}).'
                    )
                said[channel] = name_of(device)

    @property
    def channels(self) -> tuple[str, ...]:
        """The names of all that is said, device after device."""
        return tuple(channel for device in self.devices for channel in device.channels)

    @property
    def units(self) -> dict[str, str]:
        """The unit of each channel."""
        return {channel: unit for device in self.devices for channel, unit in device.units.items()}

    @property
    def needs(self) -> tuple[str, ...]:
        """The vehicle outputs that some device cannot do without."""
        return tuple(dict.fromkeys(name for device in self.devices for name in device.needs))

    @property
    def may_use(self) -> tuple[str, ...]:
        """The vehicle outputs that devices look at where there are any."""
        wanted = dict.fromkeys(name for device in self.devices for name in device.may_use)
        return tuple(name for name in wanted if name not in self.needs)

    def sample_times(self, duration: float) -> np.ndarray:
        """The instants in [0, duration] at which some device speaks, s; those closer than 1e-9 s are one."""
        return _union([device.sample_times(duration) for device in self.devices])

    def look_times(self, duration: float) -> np.ndarray:
        """The instants that devices look at, s: where the car's outputs are needed."""
        return _union([device.look_times(duration) for device in self.devices])

    def record(self, truth_times: Any, outputs: Mapping[str, Any] | Any, duration: float, key: Any = None) -> Measured:
        """What all devices say in [0, duration], aligned to the union of the instants at which they speak.

        `truth_times` (N,): increasing, known outside jit, with every instant of `look_times` among them (to 1e-9 s:
        nothing is interpolated). `outputs`: a mapping or NamedTuple of the vehicle's outputs there, (N,) each; they
        set the dtype, to which the devices' numbers are converted. `key`: one for all, each device has its own part of
        it, which devices of other classes, their channels and faults do not change; two of a class differ by their order.
        Without a key nothing is random.

        It may be jitted, vmapped over keys, outputs and devices' numbers, and differentiated. A jitted function sees
        `truth_times` as a constant.

        **Raises** `InputError` for an instant that is missing, an output that a device needs and the car lacks, an
        output of another length, or where no device speaks in the duration.
        """
        truth_times, outputs = _check_truth(truth_times, as_mapping(outputs, "outputs"))
        times = self.sample_times(duration)
        if not times.size:
            raise InputError(f"Suite.record: no device speaks in the duration = {duration} s: make it longer.")
        channels = {}
        for device, own in zip(self.devices, device_keys(self.devices, key), strict=True):
            check_outputs(device, outputs)
            spoken, looked = device.sample_times(duration), device.look_times(duration)
            rows = _locate(truth_times, looked, name_of(device))
            seen = {name: outputs[name] for name in (*device.needs, *device.may_use) if name in outputs}
            if spoken.size:
                said = _read(device, spoken, {n: v[rows] for n, v in seen.items()}, own)
                to = np.searchsorted(times, spoken - _SAME)
                channels |= {n: jnp.full(times.shape, jnp.nan, v.dtype).at[to].set(v) for n, v in said.items()}
            else:
                silent = jnp.full(times.shape, jnp.nan, next(iter(seen.values())).dtype)
                channels |= dict.fromkeys(device.channels, silent)
        return Measured(times, {name: channels[name] for name in self.channels}, self.units)


def device_keys(devices: tuple[AbstractDevice, ...], key: Any) -> list:
    """The key of each device: by its class (that within all wrappers) and how many of that class come before it.

    They are behind a name of their own, so that whoever folds small numbers into `key` meets none of them.
    """
    own, before, keys = subkey(key, _NAME), Counter(), []
    for device in devices:
        kind = name_of(innermost(device))
        keys.append(subkey(own, f"{kind} {before[kind]}"))
        before[kind] += 1
    return keys


def _as_tuple(devices) -> tuple:
    return (devices,) if isinstance(devices, AbstractDevice) else tuple(devices)


@eqx.filter_jit
def _read(device: AbstractDevice, times, outputs, key) -> dict[str, jax.Array]:
    return device.read(times, outputs, key)


def _union(grids: list[np.ndarray]) -> np.ndarray:
    """All instants of increasing grids in order, without those that follow another by less than a nanosecond."""
    times = np.sort(np.concatenate(grids))
    return times[np.diff(times, prepend=-np.inf) > _SAME]


def _locate(times: np.ndarray, instants: np.ndarray, who: str) -> np.ndarray:
    """The rows of `times` at these instants."""
    rows = np.minimum(np.searchsorted(times, instants - _SAME), times.size - 1)
    lost = np.abs(times[rows] - instants) > _SAME
    if lost.any():
        missing = instants[np.argmax(lost)]
        raise InputError(
            f"Suite.record: {who} looks at t = {missing:.9g} s, which is not among the {times.size} truth_times from "
            f"{times[0]:g} to {times[-1]:g} s. Save the car's outputs at suite.look_times(duration)."
        )
    return rows


def _check_truth(times: Any, outputs: Mapping[str, Any]) -> tuple[np.ndarray, dict[str, jax.Array]]:
    if not is_concrete(times):
        raise InputError("Suite.record: truth_times is traced: it must be known outside jit (a NumPy array).")
    times = np.asarray(times, np.float64)
    if times.ndim != 1 or not times.size or np.any(~np.isfinite(times)) or np.any(np.diff(times) <= 0):
        raise InputError(
            f"Suite.record: truth_times of shape {times.shape}: must be (N,), finite and strictly increasing."
        )
    arrays = {name: jnp.asarray(value) for name, value in outputs.items()}
    for name, value in arrays.items():
        if value.shape != times.shape:
            raise InputError(
                f"Suite.record: {name} has shape {value.shape}, truth_times has {times.shape}: must agree."
            )
    floating = lambda value: value if jnp.issubdtype(value.dtype, jnp.floating) else value.astype(float)
    return times, {name: floating(value) for name, value in arrays.items()}

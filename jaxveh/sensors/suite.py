"""All devices of a car: the instants at which its outputs are needed, and one table of all samples."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_key, check_kind, is_concrete
from jaxveh._core.names import as_mapping
from jaxveh._core.time_order import SAME_INSTANT
from jaxveh.sensors.device import AbstractDevice, check_outputs, name_of
from jaxveh.sensors.randomness import subkey
from jaxveh.sensors.wrapper import innermost

_NAME = "jaxveh.sensors.Suite"


class Measured(NamedTuple):
    """`times` (T,) in s, `channels` by name, (T,) each, NaN where a device sent no sample, and their `units`."""

    times: np.ndarray
    channels: dict[str, jax.Array]
    units: dict[str, str]


class Suite(eqx.Module):
    """The devices of one car, each with its own rate, delay and errors.

    Simulate the car and save its outputs at `look_times`; `record` computes the devices' samples from them.

    **Raises** `InputError` if there is no device, or two devices have a channel of the same name.
    """

    devices: tuple[AbstractDevice, ...] = eqx.field(converter=lambda devices: _as_tuple(devices))

    def __check_init__(self):
        if not self.devices:
            raise InputError("Suite: no device; give at least one.")
        said: dict[str, str] = {}
        for place, device in enumerate(self.devices):
            if not isinstance(device, AbstractDevice):
                raise InputError(
                    f"Suite.devices: device {place} = {device!r}: must be a device, such as IMU(rate=100.0)."
                )
            for channel in device.channels:
                if channel in said:
                    raise InputError(
                        f"Suite: {said[channel]} and {name_of(device)} both have {channel}: every channel needs a name of "
                        f'its own. Rename one: Renamed({name_of(device)}(...), {{"{channel}": "second_{channel}"}}).'
                    )
                said[channel] = name_of(device)

    @property
    def channels(self) -> tuple[str, ...]:
        """The names of all channels, device after device."""
        return tuple(channel for device in self.devices for channel in device.channels)

    @property
    def units(self) -> dict[str, str]:
        """The unit of each channel."""
        return {channel: unit for device in self.devices for channel, unit in device.units.items()}

    @property
    def needs(self) -> tuple[str, ...]:
        """The vehicle outputs that at least one device requires."""
        return tuple(dict.fromkeys(name for device in self.devices for name in device.needs))

    @property
    def may_use(self) -> tuple[str, ...]:
        """Further vehicle outputs that devices use if the car has them."""
        wanted = dict.fromkeys(name for device in self.devices for name in device.may_use)
        return tuple(name for name in wanted if name not in self.needs)

    def sample_times(self, duration: float) -> np.ndarray:
        """The instants in [0, duration] at which a device sends a sample, s; instants closer than 1e-9 s are the same."""
        return _union([device.sample_times(duration) for device in self.devices])

    def look_times(self, duration: float) -> np.ndarray:
        """The instants at which devices measure, s: the car's outputs are needed there."""
        return _union([device.look_times(duration) for device in self.devices])

    def record(self, truth_times: Any, outputs: Mapping[str, Any] | Any, duration: float, key: Any = None) -> Measured:
        """The samples of all devices in [0, duration], aligned to the union of their sample times.

        `truth_times` (N,): increasing, known outside jit, with every instant of `look_times` among them (to 1e-9 s:
        there is no interpolation). `outputs`: a mapping or NamedTuple of the vehicle's outputs at these times, (N,)
        each; they set the dtype, to which the devices' numbers are converted. `key`: one key for all devices. Each
        device has its own part of it, which does not depend on devices of other classes, their channels or faults; two
        devices of one class differ by their order. Without a key there are no random errors.

        It can be jitted, vmapped over keys, outputs and the devices' numbers, and differentiated. In a jitted function,
        `truth_times` is a constant.

        **Raises** `InputError` for a missing instant, a missing output that a device needs, an output of another
        length, or if no device sends a sample within the duration.
        """
        if key is not None:
            check_key("Suite.record", key)
        truth_times, outputs = _check_truth(truth_times, as_mapping(outputs, "outputs"))
        times = self.sample_times(duration)
        if not times.size:
            raise InputError(
                f"Suite.record: no device sends a sample within the duration = {duration} s: make it longer."
            )
        channels = {}
        for device, own in zip(self.devices, device_keys(self.devices, key), strict=True):
            check_outputs(device, outputs)
            spoken, looked = device.sample_times(duration), device.look_times(duration)
            rows = _locate(truth_times, looked, name_of(device))
            seen = {name: outputs[name] for name in (*device.needs, *device.may_use) if name in outputs}
            if spoken.size:
                said = _read(device, spoken, {n: v[rows] for n, v in seen.items()}, own)
                to = np.searchsorted(times, spoken - SAME_INSTANT)
                channels |= {n: jnp.full(times.shape, jnp.nan, v.dtype).at[to].set(v) for n, v in said.items()}
            else:
                silent = jnp.full(times.shape, jnp.nan, next(iter(seen.values())).dtype)
                channels |= dict.fromkeys(device.channels, silent)
        return Measured(times, {name: channels[name] for name in self.channels}, self.units)


def device_keys(devices: tuple[AbstractDevice, ...], key: Any) -> list:
    """The key of each device, by its class (inside all wrappers) and the number of devices of that class before it.

    They are derived from `key` by a separate name, so that they differ from keys that a caller derives from `key` by
    small numbers.
    """
    own, before, keys = subkey(key, _NAME), Counter(), []
    for device in devices:
        kind = name_of(innermost(device))
        keys.append(subkey(own, f"{kind} {before[kind]}"))
        before[kind] += 1
    return keys


def _as_tuple(devices) -> tuple:
    if isinstance(devices, AbstractDevice):
        return (devices,)
    check_kind("Suite.devices", devices, Iterable, "A device, or several.")
    return tuple(devices)


@eqx.filter_jit
def _read(device: AbstractDevice, times, outputs, key) -> dict[str, jax.Array]:
    return device.read(times, outputs, key)


def _union(grids: list[np.ndarray]) -> np.ndarray:
    """All instants of several increasing grids in order, without those that are within a nanosecond after another."""
    times = np.sort(np.concatenate(grids))
    return times[np.diff(times, prepend=-np.inf) > SAME_INSTANT]


def _locate(times: np.ndarray, instants: np.ndarray, who: str) -> np.ndarray:
    """The rows of `times` at these instants."""
    rows = np.minimum(np.searchsorted(times, instants - SAME_INSTANT), times.size - 1)
    lost = np.abs(times[rows] - instants) > SAME_INSTANT
    if lost.any():
        missing = instants[np.argmax(lost)]
        raise InputError(
            f"Suite.record: {who} measures at t = {missing:.9g} s, which is not among the {times.size} truth_times from "
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

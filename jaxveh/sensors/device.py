"""The contract of a device: the vehicle outputs that it uses, its sample times, and its channels."""

# No postponed annotations here: equinox does not recognise an AbstractVar in a string.

import abc
import math
from collections.abc import Iterable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.contracts import Checked, contract
from jaxveh._core.errors import (
    InputError,
    check_at_least,
    check_finite,
    check_key,
    check_positive,
    check_single,
    word_for,
)
from jaxveh._core.names import as_mapping
from jaxveh._core.own_results import names
from jaxveh._core.parameter import check_parameters
from jaxveh.statespace import cast

_ROUNDING = 1e-9


def _samples(who: str, device: Any, given: tuple, said: Any) -> None:
    """Raise `InputError` unless a device said an array (n,) for each of its channels, and nothing else."""
    check_samples(who, device.channels, given[0].shape, said)


def check_samples(who: str, channels: Iterable[str], shape: tuple[int, ...], said: Any) -> None:
    """Raise `InputError` unless `said` has an array of this shape for each of the channels, and nothing else."""
    if not isinstance(said, Mapping):
        raise InputError(f"{who}: returned {word_for(said)}: must return a mapping from channels to arrays (n,).")
    if set(said) != set(channels):
        raise InputError(
            f"{who}: returned {', '.join(said) or 'nothing'}: must return all these channels and no others: "
            f"{', '.join(channels)}."
        )
    for name, value in said.items():
        if getattr(value, "shape", None) != shape:
            shown = word_for(value)
            raise InputError(f"{who}: {name} is {shown}: must be an array {shape}, a number for each time.")


def _units(who: str, device: Any, given: tuple, units: Any) -> None:
    """Raise `InputError` unless a device has a unit for each channel."""
    lacking = [name for name in device.channels if not isinstance(units, Mapping) or name not in units]
    if lacking:
        raise InputError(f"{who}: has no {', '.join(lacking)}: each channel must have a unit, '-' for a plain number.")


class AbstractDevice(Checked, eqx.Module):
    """A measuring device on a car: it measures vehicle outputs and sends samples at `rate`.

    - `rate` (Hz), `phase` (s): it sends a sample at `phase + k / rate`, k = 0, 1, ...
    - `delay` (s): the sample sent at t is of the outputs at `t - delay` (at 0 for t < delay). These three are static.
    - `channels`: the names of its channels, `units` their units. `needs`: the vehicle outputs that it requires;
      `may_use`: further outputs that it uses if the car has them.

    Vehicle outputs are in ISO 8855's intermediate axes (road-parallel, turned with the car's yaw), in SI units: `v_x`,
    `v_y`, `yaw`, `yaw_rate`, `yaw_acceleration`, `a_x`, `a_y`, `a_z` (specific force at the centre of gravity, as an
    ideal accelerometer measures it there), `x`, `y` (world), `roll` (left side up), `pitch` (nose down), their rates
    and accelerations (of these two angles), `omega_fl` ... (wheel spins; `omega_to_body_fl` ... are relative to a body
    that pitches), `steer`, `drive_torque` and so on.

    Array leaves are the sizes of the errors. `read` can be jitted, vmapped over keys and differentiated.
    """

    rate: eqx.AbstractVar[float]
    delay: eqx.AbstractVar[float]
    phase: eqx.AbstractVar[float]
    _contract = contract(channels=names, units=_units, needs=names, may_use=names, say=_samples)

    def __check_init__(self):
        check_parameters(self)

    @property
    @abc.abstractmethod
    def channels(self) -> tuple[str, ...]:
        """The names of the channels that it measures."""

    @property
    @abc.abstractmethod
    def units(self) -> dict[str, str]:
        """The unit of each channel."""

    @property
    @abc.abstractmethod
    def needs(self) -> tuple[str, ...]:
        """The vehicle outputs that it requires."""

    @property
    @abc.abstractmethod
    def may_use(self) -> tuple[str, ...]:
        """Further vehicle outputs that it uses if the car has them."""

    @abc.abstractmethod
    def say(self, times: jax.Array, outputs: Mapping[str, jax.Array], key: Any) -> dict[str, jax.Array]:
        """The result of `read`, for outputs that `read` has checked: all of `needs` are present, as arrays (n,) of one dtype."""

    @property
    def period(self) -> float:
        """The time between two samples, s."""
        return 1.0 / self.rate

    def sample_times(self, duration: float) -> np.ndarray:
        """The instants in [0, duration] at which it sends samples, s, on the host; none if `phase` is beyond `duration`."""
        check_at_least("duration", duration, 0.0)
        check_finite("duration", duration)
        count = math.floor((duration - self.phase) * self.rate + _ROUNDING) + 1
        return np.arange(max(count, 0)) / self.rate + self.phase

    def look_times(self, duration: float) -> np.ndarray:
        """The instants at which it measures, one per sample: `delay` earlier, not before 0."""
        return np.maximum(self.sample_times(duration) - self.delay, 0.0)

    def read(self, times: Any, outputs: Mapping[str, Any] | Any, key: Any = None) -> dict[str, jax.Array]:
        """The device's samples at `times` (n,), consecutive instants of `sample_times`: an (n,) array by channel.

        `outputs`: a mapping or NamedTuple of (n,) arrays, the vehicle's outputs at the instants at which the device
        measures (`look_times`). They set the dtype, to which the device's own numbers are converted. Missing samples
        are NaN. `key`: for random errors; without a key there are none.

        **Raises** `InputError` for a missing output that the device needs, or an output of another shape.
        """
        if key is not None:
            check_key(name_of(self), key)
        outputs = self._look(np.shape(times), as_mapping(outputs, "outputs"))
        dtype = next(iter(outputs.values())).dtype
        return cast(self, dtype).say(jnp.asarray(times, dtype), outputs, key)

    def _look(self, shape: tuple[int, ...], outputs: Mapping[str, Any]) -> dict[str, jax.Array]:
        check_outputs(self, outputs)
        seen = {}
        for name in (*self.needs, *self.may_use):
            if name not in outputs:
                continue
            value = jnp.asarray(outputs[name])
            if value.shape != shape or len(shape) != 1 or not shape[0]:
                raise InputError(
                    f"{name_of(self)}: {name} has shape {value.shape}, times has {shape}: both must be (n,), n at least 1."
                )
            seen[name] = value if jnp.issubdtype(value.dtype, jnp.floating) else value.astype(float)
        return seen


def _as_float(value: Any) -> Any:
    """A Python float, which a static field must be; what is none is left to the check that knows its name."""
    try:
        return value if isinstance(value, str) else float(value)
    except (TypeError, ValueError, OverflowError):
        return value


class AbstractInstrument(AbstractDevice):
    """A device with its own clock, as opposed to one that wraps another device.

    **Raises** `InputError` for a rate that is not positive, or a negative delay or phase.
    """

    rate: float = eqx.field(static=True, converter=_as_float, kw_only=True)
    delay: float = eqx.field(static=True, converter=_as_float, kw_only=True, default=0.0)
    phase: float = eqx.field(static=True, converter=_as_float, kw_only=True, default=0.0)

    def __check_init__(self):
        name = name_of(self)
        check_single(**{f"{name}.{field}": getattr(self, field) for field in ("rate", "delay", "phase")})
        check_positive(f"{name}.rate", self.rate, "Hz")
        for field in ("delay", "phase"):
            check_at_least(f"{name}.{field}", getattr(self, field), 0.0)
            check_finite(f"{name}.{field}", getattr(self, field))


def name_of(device: AbstractDevice) -> str:
    """The name of a device in messages: its class."""
    return type(device).__name__


def check_outputs(device: AbstractDevice, outputs: Mapping[str, Any]) -> None:
    """Raise `InputError` unless the car has every output that the device needs."""
    missing = [name for name in device.needs if name not in outputs]
    if missing:
        raise InputError(
            f"{name_of(device)} needs {', '.join(missing)}, which this car does not have; there are: "
            f"{', '.join(outputs) or 'none'}. Use a car that has them, or leave the device out."
        )

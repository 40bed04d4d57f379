"""The one contract of a device: what it looks at, when it speaks, and what it says."""

# No postponed annotations here: equinox does not see an AbstractVar in a string.

import abc
import math
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_at_least, check_finite, check_positive
from jaxveh._core.names import as_mapping
from jaxveh.statespace import cast

_ROUNDING = 1e-9


class AbstractDevice(eqx.Module):
    """A measuring device on a car: it looks at vehicle outputs and speaks `rate` times a second.

    - `rate` (Hz), `phase` (s): it speaks at `phase + k / rate`, k = 0, 1, ...
    - `delay` (s): what it says at t is what was true at `t - delay` (at 0 for t < delay). These three are static.
    - `channels`: the names it says, `units` their units. `needs`: the vehicle outputs it looks at; `may_use`: those it
      looks at where the car has them.

    Vehicle outputs are of ISO 8855's intermediate axes (road-parallel, turned with the car's yaw), SI units: `v_x`,
    `v_y`, `yaw`, `yaw_rate`, `yaw_acceleration`, `a_x`, `a_y`, `a_z` (specific force at the centre of gravity: what an
    ideal accelerometer there shows), `x`, `y` (world), `roll` (left side up), `pitch` (nose down), their rates and
    accelerations (of these two angles), `omega_fl` ... (wheel spins; `omega_to_body_fl` ... as seen from a body that
    pitches), `steer`, `drive_torque` and so on.

    Array leaves are the errors' sizes: readings may be jitted, vmapped over keys and differentiated.
    """

    rate: eqx.AbstractVar[float]
    delay: eqx.AbstractVar[float]
    phase: eqx.AbstractVar[float]

    @property
    @abc.abstractmethod
    def channels(self) -> tuple[str, ...]:
        """The names of what it says."""

    @property
    @abc.abstractmethod
    def units(self) -> dict[str, str]:
        """The unit of each channel."""

    @property
    @abc.abstractmethod
    def needs(self) -> tuple[str, ...]:
        """The vehicle outputs that it cannot do without."""

    @property
    @abc.abstractmethod
    def may_use(self) -> tuple[str, ...]:
        """The vehicle outputs that it looks at where there are any."""

    @abc.abstractmethod
    def say(self, times: jax.Array, outputs: Mapping[str, jax.Array], key: Any) -> dict[str, jax.Array]:
        """What `read` returns, of outputs that it has checked: `needs` are there, all are arrays (n,) of one dtype."""

    @property
    def period(self) -> float:
        """Time between two samples, s."""
        return 1.0 / self.rate

    def sample_times(self, duration: float) -> np.ndarray:
        """The instants in [0, duration] at which it speaks, s, on the host; none where `phase` is beyond `duration`."""
        check_at_least("duration", duration, 0.0)
        check_finite("duration", duration)
        count = math.floor((duration - self.phase) * self.rate + _ROUNDING) + 1
        return np.arange(max(count, 0)) / self.rate + self.phase

    def look_times(self, duration: float) -> np.ndarray:
        """The instants that it looks at, one a sample: `delay` earlier, not before 0."""
        return np.maximum(self.sample_times(duration) - self.delay, 0.0)

    def read(self, times: Any, outputs: Mapping[str, Any] | Any, key: Any = None) -> dict[str, jax.Array]:
        """What the device says at `times` (n,), consecutive instants of `sample_times`: an (n,) array by channel.

        `outputs`: a mapping or NamedTuple of (n,) arrays, the vehicle's outputs at the instants that the device looks
        at (`look_times`). They set the dtype, to which the device's own numbers are converted. NaN where nothing
        is said. `key` draws what is random; without a key nothing is.

        **Raises** `InputError` for an output that the device needs and the car lacks, or of another shape.
        """
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


class AbstractInstrument(AbstractDevice):
    """A device with a clock of its own, as opposed to one that wraps another.

    **Raises** `InputError` for a rate that is not positive, a negative delay or phase.
    """

    rate: float = eqx.field(static=True, converter=float, kw_only=True)
    delay: float = eqx.field(static=True, converter=float, kw_only=True, default=0.0)
    phase: float = eqx.field(static=True, converter=float, kw_only=True, default=0.0)

    def __check_init__(self):
        name = name_of(self)
        check_positive(f"{name}.rate", self.rate, "Hz")
        for field in ("delay", "phase"):
            check_at_least(f"{name}.{field}", getattr(self, field), 0.0)
            check_finite(f"{name}.{field}", getattr(self, field))


def name_of(device: AbstractDevice) -> str:
    """What messages call a device: its class."""
    return type(device).__name__


def check_outputs(device: AbstractDevice, outputs: Mapping[str, Any]) -> None:
    """Raise unless the car has every output that the device needs."""
    missing = [name for name in device.needs if name not in outputs]
    if missing:
        raise InputError(
            f"{name_of(device)} looks at {', '.join(missing)}, which this car does not have; there are: "
            f"{', '.join(outputs) or 'none'}. Take a car that has them, or leave the device out."
        )

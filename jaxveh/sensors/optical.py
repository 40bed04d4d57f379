"""The optical sensor of test cars, which sees the road pass below it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError
from jaxveh._core.parameter import check_parameters, positive
from jaxveh.sensors.device import AbstractInstrument
from jaxveh.sensors.rigid_body import POSES, velocity
from jaxveh.sensors.sensor_set import Position
from jaxveh.sensors.signal import Signal, apply_all, as_signals, check_signals

_UNITS = {"v_x": "m/s", "v_y": "m/s", "sideslip": "rad"}


class OpticalSideslip(AbstractInstrument):
    """A correlation sensor: the velocity of its own place over the road, not of the centre of gravity.

    - `signals`: the channels and their errors, a mapping to `Signal`, out of `v_x`, `v_y` (m/s) and `sideslip` (rad,
      `atan2(v_y, v_x)`); names alone have no errors.
    - `position`: of the sensor from the centre of gravity.
    - `lowest` (m/s): below this true speed it says nothing, NaN.

    **Raises** `InputError` for unknown channels or numbers out of range.
    """

    signals: dict[str, Signal] = eqx.field(converter=as_signals, default=("v_x", "v_y"))
    position: Position = eqx.field(default_factory=Position)
    lowest: jax.Array | None = positive("m/s", default=None)

    def __check_init__(self):
        check_signals("OpticalSideslip.signals", self.signals, _UNITS)
        check_parameters(self)
        if not isinstance(self.position, Position):
            raise InputError(f"OpticalSideslip.position = {self.position!r}: must be a Position.")

    @property
    def channels(self) -> tuple[str, ...]:
        """The measured channels."""
        return tuple(name for name in _UNITS if name in self.signals)

    @property
    def units(self) -> dict[str, str]:
        """m/s and rad."""
        return {name: _UNITS[name] for name in self.channels}

    @property
    def needs(self) -> tuple[str, ...]:
        """The velocity of the centre of gravity and how the car turns."""
        return ("v_x", "v_y", "yaw_rate")

    @property
    def may_use(self) -> tuple[str, ...]:
        """How the body stands on the road."""
        return POSES

    def say(self, times: jax.Array, outputs: Mapping[str, jax.Array], key: Any) -> dict[str, jax.Array]:
        """Velocities and their angle."""
        v_x, v_y = velocity(outputs, self.position)
        true = {"v_x": v_x, "v_y": v_y, "sideslip": numerics.arctan2(v_y, v_x)}
        said = apply_all(self.signals, _UNITS, true, self.period, key)
        if self.lowest is None:
            return said
        slow = numerics.hypot(v_x, v_y) < self.lowest
        return {name: jnp.where(slow, jnp.nan, value) for name, value in said.items()}

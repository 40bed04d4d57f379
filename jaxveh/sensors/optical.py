"""The optical sensor of test cars, which measures its velocity over the road."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError
from jaxveh._core.parameter import positive
from jaxveh.sensors.rigid_body import POSES, velocity
from jaxveh.sensors.sensor_set import Position
from jaxveh.sensors.signal import Signal, as_signals
from jaxveh.sensors.signal_instrument import AbstractSignalInstrument


class OpticalSideslip(AbstractSignalInstrument):
    """A correlation sensor: it measures the velocity over the road of its own position, not of the centre of gravity.

    - `signals`: a mapping from channels to their errors (`Signal`). The channels are `v_x`, `v_y` (m/s) and `sideslip`
      (rad, `atan2(v_y, v_x)`). Channels given as names only have no errors.
    - `position`: position of the sensor from the centre of gravity.
    - `lowest` (m/s): below this true speed all channels are NaN.

    **Raises** `InputError` for unknown channels or numbers out of range.
    """

    known: ClassVar[dict[str, str]] = {"v_x": "m/s", "v_y": "m/s", "sideslip": "rad"}
    signals: dict[str, Signal] = eqx.field(converter=as_signals, default=("v_x", "v_y"))
    position: Position = eqx.field(default_factory=Position)
    lowest: jax.Array | None = positive("m/s", default=None)

    def __check_init__(self):
        if not isinstance(self.position, Position):
            raise InputError(f"OpticalSideslip.position = {self.position!r}: must be a Position.")

    @property
    def needs(self) -> tuple[str, ...]:
        """The velocity of the centre of gravity, and the yaw rate."""
        return ("v_x", "v_y", "yaw_rate")

    @property
    def may_use(self) -> tuple[str, ...]:
        """Roll and pitch of the body and their rates."""
        return POSES

    def say(self, times: jax.Array, outputs: Mapping[str, jax.Array], key: Any) -> dict[str, jax.Array]:
        """The velocities and the sideslip at the sensor."""
        v_x, v_y = velocity(outputs, self.position)
        true = {"v_x": v_x, "v_y": v_y, "sideslip": numerics.arctan2(v_y, v_x)}
        said = self.sent_values(true, key)
        if self.lowest is None:
            return said
        slow = numerics.hypot(v_x, v_y) < self.lowest
        return {name: jnp.where(slow, jnp.nan, value) for name, value in said.items()}

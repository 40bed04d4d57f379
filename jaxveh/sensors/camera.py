"""The lane camera: lateral offset and heading of the car in its lane, with a low rate and a delay."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError
from jaxveh._core.parameter import parameter, positive
from jaxveh.sensors.randomness import on_and_off, subkey
from jaxveh.sensors.sensor_set import Position
from jaxveh.sensors.signal import Signal, as_signals
from jaxveh.sensors.signal_instrument import AbstractSignalInstrument

_LOST = "lost"


class LaneCamera(AbstractSignalInstrument):
    """A camera behind the windscreen that detects the lines of the lane.

    - `signals`: a mapping from channels to their errors (`Signal`). The channels are `lane_offset` (m, the distance of
      the camera to the left of the lane's middle) and `lane_heading` (rad, the car's yaw less the lane's direction
      there, within -pi to pi). Channels given as names only have no errors.
    - The lane's middle lies at `y = middle + sway sin(2 pi x / wavelength)` in the world (m): without `sway`, a
      straight lane along x.
    - `position`: position of the camera from the centre of gravity. Its height has no effect, and pitch and roll are
      taken as compensated by its calibration.
    - `reach` (m): at a larger distance from the middle no line is detected. `loss_rate` (1/s) and `loss_length`
      (mean, s): the lines are lost at random (worn paint, wipers, low sun). In both cases all channels are NaN.

    A typical camera has 30 Hz, a delay of 80 ms, and errors of 0.03 m in `lane_offset` and 0.2 degrees in `lane_heading`.

    **Raises** `InputError` for unknown channels or numbers out of range, or for `loss_rate` without `loss_length` or
    the reverse.
    """

    known: ClassVar[dict[str, str]] = {"lane_offset": "m", "lane_heading": "rad"}
    signals: dict[str, Signal] = eqx.field(converter=as_signals, default=("lane_offset", "lane_heading"))
    position: Position = eqx.field(default_factory=Position)
    middle: jax.Array = parameter("m", scale=1.0, default=0.0)
    sway: jax.Array = parameter("m", scale=1.0, default=0.0)
    wavelength: jax.Array = positive("m", default=500.0)
    reach: jax.Array | None = positive("m", default=None)
    loss_rate: jax.Array | None = positive("1/s", default=None)
    loss_length: jax.Array | None = positive("s", default=None)

    def __check_init__(self):
        if not isinstance(self.position, Position):
            raise InputError(f"LaneCamera.position = {self.position!r}: must be a Position.")
        if (self.loss_rate is None) != (self.loss_length is None):
            raise InputError(
                f"LaneCamera.loss_rate = {self.loss_rate}, loss_length = {self.loss_length}: give both or neither."
            )

    @property
    def needs(self) -> tuple[str, ...]:
        """Position and yaw in the world."""
        return ("x", "y", "yaw")

    @property
    def may_use(self) -> tuple[str, ...]:
        """No further outputs."""
        return ()

    def say(self, times: jax.Array, outputs: Mapping[str, jax.Array], key: Any) -> dict[str, jax.Array]:
        """Offset and heading; NaN where no line is detected."""
        yaw = outputs["yaw"]
        c, s = numerics.cos(yaw), numerics.sin(yaw)
        x = outputs["x"] + c * self.position.x - s * self.position.y
        y = outputs["y"] + s * self.position.x + c * self.position.y
        turns = 2.0 * jnp.pi / self.wavelength
        slope = self.sway * turns * numerics.cos(turns * x)
        # Perpendicular to the lane, if its direction changes little within the offset.
        offset = (y - self.middle - self.sway * numerics.sin(turns * x)) / numerics.sqrt(1.0 + jnp.square(slope))
        heading = numerics.wrap_angle(yaw - numerics.arctan(slope))
        said = self.sent_values({"lane_offset": offset, "lane_heading": heading}, key)
        silent = jnp.zeros(times.shape, bool)
        if self.reach is not None:
            silent = jnp.abs(offset) > self.reach
        if self.loss_rate is not None:
            assert self.loss_length is not None  # both or neither
            lost = on_and_off(subkey(key, _LOST), times.shape[0], self.loss_rate, self.loss_length, self.period)
            silent = silent | lost
        return {name: jnp.where(silent, jnp.nan, value) for name, value in said.items()}

"""The camera that sees the lane: where the car is in it, and how it stands against it, a few times a second and late."""

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
    """A camera behind the windscreen whose program finds the lines of the lane.

    - `signals`: the channels and their errors, a mapping to `Signal`, out of `lane_offset` (m, how far to the left of the lane's
      middle the car is at the camera) and `lane_heading` (rad, the car's yaw less the lane's direction there, within -pi to pi);
      names alone have no errors.
    - The lane's middle lies at `y = middle + sway sin(2 pi x / wavelength)` in the world (m): a straight lane along x without
      `sway`.
    - `position`: of the camera from the centre of gravity; its height does not count, and pitch and roll are taken out by
      whoever calibrated it.
    - `reach` (m): from farther beside the middle no line is seen, NaN. `loss_rate` (1/s) and `loss_length` (mean, s): the lines
      are lost at random (worn paint, wipers, low sun). In both cases all channels are silent.

    A usual camera: 30 Hz, 80 ms late, `lane_offset` to 0.03 m and `lane_heading` to 0.2 degrees.

    **Raises** `InputError` for unknown channels or numbers out of range, or a rate of losses without their length.
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
        """Place and yaw in the world."""
        return ("x", "y", "yaw")

    @property
    def may_use(self) -> tuple[str, ...]:
        """Nothing else."""
        return ()

    def say(self, times: jax.Array, outputs: Mapping[str, jax.Array], key: Any) -> dict[str, jax.Array]:
        """Offset and heading; NaN where no line is seen."""
        yaw = outputs["yaw"]
        c, s = numerics.cos(yaw), numerics.sin(yaw)
        x = outputs["x"] + c * self.position.x - s * self.position.y
        y = outputs["y"] + s * self.position.x + c * self.position.y
        turns = 2.0 * jnp.pi / self.wavelength
        slope = self.sway * turns * numerics.cos(turns * x)
        # Across the lane, of a line whose direction changes little within the offset.
        offset = (y - self.middle - self.sway * numerics.sin(turns * x)) / numerics.sqrt(1.0 + jnp.square(slope))
        heading = numerics.wrap_angle(yaw - numerics.arctan(slope))
        said = self.sent_values({"lane_offset": offset, "lane_heading": heading}, key)
        silent = jnp.zeros(times.shape, bool)
        if self.reach is not None:
            silent = jnp.abs(offset) > self.reach
        if self.loss_rate is not None and self.loss_length is not None:
            lost = on_and_off(subkey(key, _LOST), times.shape[0], self.loss_rate, self.loss_length, self.period)
            silent = silent | lost
        return {name: jnp.where(silent, jnp.nan, value) for name, value in said.items()}

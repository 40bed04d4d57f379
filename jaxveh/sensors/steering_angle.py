"""The steering angle sensor, with offset, backlash and the steps of its code disc."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check_one_of
from jaxveh._core.parameter import check_parameters, positive
from jaxveh.sensors.device import AbstractInstrument
from jaxveh.sensors.signal import Signal


class SteeringAngle(AbstractInstrument):
    """A sensor of the steering angle, positive to the left.

    - `channel`: the channel that it sends, `steer` (rad at the road wheels) or `steering_wheel` (rad).
    - `ratio`: the angle of the steering wheel over that of the road wheels, to compute `steering_wheel` from `steer`;
      without it the car must have the output `steering_wheel`.
    - `backlash` (rad of the channel): the width of the play between the shaft and the sensor. It is the play operator
      (Visintin, Differential Models of Hysteresis, 1994, section III.2), which starts in the middle.
    - `signal`: offset (`bias`), noise, steps (`quantisation`), in rad of the channel.

    **Raises** `InputError` for numbers out of range, an unknown channel, or a ratio with the channel `steer`.
    """

    signal: Signal = eqx.field(default_factory=Signal)
    backlash: jax.Array | None = positive("rad", default=None)
    ratio: jax.Array | None = positive("-", default=None)
    channel: str = eqx.field(static=True, default="steer")

    def __check_init__(self):
        check_one_of("SteeringAngle.channel", self.channel, ("steer", "steering_wheel"))
        if not isinstance(self.signal, Signal):
            raise InputError(f"SteeringAngle.signal = {self.signal!r}: must be a Signal(noise=..., bias=...).")
        check_parameters(self)
        if self.ratio is not None and self.channel == "steer":
            raise InputError(f"SteeringAngle.ratio = {self.ratio}: only the channel steering_wheel has one.")

    @property
    def channels(self) -> tuple[str, ...]:
        """The channel."""
        return (self.channel,)

    @property
    def units(self) -> dict[str, str]:
        """The unit, rad."""
        return {self.channel: "rad"}

    @property
    def needs(self) -> tuple[str, ...]:
        """The channel's angle, or that of the road wheels if a ratio is given."""
        return ("steer",) if self.ratio is not None else (self.channel,)

    @property
    def may_use(self) -> tuple[str, ...]:
        """No further outputs."""
        return ()

    def say(self, times: jax.Array, outputs: Mapping[str, jax.Array], key: Any) -> dict[str, jax.Array]:
        """The angle."""
        angle = outputs[self.needs[0]]
        if self.ratio is not None:
            angle = self.ratio * angle
        if self.backlash is not None:
            angle = play(angle, self.backlash)
        return {self.channel: self.signal.apply(angle, self.period, key)}


def play(angle: jax.Array, width: jax.Array) -> jax.Array:
    """The angle that follows `angle` (n,) through a play of `width`: it moves only when one side of the play pushes it."""

    def body(follower, pusher):
        # The follower stays or is pushed by one side, chosen by `where`: unlike a clip, no derivative is shared at a tie.
        low, high = pusher - 0.5 * width, pusher + 0.5 * width
        follower = jnp.where(follower < low, low, jnp.where(follower > high, high, follower))
        return follower, follower

    return jax.lax.scan(body, angle[0], angle)[1]

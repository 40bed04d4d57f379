"""The inertial measurement unit: accelerometers and gyroscopes in one box fixed to the body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError
from jaxveh._core.parameter import check_parameters, parameter
from jaxveh.sensors.low_pass import LowPass, filtered_rows
from jaxveh.sensors.rigid_body import POSES, into_axes, rotation, specific_force
from jaxveh.sensors.sensor_set import Position
from jaxveh.sensors.signal import Signal, as_signals
from jaxveh.sensors.signal_instrument import AbstractSignalInstrument


class Alignment(eqx.Module):
    """The orientation of a box on the body: turned by `yaw` about z, then `pitch` about y, then `roll` about x, rad."""

    roll: jax.Array = parameter("rad", scale=0.01, default=0.0)
    pitch: jax.Array = parameter("rad", scale=0.01, default=0.0)
    yaw: jax.Array = parameter("rad", scale=0.01, default=0.0)

    def __check_init__(self):
        check_parameters(self)


class IMU(AbstractSignalInstrument):
    """An inertial measurement unit that rolls, pitches and turns with the body.

    - `signals`: a mapping from channels to their errors (`Signal`). The channels are `a_x`, `a_y`, `a_z` (m/s^2, specific force)
      and `roll_rate`, `pitch_rate`, `yaw_rate` (rad/s, about the box's own axes). Channels given as names only have no errors.
    - `position`: position of the box from the centre of gravity, in the body's axes. It measures the specific force of
      the rigid body, `f + alpha x r + omega x (omega x r)`, which includes gravity through roll and pitch.
    - `alignment`: the orientation of the box on the body, as exact rotations.
    - `low_pass`: a `LowPass` in every channel, before the errors (it has only the samples, not the values between them).

    For cars without roll, pitch and their rates these are zero; without `a_z` it is the gravity normal to the road. Roads are
    quasi-static, for devices and for cars: grade and bank tilt gravity, but gyroscopes do not measure the rotation of the road
    surface along the way (at 25 m/s on a bank of 0.05 rad over 50 m up to 0.047 rad/s), nor accelerometers its curvature.

    **Raises** `InputError` for unknown channels, numbers out of range, or fields of another type.
    """

    known: ClassVar[dict[str, str]] = {
        **dict.fromkeys(("a_x", "a_y", "a_z"), "m/s^2"),
        **dict.fromkeys(("roll_rate", "pitch_rate", "yaw_rate"), "rad/s"),
    }
    signals: dict[str, Signal] = eqx.field(converter=as_signals, default=("a_x", "a_y", "yaw_rate"))
    position: Position = eqx.field(default_factory=Position)
    alignment: Alignment = eqx.field(default_factory=Alignment)
    low_pass: LowPass | None = None

    def __check_init__(self):
        for name, article, kind in (("position", "a", Position), ("alignment", "an", Alignment)):
            if not isinstance(getattr(self, name), kind):
                raise InputError(f"IMU.{name} = {getattr(self, name)!r}: must be {article} {kind.__name__}.")
        if not (self.low_pass is None or isinstance(self.low_pass, LowPass)):
            raise InputError(f"IMU.low_pass = {self.low_pass!r}: must be a LowPass(cutoff_hz) or None.")

    @property
    def needs(self) -> tuple[str, ...]:
        """Specific force in the road's plane, yaw rate and yaw acceleration."""
        return ("a_x", "a_y", "yaw_rate", "yaw_acceleration")

    @property
    def may_use(self) -> tuple[str, ...]:
        """Roll and pitch of the body with their rates and accelerations, vertical specific force, grade and bank."""
        return (*POSES, "roll_acceleration", "pitch_acceleration", "a_z", "grade", "bank")

    def say(self, times: jax.Array, outputs: Mapping[str, jax.Array], key: Any) -> dict[str, jax.Array]:
        """Accelerations and angular rates in the box's axes."""
        rates, accelerations = rotation(outputs)
        force = specific_force(outputs, self.position, rates, accelerations)
        turn = (self.alignment.roll, self.alignment.pitch, self.alignment.yaw)
        felt = dict(zip(self.known, (*into_axes(force, *turn), *into_axes(rates, *turn)), strict=True))
        if self.low_pass is not None:
            rows = jnp.stack([felt[name] for name in self.channels], axis=-1)
            steps = jnp.full(times.shape[0] - 1, self.period, rows.dtype)
            felt = dict(zip(self.channels, filtered_rows(self.low_pass, rows, steps).T, strict=True))
        return self.sent_values(felt, key)

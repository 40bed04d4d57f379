"""Torques from control units: from the brake's pressure and from the motor's currents."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.parameter import positive
from jaxveh.sensors.low_pass import LowPass, filtered_rows
from jaxveh.sensors.signal import Signal, as_signals
from jaxveh.sensors.signal_instrument import AbstractSignalInstrument
from jaxveh.vehicles import kit as vehicles

_BRAKE = ("brake_torque", *(f"brake_torque_{wheel}" for wheel in vehicles.CORNERS))
_MOTOR = (
    "drive_torque",
    *(f"drive_torque_{wheel}" for wheel in vehicles.CORNERS),
    *(f"torque_{wheel}" for wheel in vehicles.CORNERS),
)


class AbstractTorque(AbstractSignalInstrument):
    """A device that sends torques (N m) with a first-order lag of time constant `lag` (s); None: no lag."""

    lag: jax.Array | None = positive("s", default=None)

    @property
    def needs(self) -> tuple[str, ...]:
        """The torques that it sends."""
        return self.channels

    @property
    def may_use(self) -> tuple[str, ...]:
        """No further outputs."""
        return ()

    def torques(self, outputs: Mapping[str, jax.Array], key: Any) -> dict[str, jax.Array]:
        """The lagged torques with their errors, N m."""
        return self.sent_values(
            {name: first_order_lag(outputs[name], self.lag, self.period) for name in self.channels}, key
        )


class BrakeTorque(AbstractTorque):
    """The braking torque that a control unit computes from the measured pressure, N m, never negative.

    - `signals`: a mapping from channels to their errors (`Signal`). The channels are `brake_torque` (the sum) and
      `brake_torque_fl` ... (at a wheel), each a vehicle output. A wrong assumption of the pads' friction is the
      signal's `scale`.
    - `lag` (s): time constant of the first-order lag of the samples; None: no lag.

    **Raises** `InputError` for unknown channels or numbers out of range.
    """

    known: ClassVar[dict[str, str]] = dict.fromkeys(_BRAKE, "N*m")
    signals: dict[str, Signal] = eqx.field(converter=as_signals, default=("brake_torque",))

    def say(self, times: jax.Array, outputs: Mapping[str, jax.Array], key: Any) -> dict[str, jax.Array]:
        """The torques."""
        return {name: jnp.where(value > 0, value, 0.0) for name, value in self.torques(outputs, key).items()}


class MotorTorque(AbstractTorque):
    """The driving torque that a control unit computes from currents or from an engine's map, N m, of either sign.

    - `signals`: a mapping from channels to their errors (`Signal`). The channels are `drive_torque` (the sum at the wheels), and
      `drive_torque_fl` ... and `torque_fl` ... (at a wheel), each a vehicle output. An error of the map is the signal's `scale`.
    - `lag` (s): time constant of the first-order lag of the samples; None: no lag.

    **Raises** `InputError` for unknown channels or numbers out of range.
    """

    known: ClassVar[dict[str, str]] = dict.fromkeys(_MOTOR, "N*m")
    signals: dict[str, Signal] = eqx.field(converter=as_signals, default=("drive_torque",))

    def say(self, times: jax.Array, outputs: Mapping[str, jax.Array], key: Any) -> dict[str, jax.Array]:
        """The torques."""
        return self.torques(outputs, key)


def first_order_lag(values: jax.Array, lag: jax.Array | None, period: float) -> jax.Array:
    """The values (n,) through a first-order lag, settled at the first value; exact for values that are linear between
    samples."""
    if lag is None:
        return values
    steps = jnp.full(values.shape[0] - 1, period, values.dtype)
    return filtered_rows(LowPass(1 / (2 * math.pi * lag), 1), values, steps)

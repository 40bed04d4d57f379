"""Sets of sensors: their channels, noise, mounting position and low-pass."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check_finite, check_kind, check_single, word_for
from jaxveh._core.names import check_names, record_type
from jaxveh._core.parameter import parameter
from jaxveh.sensors.low_pass import LowPass
from jaxveh.sensors.rigid_body import INERTIAL, inertial
from jaxveh.statespace import Gaussian


class Position(eqx.Module):
    """The position of a device from the centre of gravity: `x` forward, `y` left, `z` up, in m, in the body's axes.

    The height has an effect only for vehicles that roll or pitch.
    """

    x: jax.Array = parameter("m", scale=0.5, default=0.0)
    y: jax.Array = parameter("m", scale=0.5, default=0.0)
    z: jax.Array = parameter("m", scale=0.5, default=0.0)

    def __check_init__(self):
        for name in ("x", "y", "z"):
            check_finite(f"Position.{name}", getattr(self, name))


class SensorSet(eqx.Module):
    """Sensors with common sample times: the channels that `noise` names, each a vehicle output.

    - `noise`: standard deviations by channel name, white, of the recorded values (after the low-pass). All channels are
      drawn at once: an additional channel changes the draws of all others (unlike the devices of a `Suite`).
    - `position`: position of the accelerometers. On a rigid body that turns in the plane, a sensor at (x, y) measures
      `a_x - yaw_acceleration y - yaw_rate^2 x` and `a_y + yaw_acceleration x - yaw_rate^2 y`. In a car that rolls or pitches,
      accelerometers and gyroscopes turn with the body and measure the same as an ideal `IMU` there, with gravity through roll
      and pitch and the effect of the height. Speeds are those of the centre of gravity, to which loggers convert them.
    - `low_pass`: a `LowPass` in every channel, or None.
    """

    noise: Gaussian
    position: Position = eqx.field(default_factory=Position)
    low_pass: LowPass | None = None

    def __check_init__(self):
        if not isinstance(self.noise, Gaussian):
            raise InputError(f"SensorSet.noise = {word_for(self.noise)}: must be a Gaussian by channel name.")
        check_kind("SensorSet.position", self.position, Position, "Such as sensors.Position(x=0.5).")
        if not (self.low_pass is None or isinstance(self.low_pass, LowPass)):
            raise InputError(f"SensorSet.low_pass = {self.low_pass!r}: must be a LowPass(cutoff_hz) or None.")

    @property
    def channels(self) -> tuple[str, ...]:
        """The names of the measured channels."""
        return self.noise.names

    @property
    def filter_names(self) -> tuple[str, ...]:
        """The names of the states of the low-pass; empty without one."""
        if self.low_pass is None:
            return ()
        return tuple(name for channel in self.channels for name in self.low_pass.state_names(channel))

    @property
    def filter_type(self) -> Any:
        """The NamedTuple class of the states of the low-pass."""
        return record_type("FilterState", self.filter_names)

    def feel(self, outputs: Any) -> Any:
        """The quantities at the sensors: a NamedTuple by channel, before low-pass and noise.

        `outputs` has the channels' names as attributes. If accelerations are measured, yaw_rate and yaw_acceleration
        are used, too; they are zero if a car (`Longitudinal`, `Kinematic`) does not have them. For a car with roll or
        pitch, a_x, a_y, yaw_rate and yaw_acceleration are needed if one of `rigid_body.INERTIAL` is measured.
        """
        check_names("sensors measure a channel the vehicle does not have", self.channels, outputs._fields)
        leans = {"roll", "pitch"} & set(outputs._fields) and set(INERTIAL) & set(self.channels)
        felt = inertial(outputs._asdict(), self.position) if leans else {}
        values = [felt[name] if name in felt else self._at_position(name, outputs) for name in self.channels]
        return record_type("Measurements", self.channels)(*values)

    def start(self, outputs: Any) -> Any:
        """The states of the low-pass, settled at these outputs."""
        settled = [self.low_pass.start(value) for value in self.feel(outputs)] if self.low_pass else []
        return self.filter_type(*[state for states in settled for state in states])

    def derivatives(self, filter_state: Any, outputs: Any) -> Any:
        """The time derivatives of the states of the low-pass, as the same NamedTuple."""
        if self.low_pass is None:
            return self.filter_type()
        felt, n = self.feel(outputs), self.low_pass.order
        rates = [self.low_pass.derivatives(tuple(filter_state[i * n : (i + 1) * n]), u) for i, u in enumerate(felt)]
        return self.filter_type(*[rate for of_channel in rates for rate in of_channel])

    def measure(self, outputs: Any, filter_state: Any = None) -> Any:
        """The measurements without noise: a NamedTuple by channel."""
        if self.low_pass is None:
            return self.feel(outputs)
        if filter_state is None:
            raise InputError("SensorSet.measure: these sensors have a low-pass; give its states as filter_state.")
        return record_type("Measurements", self.channels)(*filter_state[:: self.low_pass.order])

    def _at_position(self, channel: str, outputs: Any):
        value = getattr(outputs, channel)
        if channel not in ("a_x", "a_y"):
            return value
        # A car without these goes straight, or turns steadily while its inputs are held.
        zero = jnp.zeros_like(value)
        turns, gains = getattr(outputs, "yaw_rate", zero) ** 2, getattr(outputs, "yaw_acceleration", zero)
        if channel == "a_x":
            return value - gains * self.position.y - turns * self.position.x
        return value + gains * self.position.x - turns * self.position.y


def esc(
    yaw_rate: float | None = 0.005,
    a_y: float | None = 0.1,
    a_x: float | None = None,
    v_x: float | None = None,
    v_y: float | None = None,
    *,
    low_pass: LowPass | None = None,
    position: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> SensorSet:
    """The sensors of a stability control: yaw rate and lateral acceleration, and further channels if given.

    Each argument is the standard deviation of a channel's noise (rad/s, m/s^2, m/s), or None if the sensor is not fitted.
    `low_pass`: the low-pass in every channel, such as `LowPass(20.0)`. `position`: position of the accelerometers from the
    centre of gravity (x, y, z), m. In a car that rolls or pitches they turn with its body and measure gravity.

    **Raises** `InputError` for a standard deviation that is not positive, or if no sensor is fitted.
    """
    fitted = {"yaw_rate": yaw_rate, "a_y": a_y, "a_x": a_x, "v_x": v_x, "v_y": v_y}
    fitted = {name: std for name, std in fitted.items() if std is not None}
    if not fitted:
        raise InputError("esc: no channel is fitted; give at least one of them a standard deviation.")
    return SensorSet(Gaussian(fitted), position_of("position", position), low_pass)


def position_of(name: str, place: Any) -> Position:
    """The position (x, y, z), m; raises `InputError` for what are no three numbers."""
    if isinstance(place, str) or not isinstance(place, Iterable) or len(place := tuple(place)) != 3:
        raise InputError(f"{name} = {place!r}: must be (x, y, z) in m from the centre of gravity.")
    check_single(**{f"{name}: {axis}": value for axis, value in zip("xyz", place, strict=True)})
    return Position(*place)

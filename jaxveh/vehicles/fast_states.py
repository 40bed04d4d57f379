"""Which cars have states that decay within a millisecond."""

from __future__ import annotations

from jaxveh.vehicles.base import AbstractVehicle

SLOW = {
    *("x", "y", "z", "yaw", "roll", "pitch", "v_x", "v_y", "v_z", "yaw_rate", "roll_rate", "pitch_rate", "sideslip"),
    *("a_x_felt", "a_y_felt", "steer", "speed", "hitch"),
}
"""States whose poles stay below 1000 1/s in any car."""


def has_fast_states(car: AbstractVehicle) -> bool:
    """Whether a car has states whose names do not show that they are slow: spins, wheel travels, tyre deflections.

    The pole of a spin is about 5000 1/s at standstill and falls with the speed, to 250 1/s at 20 m/s.
    """
    return not set(car.state_type._fields) <= SLOW

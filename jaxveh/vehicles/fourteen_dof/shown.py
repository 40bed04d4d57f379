"""The outputs of the car with fourteen degrees of freedom in addition to those of all two-track cars."""

from __future__ import annotations

from typing import Any

from jaxveh.vehicles.two_track import UNITS as TWO_TRACK
from jaxveh.vehicles.wheels import Wheels, wheel_names

UNITS = {
    **TWO_TRACK,
    **dict.fromkeys(("z", *wheel_names("travel")), "m"),
    **dict.fromkeys(("v_z", *wheel_names("travel_rate")), "m/s"),
    "a_z": "m/s^2",
    **dict.fromkeys(("roll", "pitch", *wheel_names("camber")), "rad"),
    **dict.fromkeys(("roll_rate", "pitch_rate", *wheel_names("omega_to_body")), "rad/s"),
    **dict.fromkeys(("roll_acceleration", "pitch_acceleration"), "rad/s^2"),
    **dict.fromkeys(wheel_names("suspension_force"), "N"),
    **dict.fromkeys((*wheel_names("M_x"), *wheel_names("M_y")), "N m"),
    **dict.fromkeys(("tyre_dissipation", "damper_dissipation", "brake_dissipation", "drag_dissipation"), "W"),
}
"""The units of states, inputs and outputs."""


def by_wheel(**values: Wheels) -> dict:
    """The outputs `<name>_fl` ... with the values of each wheel."""
    return {name: v for prefix, wheels in values.items() for name, v in zip(wheel_names(prefix), wheels, strict=True)}


def moments(forces: Wheels) -> dict:
    """The overturning and rolling resistance moments of the tyres."""
    pick = lambda name: Wheels(*[getattr(f, name) for f in forces])
    return by_wheel(M_x=pick("M_x"), M_y=pick("M_y"))


def attitude_outputs(x: Any, roll_acceleration: Any, pitch_acceleration: Any, a_z: Any) -> dict:
    """The outputs of heave, roll and pitch."""
    kept = ("z", "v_z", "roll", "pitch", "roll_rate", "pitch_rate")
    own = {"roll_acceleration": roll_acceleration, "pitch_acceleration": pitch_acceleration, "a_z": a_z}
    return {name: getattr(x, name) for name in kept} | own

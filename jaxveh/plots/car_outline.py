"""A car from above: its body, its wheels, and the forces on them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import check_kind, check_positive
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import drive_channels
from jaxveh.io import CarSpecification
from jaxveh.vehicles import AbstractVehicle

TYPICAL = {"front": 1.2, "rear": 1.5, "track": 1.55}
"""Positions of the axles and track of an ordinary passenger car, m, for recordings without a car."""

OVERHANG = (0.85, 0.95)
"""Distances from the axles to the bumpers in front and behind, m; our choice."""

BESIDE = 0.12
"""Distance from a wheel's centre to the side of the body, m; our choice."""

WHEEL = 0.65
"""Diameter of a drawn wheel, m."""


class Footprint(NamedTuple):
    """Distances (m): from the centre of gravity to the front and the rear axle, and the tracks; `single`: a single-track car."""

    front: float
    rear: float
    track_front: float
    track_rear: float
    single: bool

    @property
    def wheels(self) -> dict[str, tuple[float, float]]:
        """Position (x, y), m, of each wheel (`fl` ...), or of each axle (`f`, `r`) of a single track."""
        if self.single:
            return {"f": (self.front, 0.0), "r": (-self.rear, 0.0)}
        left = {"fl": (self.front, self.track_front / 2), "rl": (-self.rear, self.track_rear / 2)}
        return left | {name[0] + "r": (x, -y) for name, (x, y) in left.items()}

    @property
    def body(self) -> np.ndarray:
        """The outline of the body, (n, 2), m."""
        half = max(self.track_front, self.track_rear) / 2 + BESIDE
        nose, tail = self.front + OVERHANG[0], -self.rear - OVERHANG[1]
        return np.array(
            [
                (tail, -half),
                (nose - 0.5, -half),
                (nose, -half + 0.4),
                (nose, half - 0.4),
                (nose - 0.5, half),
                (tail, half),
            ]
        )


def footprint(recording: Recording, car: Any, wheelbase: float | None, track: float | None) -> Footprint:
    """Return the footprint of a `car` (inside any wrapper) or, without one, of a wheelbase and a track (m)."""
    while hasattr(car, "vehicle"):
        car = car.vehicle
    if car is not None:
        check_kind("car", car, AbstractVehicle | CarSpecification, "vehicles.passenger_car() is one.")
    for name, value in (("wheelbase", wheelbase), ("track", track)):
        if value is not None:
            check_positive(name, value, "m")
    front, rear = (
        float(getattr(car, "front_axle_to_cg", TYPICAL["front"])),
        float(getattr(car, "rear_axle_to_cg", TYPICAL["rear"])),
    )
    if wheelbase is not None:
        front, rear = (wheelbase * part / (front + rear) for part in (front, rear))
    tracks = [
        float(getattr(car, f"track_{axle}", None) or TYPICAL["track"]) if track is None else float(track)
        for axle in ("front", "rear")
    ]
    return Footprint(
        front,
        rear,
        *tracks,
        single=not drive_channels.has(recording, "F_y_fl") and drive_channels.has(recording, "F_yf"),
    )


def rotate(points: Any, angle: float) -> np.ndarray:
    """Return points (n, 2) rotated to the left by an angle (rad)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.asarray(points) @ np.array([[cosine, sine], [-sine, cosine]])


ANGLES = {"fl": ("steer_left",), "fr": ("steer_right",)}
"""Further names in logs for a front wheel's own angle."""


def wheel_angles(recording: Recording, footprint: Footprint) -> dict[str, np.ndarray]:
    """Return the angle of each wheel relative to the car, (T,), rad.

    It is the wheel's own angle if that is known, otherwise that of its axle, and zero if neither is known.
    """
    found = {}
    for name in footprint.wheels:
        asked = (f"steer_{name}", *ANGLES.get(name, ()), "steer" if name[0] == "f" else "steer_rear")
        there = [channel for channel in asked if drive_channels.has(recording, channel)]
        found[name] = drive_channels.channel(recording, there[0]) if there else np.zeros(len(recording))
    return found


def wheel_forces(recording: Recording, footprint: Footprint) -> dict[str, np.ndarray]:
    """Return the forces of the road on each wheel in the car's axes, (T, 2), N; empty if the recording has none."""
    forces = {}
    angles = wheel_angles(recording, footprint)
    for name in footprint.wheels:
        along, across = (f"F_x{name}", f"F_y{name}") if footprint.single else (f"F_x_{name}", f"F_y_{name}")
        if not drive_channels.has(recording, across):
            return {}
        F_y = drive_channels.channel(recording, across)
        F_x = drive_channels.channel(recording, along) if drive_channels.has(recording, along) else np.zeros_like(F_y)
        cosine, sine = np.cos(angles[name]), np.sin(angles[name])
        forces[name] = np.stack([F_x * cosine - F_y * sine, F_x * sine + F_y * cosine], axis=1)
    return forces

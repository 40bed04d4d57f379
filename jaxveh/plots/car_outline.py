"""A car seen from above: its body, its wheels, and the forces on them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jaxveh._core.errors import check_positive
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import drive_channels

TYPICAL = {"front": 1.2, "rear": 1.5, "track": 1.55}
"""m: places of axles and the track of an ordinary passenger car, for recordings that come without the car."""

OVERHANG = (0.85, 0.95)
"""m: from the axles to the bumpers in front and behind; ours."""

BESIDE = 0.12
"""m: from a wheel's middle to the body's side; ours."""

WHEEL = 0.65
"""m: diameter of a wheel as drawn."""


class Footprint(NamedTuple):
    """Distances (m): from the centre of gravity to the front and the rear axle, and the tracks; `single` for a car whose wheels
    are on one track."""

    front: float
    rear: float
    track_front: float
    track_rear: float
    single: bool

    @property
    def wheels(self) -> dict[str, tuple[float, float]]:
        """(x, y), m, of each wheel (`fl` ...), or of each axle (`f`, `r`) of a single track."""
        if self.single:
            return {"f": (self.front, 0.0), "r": (-self.rear, 0.0)}
        left = {"fl": (self.front, self.track_front / 2), "rl": (-self.rear, self.track_rear / 2)}
        return left | {name[0] + "r": (x, -y) for name, (x, y) in left.items()}

    @property
    def body(self) -> np.ndarray:
        """The outline, (n, 2), m, with a nose."""
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
    """The footprint of a `car` (what wraps it is looked through) or, without one, of a wheelbase and a track (m)."""
    while hasattr(car, "vehicle"):
        car = car.vehicle
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
        float(getattr(car, f"track_{axle}", TYPICAL["track"])) if track is None else float(track)
        for axle in ("front", "rear")
    ]
    return Footprint(
        front,
        rear,
        *tracks,
        single=not drive_channels.has(recording, "F_y_fl") and drive_channels.has(recording, "F_yf"),
    )


def rotate(points: Any, angle: float) -> np.ndarray:
    """Points (n, 2) turned to the left by an angle (rad)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.asarray(points) @ np.array([[cosine, sine], [-sine, cosine]])


ANGLES = {"fl": ("steer_left",), "fr": ("steer_right",)}
"""What logs call a front wheel's own angle, too."""


def wheel_angles(recording: Recording, footprint: Footprint) -> dict[str, np.ndarray]:
    """How far each wheel is turned against the car, (T,), rad: by its own angle where that is known, else the front wheels by the
    steer, and rear ones not at all."""
    found = {}
    for name in footprint.wheels:
        asked = (f"steer_{name}", *ANGLES.get(name, ()), "steer" if name[0] == "f" else "steer_rear")
        there = [channel for channel in asked if drive_channels.has(recording, channel)]
        found[name] = drive_channels.channel(recording, there[0]) if there else np.zeros(len(recording))
    return found


def wheel_forces(recording: Recording, footprint: Footprint) -> dict[str, np.ndarray]:
    """Forces of the road on each wheel in the car's directions, (T, 2), N; empty where the recording has none."""
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

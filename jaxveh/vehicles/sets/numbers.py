"""The known numbers of a car: one record from which vehicles of every fidelity are built."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from jaxveh._core.errors import InputError, check, check_finite, check_flags, check_positive
from jaxveh.vehicles.base import GRAVITY
from jaxveh.vehicles.steering import AbstractSteering


@dataclass(frozen=True)
class TyreNumbers:
    """One tyre under its load at rest: `cornering_stiffness` (N/rad), `slip_stiffness` (N; None: the cornering stiffness), peak
    `friction` (-). More detailed data replace these, in this order: `property_file`, the path of a tyre property file;
    `coefficients` of PAC2002 by their names in property files, with stiffness proportional to load; `axle_formula`, the Magic
    Formula (B, C, D, E) of both tyres of the axle together, only for cars on one track."""

    cornering_stiffness: float
    slip_stiffness: float | None = None
    friction: float = 1.0
    property_file: str | None = None
    coefficients: Mapping[str, float] | None = None
    axle_formula: tuple[float, float, float, float] | None = None

    def __post_init__(self):
        for name in ("cornering_stiffness", "slip_stiffness", "friction"):
            if getattr(self, name) is not None:
                check_positive(f"TyreNumbers.{name}", getattr(self, name))


@dataclass(frozen=True)
class SuspensionNumbers:
    """Body and suspension: masses (kg; unsprung ones per wheel), the inertias of the sprung mass about its own centre of gravity
    (kg m^2) and the position of that (m: distances from the axles, height at rest), springs (N/m) and dampers (N s/m) at the
    wheel, anti-roll bars (N/m: force at a wheel over the difference of the two wheels' travels), heights of the roll centres
    (m), stiffness (N/m) and damping (N s/m) of a tyre."""

    sprung_mass: float
    unsprung_mass_front: float
    unsprung_mass_rear: float
    roll_inertia: float
    pitch_inertia: float
    yaw_inertia: float
    front_axle_to_cg: float
    rear_axle_to_cg: float
    cg_height: float
    spring_front: float
    spring_rear: float
    damper_front: float
    damper_rear: float
    tyre_stiffness: float
    anti_roll_front: float = 0.0
    anti_roll_rear: float = 0.0
    roll_centre_front: float = 0.0
    roll_centre_rear: float = 0.0
    roll_yaw_product: float = 0.0
    tyre_damping: float = 0.0

    def __post_init__(self):
        either = ("roll_centre_front", "roll_centre_rear", "roll_yaw_product")
        zero = ("anti_roll_front", "anti_roll_rear", "damper_front", "damper_rear", "tyre_damping")
        for entry in fields(self):
            name, value = f"SuspensionNumbers.{entry.name}", getattr(self, entry.name)
            if entry.name in either:
                check_finite(name, value)
            elif entry.name in zero:
                check(name, value, lambda v: (v >= 0) & (v < 1e9), "at least 0 and finite")
            else:
                check_positive(name, value)


@dataclass(frozen=True)
class CarNumbers:
    """The numbers of a car in SI units, None if unknown; `source` is their origin.

    Distances of the axles from the centre of gravity of the whole car, `cg_height`, tracks and `wheel_radius` in m; `mass` kg,
    `yaw_inertia` kg m^2, `wheel_inertia` kg m^2 (of one wheel), `drag` N s^2/m^2, `rolling_resistance` (-), the front axle's
    shares of driving and braking (-), `four_motors`: whether each wheel has its own motor; `front` and `rear`: the tyre of one
    wheel of each axle. Vehicles with an optional `cg_height` are built without it (see `build`). `trailer_length` (m): from the
    hitch to the trailer's axle. `steer_offset` (rad) is added to the steer. `steering`: the steering system
    (`AbstractSteering`), None for front steering.

    **Raises** `InputError` for values that no car has.
    """

    name: str
    source: str
    front_axle_to_cg: float
    rear_axle_to_cg: float
    mass: float | None = None
    yaw_inertia: float | None = None
    front: TyreNumbers | None = None
    rear: TyreNumbers | None = None
    cg_height: float | None = None
    track_front: float | None = None
    track_rear: float | None = None
    wheel_radius: float | None = None
    wheel_inertia: float | None = None
    drag: float | None = None
    rolling_resistance: float | None = None
    front_drive: float = 1.0
    front_brake: float = 0.65
    four_motors: bool = False
    suspension: SuspensionNumbers | None = None
    trailer_length: float | None = None
    steer_offset: float = 0.0
    steering: AbstractSteering | None = None

    def __post_init__(self):
        for name in (
            "front_axle_to_cg", "rear_axle_to_cg", "mass", "yaw_inertia", "cg_height", "track_front", "track_rear",
            "wheel_radius", "wheel_inertia", "trailer_length",
        ):  # fmt: skip
            if getattr(self, name) is not None:
                check_positive(f"{self.name}: {name}", getattr(self, name))
        check_flags(**{f"{self.name}: four_motors": self.four_motors})
        for name in ("front_drive", "front_brake"):
            check(f"{self.name}: {name}", getattr(self, name), lambda v: (v >= 0) & (v <= 1), "between 0 and 1")
        for name in ("drag", "rolling_resistance"):
            if getattr(self, name) is not None:
                check(
                    f"{self.name}: {name}", getattr(self, name), lambda v: (v >= 0) & (v < 1e6), "at least 0 and finite"
                )

    @property
    def wheelbase(self) -> float:
        """The distance between the axles, m."""
        return self.front_axle_to_cg + self.rear_axle_to_cg

    def wheel_loads(self) -> tuple[float, float]:
        """The loads of a front and of a rear wheel at rest on a level road, N."""
        if self.mass is None:
            raise InputError(f"{self.name}: the mass is missing, which the loads need; give it in kg.")
        half = 0.5 * self.mass * GRAVITY / self.wheelbase
        return half * self.rear_axle_to_cg, half * self.front_axle_to_cg

    def values(self, sprung: bool = False) -> dict[str, Any]:
        """All known numbers by the names of the vehicles' parameters. With `sprung` the position and the inertias are those of
        the sprung mass instead of the whole car. Axle stiffnesses are twice those of a tyre."""
        check_flags(sprung=sprung)
        found = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        found |= {"wheelbase": self.wheelbase}
        for axle in ("front", "rear"):
            tyre = found.pop(axle)
            found[f"{axle}_stiffness"] = None if tyre is None else 2.0 * tyre.cornering_stiffness
        suspension = found.pop("suspension")
        if suspension is not None:
            own = {entry.name: getattr(suspension, entry.name) for entry in fields(suspension)}
            found |= own if sprung else {name: value for name, value in own.items() if name not in found}
            found |= self._rolling(suspension)
            if not sprung:
                found |= self._leaning_parameters(suspension, found)
        return {name: value for name, value in found.items() if value is not None}

    def _leaning_parameters(self, s: SuspensionNumbers, known: dict[str, Any]) -> dict[str, Any]:
        """The parameters of the suspension for cars without suspension travel: `unsprung_height`, `roll_yaw_product` about the
        roll axis below the whole car's centre of gravity, and the front axle's share of the lateral load transfer
        (`front_roll_share`). The part of springs and bars is shared by stiffness, that of roll centres and unsprung masses by
        the masses on each axle."""
        found = {} if self.wheel_radius is None else {"unsprung_height": self.wheel_radius}
        share = self.rear_axle_to_cg / self.wheelbase
        axis = share * s.roll_centre_front + (1.0 - share) * s.roll_centre_rear
        arm, ahead = s.cg_height - axis, self.front_axle_to_cg - s.front_axle_to_cg
        found["roll_yaw_product"] = s.roll_yaw_product + s.sprung_mass * ahead * arm
        stiff_front, stiff_rear = known.get("roll_stiffness_front"), known.get("roll_stiffness_rear")
        radius = self.wheel_radius
        if stiff_front is None or stiff_rear is None or radius is None:
            return found
        leaning = s.sprung_mass * arm
        direct = [
            part * s.sprung_mass * centre + 2.0 * unsprung * radius
            for part, centre, unsprung in (
                (share, s.roll_centre_front, s.unsprung_mass_front),
                (1.0 - share, s.roll_centre_rear, s.unsprung_mass_rear),
            )
        ]
        front = leaning * stiff_front / (stiff_front + stiff_rear) + direct[0]
        return found | {"front_roll_share": front / (leaning + sum(direct))}

    def _rolling(self, s: SuspensionNumbers) -> dict[str, Any]:
        """The roll stiffness (N m/rad) and damping (N m s/rad) of each axle: springs and bar, with the tyres in series."""
        found = {}
        for axle in ("front", "rear"):
            track = getattr(self, f"track_{axle}")
            if track is None:
                continue
            spring = track**2 * (0.5 * getattr(s, f"spring_{axle}") + getattr(s, f"anti_roll_{axle}"))
            tyre = 0.5 * track**2 * s.tyre_stiffness
            found[f"roll_stiffness_{axle}"] = spring * tyre / (spring + tyre)
            found[f"roll_damping_{axle}"] = 0.5 * track**2 * getattr(s, f"damper_{axle}")
        return found


NAMED_ALIKE = (
    "mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg", "track_front", "track_rear", "wheel_radius", "wheel_inertia",
)  # fmt: skip
"""The numbers with the same names in cars' files, in CommonRoad's files and in `CarNumbers`."""

SHARES = ("front_drive", "front_brake")
"""The numbers with a generic default for files without them."""


def named_alike(specification: Any) -> dict[str, Any]:
    """The numbers of a file's specification with the same names as in `CarNumbers`, without shares that are missing from it."""
    shares = {name: getattr(specification, name) for name in SHARES}
    known = {name: share for name, share in shares.items() if share is not None}
    return {name: getattr(specification, name) for name in NAMED_ALIKE} | known

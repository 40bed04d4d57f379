"""The file that describes a car: TOML in SI units, checked key by key."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, check, check_flags, check_kind, check_one_of, path_of
from jaxveh.io.car_table import CarTable
from jaxveh.io.toml import check_file, check_keys, read_toml, toml_number, toml_string, toml_text, write_toml

CAR_SCHEMA = """\
# A car. SI units; axes x forward, y left, z up; steer positive to the left.
mass = 1500.0                        # kg
yaw_inertia = 2500.0                 # kg m^2, about the vertical axis through the centre of gravity
front_axle_to_cg = 1.2               # m
rear_axle_to_cg = 1.5                # m
front_cornering_stiffness = 90000.0  # N/rad, both wheels of the axle; may be omitted if [front] is given
rear_cornering_stiffness = 110000.0  # N/rad, both wheels of the axle; may be omitted if [rear] is given

# All that follows is optional.
name = "passenger car"
cg_height = 0.55                     # m above ground
track_front = 1.55                   # m
track_rear = 1.56                    # m
steering_ratio = 15.0                # steering wheel angle over road wheel angle
steer_offset = 0.002                 # rad: value of the steer channel (at the road wheels) when the car runs straight
steering = "front"                   # or "ackermann", "rear", "four-wheel", "independent": which wheels are steered
rear_steer_ratio = 0.0               # rear over front angle of "four-wheel"; at standstill if the next key is given
rear_steer_ratio_fast = 0.0          # rear over front angle at high speed
rear_steer_speed = 20.0              # m/s: speed at which the ratio is halfway between the two
sensor_position = [0.1, 0.0, 0.3]    # m from the centre of gravity: forward, left, up
reference_position = [0.0, 0.0, 0.0] # m from the centre of gravity: where the reference v_y or sideslip is measured
low_pass = 20.0                      # Hz, cutoff of the low-pass in the accelerometers and the gyroscope
wheel_radius = 0.32                  # m, of a rolling wheel
wheel_inertia = 1.2                  # kg m^2, of one wheel about its axle
drag = 0.4                           # N s^2/m^2: half the air's density times c_d times the area
rolling_resistance = 0.01            # force over load
front_drive = 1.0                    # the front axle's share of the driving torque
front_brake = 0.65                   # the front axle's share of the braking torque
brake_torque_per_pressure = 1.6e-3   # N m/Pa: braking torque of all wheels together over the line pressure
antenna_position = [-0.5, 0.0, 0.9]  # m from the centre of gravity: position of the satellite antenna
satellite_delay = 0.15               # s, delay of speed and course from satellites
inertial_delay = 0.01                # s, delay of accelerometers and gyroscope in addition to their low-pass
camera_delay = 0.08                  # s, delay of the lane from a camera
roll_gradient = 0.006                # rad/(m/s^2): roll of the body relative to the road per lateral acceleration
roll_frequency = 1.6                 # Hz, undamped natural frequency of the body in roll
roll_damping = 0.3                   # damping ratio of the body in roll
pitch_gradient = 0.004               # rad/(m/s^2): rise of the nose relative to the road per longitudinal acceleration
# front_tyre = "tyres/front.tir"     # tyre property file of a front wheel, relative to the folder of this file
# rear_tyre = "tyres/rear.tir"

# The Magic Formula of an axle, F_y = D sin(C atan(B a - E (B a - atan(B a)))) + S_v with a = slip angle + S_h.
[front]
B = 10.0                             # 1/rad
C = 1.3
D = 8000.0                           # N, both wheels of the axle; times load / nominal_load if nominal_load is given
E = 0.2
S_h = 0.0                            # rad, optional
S_v = 0.0                            # N, optional
nominal_load = 8175.0                # N, both wheels, optional

[rear]
B = 12.0
C = 1.3
D = 6600.0
E = 0.2
"""
"""The file's schema as a commented, valid example, for programs to print."""


STEERINGS = ("front", "ackermann", "rear", "four-wheel", "independent")
"""The kinds of steering, by the steered wheels.

The front wheels (equal angles, or about one point); also a rear axle with its own angle; the rear wheels by a ratio of the front
angle; each wheel by itself.
"""

PLACES = ("sensor_position", "reference_position", "antenna_position")
"""Keys whose values are [x, y, z]."""


def _number(low: float, high: float, unit: str = "", **default: Any) -> Any:
    return field(metadata={"low": low, "high": high, "unit": unit}, **default)


@dataclass(frozen=True)
class AxleTyre:
    """Magic Formula coefficients of an axle, both wheels together; slip angle in radians, positive with the force.

    `F_y = D sin(C atan(B a - E (B a - atan(B a)))) + S_v`, `a = slip angle + S_h`; B in 1/rad, D and S_v in newton,
    S_h in radians. With `nominal_load` (newton, both wheels) D is the peak at that load and scales with
    load / nominal_load.
    """

    B: float = _number(0.01, 1e3, "1/rad")
    C: float = _number(0.01, 10.0)
    D: float = _number(1e-3, 1e8, "N")
    E: float = _number(-1e3, 1e3)
    S_h: float = _number(-0.5, 0.5, "rad", default=0.0)
    S_v: float = _number(-1e8, 1e8, "N", default=0.0)
    nominal_load: float | None = _number(1e-3, 1e8, "N", default=None)

    def __post_init__(self):
        _check_numbers(self)


@dataclass(frozen=True, repr=False)
class CarSpecification(CarTable):
    """The contents of a car file: floats in SI units, None for values that the file does not give. See `car.CAR_SCHEMA`.

    Cornering stiffnesses are per axle, N/rad; a missing one is B C D of the axle's tyre coefficients.
    `steer_offset`: value of a steer channel at the road wheels when the car runs straight. `steering`: one of
    `car.STEERINGS`, None for front wheels; the ratios are of rear over front angle (see `vehicles.FourWheelSteering`).
    `sensor_position`, `reference_position`: x, y, z in metres from the centre of gravity, of the inertial unit and of a
    reference for sideslip. `antenna_position`: likewise of the satellite antenna; `satellite_delay`, `inertial_delay`,
    `camera_delay` in seconds: delays of these measurements, without that of an inertial unit's low-pass. `low_pass`: cutoff in
    hertz, of second order. `roll_gradient`, `pitch_gradient`: of the body relative to the road, per acceleration in the axes of
    the road. `front_tyre`, `rear_tyre`: paths of the tyre property files of a wheel, which are opened only when a model with
    four wheels is built.

    **Raises** `InputError` with name, value and allowed range for values that no car has, such as a negative mass.
    """

    mass: float = _number(0.1, 1e6, "kg")
    yaw_inertia: float = _number(1e-4, 1e8, "kg m^2")
    front_axle_to_cg: float = _number(1e-3, 30.0, "m")
    rear_axle_to_cg: float = _number(1e-3, 30.0, "m")
    front_cornering_stiffness: float | None = _number(0.1, 1e8, "N/rad", default=None)
    rear_cornering_stiffness: float | None = _number(0.1, 1e8, "N/rad", default=None)
    name: str | None = None
    cg_height: float | None = _number(0.0, 10.0, "m", default=None)
    track_front: float | None = _number(1e-3, 10.0, "m", default=None)
    track_rear: float | None = _number(1e-3, 10.0, "m", default=None)
    steering_ratio: float | None = _number(0.1, 200.0, default=None)
    steer_offset: float | None = _number(-0.5, 0.5, "rad", default=None)
    steering: str | None = None
    rear_steer_ratio: float | None = _number(-5.0, 5.0, default=None)
    rear_steer_ratio_fast: float | None = _number(-5.0, 5.0, default=None)
    rear_steer_speed: float | None = _number(0.1, 1e3, "m/s", default=None)
    sensor_position: tuple[float, float, float] | None = _number(-30.0, 30.0, "m", default=None)
    reference_position: tuple[float, float, float] | None = _number(-30.0, 30.0, "m", default=None)
    low_pass: float | None = _number(1e-3, 1e6, "Hz", default=None)
    wheel_radius: float | None = _number(1e-3, 5.0, "m", default=None)
    wheel_inertia: float | None = _number(1e-6, 1e4, "kg m^2", default=None)
    drag: float | None = _number(0.0, 1e3, "N s^2/m^2", default=None)
    rolling_resistance: float | None = _number(0.0, 1.0, default=None)
    front_drive: float | None = _number(0.0, 1.0, default=None)
    front_brake: float | None = _number(0.0, 1.0, default=None)
    brake_torque_per_pressure: float | None = _number(0.0, 10.0, "N m/Pa", default=None)
    antenna_position: tuple[float, float, float] | None = _number(-30.0, 30.0, "m", default=None)
    satellite_delay: float | None = _number(0.0, 5.0, "s", default=None)
    inertial_delay: float | None = _number(0.0, 5.0, "s", default=None)
    camera_delay: float | None = _number(0.0, 5.0, "s", default=None)
    roll_gradient: float | None = _number(0.0, 0.1, "rad/(m/s^2)", default=None)
    roll_frequency: float | None = _number(0.1, 100.0, "Hz", default=None)
    roll_damping: float | None = _number(1e-3, 10.0, default=None)
    pitch_gradient: float | None = _number(-0.1, 0.1, "rad/(m/s^2)", default=None)
    front_tyre: str | None = None
    rear_tyre: str | None = None
    front: AxleTyre | None = None
    rear: AxleTyre | None = None

    def __post_init__(self):
        for name in PLACES:
            place = getattr(self, name)
            if place is not None:
                object.__setattr__(self, name, tuple(map(float, place)))
                if len(place) != 3:
                    raise InputError(f"{name} = {list(place)}: must be [x, y, z].")
        _check_numbers(self)
        _check_steering(self)
        for axle in ("front", "rear"):
            key, tyre = f"{axle}_cornering_stiffness", getattr(self, axle)
            if getattr(self, key) is None:
                if tyre is None:
                    told = getattr(self, f"{axle}_tyre") is not None
                    why = f" {axle}_tyre is a single wheel's: `jaxveh tyre show` prints its stiffness." * told
                    raise InputError(f"{key} is missing: give it in N/rad, or tyre coefficients under [{axle}].{why}")
                object.__setattr__(self, key, tyre.B * tyre.C * tyre.D)

    def save(self, path: str | os.PathLike, *, overwrite: bool = False) -> None:
        """Write it as a car file in TOML; see `write_car`."""
        write_car(self, path, overwrite=overwrite)

    @classmethod
    def load(cls, path: str | os.PathLike) -> CarSpecification:
        """Read a car file; see `read_car`."""
        return read_car(path)

    @property
    def wheelbase(self) -> float:
        """Distance between the axles in metres."""
        return self.front_axle_to_cg + self.rear_axle_to_cg

    @property
    def steers_front_alone(self) -> bool:
        """Whether no rear wheel is steered."""
        return self.steering in (None, "front", "ackermann")

    def with_front_steering(self) -> CarSpecification:
        """Return the car with front steering: steered rear wheels become straight."""
        if self.steers_front_alone:
            return self
        return replace(self, steering=None, rear_steer_ratio=None, rear_steer_ratio_fast=None)


def read_car(path: str | os.PathLike) -> CarSpecification:
    """Read a car from TOML (`car.CAR_SCHEMA`).

    **Raises** `InputError` naming the file and: the line of broken TOML, a key that is missing or unknown (with
    similar ones), or a value with its allowed range.
    """
    path = path_of(path)
    content = read_toml(path)
    check_file(path, content, "car", [entry.name for entry in fields(CarSpecification)])
    return car_of_toml(content, str(path), path.parent)


def car_of_toml(content: Mapping[str, Any], where: str, folder: Path) -> CarSpecification:
    """Return the car of a TOML table; file names in it are relative to `folder`, and errors begin with `where`."""
    check_keys(where, content, [entry.name for entry in fields(CarSpecification)])
    try:
        values = {key: _value(key, value, folder) for key, value in content.items()}
        return _build(CarSpecification, values)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def write_car(car: CarSpecification, path: str | os.PathLike, *, note: str = "", overwrite: bool = False) -> None:
    """Write a car as TOML that `read_car` reads back bit for bit; `note` becomes comment lines at the top.

    The file is written completely or not at all. **Raises** `InputError` if it exists and `overwrite` is False.
    """
    check_flags(overwrite=overwrite)
    check_car_file("write_car", car)
    write_toml(car_lines(car), path, overwrite, note)


def check_car_file(who: str, car: Any) -> None:
    """Raise `InputError` unless `car` is what a car's file says."""
    check_kind(
        f"{who}: car",
        car,
        CarSpecification,
        "io.read_car reads one from a file; a vehicle cannot be turned back into one.",
    )


def car_lines(car: CarSpecification, table: str = "") -> list[str]:
    """Return the lines of a car in TOML, inside a table of this name if one is given."""
    lines = [f"[{table}]"] if table else []
    lines += _lines(car)
    for axle in ("front", "rear"):
        if getattr(car, axle) is not None:
            lines += ["", f"[{table}.{axle}]" if table else f"[{axle}]", *_lines(getattr(car, axle))]
    return lines


def _lines(values: Any) -> list[str]:
    """Return `key = value  # unit` for each number and string that is not None."""
    lines = []
    for entry in fields(values):
        value, unit = getattr(values, entry.name), entry.metadata.get("unit")
        if value is None or isinstance(value, AxleTyre):
            continue
        shown = (
            toml_string(value) if isinstance(value, str) else str(list(value) if isinstance(value, tuple) else value)
        )
        lines.append(f"{entry.name} = {shown}{f'  # {unit}' if unit else ''}")
    return lines


def _value(key: str, value: Any, folder: Path) -> Any:
    if key in ("front", "rear"):
        check_keys(f"[{key}]", value, [entry.name for entry in fields(AxleTyre)])
        try:
            return _build(AxleTyre, {name: toml_number(name, item) for name, item in value.items()})
        except InputError as error:
            raise InputError(f"[{key}]: {error}") from error
    if key in ("name", "steering"):
        return toml_text(key, value)
    if key in ("front_tyre", "rear_tyre"):
        return str(folder / toml_text(key, value))
    if key in PLACES:
        if not isinstance(value, list) or len(value) != 3:
            raise InputError(f"{key} = {value!r}: must be [x, y, z] in metres.")
        return tuple(toml_number(key, item) for item in value)
    return toml_number(key, value)


def _build(kind: type, values: Mapping[str, Any]) -> Any:
    """Make the dataclass; the error lists all missing required keys."""
    missing = [entry.name for entry in fields(kind) if _is_required(entry) and entry.name not in values]
    if missing:
        raise InputError(f"missing key(s): {', '.join(missing)}.")
    return kind(**values)


def _is_required(entry: Any) -> bool:
    return entry.default is MISSING


def _check_steering(car: CarSpecification) -> None:
    """Raise `InputError` for an unknown steering, a missing ratio, and a ratio that the steering does not use."""
    if car.steering is not None:
        check_one_of("steering", car.steering, STEERINGS)
    if car.steering == "four-wheel":
        if car.rear_steer_ratio is None:
            raise InputError(
                'rear_steer_ratio is missing: a car with steering = "four-wheel" needs it (rear over front angle).'
            )
        return
    for name in ("rear_steer_ratio", "rear_steer_ratio_fast"):
        if getattr(car, name):
            raise InputError(
                f'{name} = {getattr(car, name)}: only for steering = "four-wheel"; set that, or leave it out.'
            )


def _check_numbers(values: Any) -> None:
    """Convert every number to a Python float and check its range, which is in the field's metadata."""
    for entry in fields(values):
        value = getattr(values, entry.name)
        if value is None or "low" not in entry.metadata:
            continue
        low, high, unit = entry.metadata["low"], entry.metadata["high"], entry.metadata["unit"]
        allowed = f"between {low:g} and {high:g}{f' {unit}' if unit else ''}"
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError) as error:
            raise InputError(f"{entry.name} = {value!r}: must be a number {allowed}.") from error
        check(entry.name, array, lambda v, low=low, high=high: (v >= low) & (v <= high), allowed)
        if not isinstance(value, tuple):
            object.__setattr__(values, entry.name, float(array))

"""The vehicle files of CommonRoad (YAML): one for the car, one for its tyres."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any

from jaxveh._core.errors import InputError, path_of
from jaxveh.io.decimals import decimal
from jaxveh.io.files import check_readable
from jaxveh.io.naming import check_known
from jaxveh.io.optional import require
from jaxveh.io.toml import shorten

TYRE_COEFFICIENTS = (
    *("p_cx1", "p_dx1", "p_dx3", "p_ex1", "p_kx1", "p_hx1", "p_vx1", "r_bx1", "r_bx2", "r_cx1", "r_ex1", "r_hx1"),
    *("p_cy1", "p_dy1", "p_dy3", "p_ey1", "p_ky1", "p_hy1", "p_hy3", "p_vy1", "p_vy3"),
    *("r_by1", "r_by2", "r_by3", "r_cy1", "r_ey1", "r_hy1", "r_vy1", "r_vy3", "r_vy4", "r_vy5", "r_vy6"),
)
"""The coefficients in a tyre file, those of PAC2002."""


def _key(key: str, low: float, high: float, unit: str = "", default: Any = None) -> Any:
    return field(default=default, metadata={"key": key, "low": low, "high": high, "unit": unit})


@dataclass(frozen=True)
class CommonRoadSpecification:
    """The parameters of a vehicle from CommonRoad's files, with the names of this package: floats in SI units, None if missing.

    The keys are explained in M. Althoff & G. Würsching, CommonRoad: Vehicle Models, 2020, tables 6 and 7. `front_axle_to_cg` and
    `rear_axle_to_cg` are those of the sprung mass. Unsprung masses and stiffnesses of the torsion bars (negative, N m/rad) are
    per axle, springs and dampers are per wheel. `tyre` has the coefficients of PAC2002 by their names there (`p_ky1`), or
    is None.

    **Raises** `InputError` with key, value and allowed range for values that no vehicle has.
    """

    front_axle_to_cg: float = _key("a", 1e-3, 30.0, "m", MISSING)
    rear_axle_to_cg: float = _key("b", 1e-3, 30.0, "m", MISSING)
    length: float | None = _key("l", 0.01, 100.0, "m")
    width: float | None = _key("w", 0.01, 10.0, "m")
    steer_min: float | None = _key("steering.min", -2.0, 0.0, "rad")
    steer_max: float | None = _key("steering.max", 0.0, 2.0, "rad")
    steer_rate_min: float | None = _key("steering.v_min", -100.0, 0.0, "rad/s")
    steer_rate_max: float | None = _key("steering.v_max", 0.0, 100.0, "rad/s")
    curvature_rate_max: float | None = _key("steering.kappa_dot_max", 0.0, 1e6)
    curvature_rate_rate_max: float | None = _key("steering.kappa_dot_dot_max", 0.0, 1e6)
    acceleration_max: float | None = _key("longitudinal.a_max", 0.0, 1e3, "m/s^2")
    jerk_max: float | None = _key("longitudinal.j_max", 0.0, 1e9, "m/s^3")
    jerk_rate_max: float | None = _key("longitudinal.j_dot_max", 0.0, 1e9, "m/s^4")
    speed_min: float | None = _key("longitudinal.v_min", -500.0, 0.0, "m/s")
    speed_max: float | None = _key("longitudinal.v_max", 0.0, 500.0, "m/s")
    switching_speed: float | None = _key("longitudinal.v_switch", 1e-3, 500.0, "m/s")
    mass: float | None = _key("m", 0.1, 1e6, "kg")
    sprung_mass: float | None = _key("m_s", 0.1, 1e6, "kg")
    unsprung_mass_front: float | None = _key("m_uf", 1e-3, 1e5, "kg")
    unsprung_mass_rear: float | None = _key("m_ur", 1e-3, 1e5, "kg")
    roll_inertia: float | None = _key("I_Phi_s", 1e-4, 1e8, "kg m^2")
    pitch_inertia: float | None = _key("I_y_s", 1e-4, 1e8, "kg m^2")
    yaw_inertia: float | None = _key("I_z", 1e-4, 1e8, "kg m^2")
    roll_yaw_product: float | None = _key("I_xz_s", -1e8, 1e8, "kg m^2")
    spring_front: float | None = _key("K_sf", 1.0, 1e8, "N/m")
    damper_front: float | None = _key("K_sdf", 0.0, 1e7, "N s/m")
    spring_rear: float | None = _key("K_sr", 1.0, 1e8, "N/m")
    damper_rear: float | None = _key("K_sdr", 0.0, 1e7, "N s/m")
    track_front: float | None = _key("T_f", 1e-3, 10.0, "m")
    track_rear: float | None = _key("T_r", 1e-3, 10.0, "m")
    pin_spring: float | None = _key("K_ras", 0.0, 1e9, "N/m")
    pin_damper: float | None = _key("K_rad", 0.0, 1e8, "N s/m")
    torsion_front: float | None = _key("K_tsf", -1e8, 1e8, "N m/rad")
    torsion_rear: float | None = _key("K_tsr", -1e8, 1e8, "N m/rad")
    tyre_stiffness: float | None = _key("K_zt", 1.0, 1e8, "N/m")
    cg_height: float | None = _key("h_cg", 0.0, 10.0, "m")
    roll_centre_front: float | None = _key("h_raf", -5.0, 5.0, "m")
    roll_centre_rear: float | None = _key("h_rar", -5.0, 5.0, "m")
    sprung_cg_height: float | None = _key("h_s", 0.0, 10.0, "m")
    unsprung_inertia_front: float | None = _key("I_uf", 0.0, 1e6, "kg m^2")
    unsprung_inertia_rear: float | None = _key("I_ur", 0.0, 1e6, "kg m^2")
    wheel_inertia: float | None = _key("I_y_w", 1e-6, 1e4, "kg m^2")
    lateral_compliance: float | None = _key("K_lt", 0.0, 1.0, "m/N")
    wheel_radius: float | None = _key("R_w", 1e-3, 5.0, "m")
    front_brake: float | None = _key("T_sb", 0.0, 1.0)
    front_drive: float | None = _key("T_se", 0.0, 1.0)
    camber_front: float | None = _key("D_f", -100.0, 100.0, "rad/m")
    camber_rear: float | None = _key("D_r", -100.0, 100.0, "rad/m")
    camber_square_front: float | None = _key("E_f", -1e4, 1e4)
    camber_square_rear: float | None = _key("E_r", -1e4, 1e4)
    trailer_length: float | None = _key("trailer.l", 0.01, 100.0, "m")
    trailer_width: float | None = _key("trailer.w", 0.01, 10.0, "m")
    hitch_length: float | None = _key("trailer.l_hitch", 0.01, 100.0, "m")
    total_length: float | None = _key("trailer.l_total", 0.01, 200.0, "m")
    trailer_wheelbase: float | None = _key("trailer.l_wb", 0.01, 100.0, "m")
    tyre: Mapping[str, float] | None = None

    def __post_init__(self):
        for entry in fields(self):
            value = getattr(self, entry.name)
            if value is not None and "key" in entry.metadata:
                low, high, unit = (entry.metadata[name] for name in ("low", "high", "unit"))
                name = f"{entry.metadata['key']} ({entry.name})"
                allowed = f"between {low:g} and {high:g}{f' {unit}' if unit else ''}"
                object.__setattr__(self, entry.name, _number(name, value, low, high, allowed))
        if self.tyre is not None:
            values = {}
            for name, value in self.tyre.items():
                check_known("tire", "coefficient", name, TYRE_COEFFICIENTS)
                values[name] = _number(f"tire.{name}", value, -math.inf, math.inf, "a finite number")
            object.__setattr__(self, "tyre", values)


def read_commonroad(path: str | os.PathLike, tyre: str | os.PathLike | None = None) -> CommonRoadSpecification:
    """Read a vehicle file of CommonRoad (`parameters_vehicle2.yaml`) and, if `tyre` names one, a tyre file
    (`parameters_tire.yaml`).

    **Raises** `InputError` naming the file and: the place of broken YAML, a key that is unknown (with similar ones), missing
    (only `a` and `b` are required) or in both files, or a value with its allowed range.
    """
    keys = {entry.metadata["key"]: entry.name for entry in fields(CommonRoadSpecification) if "key" in entry.metadata}
    tyre_keys = {f"tire.{name}" for name in TYRE_COEFFICIENTS}
    found: dict[str, Any] = {}
    coefficients: dict[str, Any] = {}
    for file in [path_of(path)] if tyre is None else [path_of(path), path_of(tyre)]:
        for key, value in _flat(_load(file)).items():
            check_known(str(file), "key", key, [*keys, *sorted(tyre_keys)])
            into, name = (coefficients, key[5:]) if key in tyre_keys else (found, keys[key])
            if name in into:
                raise InputError(f"{file}: {key} is given twice; it is also in {path}.")
            into[name] = value
    missing = [key for key in ("a", "b") if keys[key] not in found]
    if missing:
        raise InputError(f"{path}: missing key(s): {', '.join(missing)}.")
    try:
        return CommonRoadSpecification(**found, tyre=coefficients or None)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _load(path: Path) -> Mapping:
    yaml = require("yaml", "reading CommonRoad's vehicle files")
    check_readable(path)
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: broken YAML: not UTF-8 text (byte {error.start}).") from error
    except (
        yaml.YAMLError,
        ValueError,
        TypeError,
        RecursionError,
    ) as error:  # invalid dates, numbers and keys, too
        raise InputError(f"{path}: broken YAML: {' '.join(str(error).split())}.") from error
    if not isinstance(content, Mapping):
        raise InputError(f"{path}: must be a mapping of keys to numbers.")
    return content


def _flat(content: Mapping) -> dict[str, Any]:
    """Return `{"steering": {"min": 1}}` as `{"steering.min": 1}`; empty values are left out."""
    flat: dict[str, Any] = {}
    for key, value in content.items():
        inner = {f"{key}.{name}": v for name, v in value.items()} if isinstance(value, Mapping) else {str(key): value}
        flat |= {name: v for name, v in inner.items() if v is not None}
    return flat


def _number(name: str, value: Any, low: float, high: float, allowed: str) -> float:
    try:
        # YAML reads 10.0e3 as text, because its exponents need signs.
        number = math.nan if isinstance(value, bool) else decimal(value) if isinstance(value, str) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not (math.isfinite(number) and low <= number <= high):
        raise InputError(f"{name} = {shorten(value)}: must be {allowed}.")
    return number

"""The settings of a study: nested tables with defaults, checked key by key; and the settings of one of its points."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, is_concrete
from jaxveh.io import CarSpecification, kit
from jaxveh.manoeuvres import MANOEUVRES, USUAL, manoeuvre_options
from jaxveh.studies.numbers import flat

DEFAULTS: dict[str, dict[str, Any]] = {
    "drive": {
        "vehicle": "passenger_car", "fidelity": "single-track", "manoeuvre": "double-lane-change", "road": "level", "rate": 100.0,
    },
    "car": {},
    "sensors": {"devices": "esc"},
    "channels": {},
    "estimator": {"name": "state-space"},
    "told": {},
    "process_noise": {},
    "measurement_noise": {},
    "filter": {"name": "extended"},
    "metrics": {"names": ["rmse.sideslip", "coverage_95.sideslip", "failed"], "after": 0.0},
}  # fmt: skip
"""Every table of a study except `vary`, with the defaults of its keys."""

WHOLE = ("seeds", "seed", "vary")
"""Keys besides these tables."""

OF_DRIVE = ("vehicle", "fidelity", "manoeuvre", "road", "rate", "speed", "steer_deg", "duration")
"""Keys of `drive` besides the manoeuvre's own options."""


NUMBERS = ("drive", "car", "sensors", "told", "process_noise", "measurement_noise")
"""Tables whose values are numbers, except those of `TEXTS`."""

TEXTS = (
    "drive.vehicle", "drive.fidelity", "drive.manoeuvre", "drive.road", "sensors.devices", "estimator.name", "estimator.fidelity",
)  # fmt: skip


def check_kinds(settings: Mapping[str, Any]) -> None:
    """Raise `InputError` for a text, a truth value or an empty list where a number belongs, and for what is no text where a
    text does. Cars' files have been read, and traced numbers pass."""
    for table in DEFAULTS:
        for key, value in flat(settings[table]).items():
            path = f"{table}.{key}"
            if path in TEXTS or table == "channels":
                if not isinstance(value, str | CarSpecification):
                    raise InputError(f"{path} = {kit.shorten(value)}: must be a text in quotes.")
            elif table in NUMBERS and is_concrete(value) and not _is_number(value):
                raise InputError(f"{path} = {kit.shorten(value)}: must be a number, or a list of numbers.")


def _is_number(value: Any) -> bool:
    """Whether a value is a number or an array of numbers, and not empty."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        return False
    # A whole number that no integer type holds is an object to NumPy.
    return array.size > 0 and (array.dtype.kind in "iuf" or type(value) is int)


def with_defaults(told: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The study's tables, each with its defaults; `filter` and `estimator` may be just a name."""
    found: dict[str, dict[str, Any]] = {}
    for table, usual in DEFAULTS.items():
        own = told.get(table, {})
        if table in ("filter", "estimator") and isinstance(own, str):
            own = {"name": own}
        if not isinstance(own, Mapping):
            raise InputError(f"{table} = {own!r}: must be a table of keys.")
        # A filter or an estimator of another name has other options.
        found[table] = dict(own) if table in ("filter", "estimator") and "name" in own else {**usual, **own}
    return found


def put_at(settings: Mapping[str, Any], path: str, value: Any) -> dict[str, Any]:
    """A copy of nested tables with a value at a dotted path."""
    found = copy.copy(dict(settings))
    name, _, rest = path.partition(".")
    if not rest:
        found[name] = value
        return found
    inner = found.get(name, {})
    found[name] = put_at(inner if isinstance(inner, Mapping) else {"name": inner}, rest, value)
    return found


def check_drive(drive: Mapping[str, Any]) -> None:
    """Raise `InputError` for a key of `drive` that is neither its own nor an option of its manoeuvre."""
    kit.check_known("drive", "manoeuvre", drive["manoeuvre"], MANOEUVRES)
    known = [*OF_DRIVE, *(name for name in manoeuvre_options(drive["manoeuvre"]) if name not in OF_DRIVE)]
    for key in drive:
        kit.check_known(f"drive ({drive['manoeuvre']})", "key", key, known)


def speed_and_steer(drive: Mapping[str, Any]) -> tuple[Any, Any]:
    """Speed (m/s) and steer (degrees) of a drive; the manoeuvre's usual ones if it gives none."""
    usual = USUAL[drive["manoeuvre"]]
    return drive.get("speed", usual.speed), drive.get("steer_deg", usual.steer_deg)

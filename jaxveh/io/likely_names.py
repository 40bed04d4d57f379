"""Names that others give to known channels, such as `Steered Angle` or `G Force Lat`, and the units with which names end."""

from __future__ import annotations

import re
from collections.abc import Iterable

from jaxveh.io.canonical import CANONICAL, canonical_unit

MOST_LIKELY = 3
"""The number of names that a message proposes for one channel."""
_ACCELERATION = r"(acc\w*|beschl\w*|g force|g)"
_OF = lambda axis, letter: (
    rf"\b{axis} ?{_ACCELERATION}\b|\b{_ACCELERATION} ?{axis}\b|\b{axis}\w*beschl\w*|\b(acc\w*|a) ?{letter}\b|\b{letter} acc\w*\b"
)
_CORNERS = {
    "fl": "fl|lf|vl|front left|left front", "fr": "fr|rf|vr|front right|right front",
    "rl": "rl|lr|hl|rear left|left rear", "rr": "rr|hr|rear right|right rear",
}  # fmt: skip
_LIKELY = {
    "v_x": r"^v$|\bvx\b|^v (ego|veh\w*|car|x|lon\w*)\b|\b(speed|spd|vel\w*|\w*geschw\w*|linear x)\b",
    "yaw_rate": r"\b(yaw|gier|psi|heading) ?(rate|rt|vel\w*|speed|dot|p)\b|\b(gyro\w*|ang\w*( rate| vel\w*)?|rate|omega|g|w) ?z\b"
    r"|\bz (ang\w* )?(rate|gyro|vel\w*|rotation)\b|^omega$|\ba ?vz\b|\bvel\w* yaw\b|\bgps gyro\b|\bgierrate\b|\bgiergeschw\w*",
    "a_y": _OF(r"(lat(eral)?|quer)", "y"),
    "a_x": _OF(r"(long(itudinal)?|lon|inline|l(ä|ae)ngs)", "x"),
    "steer": r"\b(steer\w*|lenk\w*|swa|sas)\b|\bstr( ?whl| ang)|^delta( (f|fl|front))?$",
    **{
        f"wheel_speed_{at}": rf"(?=.*\b(wheel\w*|whl\w*|w ?spd|wss|rad\w*)\b).*\b({corner})\b"
        for at, corner in _CORNERS.items()
    },
    "time": r"\b(time|zeit\w*|uhrzeit|timestamps?|stamp|millis|clock|elapsed|secs?|seconds)\b|^t$|^x value$",
}
"""What the words of a name contain, by the known channel for which they stand."""
_WHEEL = r"\b(torque|brake|pressure|temp\w*|load|force|slip|radius|angle|travel|susp\w*|steer\w*|moment\w*|acc\w*|camber|toe)\b"
_OTHER = {
    **dict.fromkeys((f"wheel_speed_{at}" for at in _CORNERS), _WHEEL),
    "v_x": r"\b(wheel\w*|whl\w*|w ?spd|wss|rad\w*|engine|motor|fan|wind|turbo\w*|shaft|ang\w*|yaw|giergeschw\w*|roll|pitch|"
    r"lat\w*|quer\w*|vert\w*|y|z|north|east|down|[frvh][lr]|[lr][fr]|steer\w*|lenk\w*|limit|gyro)\b",
    "time": r"\b(lap|sector|predicted|best|delta)\b",  # these begin again in every lap
    "steer": r"\b(rate|speed|vel\w*|torque|force|moment\w*|current|assist|arm|status)\b",
}
_NO_MEASUREMENT = (
    r"\b(std|cov\w*|var|target|cmd|command|set ?point|soll|desired|accuracy|precision|valid|status|bias|offset)\b"
)

_UNITS = {
    "rad": {"deg": ("deg", "degs", "degree", "degrees", "grad"), "rad": ("rad", "rads", "radian", "radians")},
    "rad/s": {
        "deg/s": ("deg/s", "degs", "dps", "degps", "deg s", "deg sec", "deg per s", "deg"),
        "rad/s": ("rads", "radps", "rad s", "rad sec", "rad per s", "rad"), "rpm": ("rpm",),
    },
    "m/s": {"km/h": ("kmh", "kph", "kmph", "km h"), "mph": ("mph",), "knot": ("knots", "kts", "kt"), "m/s": ("mps", "ms", "m s")},
    "m/s^2": {"g": ("g", "gs"), "m/s^2": ("mps 2", "ms 2", "m s 2", "mpss")},
    "s": {
        "s": ("s", "sec", "secs", "seconds"), "ms": ("ms", "msec", "millis", "milliseconds"),
        "us": ("us", "usec", "micros", "microseconds"), "ns": ("ns", "nsec", "nanos"),
    },
    "Pa": {"bar": ("bar",), "psi": ("psi",), "kPa": ("kpa",)},
    "1": {"percent": ("pct", "percent", "perc")},
}  # fmt: skip
"""Words with which a name ends, by the unit that they mean, by the SI unit of the quantity."""


def words_of(name: str) -> str:
    """Return the words of a name in small letters: 'steering wheel angle' of 'steeringWheelAngle' and 'STEERING_WHEEL_ANGLE'."""
    apart = re.sub(r"(?<=[a-zä-ü0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    return " ".join(re.findall(r"[^\W\d_]+|\d+", apart)).casefold()


def likely_names(channel: str, names: Iterable[str]) -> list[str]:
    """Return those of `names` that look like a known channel under another name, in their order; none for most channels.

    An angle of the steering wheel counts as `steer`, and every speed along the car as `v_x`.
    """
    if channel not in _LIKELY:
        return []
    unlike = f"{_NO_MEASUREMENT}|{_OTHER[channel]}" if channel in _OTHER else _NO_MEASUREMENT
    of = lambda name: _without_unit(words_of(name), canonical_unit(channel) or "")
    fits = lambda words: re.search(_LIKELY[channel], words) is not None and re.search(unlike, words) is None
    return [name for name in names if name not in CANONICAL and fits(of(name))]


def likely_words(missing: Iterable[str], names: Iterable[str]) -> str:
    """Return a sentence for a message, which proposes `names` for known channels that are missing; "" if none looks like one."""
    alike = {channel: likely_names(channel, names)[:MOST_LIKELY] for channel in missing}
    return " ".join(f"{', '.join(found)} may be {channel}." for channel, found in alike.items() if found)


def unit_of_ending(name: str, quantity: str) -> str:
    """Return the unit with which a name ends (`deg` of `steer_deg`), of a quantity with this SI unit; "" for none."""
    words = words_of(name)
    for unit, endings in _UNITS.get(quantity, {}).items():
        if any(words.endswith(f" {ending}") for ending in endings):
            return unit
    return ""


def _without_unit(words: str, quantity: str) -> str:
    endings = {ending for units in _UNITS.get(quantity, {}).values() for ending in units}
    found = max((one for one in endings if words.endswith(f" {one}")), key=len, default="")
    # `lateral g` has its quantity in its unit.
    return words if found in ("", "g", "gs", "millis") else words.removesuffix(f" {found}")

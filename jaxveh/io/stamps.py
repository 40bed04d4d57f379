"""Time stamps as seconds: dates, durations, and their texts in logs, such as `2024-03-01T10:00:00.5Z` or `10:05:03.120`."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh.io.national_dates import in_iso_order, is_national
from jaxveh.io.optional import require
from jaxveh.io.toml import shorten

DAY, HALF = 86_400.0, 43_200.0
"""A day, and the step back beyond which a clock without a date has passed midnight, s."""

_DATE = re.compile(r"\s*\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d([.,]\d+)?)?\s*(Z|UTC|[+-]\d\d:?\d\d)?\s*")
_DURATION = re.compile(r"\s*(?P<days>\d+) days?\s+(?P<clock>\d+:\d\d:\d\d([.,]\d+)?)\s*")
_CLOCK = re.compile(r"\s*(?P<hours>\d+):(?P<minutes>[0-5]\d):(?P<seconds>[0-5]\d([.,]\d+)?)\s*")
_MINUTES = re.compile(r"\s*(?P<minutes>\d+):(?P<seconds>[0-5]\d[.,]\d+)\s*")


def is_stamp(text: str) -> bool:
    """Whether a text is a time stamp in one of the forms that `seconds` reads."""
    return any(form.fullmatch(text) for form in (_DATE, _DURATION, _CLOCK, _MINUTES)) or is_national(text)


def seconds(cells: Any, what: str) -> np.ndarray | None:
    """Return dates as seconds since 1970, and durations and times of day as seconds, (n,); None for anything else.

    `cells`: an array (n,) of dates or durations, or of texts; empty ones are NaN. Dates without a zone count as UTC, and may
    be in the order of a country (`national_dates`); times of day go on after midnight.

    **Raises** `InputError` for the first text that is none if others are.
    """
    array = np.asarray(cells)
    if array.dtype.kind in "mM":
        missing = np.isnat(array)
        # Nanoseconds since 1970 have more digits than a float.
        whole, part = np.divmod(array.astype(f"{array.dtype.kind}8[ns]").astype(np.int64), 1_000_000_000)
        return np.where(missing, np.nan, whole + part / 1e9)
    texts = array.tolist() if array.dtype.kind in "OUT" else []
    first = next((one for one in texts if isinstance(one, str) and one.strip()), "")
    if not is_stamp(first):
        return None
    texts = in_iso_order([one if isinstance(one, str) else "" for one in texts], what)
    dates = next(_DATE.fullmatch(one) is not None for one in texts if one.strip())
    found = np.full(len(texts), np.nan)
    for row, text in enumerate(texts):
        if text.strip():
            if not is_stamp(text) or (_DATE.fullmatch(text) is not None) != dates:
                raise InputError(f"{what}, data row {row + 1}: {shorten(text)} is no time stamp like {shorten(first)}.")
            found[row] = np.nan if dates else _of_clock(text)
    if not dates:
        return after_midnight(found)
    pandas = require("pandas", "reading dates")
    try:
        stamps = pandas.to_datetime([_point(one) for one in texts], format="ISO8601", utc=True)
    except (ValueError, OverflowError) as error:
        raise InputError(f"{what}: {error}. Write dates as 2024-03-01T10:00:00.5.") from error
    return seconds(stamps.tz_convert(None).to_numpy(), what)


def after_midnight(clock: np.ndarray) -> np.ndarray:
    """Return times of day (n,) in seconds that go on after midnight, also where some are missing."""
    known = np.isfinite(clock)
    found = np.full(clock.shape, np.nan)
    back = np.diff(clock[known], prepend=clock[known][:1]) < -HALF
    found[known] = clock[known] + DAY * np.cumsum(back)
    return found


def of_packed_clock(cells: Any) -> Any:
    """Return times of day, HHMMSS.SS, as seconds, which go on after midnight; texts such as 10:05:03.1 as they are."""
    if np.asarray(cells).dtype.kind not in "fiu":
        return cells
    hours, rest = np.divmod(np.asarray(cells, np.float64), 10_000.0)
    minutes, seconds = np.divmod(rest, 100.0)
    # The remainder of a number of six digits has lost six of its own.
    return after_midnight(np.round(3600.0 * hours + 60.0 * minutes + seconds, 6))


def _point(text: str) -> str | None:
    """Return a date with a point before the fraction; None for an empty cell."""
    return text.strip().replace(",", ".") or None


def _of_clock(text: str) -> float:
    days = 0.0
    if (long := _DURATION.fullmatch(text)) is not None:
        days, text = float(long["days"]), long["clock"]
    parts = (_CLOCK.fullmatch(text) or _MINUTES.fullmatch(text)).groupdict()  # type: ignore[union-attr]
    number = lambda name: float(parts.get(name, "0").replace(",", "."))
    return days * DAY + number("hours") * 3600 + number("minutes") * 60 + number("seconds")

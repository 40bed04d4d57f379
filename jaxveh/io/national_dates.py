"""Dates as countries write them, such as `01.03.2024 10:59:55,5` or `1-Mar-2024 10:59:55`, in the order of ISO 8601."""

from __future__ import annotations

import re
from collections.abc import Sequence

from jaxveh._core.errors import InputError
from jaxveh.io.toml import shorten

_CLOCK = r"[T ]\s*(?P<hour>\d\d?)(?P<rest>:\d\d(:\d\d([.,]\d+)?)?)\s*(?P<half>[AaPp][Mm])?\s*"
_DAY_FIRST = re.compile(rf"\s*(?P<day>\d\d?)\.(?P<month>\d\d?)\.(?P<year>\d{{4}}){_CLOCK}")
_YEAR_FIRST = re.compile(rf"\s*(?P<year>\d{{4}})[/.](?P<month>\d\d?)[/.](?P<day>\d\d?){_CLOCK}")
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_NAMED = re.compile(
    rf"\s*(?P<day>\d\d?)[-/. ](?P<month>{'|'.join(_MONTHS)})[a-z]*\.?[-/. ](?P<year>\d{{4}}){_CLOCK}", re.IGNORECASE
)
_SLASHES = re.compile(rf"\s*(?P<one>\d\d?)/(?P<other>\d\d?)/(?P<year>\d{{4}}){_CLOCK}")


def in_iso_order(texts: Sequence[str], what: str) -> list[str]:
    """Return texts with dates in the order of ISO 8601; other texts as they are, and all if the first that is not empty is none.

    Dots and names of months (English) have the day first. With slashes it is the day or the month, whichever no row of the column
    contradicts. The clock may have twelve hours, with AM or PM.

    **Raises** `InputError` for slashes if no row tells which.
    """
    if not is_national(next((text for text in texts if text.strip()), "")):
        return list(texts)
    slashed = [found for text in texts if (found := _SLASHES.fullmatch(text))]
    if not slashed:
        return [_iso(text, "") for text in texts]
    day_first, month_first = (any(int(one[part]) > 12 for one in slashed) for part in ("one", "other"))
    if day_first == month_first:
        why = (
            "some rows begin with the day and others with the month"
            if day_first
            else "begins with the day or the month"
        )
        raise InputError(f"{what}: {shorten(slashed[0][0])}: {why}. Write dates as 2024-03-01T10:00:00.5.")
    return [_iso(text, "day" if day_first else "month") for text in texts]


def is_national(text: str) -> bool:
    """Whether a text is a date and a time of day in one of these orders."""
    return any(form.fullmatch(text) for form in (_DAY_FIRST, _YEAR_FIRST, _NAMED, _SLASHES))


def _iso(text: str, first: str) -> str:
    forms = (_DAY_FIRST, _YEAR_FIRST, _NAMED, _SLASHES)
    found = next((found for form in forms if (found := form.fullmatch(text)) is not None), None)
    if found is None:
        return text
    parts = found.groupdict()
    if parts.get("month", "").casefold()[:3] in _MONTHS:
        parts["month"] = str(1 + _MONTHS.index(parts["month"].casefold()))
    if first:
        one, other = parts["one"], parts["other"]
        parts["day"], parts["month"] = (one, other) if first == "day" else (other, one)
    hour = int(parts["hour"])
    if parts["half"] is not None:
        hour = hour % 12 + 12 * (parts["half"].casefold() == "pm")
    return f"{parts['year']}-{parts['month']:0>2}-{parts['day']:0>2} {hour:02}{parts['rest']}"

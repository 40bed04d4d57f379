"""Text of Autosport Labs' RaceCapture, whose names have units, ranges and rates: `"Speed"|"MPH"|0.0|150.0|10`."""

from __future__ import annotations

import re
from collections.abc import Sequence

CLOCK = "Interval"
"""The column with the time since the device was switched on. A column `Time` of older logs packs hours, minutes and seconds."""

_NAME = re.compile(r'"?(?P<name>[^"|]*)"?\|"?(?P<unit>[^"|]*)"?(\|[^|]*){3}')


def named_by_race_capture(headings: Sequence[str]) -> tuple[list[str], list[str]] | None:
    """Return the names and units of headings that a RaceCapture wrote, in their order; None for those of others."""
    found = [_NAME.fullmatch(heading) for heading in headings]
    if len(found) < 2 or None in found:
        return None
    return [one["name"].strip() for one in found if one], [one["unit"].strip() for one in found if one]

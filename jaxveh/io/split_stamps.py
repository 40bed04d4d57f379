"""Time stamps in two columns, whole seconds and nanoseconds, as ROS writes them: header.stamp.secs, header.stamp.nsecs."""

from __future__ import annotations

import re
from collections.abc import Iterable

_WHOLE = re.compile(r"(?P<stem>.*?)(?P<unit>secs?|seconds?)", re.IGNORECASE)
_PART = r"(nsecs?|nanosecs?|nanoseconds?)"


def nanoseconds_of(name: str, names: Iterable[str]) -> str | None:
    """Return the column with the nanoseconds that belong to a column of whole seconds, such as stamp.nanosec to stamp.sec;
    None if there is none."""
    found = _WHOLE.fullmatch(name)
    if found is None:
        return None
    part = re.compile(re.escape(found["stem"]) + _PART, re.IGNORECASE)
    return next((one for one in names if part.fullmatch(one)), None)


def split_stamps(names: Iterable[str]) -> list[tuple[str, str]]:
    """Return the pairs of columns of whole seconds and nanoseconds."""
    names = list(names)
    pairs = ((one, nanoseconds_of(one, names)) for one in names)
    return [(one, part) for one, part in pairs if part is not None]

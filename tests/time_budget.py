"""Which tests run by default: each test function has a budget of seconds, and long cases are left to `.ci/run`.

`tests/recorded/seconds.json` has the seconds that one case of a test function took when last recorded, for functions that take
longer than `BUDGET`. Beyond it a function's time grows with the square root of the time of all its cases: at least one case
runs, the others are left to `-m full`. Each function starts at a case of its own, which its name decides: most members of a
class (every filter, every method) meet some test, and a file alone runs the cases that it runs among all. A case that takes
longer than `LONGEST` is `thorough`. A function that is not on record runs whole, so that a new one is never left out.

`JAXVEH_SECONDS=1 python -m pytest` records them again.
"""

import json
import math
import zlib
from pathlib import Path

import pytest

BUDGET, LONGEST = 1.0, 5.0
"""Seconds a test function, and a case, on the machine on which they were recorded (one of sixteen workers)."""

RECORD = Path(__file__).parent / "recorded" / "seconds.json"

LEFT_OUT = ("full", "peers", "studies", "site")
"""Marks of tests that do not run by default whatever they take."""


def function_of(nodeid):
    """`filters/test_x.py::test_some_property` of `tests/filters/test_x.py::test_some_property[a-b]`."""
    return nodeid.partition("[")[0].removeprefix("tests/")


def keep_to_budget(items):
    """Mark as `full` the cases beyond a function's budget, and as `thorough` what is left of those that take too long."""
    seconds, cases = json.loads(RECORD.read_text()), {}
    for item in items:
        if not any(item.get_closest_marker(mark) for mark in LEFT_OUT):
            cases.setdefault(function_of(item.nodeid), []).append(item)
    for name, members in cases.items():
        each = seconds.get(name, 0.0)
        kept = spread_evenly(len(members), number_kept(each, len(members)), zlib.crc32(name.encode()))
        for place, item in enumerate(members):
            if place not in kept:
                item.add_marker(pytest.mark.full)
            elif each > LONGEST:
                item.add_marker(pytest.mark.thorough)


def number_kept(each, most):
    """How many of a function's cases run, which take `each` so many seconds."""
    whole = each * most
    return most if whole <= BUDGET else min(most, math.ceil(math.sqrt(BUDGET * whole) / each))


def spread_evenly(many, few, first):
    """The places of `few` of `many`, from the `first` on."""
    return {(first + (many * k) // few) % many for k in range(few)}


def record_seconds(durations):
    """Put the mean seconds of a case on record, of functions that take longer than their budget: `durations` are those of all
    cases that ran, by node. What did not run keeps its number."""
    found = {}
    for nodeid, took in durations.items():
        found.setdefault(function_of(nodeid), []).append(took)
    seconds = (
        {name: took for name, took in json.loads(RECORD.read_text()).items() if name not in found}
        if RECORD.exists()
        else {}
    )
    seconds |= {name: round(sum(took) / len(took), 2) for name, took in found.items() if sum(took) > BUDGET}
    RECORD.write_text(json.dumps(dict(sorted(seconds.items())), indent=0) + "\n")

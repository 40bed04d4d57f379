"""Which tests run by default: each test function has a budget of seconds, and long cases are left to `.ci/run`.

`tests/recorded/seconds.json` has the seconds that one case of a test function took when last recorded, for functions that take
longer than `BUDGET`. Beyond it a function's time grows with the square root of the time of all its cases: at least one case
runs, the others are left to `-m full`. Each function starts at a case of its own, which its name decides: most members of a
class (every filter, every method) meet some test, and a file alone runs the cases that it runs among all. Cases that take
longer than `LONGEST` are `thorough`, the quickest functions of a file first, for `LONG_BUDGET` seconds a file; the others are
`seldom`. A case that alone takes much longer than its function's others is on record by its own name: it is long,
the others are not. A function that is not on record runs whole, so that a new one is never left out, and so does one that is
marked `whole`: each of its cases is the only one that looks at a member's numbers.

`JAXVEH_SECONDS=1 python -m pytest` records them again.

What is marked `full` by hand takes minutes. One case of each such function is `rare`, so that each is run by somebody.

`JAXVEH_PART=0` to `9999` leaves four fifths of what is `thorough` or of the `studies`, 19 twentieths of what is `seldom`, and 99
hundredths of what is `rare`, to `-m full`; its hundreds choose the case of a function that is `rare`, and in time all are run.
`.ci/run` takes the part that the commit decides, so that changes in a row run all of them, and the same commit always the
same: all of them at once would take it hours. Without it all run, one case of each function.
"""

import json
import math
import statistics
import zlib
from pathlib import Path

import pytest

BUDGET, LONGEST, LONG_BUDGET = 0.6, 2.0, 3.0
"""Seconds a test function, a case, and a file's long cases, on a slow machine of two cores; a quick one takes 0.4 of them.

What tests of a file share is taken by the first that runs: the record has the larger numbers of two selections."""

OUTLIER = 3.0
"""Times the median of its function's cases: a case that takes longer is on record by itself."""

COLOURS = 6
"""Of the cases of a `product` that together take longer than a budget one in so many runs by default."""

RECORD = Path(__file__).parent / "recorded" / "seconds.json"

ALWAYS = ("site/test_notebooks.py", "test_a_page_runs_from_top_to_bottom[README.md]", "[jaxveh estimate drive.csv")
"""Parts of the names of those of every fifth: what a user meets first."""

PARTS = {"thorough": 5, "studies": 5, "seldom": 20}
"""Of what bears the mark `.ci/run` runs one in so many."""

RARE = 100
"""Of what is marked `full` by hand `.ci/run` runs one function in so many."""

ELSEWHERE = ("peers", "site")
"""Marks of tests with an environment of their own."""

LEFT_OUT = ("full", *ELSEWHERE, *PARTS)
"""Marks of tests that do not run by default whatever they take. What no other test executes is marked `thorough` by hand,
whatever it takes."""


def function_of(nodeid):
    """`filters/test_x.py::test_some_property` of `tests/filters/test_x.py::test_some_property[a-b]`."""
    return nodeid.partition("[")[0].removeprefix("tests/")


def mark_rare(items, part=None):
    """Mark as `rare` one case of each function with cases that are marked `full` by hand, of all such functions or of those of a
    part, whose hundreds choose another case. Comes before what marks others."""
    functions = {}
    for item in items:
        if item.get_closest_marker("full") and not any(item.get_closest_marker(mark) for mark in ELSEWHERE):
            functions.setdefault(function_of(item.nodeid), []).append(item)
    for name, members in functions.items():
        own = zlib.crc32(name.encode())
        if part is None or own % RARE == part % RARE:
            members[(own + (part or 0) // RARE) % len(members)].add_marker(pytest.mark.rare)


def keep_one_colour(items):
    """Of a `product` beyond the budget one case in six stays, the others are left to `-m full`: each value of a parameter meets
    a sixth of the others', and each test has a sixth of the cases, as the fields of one colour on a board of six. The test's
    name decides the colour: whatever stands beside it, the same cases run. Of few cases none may have the colour: then one of
    the next colour stays, so that every test has a case."""
    seconds, functions = json.loads(RECORD.read_text()), {}
    for item in items:
        if item.get_closest_marker("product") and hasattr(item, "callspec"):
            functions.setdefault(function_of(item.nodeid), []).append(item)
    for name, members in functions.items():
        if seconds.get(name, 0.0) * len(members) <= BUDGET:
            continue  # each is often the only one that looks at its member's numbers
        start = zlib.crc32(name.encode())
        # Names that are given together, `("quantity", "name")`, count once.
        places = set(zip(*(item.callspec.indices.values() for item in members), strict=True))
        colours = [(start + sum(at)) % COLOURS for at in zip(*places, strict=True)]
        kept = [place for place, colour in enumerate(colours) if colour == 0] or [colours.index(min(colours))]
        for place, item in enumerate(members):
            if place not in kept:
                item.add_marker(pytest.mark.full)


def keep_to_budget(items):
    """Mark as `full` the cases beyond a function's budget, and as `thorough` or `seldom` what is left of those that take too
    long."""
    seconds, cases, long = json.loads(RECORD.read_text()), {}, {}
    for item in items:
        if any(item.get_closest_marker(mark) for mark in (*LEFT_OUT, "whole")):
            continue
        name, own = function_of(item.nodeid), item.nodeid.removeprefix("tests/")
        if own != name and own in seconds:
            long.setdefault(name.partition("::")[0], []).append((seconds[own], own, [item]))
        else:
            cases.setdefault(name, []).append(item)
    for name, members in cases.items():
        each = seconds.get(name, 0.0)
        kept = spread_evenly(len(members), number_kept(each, len(members)), zlib.crc32(name.encode()))
        for place, item in enumerate(members):
            if place not in kept:
                item.add_marker(pytest.mark.full)
        if each > LONGEST:
            long.setdefault(name.partition("::")[0], []).append((each * len(kept), name, [members[k] for k in kept]))
    for functions in long.values():
        mark_long(functions)


def mark_long(functions):
    """Mark the long cases of a file's functions, each `(seconds, name, cases)`."""
    spent = 0.0
    for took, _, members in sorted(functions, key=lambda function: function[:2]):
        spent += took
        for item in members:
            item.add_marker(pytest.mark.thorough if spent <= LONG_BUDGET else pytest.mark.seldom)


def keep_part(items, part):
    """Mark as `full` those long tests that are not of this part, 0 to 99: of pages each by itself, of other files each function
    with all its cases, which share what they compile. Whatever stands beside a test, it is of the same part."""
    for item in items:
        if any(name in item.nodeid for name in ALWAYS):
            continue
        own = zlib.crc32((item.nodeid if "/site/" in item.nodeid else function_of(item.nodeid)).encode())
        if any(item.get_closest_marker(mark) and own % count != part % count for mark, count in PARTS.items()):
            item.add_marker(pytest.mark.full)


def number_kept(each, most):
    """How many of a function's cases run, which take `each` so many seconds."""
    whole = each * most
    return most if whole <= BUDGET else min(most, math.ceil(math.sqrt(BUDGET * whole) / each))


def number_in_all(each, kept):
    """At most how many cases a function has, of which `kept` ran when each took so many seconds: `number_kept` the other way."""
    return max(kept, each * kept**2 / BUDGET)


def spread_evenly(many, few, first):
    """The places of `few` of `many`, from the `first` on."""
    return {(first + (many * k) // few) % many for k in range(few)}


def record_seconds(durations):
    """Put the mean seconds of a case on record, of functions that take longer than their budget with all their cases, and cases
    that are much longer than the others by themselves: `durations` are those of all cases that ran, by node. What did not run
    keeps its number."""
    kept = json.loads(RECORD.read_text()) if RECORD.exists() else {}
    found, seconds = {}, {}
    for nodeid, took in durations.items():
        found.setdefault(function_of(nodeid), {})[nodeid.removeprefix("tests/")] = took
    for name, took in found.items():
        alone = {case: t for case, t in took.items() if t > max(LONGEST, OUTLIER * statistics.median(took.values()))}
        others = [t for case, t in took.items() if case not in alone]
        whole = number_in_all(kept.get(name, 0.0), len(others)) * sum(others) / max(len(others), 1)
        seconds |= alone | ({name: sum(others) / len(others)} if whole > BUDGET else {})
    kept = {name: took for name, took in kept.items() if name not in found and f"tests/{name}" not in durations}
    seconds = kept | {name: round(took, 2) for name, took in seconds.items()}
    RECORD.write_text(json.dumps(dict(sorted(seconds.items())), indent=0) + "\n")

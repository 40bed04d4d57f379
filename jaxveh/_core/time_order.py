"""Instants that are the same, and what to do about times that do not increase."""

from __future__ import annotations

import numpy as np

SAME_INSTANT = 1e-9
"""s: time stamps that should be equal may differ by rounding; instants closer than this are the same."""

_CLOCKS = {60.0: "of a minute", 3600.0: "of an hour", 86_400.0: "of a day", 604_800.0: "of a GPS week"}
ROLLS = {
    **{2.0**bits * unit: f"counters of {bits} bits" for bits in (8, 16, 24, 32) for unit in (1.0, 1e-3, 1e-6)},
    **{1e3 * period: f"milliseconds {what}" for period, what in _CLOCKS.items()},
    **{period: f"seconds {what}" for period, what in _CLOCKS.items()},
}
"""Periods after which a time begins again, by what it counts."""


def remedy(time: np.ndarray, k: int) -> str:
    """What to do about time stamps (T,) of which that in row k + 1 is not larger than that in row k."""
    if time[k + 1] == time[k] and np.array_equal(time, time.astype(np.float32)) and abs(time[k]) > 1e5:
        step = np.spacing(np.float32(abs(time[k])))
        return f"The stamps have lost their digits in float32, whose step is {step:g} s here: write them in float64."
    if time[k + 1] == time[k]:
        return (
            "Two rows have this time: an event of a simulation, or stamps that are too coarse? Write more digits; otherwise sort "
            "the rows and drop repeated time stamps."
        )
    step, back = np.median(np.diff(time)), time[k] - time[k + 1]
    for period, what in ROLLS.items():
        if step < 0.1 * period and abs(back + step - period) <= max(2.0 * step, 1e-6 * period):
            return (
                f"Does it begin again after {period:.9g}, as {what} do? Then add that after each step back; two drives in one "
                "file are split there."
            )
    return "Two drives in one file? Split them where time steps back; otherwise sort the rows and drop repeated time stamps."

"""Drives that the tests of bank, roll, grade, mass and geometry share: made once a process."""

import functools

import numpy as np
from banked_drives import drives, heard, horizon_roll

SCORED = ("suv", "compact_car", "passenger_car")
"""None of these was looked at while a number was chosen; those were the sedan's and the van's drives."""

FIRST_SEED = 500


@functools.cache
def driven(car, count, duration):
    """The truth of drives of a car; `roll` is the body's on its springs, `horizon_roll` against the horizon."""
    made = drives(car, FIRST_SEED + np.arange(count), duration)
    one = [{name: value[k] for name, value in made.items()} for k in range(count)]
    return [truth | {"horizon_roll": horizon_roll(truth)} for truth in one]


@functools.cache
def heard_of(cars, seeds, duration, six_axes=False):
    """Cases (car, channels), truths, offsets, and the time."""
    cases, truths, offsets, time = [], [], [], None
    for number, car in enumerate(cars):
        for seed, truth in zip(seeds, driven(car, len(seeds), duration), strict=True):
            said, off, time = heard(car, truth, 1000 * number + seed, six_axes)
            cases.append((car, said))
            truths.append(truth)
            offsets.append(off)
    return cases, truths, offsets, time

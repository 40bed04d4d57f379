"""How varied the lateral motion of a drive is: a number of cosines that are equally strong.

A ramp of steer, a circle at slowly rising speed and a slalom at one frequency show a few numbers of a car, however many rows
their logs have: the model's errors have the same shape as what the parameters do, and do not average out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jaxveh._core.recording import Recording
from jaxveh.estimators.rear_axle import CHANNEL

QUIET = 0.1
"""m/s^2: a_y of this standard deviation, without any regularity, is roads and noise."""

COLOUR = 1.5
"""Power of the frequency by which energies count: between those of a_y, in which slow turns hide all else, and of its rate, which
uneven roads would make varied."""


def variety(logs: Sequence[Recording]) -> float:
    """The number of equally strong cosines (-) of which a_y in the counted rows of `coarse_logs` consists, of all logs together:
    `(sum of P)^2 / sum of P^2` of their energies P (the participation ratio)."""
    return float(sum(_of_one(np.asarray(log["a_y_smooth"], float)[np.isfinite(log[CHANNEL])]) for log in logs))


def _of_one(a_y: np.ndarray) -> float:
    if not a_y.size:
        return 0.0
    # Mirrored at its end, as for a cosine transform: a jump from the last value to the first would look varied.
    ring = np.concatenate([a_y, a_y[::-1]]) - a_y.mean()
    energy = np.maximum(np.abs(np.fft.rfft(ring)) ** 2 - len(ring) * QUIET**2, 0.0)
    energy = energy * np.arange(len(energy)) ** COLOUR
    return float(energy.sum() ** 2 / (energy @ energy)) if energy.any() else 0.0

"""A warning of steer that no car has: degrees, or inputs of a manoeuvre of one's own in another order."""

from __future__ import annotations

import numpy as np

from jaxveh._core.errors import is_concrete, warn
from jaxveh.simulation.solve import Solution

FURTHEST = 1.6
"""Angle of a road wheel that no steering reaches, rad; wheels that are steered alone turn across."""


def warn_of_steer(found: Solution, times: np.ndarray) -> None:
    """Warn of a steer beyond `FURTHEST`; it is silent under jit, vmap and grad."""
    if not is_concrete(found):
        return
    reached = np.arange(len(times)) < int(found.reached)
    for name, values in found.u._asdict().items():
        if not name.startswith("steer") or name.startswith("steering"):
            continue
        size = np.where(reached, np.abs(np.asarray(values)), 0.0)
        row = int(np.argmax(size))
        if size[row] > FURTHEST:
            warn(
                f"simulate: {name} is {float(np.asarray(values)[row]):.4g} rad at t = {times[row]:g} s, more than any road wheel "
                "turns. Angles are in rad; are the inputs of a manoeuvre of your own in the order of their names?"
            )

"""The progress of a simulation, reported while it runs."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.progress import Progress, silent

LEAST = 0.01
"""Share of a simulation after which progress is reported again."""

_listeners: list[Progress] = []
"""The listeners at present: kept out of the compiled program, so that one program serves any of them."""


class Meter(diffrax.AbstractProgressMeter):
    """Reports the progress of a solve to the listener of `meter_for`."""

    def init(self):
        return jnp.zeros(())

    def step(self, state, progress):
        progress = jnp.asarray(progress, state.dtype)
        further = progress - state > LEAST
        jax.lax.cond(further, lambda p: jax.debug.callback(_tell, p), lambda p: None, progress)
        return jnp.where(further, progress, state)

    def close(self, state):
        del state


def _tell(progress) -> None:
    if _listeners:
        _listeners[-1](float(np.max(progress)), 1.0, "simulate")


@contextlib.contextmanager
def meter_for(report: Progress) -> Iterator[diffrax.AbstractProgressMeter]:
    """The meter for a solve whose progress goes to `report`; none for `silent`."""
    if report is silent:
        yield diffrax.NoProgressMeter()
        return
    _listeners.append(report)
    try:
        report(0.0, 1.0, "simulate")
        yield Meter()
        jax.effects_barrier()
        report(1.0, 1.0, "simulate")
    finally:
        _listeners.remove(report)

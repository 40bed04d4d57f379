"""Observers with constant gains: linear, and with a switching part."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import check, float_array
from jaxveh.observers.base import AbstractObserver, check_gain


def array(value: Any) -> jax.Array:
    """A strong float array of numbers or of an array."""
    return float_array(value if eqx.is_array(value) else np.asarray(value, float))


class Luenberger(AbstractObserver):
    """`x = x- + gain e`, a constant `gain` (n, m) a step (D. Luenberger 1964). `place_poles` makes one.

    The estimate's error obeys `(I - gain H) F`: with poles inside the unit circle it dies out on the model that is linear there.
    """

    gain: jax.Array = eqx.field(converter=array)

    def check(self, model):
        check_gain("Luenberger.gain", self.gain, model)

    def start(self, model):
        return ()

    def correct(self, model, belief, row, error, here):
        return self.gain @ error, ()


class SlidingMode(AbstractObserver):
    """`x = x- + gain e + switching s(e / boundary)`, s(z) = z / (1 + |z|) for the sign, without its chatter.

    (J.-J. Slotine, J. Hedrick & E. Misawa 1987.) The switching gain (n, m) bounds what a wrong model may add in a step; within
    the `boundary` (m,), in each channel's unit, the observer is linear.
    """

    gain: jax.Array = eqx.field(converter=array)
    switching: jax.Array = eqx.field(converter=array)
    boundary: jax.Array = eqx.field(converter=array)

    def __check_init__(self):
        check("SlidingMode.boundary", self.boundary, lambda b: b > 0, "positive")

    def check(self, model):
        check_gain("SlidingMode.gain", self.gain, model)
        check_gain("SlidingMode.switching", self.switching, model)

    def start(self, model):
        return ()

    def correct(self, model, belief, row, error, here):
        scaled = error / self.boundary
        smooth = scaled / (1.0 + jnp.abs(scaled))
        return self.gain @ error + self.switching @ smooth, ()

"""Observers with constant gains: linear, and with a switching part."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import check, float_array
from jaxveh.observers.base import AbstractObserver, advance, check_gain, check_one_or_each


def array(value: Any) -> jax.Array:
    """A strong float array of numbers or of an array."""
    return float_array(value if eqx.is_array(value) else np.asarray(value, float))


class AbstractMemoryless(AbstractObserver):
    """An observer that remembers nothing but its state, which the model alone moves between rows."""

    def start(self, model):
        return ()

    def predict(self, model, belief, row):
        return advance(model, belief, row, belief.vector), ()


class Luenberger(AbstractMemoryless):
    """`x = x- + gain e`, a constant `gain` (n, m) a step (D. Luenberger 1964). `place_poles` makes one.

    The estimate's error obeys `(I - gain H) F`: on a linear model it dies out with these poles. On another it dies out as long as
    one quadratic form falls wherever the car may be (`contraction_rate`). With gains from `a_y` to `v_y` this is the observer of
    lateral velocity of L. Imsland et al. (Automatica 42, 2006), whose acceleration is the measured one and which is drawn to
    where the tyres' forces agree with it: their condition is that those forces fall with v_y, so not beyond the tyres' peak.
    """

    gain: jax.Array = eqx.field(converter=array)

    def check(self, model):
        check_gain("Luenberger.gain", self.gain, model)

    def correct(self, model, belief, row, error, here):
        return self.gain.astype(error.dtype) @ error, ()


class SlidingMode(AbstractMemoryless):
    """`x = x- + gain e + switching s(e / boundary)`, s(z) = z / (1 + |z|) for the sign, without its chatter.

    (J.-J. Slotine, J. Hedrick & E. Misawa 1987.) The switching gain (n, m) bounds what a wrong model may add in a step; within
    the `boundary` (m,), in each channel's unit, the observer is close to linear with `gain + switching / boundary`: a boundary of
    at least H switching, or the steps chatter. With one channel that is the state and without `gain`, what adds d a step is
    rejected for |d| < switching: the error is within the boundary in finite time and ends at `boundary q / (1 - q)`,
    q = |d| / switching.
    """

    gain: jax.Array = eqx.field(converter=array)
    switching: jax.Array = eqx.field(converter=array)
    boundary: jax.Array = eqx.field(converter=array)

    def __check_init__(self):
        check("SlidingMode.boundary", self.boundary, lambda b: b > 0, "positive")

    def check(self, model):
        check_one_or_each("SlidingMode.boundary", self.boundary, model.channels)
        check_gain("SlidingMode.gain", self.gain, model)
        check_gain("SlidingMode.switching", self.switching, model)

    def correct(self, model, belief, row, error, here):
        dtype = error.dtype
        scaled = error / self.boundary.astype(dtype)
        smooth = scaled / (1 + jnp.abs(scaled))
        return self.gain.astype(dtype) @ error + self.switching.astype(dtype) @ smooth, ()

"""Observers with constant gains: linear, and with a switching part."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import check, check_finite, float_array
from jaxveh.observers.base import AbstractObserver, advance, check_gain, check_one_or_each


def array(value: Any) -> Any:
    """A float array (not weakly typed) from numbers or from an array; what is none is left to the check that knows its name."""
    try:
        # None would become NaN.
        return value if value is None else float_array(value if eqx.is_array(value) else np.asarray(value, float))
    except (TypeError, ValueError):
        return value


class AbstractMemoryless(AbstractObserver):
    """An observer without memory beyond its state, which only the model moves between rows."""

    def start(self, model):
        return ()

    def predict(self, model, belief, row):
        return advance(model, belief, row, belief.vector), ()


class Luenberger(AbstractMemoryless):
    """`x = x- + gain e`, with a constant `gain` (n, m) per step (D. Luenberger 1964), computed by `place_poles`.

    The estimate's error obeys `(I - gain H) F`: on a linear model it decays with these poles. On a nonlinear one it decays if
    one quadratic form falls at every state that the car may reach (`contraction_rate`). With gains from `a_y` to `v_y` this
    is the observer of lateral velocity of L. Imsland et al. (Automatica 42, 2006): it integrates the measured acceleration
    and is drawn to the velocity at which the tyres' forces agree with it. Their condition is that these forces fall with v_y,
    so it does not hold beyond the tyres' peak.
    """

    gain: jax.Array = eqx.field(converter=array)

    def __check_init__(self):
        check_finite("Luenberger.gain", self.gain)

    def check(self, model):
        check_gain("Luenberger.gain", self.gain, model)

    def correct(self, model, belief, row, error, here):
        return self.gain.astype(error.dtype) @ error, ()


class SlidingMode(AbstractMemoryless):
    """`x = x- + gain e + switching s(e / boundary)`, with s(z) = z / (1 + |z|) instead of the sign, to avoid its chatter.

    (J.-J. Slotine, J. Hedrick & E. Misawa 1987.) The switching gain (n, m) limits the error per step of a wrong model that the
    observer rejects. Within the `boundary` (m,), in each channel's unit, the observer is close to linear with the gain
    `gain + switching / boundary`; so the boundary must be at least H switching, otherwise the steps chatter. With one channel
    that measures the state and without `gain`, a disturbance of d per step is rejected for |d| < switching: the error is within
    the boundary in finite time and ends at `boundary q / (1 - q)`, q = |d| / switching.
    """

    gain: jax.Array = eqx.field(converter=array)
    switching: jax.Array = eqx.field(converter=array)
    boundary: jax.Array = eqx.field(converter=array)

    def __check_init__(self):
        check_finite("SlidingMode.gain", self.gain)
        check_finite("SlidingMode.switching", self.switching)
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

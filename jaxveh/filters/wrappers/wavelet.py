"""Measurement noise from the measurements' own fastest changes."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check
from jaxveh.filters.gaussian.filter import AbstractGaussianFilter
from jaxveh.filters.wrappers.base import (
    AbstractRemembering,
    Remembering,
    check_independent,
    variances_of,
    with_variances,
)

# The median of the absolute value of a standard normal number.
MEDIAN = 0.6744897501960817


class Window(NamedTuple):
    """The last measurements of each channel, `values` (window, m), newest last; how many there were, `count` (m,); and the
    `variances` (m,) in use."""

    values: Any
    count: Any
    variances: Any


class HaarNoise(AbstractRemembering):
    """`filter` with measurement variances from the Haar wavelet's highest band of the last `window` samples
    (Qin et al. 2014).

        d_j = (y_{2j+1} - y_{2j}) / sqrt(2),    sigma = median |d| / 0.6745,    R <- b R + (1 - b) sigma^2

    with b = `forgetting` (D. Donoho & I. Johnstone 1994). Channel by channel, of the rows where it is present. It asks nothing of
    the model, so that the model's errors are no noise to it; but the signal must move less than the noise from row to row: of a
    fast manoeuvre or of coarse samples it makes noise, noise that is coloured it does not see, and of noise that jumps up it
    learns half a window late, trusting wild values meanwhile (gate them). Before a window is full the model's own variances
    hold; always they stay between `floor` and `ceiling` times the model's own (a channel that is quantised, or stuck, has a
    median of zero). The noise must be Gaussian, a standard deviation a channel.
    """

    learns_variances: ClassVar[bool] = True
    filter: AbstractGaussianFilter
    window: int = eqx.field(static=True, default=64)
    forgetting: float = eqx.field(static=True, default=0.9)
    floor: float = eqx.field(static=True, default=0.01)
    ceiling: float = eqx.field(static=True, default=1e4)

    def __check_init__(self):
        if not isinstance(self.window, int) or self.window < 4 or self.window % 2:
            raise InputError(f"HaarNoise.window = {self.window}: must be an even whole number of at least 4.")
        check("HaarNoise.forgetting", self.forgetting, lambda v: (v >= 0) & (v < 1), "at least 0 and below 1")
        check("HaarNoise.floor", self.floor, lambda v: (v > 0) & (v <= 1), "above 0 and at most 1")
        check("HaarNoise.ceiling", self.ceiling, lambda v: v >= 1, "at least 1")

    def check(self, model):
        check_independent("HaarNoise", model)
        self.filter.check(model)

    def start(self, model):
        variances = variances_of(model)
        m = variances.shape[0]
        return Window(jnp.zeros((self.window, m), variances.dtype), jnp.zeros(m, jnp.int32), variances)

    def believed(self, model, memory):
        return with_variances(model, memory.variances)

    def update(self, model, belief, row):
        memory = self._seen(model, belief.memory, row)
        return self.update_inside(model, Remembering(belief.inside, memory), row)

    def _seen(self, model, memory: Window, row) -> Window:
        given = jnp.stack([getattr(row.y, name) for name in model.channels])
        here = jnp.isfinite(given)
        longer = jnp.concatenate([memory.values[1:], jnp.where(here, given, 0.0)[None]])
        values = jnp.where(here, longer, memory.values)
        count = memory.count + here.astype(jnp.int32)
        # Pairs as the window lies now, not as they fell: each row is in one.
        details = (values[1::2] - values[::2]) * 0.5**0.5
        found = jnp.square(jnp.median(jnp.abs(details), axis=0) / MEDIAN)
        own = variances_of(model)
        found = jnp.clip(found, self.floor * own, self.ceiling * own)
        mixed = self.forgetting * memory.variances + (1.0 - self.forgetting) * found
        return Window(values, count, jnp.where(here & (count >= self.window), mixed, memory.variances))

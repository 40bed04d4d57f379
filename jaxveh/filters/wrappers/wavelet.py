"""Measurement noise from the fastest changes of the measurements."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check, check_one_of, is_whole, kind_of_inner, word_for
from jaxveh.filters.gaussian.filter import AbstractGaussianFilter
from jaxveh.filters.particle import AbstractParticleFilter
from jaxveh.filters.wrappers.base import (
    AbstractLearnedNoise,
    Remembering,
    variances_of,
    with_variances,
)
from jaxveh.statespace import AbstractFilter, AbstractWrapper, CauchyGaussianMixture, Gaussian, Smoothing, kit

# The median of the absolute value of a standard normal number.
NORMAL_MEDIAN = 0.6744897501960817
"""Median of the absolute value of a standard normal variable."""


class Window(NamedTuple):
    """The last measurements of each channel, `values` (window, m), newest last; the number of measurements so far,
    `count` (m,); and the `variances` (m,) in use."""

    values: Any
    count: Any
    variances: Any


class AbstractHaar(AbstractWrapper):
    """A filter around another with variances from a `Window`; `HaarNoise` describes the settings."""

    has_covariance: ClassVar[bool] = True
    rows_between: ClassVar[bool] = True
    inner: AbstractFilter
    window: int = eqx.field(static=True, default=64)
    forgetting: float = eqx.field(static=True, default=0.9)
    floor: float = eqx.field(static=True, default=0.01)
    ceiling: float = eqx.field(static=True, default=1e4)
    fewest: int | None = eqx.field(static=True, default=None)
    initial: float = eqx.field(static=True, default=1.0)

    def __check_init__(self):
        check_settings(self)


class HaarNoise(AbstractHaar, AbstractLearnedNoise):
    """`inner` with measurement variances from the Haar wavelet's highest band of the last `window` samples
    (Qin et al. 2014).

        d_j = (y_{2j+1} - y_{2j}) / sqrt(2),    sigma = median |d| / 0.6745,    R <- b R + (1 - b) sigma^2

    with b = `forgetting` (D. Donoho & I. Johnstone 1994). Each channel has its own sigma, over the rows in which it is
    present. The estimate does not use the model, so that model errors are not taken for noise. However, the signal must
    change less than the noise from row to row: fast manoeuvres and coarse samples are taken for noise, coloured noise
    is missed, and a jump of the noise is noticed half a window late, with outliers trusted meanwhile (gate them).
    Variances are limited to `floor` and `ceiling` times the model's own (a quantised or stuck channel has a median of
    zero). The noise must be Gaussian, with one standard deviation per channel.

    Until a channel has had `fewest` rows (at least 2; None: a full window, as in the paper), its variance is `initial` times the
    model's own; after that, the median is over the rows that the window has so far. If the noise may be far above the data
    sheet's from the first row on, choose a large `initial`, as a slow state keeps an error that it takes from the first rows.
    """

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    inner: AbstractGaussianFilter

    def start(self, model):
        return first_window(self, variances_of(model))

    def believed_model(self, model, memory):
        return with_variances(model, memory.variances)

    def update(self, model, belief, row):
        memory = window_after(self, variances_of(model), belief.memory, row_values(model, row))
        return self.update_inside(model, Remembering(belief.inside, memory), row)


class HaarParticles(AbstractHaar):
    """The variances of `HaarNoise` for a particle filter `inner`, whose likelihood need not be Gaussian.

    The settings are those of `HaarNoise`. For a `CauchyGaussianMixture`, the variances are those of its Gaussian part
    (Qin et al. 2014); `follows="both"` scales the Cauchy part by the same factor, `"gaussian"` (the default, as in the
    paper) does not. The belief is that of the filter with the `Window` as its memory.

    **Raises** `InputError` for settings out of range, a filter without particles, or a law of another kind.
    """

    inner: AbstractParticleFilter
    follows: str = eqx.field(static=True, default="gaussian")

    def __check_init__(self):
        if not isinstance(self.inner, AbstractParticleFilter):
            kind = kind_of_inner(self.inner)
            raise InputError(
                f"HaarParticles: {kind} inside: must be a particle filter. For Gaussian filters use HaarNoise."
            )
        check_one_of("HaarParticles.follows", self.follows, ("gaussian", "both"))

    def check(self, model):
        law = model.measurement_noise
        kit.check_fixed("HaarParticles", law, "Use the particle filter without this wrapper.")
        if not isinstance(law, Gaussian | CauchyGaussianMixture):
            raise InputError(
                f"HaarParticles: the measurement noise is {word_for(law)}: must be Gaussian, one standard deviation per "
                "channel, or CauchyGaussianMixture."
            )
        self.inner.check(model)

    def _init(self, model, row, key):
        own = variances_of(model)
        memory = window_after(self, own, first_window(self, own), row_values(model, row))
        inside, info = self.inner._init(self._with_memory(model, memory), row, key)
        return Remembering(inside, memory), info

    def _step(self, model, belief, row):
        memory = window_after(self, variances_of(model), belief.memory, row_values(model, row))
        inside, info = self.inner._step(self._with_memory(model, memory), belief.inside, row)
        return Remembering(inside, memory), info

    def _with_memory(self, model, memory: Window):
        told = with_variances(model, memory.variances)
        if self.follows == "both" and isinstance(model.measurement_noise, CauchyGaussianMixture):
            factors = jnp.sqrt(memory.variances / variances_of(model))
            scale = model.measurement_noise.scale
            wider = type(scale)(*(value * factors[i] for i, value in enumerate(scale)))
            told = eqx.tree_at(lambda m: m.measurement_noise.scale, told, wider)
        return told


def check_settings(settings: Any) -> None:
    """Raise `InputError` unless the settings are within their ranges."""
    who = type(settings).__name__
    if not is_whole(settings.window) or settings.window < 4 or settings.window % 2:
        raise InputError(f"{who}.window = {settings.window}: must be an even whole number of at least 4.")
    check(f"{who}.forgetting", settings.forgetting, lambda v: (v >= 0) & (v < 1), "at least 0 and below 1")
    check(f"{who}.floor", settings.floor, lambda v: (v > 0) & (v <= 1), "above 0 and at most 1")
    check(f"{who}.ceiling", settings.ceiling, lambda v: v >= 1, "at least 1")
    inside = f"from 2 to the window, {settings.window}; None: the whole window"
    if settings.fewest is not None:
        check(f"{who}.fewest", settings.fewest, lambda v: (v >= 2) & (v <= settings.window), inside)
    within = lambda v: (v >= settings.floor) & (v <= settings.ceiling)
    check(f"{who}.initial", settings.initial, within, f"from floor, {settings.floor}, to ceiling, {settings.ceiling}")


def first_window(settings: Any, own: Any) -> Window:
    """An empty window, with `initial` times the model's `own` variances (m,)."""
    m = own.shape[0]
    return Window(jnp.zeros((settings.window, m), own.dtype), jnp.zeros(m, jnp.int32), settings.initial * own)


def row_values(model: Any, row: Any) -> Any:
    """The row's measurements, (m,), in the order of the channels."""
    return jnp.stack([getattr(row.y, name) for name in model.channels])


def window_after(settings: Any, own: Any, memory: Window, given: Any) -> Window:
    """The window after the measurements `given` (m,), NaN where missing, of a model with its `own` variances (m,)."""
    here = jnp.isfinite(given)
    longer = jnp.concatenate([memory.values[1:], jnp.where(here, given, 0.0)[None]])
    values = jnp.where(here, longer, memory.values)
    count = memory.count + here.astype(jnp.int32)
    # Pairs are formed in the window as it is now: each row is in one pair.
    details = (values[1::2] - values[::2]) * 0.5**0.5
    found = jnp.square(_median_of_last(jnp.abs(details), count // 2) / NORMAL_MEDIAN)
    found = jnp.clip(found, settings.floor * own, settings.ceiling * own)
    mixed = settings.forgetting * memory.variances + (1.0 - settings.forgetting) * found
    fewest = settings.window if settings.fewest is None else settings.fewest
    return Window(values, count, jnp.where(here & (count >= fewest), mixed, memory.variances))


def _median_of_last(values: Any, count: Any) -> Any:
    """By column, the median of the last `count` (m,) of the values (n, m), at least one and at most all."""
    n = values.shape[0]
    count = jnp.clip(count, 1, n)
    known = jnp.arange(n, dtype=count.dtype)[:, None] >= n - count
    ordered = jnp.sort(jnp.where(known, values, jnp.inf), axis=0)
    at = lambda i: jnp.take_along_axis(ordered, i[None], axis=0)[0]
    return 0.5 * (at((count - 1) // 2) + at(count // 2))

"""Uneven roads with the spectrum of ISO 8608, whose left and right tracks are coherent in long waves and not in short ones."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import InputError, check, check_key, check_one_of, check_positive, check_single, check_whole
from jaxveh._core.parameter import check_parameters, positive, table
from jaxveh.roads.base import AbstractRoad, Surface, place, surface

ROUGHNESS = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6, "E": 4096e-6}
"""Classes of ISO 8608:2016 (A is very good, E very poor), each with the geometric mean of its displacement spectral density at
0.1 1/m, m^3."""

REFERENCE = 0.1
"""1/m: the reference wavenumber of that density, which is proportional to the wavenumber's power -2."""

LONGEST = 90.0
"""m: the longest wave in the range of ISO 8608. Longer waves are hills."""


class Rough(AbstractRoad):
    """A road whose height over its plane is a sum of waves in different directions; made by `rough`.

    `heights` (m), `wavenumbers` (1/m, along the road), `phases` (rad) and `slants` (-): (n,) each. A wave of slant q has the
    height `h sin(2 pi n (s + q y) + phase)`, so that the spectrum is the same along any track. `friction` (-, default 1).

    **Raises** `InputError` for arrays of different length, or a friction that is not positive.
    """

    heights: jax.Array = table("m", scale=0.001)
    wavenumbers: jax.Array = table("1/m", scale=0.1)
    phases: jax.Array = table("rad", scale=1.0)
    slants: jax.Array = table("-", scale=1.0)
    friction: jax.Array = positive("-", default=1.0)

    def __check_init__(self):
        check_parameters(self)
        shapes = {np.shape(one) for one in (self.heights, self.wavenumbers, self.phases, self.slants)}
        if len(shapes) > 1 or len(next(iter(shapes))) != 1:
            raise InputError(
                f"Rough: heights, wavenumbers, phases and slants have the shapes {shapes}: all must be (n,)."
            )

    def at(self, s: Any, y: Any = 0.0) -> Surface:
        s, y = place(s, y, self.friction)
        return surface(s, y, self.friction, height=self._height(s, y) - self._height(*place(0.0, 0.0, self.friction)))

    def _height(self, s: jax.Array, y: jax.Array) -> jax.Array:
        """The sum of the waves. `at` subtracts its value at the origin, where a car starts with its springs at rest."""
        along = s[..., None] + self.slants * y[..., None]
        return jnp.sum(self.heights * numerics.sin(2 * jnp.pi * self.wavenumbers * along + self.phases), axis=-1)


def rough(
    roughness: str | float,
    key: jax.Array,
    *,
    shortest: float = 0.5,
    count: int = 80,
    slant: float = 0.6,
    friction: Any = 1.0,
) -> Rough:
    """A road with the `roughness` of a class of ISO 8608 (`"A"` to `"E"`) or of a displacement spectral density at 0.1 1/m (m^3).

    Each `key` gives one road. Along the road the one-sided density of its height is `roughness (n / 0.1)^-2` from `LONGEST`
    down to the `shortest` wave (m; tyres smooth out waves shorter than their contact). The slants have a Cauchy distribution
    with the scale `slant`. The coherence of two tracks at the distance w is then `exp(-2 pi slant n w)`, the usual exponential
    law for parallel tracks. The default of the scale is our own choice: tracks 1.5 m apart have the coherence 1/2 in waves of
    8 m. `count` is the number of waves, drawn evenly over the logarithm of the wavenumber. Slants beyond 32 times the scale do
    not occur. `friction` (-, that of the road).

    **Raises** `InputError` for an unknown class, or values out of range.
    """
    if isinstance(roughness, str):
        check_one_of("roughness", roughness, tuple(ROUGHNESS))
        roughness = ROUGHNESS[roughness]
    check_single(roughness=roughness, shortest=shortest, slant=slant)
    check_positive("roughness", roughness, "m^3")
    check("shortest", shortest, lambda v: (v > 0) & (v < LONGEST), f"above 0 and below {LONGEST:g} m")
    check_whole("count", count)
    check("slant", slant, lambda v: v >= 0, "at least 0")
    check_key("rough", key)
    shares, turns, ways = jax.random.split(key, 3)
    width = jnp.log(LONGEST / shortest) / count
    shares = jax.random.uniform(shares, (count,))
    steps = (jnp.arange(count, dtype=shares.dtype) + shares) * width
    wavenumbers = jnp.exp(steps) / LONGEST
    # A wave of height h has the variance h^2 / 2. The spectrum has the variance density(n) n width in the wave's share of the
    # logarithm of n.
    heights = jnp.sqrt(2 * roughness * REFERENCE**2 / wavenumbers * width)
    phases = 2 * jnp.pi * jax.random.uniform(turns, (count,))
    slants = slant * jnp.tan(jnp.pi * (jax.random.uniform(ways, (count,), minval=0.01, maxval=0.99) - 0.5))
    return Rough(heights, wavenumbers, phases, slants, friction)

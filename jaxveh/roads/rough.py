"""Uneven roads by the spectrum of ISO 8608, whose left and right tracks go together over long waves and not over short ones."""

from __future__ import annotations

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import InputError, check, check_key, check_one_of, check_positive
from jaxveh._core.parameter import check_parameters, positive, table
from jaxveh.roads.base import AbstractRoad, Surface, place, surface

ROUGHNESS = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6, "E": 4096e-6}
"""Classes of ISO 8608:2016 (A is very good, E very poor) and the geometric mean of their displacement density at 0.1 1/m, m^3."""

REFERENCE = 0.1
"""1/m: the wavenumber of that density, which goes with the wavenumber's power -2."""

LONGEST = 90.0
"""m: of the waves in ISO 8608's range; longer ones are hills."""


class Rough(AbstractRoad):
    """A road whose height over its plane is a sum of waves that run across each other; made by `rough`.

    `heights` (m), `wavenumbers` (1/m, along the road), `phases` (rad) and `slants` (-): (n,) each. A wave of slant q has the
    height `h sin(2 pi n (s + q y) + phase)`, so that along any track the spectrum is the same. `friction` (-, default 1).

    **Raises** `InputError` for waves of different number, or a friction that is not positive.
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
                f"Rough: heights, wavenumbers, phases and slants have the shapes {shapes}: must be (n,) all."
            )

    def at(self, s: Any, y: Any = 0.0) -> Surface:
        s, y = place(s, y, self.friction)
        return surface(s, y, self.friction, height=self._height(s, y) - self._height(*place(0.0, 0.0, self.friction)))

    def _height(self, s: jax.Array, y: jax.Array) -> jax.Array:
        """Not yet measured from the origin, where a car begins on its springs at rest."""
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
    """A road of a class of ISO 8608 (`"A"` to `"E"`), or of a displacement density at 0.1 1/m (m^3); one `key`, one road.

    Along the road the one-sided density of its height is `roughness (n / 0.1)^-2` from `LONGEST` down to the `shortest` wave
    (m; tyres smooth out what is shorter than their contact). The waves' slants are Cauchy's with the scale `slant`, which makes
    the coherence of two tracks that are w apart `exp(-2 pi slant n w)`, the exponential law that is usual for parallel tracks;
    the scale's default is ours: tracks 1.5 m apart are alike to a half in waves of 8 m. `count` waves, evenly drawn over the
    wavenumber's logarithm; slants beyond 19 times the scale are left out.

    **Raises** `InputError` for an unknown class, or values out of range.
    """
    if isinstance(roughness, str):
        check_one_of("roughness", roughness, tuple(ROUGHNESS))
        roughness = ROUGHNESS[roughness]
    check_positive("roughness", roughness, "m^3")
    check("shortest", shortest, lambda v: (v > 0) & (v < LONGEST), f"above 0 and below {LONGEST:g} m")
    check("count", count, lambda v: v >= 1, "at least 1")
    check("slant", slant, lambda v: v >= 0, "at least 0")
    check_key("rough", key)
    shares, turns, ways = jax.random.split(key, 3)
    width = math.log(LONGEST / shortest) / count
    shares = jax.random.uniform(shares, (count,))
    steps = (jnp.arange(count, dtype=shares.dtype) + shares) * width
    wavenumbers = jnp.exp(steps) / LONGEST
    # A wave of height h has h^2 / 2 of variance; that of its share of the logarithm is density(n) n width.
    heights = jnp.sqrt(2 * roughness * REFERENCE**2 / wavenumbers * width)
    phases = 2 * jnp.pi * jax.random.uniform(turns, (count,))
    slants = slant * jnp.tan(jnp.pi * (jax.random.uniform(ways, (count,), minval=0.01, maxval=0.99) - 0.5))
    return Rough(heights, wavenumbers, phases, slants, friction)

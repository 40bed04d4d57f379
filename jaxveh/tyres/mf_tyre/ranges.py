"""The ranges in which a tyre was measured: slip, camber, load and pressure are limited to them."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.tyres.mf_tyre.formula import coefficient
from jaxveh.tyres.mf_tyre.section import AbstractSection

UNLIMITED = 1e10


class Ranges(AbstractSection):
    """The ranges of a property file: slip ratio `KPUMIN`, `KPUMAX` (-), slip angle `ALPMIN`, `ALPMAX` and camber `CAMMIN`,
    `CAMMAX` (rad), load `FZMIN`, `FZMAX` (N), pressure `PRESMIN`, `PRESMAX` (Pa), and the speed `VXLOW` (m/s) below which slip
    (unless a vehicle has regularised it) and shifts fade. They do not fade if `VXLOW` is zero or negative."""

    KPUMIN: jax.Array = coefficient(-UNLIMITED)
    KPUMAX: jax.Array = coefficient(UNLIMITED)
    ALPMIN: jax.Array = coefficient(-1.5, unit="rad")
    ALPMAX: jax.Array = coefficient(1.5, unit="rad")
    CAMMIN: jax.Array = coefficient(-1.5, unit="rad")
    CAMMAX: jax.Array = coefficient(1.5, unit="rad")
    FZMIN: jax.Array = coefficient(0.0, unit="N")
    FZMAX: jax.Array = coefficient(UNLIMITED, unit="N")
    PRESMIN: jax.Array = coefficient(1.0, unit="Pa")
    PRESMAX: jax.Array = coefficient(UNLIMITED, unit="Pa")
    VXLOW: jax.Array = coefficient(1.0, unit="m/s")

    def fading_factors(self, slip_angle, speed):
        """The factors of slip ratio and slip angle, and the smooth factor of shifts; all fade below `VXLOW`."""
        fades = self.VXLOW > 0
        lowest = jnp.where(fades, self.VXLOW, 1.0)
        share = jnp.where(fades, jnp.minimum(jnp.abs(speed) / lowest, 1.0), 1.0)
        smooth = 0.5 * (1 - numerics.cos(math.pi * share))
        both = jnp.minimum(jnp.abs(speed) * (1 + jnp.abs(numerics.tan(slip_angle))) / lowest, 1.0)
        return share, jnp.where(fades, both, 1.0), smooth

"""The tyre as a body: dimensions, vertical stiffness, rolling radius, contact patch, carcass stiffness and relaxation."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.tyres.mf_tyre.formula import coefficient, unless_zero
from jaxveh.tyres.mf_tyre.section import AbstractSection

RADIUS_ITERATIONS = 12
"""Iterations for the rolling radius: it depends weakly on the wheel's speed, and that on the radius; 12 give full precision."""


class Wheel(NamedTuple):
    """`effective_radius`, `free_radius` (m) and `speed` (rad/s) of the wheel."""

    effective_radius: Any
    free_radius: Any
    speed: Any


class Structure(AbstractSection):
    """The entries of the sections [DIMENSION], [OPERATING_CONDITIONS], [VERTICAL], [STRUCTURAL] and [CONTACT_PATCH] that steady
    forces and relaxation need: radii, `WIDTH`, nominal load `FNOMIN` (N), pressure `NOMPRES` (Pa) and speed `LONGVL` (m/s),
    stiffnesses (N/m) and their dependence on load, speed, forces, pressure and, in 6.2, camber.

    **Raises** `InputError` for a radius, load, speed, pressure, width or stiffness that is not positive.
    """

    UNLOADED_RADIUS: jax.Array = positive("m")
    FNOMIN: jax.Array = positive("N")
    LONGVL: jax.Array = positive("m/s", default=16.7)
    NOMPRES: jax.Array = positive("Pa", default=220000.0)
    INFLPRES: jax.Array = positive("Pa", default=220000.0)
    WIDTH: jax.Array = positive("m", default=0.205)
    ASPECT_RATIO: jax.Array = coefficient(0.6)
    RIM_RADIUS: jax.Array = coefficient(0.0, unit="m")
    BOTTOM_OFFST: jax.Array = coefficient(0.01, unit="m")
    VERTICAL_STIFFNESS: jax.Array = positive("N/m", default=200000.0)
    BREFF: jax.Array = coefficient()
    DREFF: jax.Array = coefficient()
    FREFF: jax.Array = coefficient()
    Q_RE0: jax.Array = positive("-", default=1.0)
    Q_V1: jax.Array = coefficient(scale=1e-3)
    Q_V2: jax.Array = coefficient(scale=0.05)
    Q_FZ2: jax.Array = coefficient(1e-4, scale=10.0)
    Q_FCX: jax.Array = coefficient()
    Q_FCY: jax.Array = coefficient()
    Q_FCY2: jax.Array = coefficient()
    Q_CAM1: jax.Array = coefficient(scale=100.0, unit="1/m")
    Q_CAM2: jax.Array = coefficient(scale=100.0, unit="1/m^2")
    Q_CAM3: jax.Array = coefficient()
    Q_FYS1: jax.Array = coefficient(scale=1e4, unit="N/rad")
    Q_FYS2: jax.Array = coefficient(scale=1e4, unit="N/rad")
    Q_FYS3: jax.Array = coefficient(scale=1e4, unit="N/rad")
    PFZ1: jax.Array = coefficient()
    Q_RA1: jax.Array = coefficient()
    Q_RA2: jax.Array = coefficient()
    Q_RB1: jax.Array = coefficient()
    Q_RB2: jax.Array = coefficient()
    Q_A1: jax.Array = coefficient()
    Q_A2: jax.Array = coefficient()
    LONGITUDINAL_STIFFNESS: jax.Array = positive("N/m", default=300000.0)
    LATERAL_STIFFNESS: jax.Array = positive("N/m", default=100000.0)
    PCFX1: jax.Array = coefficient()
    PCFX2: jax.Array = coefficient()
    PCFX3: jax.Array = coefficient()
    PCFY1: jax.Array = coefficient()
    PCFY2: jax.Array = coefficient()
    PCFY3: jax.Array = coefficient()

    def vertical_stiffness(self, dp_i):
        """Vertical stiffness at a pressure (A5), N/m."""
        return self.VERTICAL_STIFFNESS * (1 + self.PFZ1 * dp_i)

    def wheel(self, load, slip_ratio, speed, dp_i) -> Wheel:
        """The effective rolling radius (A7), free radius (A1) and speed of a wheel with this slip ratio (book 2.5)."""
        share = load / self.FNOMIN
        sinks = self.FNOMIN / self.vertical_stiffness(dp_i)
        sinks = sinks * (self.DREFF * numerics.arctan(self.BREFF * share) + self.FREFF * share)
        radius = numerics.as_wide_as(0.965 * self.UNLOADED_RADIUS, sinks)
        for _ in range(RADIUS_ITERATIONS):
            omega = (1 + slip_ratio) * speed / unless_zero(radius)
            grown = self.Q_RE0 + self.Q_V1 * (omega * self.UNLOADED_RADIUS / self.LONGVL) ** 2
            free = self.UNLOADED_RADIUS * grown
            radius = free - sinks
        return Wheel(radius, free, omega)

    def deflection(self, load, omega, dp_i, F_x, F_y):
        """The vertical deflection rho of a loaded, rolling tyre (from A2 to A4), m."""
        stiff = self.VERTICAL_STIFFNESS * self.UNLOADED_RADIUS / self.FNOMIN
        q_1 = numerics.sqrt(jnp.maximum(stiff**2 - 4 * self.Q_FZ2, 0.0))
        carries = 1 + self.Q_V2 * self.UNLOADED_RADIUS / self.LONGVL * jnp.abs(omega)
        carries = carries - (self.Q_FCX * F_x / self.FNOMIN) ** 2 - (self.Q_FCY * F_y / self.FNOMIN) ** 2
        carries = jnp.maximum(carries * (1 + self.PFZ1 * dp_i), 1e-12)
        # The root of q_2 x^2 + q_1 x = load, in a form that also holds for q_2 = 0.
        target = load / (carries * self.FNOMIN)
        root = numerics.sqrt(jnp.maximum(q_1**2 + 4 * self.Q_FZ2 * target, 0.0))
        x = 2 * target / unless_zero(q_1 + root)
        return jnp.maximum(x * self.UNLOADED_RADIUS, 0.0)

    def loaded_radius(self, load, camber, wheel: Wheel, dp_i, F_x, F_y):
        """The loaded radius, at which `carried_load` is the load, and the vertical deflection of version 6.2, m."""
        first = numerics.as_wide_as(self.UNLOADED_RADIUS, wheel.speed, load, F_x, F_y, camber)

        def missing(radius, given):
            structure, load, *rest = given
            return structure.carried_load(radius, *rest)[0] - load

        rest = (camber, wheel, dp_i, F_x, F_y)
        # Starting values and tolerance are those of the reference evaluator: its tolerance of 1e-6 of the nominal load shows in
        # the result.
        given = (self, numerics.as_wide_as(load, first), *rest)
        radius = numerics.secant(missing, given, 0.95 * first, first, 1e-6 * self.FNOMIN)
        return radius, self.carried_load(radius, *rest)[1]

    def carried_load(self, radius, camber, wheel: Wheel, dp_i, F_x, F_y):
        """The load (N) and the deflection (m) at a loaded radius in version 6.2 (MF-Tyre/MF-Swift 6.2 equation manual, 2013)."""
        s = self
        free = wheel.free_radius
        share = radius / free
        asymmetric = (s.Q_FYS1 + s.Q_FYS2 * share + s.Q_FYS3 * share**2) * camber
        sinks = jnp.maximum(free - radius, 0.0)
        tread = (1.075 - 0.5 * s.ASPECT_RATIO) * s.WIDTH
        grown = s.Q_CAM1 * free + s.Q_CAM2 * free**2
        leans = (grown != 0) & (camber != 0)
        ratio = (s.Q_CAM1 * radius + s.Q_CAM2 * radius**2) / numerics.or_one(grown, leans)
        by_camber = ratio**2 * tread / 8 * jnp.abs(numerics.tan(camber)) - s.Q_CAM3 * sinks * jnp.abs(camber)
        rho = jnp.maximum(sinks + jnp.where(leans, by_camber, 0.0), 1e-12)
        x = rho / s.UNLOADED_RADIUS
        across = x**s.Q_FCY2 * s.Q_FCY * (F_y - asymmetric) / s.FNOMIN
        carries = 1 + s.Q_V2 * s.UNLOADED_RADIUS / s.LONGVL * jnp.abs(wheel.speed)
        carries = (carries - (s.Q_FCX * F_x / s.FNOMIN) ** 2 - across**2) * (1 + s.PFZ1 * dp_i)
        q_1 = numerics.sqrt(jnp.maximum((s.VERTICAL_STIFFNESS * s.UNLOADED_RADIUS / s.FNOMIN) ** 2 - 4 * s.Q_FZ2, 0.0))
        return carries * (q_1 * x + s.Q_FZ2 * x**2) * s.FNOMIN, rho

    def contact_patch(self, load, dp_i, version: int):
        """Half length a and half width b of the contact patch (A9, A10; 5.2: the MF-Tyre manual), m."""
        stiffness = self.vertical_stiffness(dp_i)
        lowest = jnp.maximum(self.UNLOADED_RADIUS - self.RIM_RADIUS - self.BOTTOM_OFFST, 0.0)
        load = jnp.minimum(load, lowest * stiffness)
        if version == 52:
            share = load / self.FNOMIN
            y = jnp.log10(self.UNLOADED_RADIUS * self.VERTICAL_STIFFNESS / self.FNOMIN)
            told = (self.Q_A1 != 0) | (self.Q_A2 != 0)
            guess = -0.0388 * y**3 + 0.2509 * y**2 - 0.6283 * y + 0.6279
            root = jnp.where(told, self.Q_A1, guess)
            linear = jnp.where(told, self.Q_A2, 1.693 * guess**2)
            a = self.UNLOADED_RADIUS * (linear * share + root * numerics.sqrt(share))
            return a, numerics.as_wide_as(self.WIDTH / 2, a)
        share = load / (stiffness * self.UNLOADED_RADIUS)
        a = self.UNLOADED_RADIUS * (self.Q_RA2 * share + self.Q_RA1 * numerics.sqrt(share))
        some = share > 0
        third = jnp.where(some, jnp.cbrt(numerics.or_one(share, some)), 0.0)
        return a, self.WIDTH * (self.Q_RB2 * share + self.Q_RB1 * third)

    def carcass(self, df_z, dp_i):
        """Longitudinal and lateral stiffness of the carcass (A17, A18), N/m."""
        along = (1 + self.PCFX1 * df_z + self.PCFX2 * df_z**2) * (1 + self.PCFX3 * dp_i)
        across = (1 + self.PCFY1 * df_z + self.PCFY2 * df_z**2) * (1 + self.PCFY3 * dp_i)
        return self.LONGITUDINAL_STIFFNESS * along, self.LATERAL_STIFFNESS * across

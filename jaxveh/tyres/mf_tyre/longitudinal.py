"""Longitudinal force: pure slip (4.E9 to 4.E18) and its weight in combined slip (4.E50 to 4.E57)."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.tyres.mf_tyre.formula import coefficient, cosine_of_arctan, curvature, not_zero, sign, sine_curve, weight
from jaxveh.tyres.mf_tyre.section import AbstractSection


class PureLongitudinal(NamedTuple):
    """`force` (N) at zero slip angle, `stiffness` K_xk (N), friction `mu` (-)."""

    force: Any
    stiffness: Any
    mu: Any


class LongitudinalCoefficients(AbstractSection):
    """The section [LONGITUDINAL_COEFFICIENTS].

    Pure slip: shape `PCX1`; friction `PDX1` at nominal load and its dependence on load (`2`) and camber squared (`3`);
    curvature `PEX1` and its dependence on load (`2`, `3`) and the slip's sign (`4`); stiffness `PKX1` and its dependence on load
    (`2`, `3`); shifts `PHX1`, `PHX2`, `PVX1`, `PVX2`; pressure `PPX1` to `PPX4`. Combined slip: `RBX1` to `RBX3`, `RCX1`,
    `REX1`, `REX2`, `RHX1`. Relaxation in 5.2: `PTX1` to `PTX3`.
    """

    PCX1: jax.Array = coefficient(scale=1.5)
    PDX1: jax.Array = coefficient()
    PDX2: jax.Array = coefficient(scale=0.1)
    PDX3: jax.Array = coefficient()
    PEX1: jax.Array = coefficient()
    PEX2: jax.Array = coefficient()
    PEX3: jax.Array = coefficient()
    PEX4: jax.Array = coefficient()
    PKX1: jax.Array = coefficient(scale=20.0)
    PKX2: jax.Array = coefficient(scale=10.0)
    PKX3: jax.Array = coefficient()
    PHX1: jax.Array = coefficient(scale=0.002)
    PHX2: jax.Array = coefficient(scale=0.002)
    PVX1: jax.Array = coefficient(scale=0.05)
    PVX2: jax.Array = coefficient(scale=0.05)
    PPX1: jax.Array = coefficient()
    PPX2: jax.Array = coefficient()
    PPX3: jax.Array = coefficient()
    PPX4: jax.Array = coefficient()
    RBX1: jax.Array = coefficient(scale=10.0)
    RBX2: jax.Array = coefficient(scale=10.0)
    RBX3: jax.Array = coefficient(scale=100.0)
    RCX1: jax.Array = coefficient()
    REX1: jax.Array = coefficient()
    REX2: jax.Array = coefficient()
    RHX1: jax.Array = coefficient(scale=0.01)
    PTX1: jax.Array = coefficient()
    PTX2: jax.Array = coefficient()
    PTX3: jax.Array = coefficient()

    @numerics.fence_results
    def pure(self, at, scaling) -> PureLongitudinal:
        """F_x0 and its components."""
        c, s = self, scaling
        S_Hx = (c.PHX1 + c.PHX2 * at.df_z) * s.LHX * at.smooth
        S_Vx = at.load * (c.PVX1 + c.PVX2 * at.df_z) * s.LVX * at.mu_x * at.spin.zeta_1 * at.smooth
        kappa = at.slip_ratio + S_Hx
        C_x = c.PCX1 * s.LCX
        pressure = 1 + c.PPX3 * at.dp_i + c.PPX4 * at.dp_i**2
        mu_x = (c.PDX1 + c.PDX2 * at.df_z) * pressure * (1 - c.PDX3 * at.camber**2) * at.mu_x
        D_x = mu_x * at.load * at.spin.zeta_1
        bend = c.PEX1 + c.PEX2 * at.df_z + c.PEX3 * at.df_z**2
        E_x = curvature(bend * (1 - c.PEX4 * sign(kappa)) * s.LEX, at)
        K_xk = at.load * (c.PKX1 + c.PKX2 * at.df_z) * jnp.exp(c.PKX3 * at.df_z)
        K_xk = K_xk * (1 + c.PPX1 * at.dp_i + c.PPX2 * at.dp_i**2) * s.LKX
        B_x = K_xk / not_zero(C_x * D_x)
        return PureLongitudinal(sine_curve(kappa, B_x, C_x, D_x, E_x) + S_Vx, K_xk, mu_x)

    @numerics.fence_results
    def weight(self, at, scaling):
        """G_xa: the share of F_x0 that remains at a slip angle."""
        c = self
        B = (c.RBX1 + c.RBX3 * at.sine**2) * cosine_of_arctan(c.RBX2 * at.slip_ratio) * scaling.LXAL
        return weight(at.tangent, c.RHX1, B, c.RCX1, curvature(c.REX1 + c.REX2 * at.df_z, at))

"""Lateral force: pure slip (4.E19 to 4.E30), its weight and the force that slip adds in combined slip (4.E58 to 4.E67)."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.tyres.mf_tyre.formula import (
    coefficient,
    cosine_of_arctan,
    curvature,
    not_zero,
    sign,
    sine_curve,
    unless_zero,
    weight,
)
from jaxveh.tyres.mf_tyre.section import AbstractSection


class PureLateral(NamedTuple):
    """`force` (N) at zero slip ratio; `stiffness` K_ya (N/rad), friction `mu`, `B`, `C`, shifts `S_H` (rad) and `S_V` (N)."""

    force: Any
    stiffness: Any
    mu: Any
    B: Any
    C: Any
    S_H: Any
    S_V: Any


class LateralCoefficients(AbstractSection):
    """The section [LATERAL_COEFFICIENTS].

    Pure slip: shape `PCY1`; friction `PDY1` and its dependence on load (`2`) and camber squared (`3`); curvature `PEY1` and its
    dependence on load (`2`), side (`3`) and camber (`4`, `5`); stiffness `PKY1`, the load of its maximum (`2`), its dependence
    on camber (`3`, `5`), its shape over load (`4`), camber stiffness (`6`, `7`); shifts `PHY1`, `PHY2`, `PVY1` to `PVY4`, in 5.2
    `PHY3`; pressure `PPY1` to `PPY5`. Combined slip: `RBY1` to `RBY4`, `RCY1`, `REY1`, `REY2`, `RHY1`, `RHY2`, `RVY1` to
    `RVY6`. Relaxation in 5.2: `PTY1`, `PTY2`.
    """

    PCY1: jax.Array = coefficient(scale=1.5)
    PDY1: jax.Array = coefficient()
    PDY2: jax.Array = coefficient(scale=0.1)
    PDY3: jax.Array = coefficient()
    PEY1: jax.Array = coefficient()
    PEY2: jax.Array = coefficient()
    PEY3: jax.Array = coefficient()
    PEY4: jax.Array = coefficient(scale=10.0)
    PEY5: jax.Array = coefficient(scale=10.0)
    PKY1: jax.Array = coefficient(scale=20.0)
    PKY2: jax.Array = coefficient(1.0)
    PKY3: jax.Array = coefficient()
    PKY4: jax.Array = coefficient(2.0)
    PKY5: jax.Array = coefficient(scale=10.0)
    PKY6: jax.Array = coefficient()
    PKY7: jax.Array = coefficient()
    PHY1: jax.Array = coefficient(scale=0.002)
    PHY2: jax.Array = coefficient(scale=0.002)
    PHY3: jax.Array = coefficient(scale=0.1)
    PVY1: jax.Array = coefficient(scale=0.05)
    PVY2: jax.Array = coefficient(scale=0.05)
    PVY3: jax.Array = coefficient()
    PVY4: jax.Array = coefficient()
    PPY1: jax.Array = coefficient()
    PPY2: jax.Array = coefficient()
    PPY3: jax.Array = coefficient()
    PPY4: jax.Array = coefficient()
    PPY5: jax.Array = coefficient()
    RBY1: jax.Array = coefficient(scale=10.0)
    RBY2: jax.Array = coefficient(scale=10.0)
    RBY3: jax.Array = coefficient(scale=0.05)
    RBY4: jax.Array = coefficient(scale=100.0)
    RCY1: jax.Array = coefficient()
    REY1: jax.Array = coefficient()
    REY2: jax.Array = coefficient()
    RHY1: jax.Array = coefficient(scale=0.01)
    RHY2: jax.Array = coefficient(scale=0.01)
    RVY1: jax.Array = coefficient(scale=0.05)
    RVY2: jax.Array = coefficient(scale=0.05)
    RVY3: jax.Array = coefficient()
    RVY4: jax.Array = coefficient(scale=10.0)
    RVY5: jax.Array = coefficient()
    RVY6: jax.Array = coefficient(scale=10.0)
    PTY1: jax.Array = coefficient()
    PTY2: jax.Array = coefficient(1.0)

    @numerics.fence_results
    def pure(self, at, scaling, nominal_load, version: int) -> PureLateral:
        """F_y0 and its components at the point's camber; `nominal_load` is F_z0 times its scaling factor."""
        c, s, sine = self, scaling, at.sine
        K_ya = self._stiffness(at, s, nominal_load, sine)
        S_Vg = at.load * (c.PVY3 + c.PVY4 * at.df_z) * sine * s.LKYC * at.mu_y * at.spin.zeta_2
        S_H = (c.PHY1 + c.PHY2 * at.df_z) * s.LHY
        if version == 52:
            S_H = S_H + c.PHY3 * sine * s.LKYC
        else:
            K_yg = at.load * (c.PKY6 + c.PKY7 * at.df_z) * (1 + c.PPY5 * at.dp_i) * s.LKYC
            if at.spin.coefficients is None:
                S_H = S_H + (K_yg * sine - S_Vg) / not_zero(K_ya)
            else:
                upright = self._stiffness(at, s, nominal_load, jnp.zeros_like(sine))
                S_H = S_H + at.spin.shift(at, K_yg, upright) - S_Vg / not_zero(K_ya)
        S_V = at.load * (c.PVY1 + c.PVY2 * at.df_z) * s.LVY * at.mu_y * at.spin.zeta_2 + S_Vg
        S_H, S_V = S_H * at.smooth, S_V * at.smooth
        alpha = at.tangent + S_H
        C_y = c.PCY1 * s.LCY
        pressure = 1 + c.PPY3 * at.dp_i + c.PPY4 * at.dp_i**2
        mu_y = (c.PDY1 + c.PDY2 * at.df_z) * pressure * (1 - c.PDY3 * sine**2) * at.mu_y
        D_y = mu_y * at.load * at.spin.zeta_2
        side = 1 + c.PEY5 * sine**2 - (c.PEY3 + c.PEY4 * sine) * sign(alpha)
        E_y = curvature((c.PEY1 + c.PEY2 * at.df_z) * side * s.LEY, at)
        B_y = K_ya / not_zero(C_y * D_y)
        return PureLateral(sine_curve(alpha, B_y, C_y, D_y, E_y) + S_V, K_ya, mu_y, B_y, C_y, S_H, S_V)

    def _stiffness(self, at, scaling, nominal_load, sine):
        """K_ya (4.E25) at the sine of a camber, N/rad, negative in ISO-W."""
        c = self
        reach = (c.PKY2 + c.PKY5 * sine**2) * (1 + c.PPY2 * at.dp_i)
        K_ya = c.PKY1 * nominal_load * (1 + c.PPY1 * at.dp_i) * (1 - c.PKY3 * jnp.abs(sine)) * scaling.LKY
        return (
            K_ya * numerics.sin(c.PKY4 * numerics.arctan(at.load / nominal_load / unless_zero(reach))) * at.spin.zeta_3
        )

    @numerics.fence_results
    def weight(self, at, scaling):
        """G_yk: the share of F_y0 that remains at a slip ratio."""
        c = self
        B = (c.RBY1 + c.RBY4 * at.sine**2) * cosine_of_arctan(c.RBY2 * (at.tangent - c.RBY3)) * scaling.LYKA
        E = curvature(c.REY1 + c.REY2 * at.df_z, at)
        return weight(at.slip_ratio, c.RHY1 + c.RHY2 * at.df_z, B, c.RCY1, E)

    def ply_steer(self, at, scaling, mu_y):
        """S_Vyk: the lateral force that slip ratio adds ("ply-steer"), N."""
        c = self
        D = mu_y * at.load * (c.RVY1 + c.RVY2 * at.df_z + c.RVY3 * at.sine) * cosine_of_arctan(c.RVY4 * at.tangent)
        D = D * at.spin.zeta_2
        return D * numerics.sin(c.RVY5 * numerics.arctan(c.RVY6 * at.slip_ratio)) * scaling.LVYKA * at.smooth

"""Turn slip: the effect of a curved path, or of turning on the spot, on forces and moments (Pacejka 4.3.3, 4.75 to 4.105)."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.tyres.mf_tyre.formula import (
    coefficient,
    cosine_of_arctan,
    curvature,
    not_zero,
    sine_curve,
    unless_zero,
)
from jaxveh.tyres.mf_tyre.section import AbstractSection


class TurnSlip(AbstractSection):
    """The section [TURNSLIP_COEFFICIENTS].

    Loss of F_x `PDXP1` to `PDXP3`, of F_y `PDYP1` to `PDYP4`, of cornering stiffness `PKYP1`, of trail `QDTP1`, of residual
    torque `QBRP1`; shift of F_y `PHYP1` to `PHYP4`; camber reduction `PECP1`, `PECP2`; parking moment `QCRP1`, `QCRP2`, `QDRP1`.
    """

    PDXP1: jax.Array = coefficient(0.4)
    PDXP2: jax.Array = coefficient()
    PDXP3: jax.Array = coefficient()
    PKYP1: jax.Array = coefficient(1.0)
    PDYP1: jax.Array = coefficient(0.4)
    PDYP2: jax.Array = coefficient()
    PDYP3: jax.Array = coefficient()
    PDYP4: jax.Array = coefficient()
    PHYP1: jax.Array = coefficient(1.0)
    PHYP2: jax.Array = coefficient(0.15)
    PHYP3: jax.Array = coefficient()
    PHYP4: jax.Array = coefficient(-4.0)
    PECP1: jax.Array = coefficient(0.5)
    PECP2: jax.Array = coefficient()
    QDTP1: jax.Array = coefficient(10.0)
    QCRP1: jax.Array = coefficient(0.2)
    QCRP2: jax.Array = coefficient(0.1)
    QBRP1: jax.Array = coefficient(0.1)
    QDRP1: jax.Array = coefficient(1.0)

    def spin(self, at, turn_slip, omega, radius, least_speed) -> Spin:
        """The spin and its factors at an operating point.

        `turn_slip` is phi_t (1/m), faded if the tyre has limits; `omega` (rad/s) and `radius` R_0 (m) are those of the wheel.
        The angular speed about the road's normal is that of the path plus that of a cambered wheel, reduced by epsilon_gamma
        (4.76).
        """
        c = self
        reduction = c.PECP1 * (1 + c.PECP2 * at.df_z)
        speed = jnp.where(
            at.speed < least_speed, least_speed, at.speed * jnp.sqrt(1 + numerics.tan(at.slip_angle) ** 2)
        )
        phi = -turn_slip - (1 - reduction) * omega * numerics.sin(at.camber) / speed
        turns = radius * phi
        B_xp = c.PDXP1 * (1 + c.PDXP2 * at.df_z) * cosine_of_arctan(c.PDXP3 * at.slip_ratio)
        B_yp = c.PDYP1 * (1 + c.PDYP2 * at.df_z) * cosine_of_arctan(c.PDYP3 * numerics.tan(at.slip_angle))
        size = jnp.abs(turns)
        return Spin(
            zeta_1=cosine_of_arctan(B_xp * turns),
            zeta_2=cosine_of_arctan(B_yp * (size + c.PDYP4 * numerics.sqrt(size))),
            zeta_3=cosine_of_arctan(c.PKYP1 * turns**2),
            zeta_5=cosine_of_arctan(c.QDTP1 * turns),
            zeta_6=cosine_of_arctan(c.QBRP1 * turns),
            turns=turns,
            path=radius * turn_slip,
            reduction=reduction,
            coefficients=self,
        )


class Spin(NamedTuple):
    """The spin at an operating point: the factors zeta of the book, `turns` R_0 phi, `path` R_0 phi_t, `reduction` epsilon_gamma.

    Without turn slip the factors are 1 and `coefficients` is None.
    """

    zeta_1: Any = 1.0
    zeta_2: Any = 1.0
    zeta_3: Any = 1.0
    zeta_5: Any = 1.0
    zeta_6: Any = 1.0
    turns: Any = 0.0
    path: Any = 0.0
    reduction: Any = 0.0
    coefficients: Any = None

    def shift(self, at, K_yg, K_ya0):
        """S_Hyp: the slip angle by which spin shifts F_y (4.80, 4.85 to 4.89), including camber thrust."""
        c = self.coefficients
        D = c.PHYP2 + c.PHYP3 * at.df_z
        B = K_yg / unless_zero(1 - self.reduction) / unless_zero(c.PHYP1 * D * not_zero(K_ya0))
        return sine_curve(self.turns, B, c.PHYP1, D, curvature(c.PHYP4, at))

    def parking(self, at, scaling, aligning, structure, mu_y, weight) -> tuple[Any, Any]:
        """`D_rphi` (N m), the peak of the residual torque due to spin, and its shape zeta_7 (4.93 to 4.103).

        The slope in (4.99) is that of the residual torque over camber, `QDZ8 + QDZ9 df_z` (the reference evaluator multiplies
        the two). The argument of the arccos in zeta_7 is limited to -1 to 1.
        """
        c, a = self.coefficients, aligning
        R_0, nominal = structure.UNLOADED_RADIUS, scaling.LFZO * structure.FNOMIN
        most = c.QCRP1 * jnp.abs(mu_y) * R_0 * at.moment_load * numerics.sqrt(at.moment_load / nominal) * scaling.LMP
        D = most / unless_zero(numerics.sin(0.5 * math.pi * c.QDRP1))
        slope = a.QDZ8 + a.QDZ9 * at.df_z + (a.QDZ10 + a.QDZ11 * at.df_z) * jnp.abs(at.camber)
        slope = at.moment_load * R_0 * slope * scaling.LKZC
        turned = slope / not_zero(c.QDRP1 * D * (1 - self.reduction)) * self.path
        D_rp = D * numerics.sin(c.QDRP1 * numerics.arctan(turned))
        at_90 = most * (2 / math.pi) * numerics.arctan(c.QCRP2 * jnp.abs(self.path)) * weight
        turning = jnp.abs(D_rp) > 1e-9 * (1 + most)
        share = jnp.where(turning, at_90 / numerics.or_one(jnp.abs(D_rp), turning), 0.0)
        inside = jnp.abs(share) < 1 - 1e-9
        at_limit = jnp.where(share < 0, math.pi, 0.0)
        angle = jnp.where(inside, jnp.arccos(jnp.where(inside, share, 0.0)), at_limit)
        return D_rp, jnp.where(turning, (2 / math.pi) * angle, 1.0)


NO_SPIN = Spin()

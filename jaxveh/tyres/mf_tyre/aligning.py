"""Aligning moment: pneumatic trail, residual torque and the longitudinal force's arm (4.E31 to 4.E49, 4.E71 to 4.E78)."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.tyres.mf_tyre.formula import EPSILON, coefficient, cosine_curve, cosine_of_arctan, curvature, not_zero, sign
from jaxveh.tyres.mf_tyre.section import AbstractSection


class AligningParts(NamedTuple):
    """`moment` M_z (N m), pneumatic `trail` (m), `residual` torque M_zr (N m)."""

    moment: Any
    trail: Any
    residual: Any


class AligningCoefficients(AbstractSection):
    """The section [ALIGNING_COEFFICIENTS].

    Trail: slope `QBZ1` to `QBZ5`, shape `QCZ1`, peak `QDZ1` to `QDZ4`, curvature `QEZ1` to `QEZ5`, shift `QHZ1` to `QHZ4`.
    Residual torque: slope `QBZ9`, `QBZ10`, peak `QDZ6` to `QDZ11`. Pressure: `PPZ1`, `PPZ2`. Arm of F_x: `SSZ1` to `SSZ4`.
    """

    QBZ1: jax.Array = coefficient(scale=10.0)
    QBZ2: jax.Array = coefficient()
    QBZ3: jax.Array = coefficient()
    QBZ4: jax.Array = coefficient()
    QBZ5: jax.Array = coefficient()
    QBZ9: jax.Array = coefficient(scale=10.0)
    QBZ10: jax.Array = coefficient()
    QCZ1: jax.Array = coefficient()
    QDZ1: jax.Array = coefficient(scale=0.1)
    QDZ2: jax.Array = coefficient(scale=0.01)
    QDZ3: jax.Array = coefficient()
    QDZ4: jax.Array = coefficient(scale=10.0)
    QDZ6: jax.Array = coefficient(scale=0.002)
    QDZ7: jax.Array = coefficient(scale=0.002)
    QDZ8: jax.Array = coefficient(scale=0.1)
    QDZ9: jax.Array = coefficient(scale=0.1)
    QDZ10: jax.Array = coefficient()
    QDZ11: jax.Array = coefficient()
    QEZ1: jax.Array = coefficient()
    QEZ2: jax.Array = coefficient()
    QEZ3: jax.Array = coefficient()
    QEZ4: jax.Array = coefficient()
    QEZ5: jax.Array = coefficient()
    QHZ1: jax.Array = coefficient(scale=0.005)
    QHZ2: jax.Array = coefficient(scale=0.005)
    QHZ3: jax.Array = coefficient(scale=0.1)
    QHZ4: jax.Array = coefficient(scale=0.1)
    PPZ1: jax.Array = coefficient()
    PPZ2: jax.Array = coefficient()
    SSZ1: jax.Array = coefficient(scale=0.05)
    SSZ2: jax.Array = coefficient(scale=0.05)
    SSZ3: jax.Array = coefficient()
    SSZ4: jax.Array = coefficient()

    def parts(self, at, scaling, structure, pure, K_xk, weight_y, forces) -> AligningParts:
        """M_z of combined slip.

        `pure`: the `PureLateral` at the point's camber; `weight_y`: G_yk; `forces`: F_x and F_y of combined slip, and the
        lateral force that acts on the trail: the weighted F_y without camber (4.E74), or in version 5.2 F_y without ply-steer.
        """
        F_x, F_y, on_trail = forces
        slip = _slip_share(at, K_xk, pure.stiffness)
        trail = self._trail(at, scaling, structure, slip)
        residual = self._residual(at, scaling, structure, pure, slip, weight_y)
        arm = self.SSZ1 + self.SSZ2 * F_y / structure.FNOMIN + (self.SSZ3 + self.SSZ4 * at.df_z) * at.camber
        arm = structure.UNLOADED_RADIUS * arm * scaling.LS
        return AligningParts(-trail * on_trail + residual + arm * F_x, trail, residual)

    @numerics.fence_results
    def _trail(self, at, scaling, structure, slip):
        """The pneumatic trail (4.E73 with A55, A58, A60), m, with the opposite sign in backward travel (4.E42)."""
        c, camber = self, at.camber
        S_Ht = c.QHZ1 + c.QHZ2 * at.df_z + (c.QHZ3 + c.QHZ4 * at.df_z) * at.sine
        alpha = at.tangent + S_Ht
        B = (c.QBZ1 + c.QBZ2 * at.df_z + c.QBZ3 * at.df_z**2) * (1 + c.QBZ4 * camber + c.QBZ5 * jnp.abs(camber))
        B = B * _per_friction(scaling.LKY, at.mu_y)
        peak = (c.QDZ1 + c.QDZ2 * at.df_z) * (1 - c.PPZ1 * at.dp_i) * (1 + c.QDZ3 * camber + c.QDZ4 * camber**2)
        D = peak * at.moment_load * structure.UNLOADED_RADIUS / (structure.FNOMIN * scaling.LFZO) * scaling.LTR
        D = D * at.spin.zeta_5 * at.direction
        bend = c.QEZ1 + c.QEZ2 * at.df_z + c.QEZ3 * at.df_z**2
        side = 1 + (c.QEZ4 + c.QEZ5 * at.sine) * (2 / math.pi) * numerics.arctan(B * c.QCZ1 * alpha)
        E = curvature(bend * side, at)
        # The factor LFZO is not in the book. The reference evaluator has it, in agreement with TNO's own solver.
        curve = cosine_curve(_equivalent(alpha, slip), B, c.QCZ1, E) * _cosine_of_course(at)
        return D * curve * at.smooth * scaling.LFZO

    @numerics.fence_results
    def _residual(self, at, scaling, structure, pure, slip, weight_y):
        """The residual torque M_zr (4.E75 with A54), N m, with the opposite sign in backward travel (4.E47)."""
        c = self
        alpha = at.tangent + pure.S_H + pure.S_V / not_zero(pure.stiffness)
        B = c.QBZ9 * _per_friction(scaling.LKY, at.mu_y) + c.QBZ10 * pure.B * pure.C
        B = B * at.spin.zeta_6
        camber = (c.QDZ8 + c.QDZ9 * at.df_z) * (1 + c.PPZ2 * at.dp_i) + (c.QDZ10 + c.QDZ11 * at.df_z) * jnp.abs(at.sine)
        spins = at.spin.coefficients is not None
        peak = (c.QDZ6 + c.QDZ7 * at.df_z) * scaling.LRES * at.spin.zeta_2
        peak = peak if spins else peak + camber * at.sine * scaling.LKZC
        D = at.moment_load * structure.UNLOADED_RADIUS * peak * at.mu_y * numerics.cos(at.tangent) * at.direction
        if not spins:
            return D * cosine_of_arctan(B * _equivalent(alpha, slip)) * at.smooth
        turning, shape = at.spin.parking(at, scaling, self, structure, pure.mu, weight_y)
        return (D + turning) * numerics.cos(shape * numerics.arctan(B * _equivalent(alpha, slip))) * at.smooth


@numerics.fence_results
def _slip_share(at, K_xk, K_ya):
    """The square of the slip ratio's part in the equivalent slip angles of the trail and of the residual torque (A54, A55)."""
    return (K_xk / not_zero(K_ya)) ** 2 * at.slip_ratio**2


def _per_friction(scale, mu):
    """`scale / mu`, or 0 without friction, where there is no force for which it matters."""
    grips = mu != 0
    return jnp.where(grips, scale / numerics.or_one(mu, grips), 0.0)


def _equivalent(alpha, slip):
    """The equivalent slip angle of combined slip (A54, A55); `slip` is the square of the slip ratio's part."""
    return numerics.arctan(numerics.sqrt(numerics.tan(alpha) ** 2 + slip)) * sign(alpha)


@numerics.fence_results
def _cosine_of_course(at):
    """cos(alpha'): the wheel's forward speed over the speed of its contact centre (4.E6)."""
    course = jnp.abs(at.speed) * jnp.sqrt(1 + numerics.tan(at.slip_angle) ** 2)
    return jnp.abs(at.speed) / (course + EPSILON)

"""Combined slip from two laws of pure slip: the force lies on an ellipse whose half-axes are their forces."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.tyres.base import AbstractTyre, Contact, Forces, need_static
from jaxveh.tyres.slip import length, practical, share


class FrictionEllipse(AbstractTyre):
    """Combined slip from `along`, a law of F_x over slip ratio, and `across`, a law of F_y over slip angle.

    Both laws are evaluated at the total slip `s = |(kappa, tan(alpha))|`, the sliding speed over the forward speed. Each force
    is the share of its direction, after Bakker, Nyborg & Pacejka (SAE 870421, 1987), here in practical slips:

        F_x = kappa / s F_x0(s),    F_y = tan(alpha) / s F_y0(arctan(s))

    Then `(F_x / F_x0)^2 + (F_y / F_y0)^2 = 1`, an ellipse within that of the laws' peaks, and the slopes at zero slip are those
    of pure slip. The force on a locked wheel (kappa = -1) opposes its sliding, which is not so with
    `sqrt(1 - (F_x / F_max)^2)`. If one slip is zero, the other law is unchanged. Where a slip is negative, the negative side of
    its law is used. A force at zero slip (shifts, camber) is kept at every slip, and the total may leave the ellipse by as much.

    A law with F_y only can be used along the wheel as `LongitudinalLaw(law)`. Both laws get the contact's load, camber,
    friction, speed and pressure. Moments are left out.

    **Raises** `InputError` for a law that is not a tyre or that has states.
    """

    along: AbstractTyre
    across: AbstractTyre

    def __check_init__(self):
        need_static("FrictionEllipse.along", self.along)
        need_static("FrictionEllipse.across", self.across)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_x and F_y, N."""
        s_x, s_y = practical(contact)
        s = length(s_x, s_y)

        def along(slip):
            at = contact._replace(slip_ratio=slip, slip_angle=jnp.zeros_like(slip), lateral_slip=None)
            return self.along.forces(at).F_x

        def across(slip):
            at = contact._replace(slip_ratio=jnp.zeros_like(slip), slip_angle=numerics.arctan(slip), lateral_slip=slip)
            return self.across.forces(at).F_y

        none = jnp.zeros_like(s)
        return Forces(F_x=along(none) + share(along, s_x, s), F_y=across(none) + share(across, s_y, s))

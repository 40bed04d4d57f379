"""The arctangent tyre: a lateral force law with three parameters, one of them for the load."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.tyres.base import AbstractTyre, Contact, Forces, need_load


class Arctangent(AbstractTyre):
    """`F_y = k_red (1 - F_z / xi_1) F_z atan(xi_2 alpha)`, for lateral slip only.

    M. Hiemer, Model based detection and reconstruction of road traffic accidents, Karlsruhe, 2005; eq. 7 of the sideslip
    review (Chen, Gao & Xu, 2013).

    - `load_limit` (N): xi_1. The force is greatest at half this load. From this load on, outside the law's range, it is zero.
    - `stiffness_factor` (1/rad): xi_2.
    - `reduction` (-): k_red, which the contact's friction multiplies. It is not a friction coefficient: for large slip angles
      and small loads the force over the load tends to pi/2 times this value.

    **Raises** `InputError` for parameters that are not positive, or a contact without a load.
    """

    load_limit: jax.Array = positive("N")
    stiffness_factor: jax.Array = positive("1/rad")
    reduction: jax.Array = positive("-", default=1.0)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """The lateral force only, N."""
        load = need_load(contact, "Arctangent")
        height = self.reduction * contact.friction * jnp.maximum(1 - load / self.load_limit, 0.0) * load
        return Forces(F_y=height * numerics.arctan(self.stiffness_factor * contact.slip_angle))

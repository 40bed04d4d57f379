"""The exponential tyre: the lateral force approaches the friction limit exponentially in slip angle."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.tyres.base import AbstractTyre, Contact, Forces, need_load


class Exponential(AbstractTyre):
    """`F_y = mu_s F_z (1 - exp(-k |alpha|)) sgn(alpha)` with `mu_s = sqrt(mu^2 - (F_x / F_z)^2)`.

    J. Zuurbier & P. Bremmer, AVEC 2002 (the review's [32] says 2000); eq. 6 of the sideslip review (Chen, Gao & Xu, 2013;
    erratum: `k` is in 1/rad, not a stiffness in N/rad).

    - `stiffness_factor` (1/rad): k, cornering stiffness over `mu F_z`.
    - `friction` (-): mu.
    - `slip_stiffness_factor` (-): k_x of the same law in slip ratio, `F_x = mu F_z (1 - exp(-k_x |kappa|)) sgn(kappa)`; None
      for no longitudinal force. The source takes F_x as known. This law is our own choice; with it the total force stays within
      `mu F_z`.

    **Raises** `InputError` for parameters that are not positive, or a contact without a load.
    """

    stiffness_factor: jax.Array = positive("1/rad")
    friction: jax.Array = positive("-", default=1.0)
    slip_stiffness_factor: jax.Array | None = positive("-", default=None)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_y (N), and F_x (N) where a slip stiffness factor is given."""
        limit = self.friction * contact.friction * need_load(contact, "Exponential")
        F_y = limit * _rise(self.stiffness_factor * contact.slip_angle)
        if self.slip_stiffness_factor is None:
            return Forces(F_y=F_y)
        x = self.slip_stiffness_factor * contact.slip_ratio
        # sqrt(1 - (F_x / limit)^2), in a form without infinite slope where F_x uses all of the friction.
        decay = jnp.exp(-jnp.abs(x) / 2)
        left = decay * numerics.sqrt(2 - decay**2)
        return Forces(F_x=limit * _rise(x), F_y=left * F_y)


def _rise(x):
    """`(1 - exp(-|x|)) sgn(x)`; its slope at 0 is 1."""
    x = jnp.asarray(x)
    backward = x < 0
    less = jnp.expm1(jnp.where(backward, x, -x))
    return jnp.where(backward, less, -less)

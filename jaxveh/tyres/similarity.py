"""Similarity: one measured curve of pure slip represents all loads, roads and directions."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import positive
from jaxveh.tyres.base import AbstractTyre, Contact, Forces, need_load, need_static
from jaxveh.tyres.slip import length, share, theoretical

LEAST_FRICTION = 1e-3
"""The lower bound of the friction by which the equivalent slip is divided; the force still vanishes with the road's friction."""


class Similarity(AbstractTyre):
    """Pacejka's similarity method (H. B. Pacejka, Tire and Vehicle Dynamics, 3rd ed., sec. 4.2): the lateral curve of `tyre`
    at `reference_load` F_z0 (N) and friction 1, normalised and stretched.

        F_y = f F_z / F_z0 F_y0(alpha_eq),    tan(alpha_eq) = C(F_z) / C(F_z0) F_z0 / (f F_z) tan(alpha)

    with f the contact's friction. Less friction or load shrinks the whole curve towards zero, while the slope at zero slip is
    the cornering stiffness C(F_z), which friction does not change. (The book scales alpha; scaling its tangent keeps the
    equivalent slip angle below a quarter turn on slippery roads.)

    `stiffness_load` (N; default None) is the load of the largest cornering stiffness, `C = C_max sin(2 arctan(F_z /
    stiffness_load))`; None: C is proportional to the load. `slip_stiffness_ratio` (-; default None) is the slip stiffness over
    the cornering stiffness. With it the same curve is used for combined slip: it is evaluated at the length of the vector
    (ratio sigma_x, sigma_y) of theoretical slips, and the force points along this vector. If the ratio is far from one, that is
    not the direction of sliding at full sliding. None: no F_x, and the slip ratio has no effect.

    The curve's force at zero slip (shifts, camber) is scaled and kept at every slip. The wrapped tyre gets the contact's camber,
    speed and pressure; moments are left out.

    **Raises** `InputError` for parameters that are not positive, a tyre with states, or a contact without a load.
    """

    tyre: AbstractTyre
    reference_load: jax.Array = positive("N")
    stiffness_load: jax.Array | None = positive("N", default=None)
    slip_stiffness_ratio: jax.Array | None = positive("-", default=None)

    def __check_init__(self):
        need_static("Similarity.tyre", self.tyre)

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_y and, with a `slip_stiffness_ratio`, F_x, N."""
        load = need_load(contact, "Similarity")
        scale = contact.friction * (load / self.reference_load)
        stretch = self._stiffness_per_load(load) / jnp.maximum(contact.friction, LEAST_FRICTION)

        def curve(slip):
            angle = numerics.arctan(slip)
            at = contact._replace(slip_angle=angle, lateral_slip=slip, slip_ratio=jnp.zeros_like(slip))
            return self.tyre.forces(at._replace(load=self.reference_load, friction=1.0)).F_y

        if self.slip_stiffness_ratio is None:
            _, s_y = theoretical(contact._replace(slip_ratio=0.0))
            return Forces(F_y=scale * curve(stretch * s_y))
        sigma_x, sigma_y = theoretical(contact)
        s_x, s_y = stretch * self.slip_stiffness_ratio * sigma_x, stretch * sigma_y
        s = length(s_x, s_y)
        return Forces(F_x=scale * share(curve, s_x, s), F_y=scale * (curve(jnp.zeros_like(s)) + share(curve, s_y, s)))

    def _stiffness_per_load(self, load):
        """Cornering stiffness over load, relative to its value at the reference load."""
        if self.stiffness_load is None:
            return 1.0
        # sin(2 arctan(x)) = 2 x / (1 + x^2): the load cancels, so that zero load is not a singular point.
        x, x_0 = load / self.stiffness_load, self.reference_load / self.stiffness_load
        return (1 + x_0**2) / (1 + x**2)

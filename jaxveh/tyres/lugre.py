"""The LuGre tyre: the mean deflection of its bristles is the state, valid from standstill to full sliding."""

from __future__ import annotations

import math
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_at_least, check_positive
from jaxveh._core.parameter import parameter, positive
from jaxveh.numerics import polynomials
from jaxveh.tyres.base import AbstractDynamicTyre, Contact, Forces, need_load, need_slip_speed, need_speed
from jaxveh.tyres.slip import LOCKED, practical

LEAST_FRICTION = 1e-3
"""The least road friction used for the bristles; at zero friction their deflection would have to vanish at once."""

_TERMS = 16
_ABOVE = tuple((-1) ** n / math.factorial(n + 1) for n in range(_TERMS))
_BELOW = tuple(2 * (-1) ** n / math.factorial(n + 2) for n in range(_TERMS))


class LuGreState(NamedTuple):
    """The mean deflections of the bristles, m, with the sign of their forces."""

    z_x: Any
    z_y: Any


class LuGre(AbstractDynamicTyre):
    """The average lumped LuGre tyre for combined slip (Velenis, Tsiotras, Canudas-de-Wit & Sorine, Vehicle System Dynamics
    43, 2005; longitudinal: Canudas-de-Wit, Tsiotras, Velenis, Basset & Gissinger, VSD 39, 2003), with uniform pressure.

    With the sliding velocities v_rx = omega r - v_x and v_ry = -v_y, which are kappa and tan(alpha) times the contact's
    `slip_speed` (|v| if it is None), and the rolling speed |omega r| = |v_x + v_rx|, for each direction i:

        dz_i/dt = v_ri - (c_i + kappa_i omega r) z_i,    c_i = sigma_0i |v_r| / g
        g       = mu_k + (mu_s - mu_k) exp(-(|v_r| / v_s)^gamma)
        F_i     = F_z (sigma_0i z_i + sigma_1i dz_i/dt + sigma_2 v_ri)

    `stiffness_x`, `stiffness_y` (sigma_0, 1/m; the slip stiffness at zero slip is `F_z sigma_0 L / 2`), `static_friction` and
    `kinetic_friction` (mu_s, mu_k), `stribeck_speed` (v_s, m/s), `contact_length` (L, m), `damping_x`, `damping_y` (sigma_1,
    s/m, default 0), `viscous` (sigma_2, s/m, default 0), `exponent` (gamma, default 2). The road's friction multiplies g.
    Friction is isotropic (the paper's M_k and M_s are multiples of the unit matrix). There is no aligning moment, which would
    need a third state.

    `kappa_i`, between 1 / L and 2 / L, makes the steady state exactly that of the distributed bristles: with
    `p = c_i L / (omega r)` it is `(1 - e^-p) / (L (1 - (1 - e^-p) / p))`. In the steady state, without viscous friction, the
    force is within `mu_s F_z`. At standstill the bristles keep their deflection and take up all sliding, up to the friction
    limit. `start` gives the steady state at the contact's slips. If nothing moves, it is zero; for a contact without a
    `slip_speed` it is the limit of slow rolling.

    The poles `-(c_i + kappa_i omega r)` are fast in sliding: RK4 needs steps below `2.78 / (sigma_0 |v_r| / g + 2 omega r / L)`.
    With steps of 1 ms, sigma_0 = 180, g = 0.8 and L = 0.2 m the sliding speed at 60 m/s must be below 9 m/s.

    **Raises** `InputError` for parameters out of range, or a contact without a load or speed.
    """

    stiffness_x: jax.Array = positive("1/m")
    stiffness_y: jax.Array = positive("1/m")
    static_friction: jax.Array = positive("-")
    kinetic_friction: jax.Array = positive("-")
    stribeck_speed: jax.Array = positive("m/s")
    contact_length: jax.Array = positive("m", default=0.2)
    damping_x: jax.Array = parameter("s/m", scale=1.0, default=0.0)
    damping_y: jax.Array = parameter("s/m", scale=1.0, default=0.0)
    viscous: jax.Array = parameter("s/m", scale=1e-3, default=0.0)
    exponent: float = eqx.field(static=True, default=2.0)
    state_names: ClassVar[tuple[str, ...]] = LuGreState._fields

    def __check_init__(self):
        for name in ("damping_x", "damping_y", "viscous"):
            check_at_least(f"LuGre.{name}", getattr(self, name), 0.0)
        check_positive("LuGre.exponent", self.exponent)

    def start(self, contact: Contact) -> LuGreState:
        s_x, s_y = practical(contact)
        fading_x, fading_y = self._fading_rates(contact, s_x, s_y)
        return LuGreState(_settled_deflection(s_x, fading_x), _settled_deflection(s_y, fading_y))

    def derivatives(self, contact: Contact, state: Any) -> LuGreState:
        speed = need_slip_speed(contact, "LuGre")
        s_x, s_y = practical(contact)
        fading_x, fading_y = self._fading_rates(contact, s_x, s_y)
        return LuGreState(speed * (s_x - fading_x * state.z_x), speed * (s_y - fading_y * state.z_y))

    def forces(self, contact: Contact, state: Any = None) -> Forces:
        """F_x and F_y, N."""
        if state is None:
            raise InputError("state = None: LuGre has states of its own; `start(contact)` gives the steady state.")
        load, speed = need_load(contact, "LuGre"), need_slip_speed(contact, "LuGre")
        s_x, s_y = practical(contact)
        rates = self.derivatives(contact, state)
        mu_x = self.stiffness_x * state.z_x + self.damping_x * rates.z_x + self.viscous * speed * s_x
        mu_y = self.stiffness_y * state.z_y + self.damping_y * rates.z_y + self.viscous * speed * s_y
        return Forces(F_x=load * mu_x, F_y=load * mu_y)

    def _fading_rates(self, contact: Contact, s_x, s_y):
        """The decay rate of the deflections over the `slip_speed`, 1/m, in both directions."""
        slides = numerics.hypot(s_x, s_y)
        g = self._friction(need_slip_speed(contact, "LuGre") * slides) * jnp.maximum(contact.friction, LEAST_FRICTION)
        rolls = jnp.abs(_travels(contact) + s_x)

        def fading(stiffness):
            lost = stiffness * slides / g
            p = self.contact_length * lost / jnp.maximum(rolls, LOCKED)
            return lost + rolls / self.contact_length * _inflow(p)

        return fading(self.stiffness_x), fading(self.stiffness_y)

    def _friction(self, speed):
        """The friction at a sliding speed (Stribeck)."""
        slides = speed > 0
        power = jnp.where(slides, (numerics.or_one(speed, slides) / self.stribeck_speed) ** self.exponent, 0.0)
        return self.kinetic_friction + (self.static_friction - self.kinetic_friction) * jnp.exp(-power)


def _travels(contact: Contact):
    """v_x over the speed to which the slips are relative, with its sign. Where that speed is zero nothing moves, and the result
    is the direction of travel."""
    forwards = jnp.sign(contact.direction)
    if contact.slip_speed is None:
        return forwards
    moves = contact.slip_speed > 0
    share = need_speed(contact, "LuGre") / numerics.or_one(contact.slip_speed, moves)
    return forwards * jnp.where(moves, share, 1.0)


def _settled_deflection(slip, fading):
    """The steady deflection; zero where nothing moves."""
    moves = fading > 0
    return slip / numerics.or_one(fading, moves)


def _inflow(p):
    """`L kappa`, from 2 at p = 0 down to 1: undeflected bristles replace the deflected ones that leave the contact."""
    large = p >= 1
    q = numerics.or_one(p, large)
    gone = -jnp.expm1(-q)
    small = numerics.or_one(p, ~large)
    series = 2 * polynomials.evaluate(_ABOVE, small) / polynomials.evaluate(_BELOW, small)
    return jnp.where(large, gone / (1 - gone / q), series)

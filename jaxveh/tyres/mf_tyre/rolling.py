"""Rolling resistance moment (A48 for 6.1, the MF-Tyre manual for 5.2; the book's 4.E70 has another sign and load)."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.tyres.mf_tyre.formula import coefficient
from jaxveh.tyres.mf_tyre.section import AbstractSection


class RollingCoefficients(AbstractSection):
    """The section [ROLLING_COEFFICIENTS].

    Constant part `QSY1`; dependence on F_x `QSY2`, on speed `QSY3`, `QSY4`, on camber `QSY5`, `QSY6`; exponents of load `QSY7`
    and of pressure `QSY8`.
    """

    QSY1: jax.Array = coefficient(scale=0.01)
    QSY2: jax.Array = coefficient(scale=0.01)
    QSY3: jax.Array = coefficient(scale=0.001)
    QSY4: jax.Array = coefficient(scale=1e-4)
    QSY5: jax.Array = coefficient()
    QSY6: jax.Array = coefficient()
    QSY7: jax.Array = coefficient(1.0)
    QSY8: jax.Array = coefficient()

    def moment(self, at, scaling, structure, ranges, version: int, F_x, load, slip_ratio):
        """M_y, N m, negative when rolling forward; `load` and `slip_ratio` are those of the contact, without limits."""
        c = self
        least = ranges.FZMIN
        load = jnp.where(load < least, load**2 / numerics.or_one(least, least > 0), load)
        share, speed = load / structure.FNOMIN, at.speed / structure.LONGVL
        sum_ = c.QSY1 + c.QSY2 * F_x / structure.FNOMIN + c.QSY3 * jnp.abs(speed) + c.QSY4 * speed**4
        if version == 52:
            moment = -structure.UNLOADED_RADIUS * load * scaling.LMY * sum_
        else:
            sum_ = sum_ + (c.QSY5 + c.QSY6 * share) * at.camber**2
            powers = _power(share, c.QSY7) * _power(at.pressure / structure.NOMPRES, c.QSY8)
            moment = -structure.UNLOADED_RADIUS * structure.FNOMIN * scaling.LMY * sum_ * powers
        return moment * self._rolls(at, ranges, slip_ratio)

    @numerics.fence_results
    def _rolls(self, at, ranges, slip_ratio):
        """1 if the wheel rolls forward, -1 backward, with a smooth transition about the locked wheel; zero at standstill.

        The bounds are those of the reference evaluator, made for a VXLOW of 1 m/s. With other values they are not symmetric
        about the locked wheel.
        """
        moves = at.speed > 0
        high = ranges.VXLOW / numerics.or_one(at.speed, moves) - 1
        low = -1 - ranges.VXLOW - high
        between = numerics.sin((math.pi / 2) * (slip_ratio + 1) / jnp.where(high + 1 == 0, 1, high + 1))
        turns = jnp.where(slip_ratio > high, 1.0, jnp.where(slip_ratio < low, -1.0, between))
        return jnp.where(moves, turns, 0.0)


@numerics.fence_results
def _power(base, exponent):
    """`base^exponent`; if the base is zero, the result and its derivatives are zero."""
    some = base > 0
    # On the CPU the power of XLA takes ten times as long as an exponential and a logarithm.
    return jnp.where(some, jnp.exp(exponent * numerics.log(numerics.or_one(base, some))), 0.0)

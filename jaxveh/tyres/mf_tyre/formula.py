"""The sine and cosine curves of MF-Tyre, and the declaration of a coefficient."""

from __future__ import annotations

import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter

EPSILON = 1e-6
"""The small number that the book adds to denominators (4.E6a)."""


def coefficient(default: float = 0.0, scale: float = 1.0, unit: str = "-"):
    """Declare a coefficient of a property file: any real number, with a `default` for files without it.

    `scale` is a typical size, to which relative prior standard deviations refer.
    """
    return parameter(unit, scale=scale, default=default)


def factor():
    """Declare a scaling factor, which is 1 for files without it."""
    return coefficient(1.0)


def bend(x, E):
    """`x - E (x - arctan x)`: the argument of both curves."""
    return x - E * (x - numerics.arctan(x))


def sine_curve(x, B, C, D, E):
    """`D sin(C arctan(B x - E (B x - arctan(B x))))`, for forces."""
    x, B, C, D, E = numerics.fence_blocks((x, B, C, D, E))
    return D * numerics.sin(C * numerics.arctan(bend(B * x, E)))


def cosine_curve(x, B, C, E):
    """`cos(C arctan(B x - E (B x - arctan(B x))))`, for the trail and the weights of combined slip."""
    x, B, C, E = numerics.fence_blocks((x, B, C, E))
    return numerics.cos(C * numerics.arctan(bend(B * x, E)))


def weight(x, shift, B, C, E):
    """A weight of combined slip, 1 at `x = 0`: the cosine curve at `x + shift` over that at `shift`."""
    return cosine_curve(x + shift, B, C, E) / cosine_curve(shift, B, C, E)


def curvature(E, at):
    """E, limited to 1 as the book requires, unless the point is without limits (as in the reference evaluator)."""
    return jnp.minimum(E, 1) if at.bounded else E


def sign(x):
    """1 for x >= 0, otherwise -1."""
    return jnp.where(x >= 0, jnp.ones_like(x), -jnp.ones_like(x))


def not_zero(x):
    """The book's guard of a denominator: `x + epsilon sign(x)`."""
    return x + EPSILON * sign(x)


def unless_zero(x):
    """A denominator that unusual coefficients can make exactly zero; it is `EPSILON` then."""
    return jnp.where(x == 0, EPSILON, x)


def cosine_of_arctan(x):
    """`cos(arctan x)`, without trigonometry."""
    return 1 / jnp.sqrt(1 + x * x)

"""The brush's curve of one slip and its inverse, in closed form (Pacejka, 3rd ed., section 3.2)."""

from __future__ import annotations

import jax.numpy as jnp


def force(slip, stiffness, limit):
    """`limit (1 - (1 - g)^3)` along the slip, g = stiffness |slip| / (3 limit), the `limit` itself beyond g = 1. N."""
    rest = jnp.maximum(1.0 - stiffness * jnp.abs(slip) / (3.0 * limit), 0.0)
    return jnp.sign(slip) * limit * (1.0 - rest**3)


def slip_of(force, stiffness, limit):
    """The slip that makes this force; where the force is beyond 0.98 of the limit, that of 0.98."""
    used = jnp.minimum(jnp.abs(force) / limit, 0.98)
    return jnp.sign(force) * 3.0 * limit / stiffness * (1.0 - jnp.cbrt(1.0 - used))


def trail_share(force, limit):
    """The pneumatic trail over that at no slip, of an axle that makes this force: it falls long before the force saturates."""
    used = jnp.minimum(jnp.abs(force) / limit, 0.99)
    rest = jnp.cbrt(1.0 - used)
    g = 1.0 - rest
    return rest**3 / (1.0 - g + g**2 / 3.0)

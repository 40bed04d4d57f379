"""The brush model's curve for one slip and its inverse, in closed form (Pacejka, 3rd ed., section 3.2)."""

from __future__ import annotations

import jax.numpy as jnp


def force(slip, stiffness, limit):
    """The force (N) in the direction of the slip: `limit (1 - (1 - g)^3)` with g = stiffness |slip| / (3 limit), and `limit`
    beyond g = 1."""
    rest = jnp.maximum(1.0 - stiffness * jnp.abs(slip) / (3.0 * limit), 0.0)
    return jnp.sign(slip) * limit * (1.0 - rest**3)


def slip_of(force, stiffness, limit):
    """The slip at this force; for a force beyond 0.98 of the limit, that at 0.98."""
    used = jnp.minimum(jnp.abs(force) / limit, 0.98)
    return jnp.sign(force) * 3.0 * limit / stiffness * (1.0 - jnp.cbrt(1.0 - used))


def trail_share(force, limit):
    """The pneumatic trail at this force over that at zero slip: it falls long before the force saturates."""
    used = jnp.minimum(jnp.abs(force) / limit, 0.99)
    rest = jnp.cbrt(1.0 - used)
    g = 1.0 - rest
    return rest**3 / (1.0 - g + g**2 / 3.0)

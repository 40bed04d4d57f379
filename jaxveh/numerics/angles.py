"""Angles as points of a circle."""

import jax.numpy as jnp


def wrap_angle(angle):
    """The same angle in [-pi, pi)."""
    return angle - 2 * jnp.pi * jnp.floor(angle / (2 * jnp.pi) + 0.5)

"""Speeds and times of small cars: those of similar cars scale with the root of their size (Froude's law)."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

FULL_SIZE = 2.0
"""The least wheelbase of a full-size car, m. From it on speeds and times are constants."""


def small_size(wheelbase: Any) -> jax.Array:
    """The factor of speeds and times for a car with this wheelbase (m): the root of the wheelbase over `FULL_SIZE`, at most 1."""
    return jnp.sqrt(jnp.minimum(wheelbase / FULL_SIZE, 1.0))

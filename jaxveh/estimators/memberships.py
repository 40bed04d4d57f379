"""Membership functions of fuzzy statements."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp


def large(value: Any, low: Any, high: Any) -> jax.Array:
    """The membership of "large in size": 0 at `low`, 1 at `high`, linear between."""
    return jnp.clip((jnp.abs(value) - low) / (high - low), 0.0, 1.0)

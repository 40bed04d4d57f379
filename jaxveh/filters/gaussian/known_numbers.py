"""A look at a model's numbers before a run, inside jit, too."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import is_concrete
from jaxveh.statespace import StateSpace


def concrete_values():
    """A context in which a model of plain numbers has concrete values inside jit, too. Outside jit it does nothing:
    there it would only compile constants one by one."""
    inside = not is_concrete(jnp.zeros(()))
    return jax.ensure_compile_time_eval() if inside else contextlib.nullcontext()


def look_inside_jit(look: Callable[[StateSpace], Any], model: StateSpace) -> Any:
    """`look(model)` as NumPy arrays; None if it depends on traced values, inside functions of the model too.

    `look` must not depend on the numbers of the noises: those that are traced are zeros in the model that it gets.
    """
    if not is_concrete(model.system, model.prior):
        return None
    hidden = lambda leaf: leaf if is_concrete(leaf) else np.zeros(leaf.shape, leaf.dtype)
    noises = lambda model: (model.process_noise, model.measurement_noise)
    shown = eqx.tree_at(noises, model, jax.tree.map(hidden, noises(model)), is_leaf=lambda one: one is None)
    with concrete_values():
        found = look(shown)
    return jax.tree.map(np.asarray, found) if is_concrete(found) else None

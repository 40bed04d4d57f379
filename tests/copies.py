"""What a copy of an object must be: the same object to jax, which compiles nothing anew for it."""

import copy
import dataclasses
import pickle

import equinox as eqx
import jax


def check_copies(value):
    """A copy, and what a pickle gives back, equal the value in structure and numbers; also of a value that went through jax."""
    for one in (value, jax.tree.map(lambda leaf: leaf, value)):
        for again in (copy.copy(one), copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
            assert jax.tree.structure(again) == jax.tree.structure(one)
            assert hash(jax.tree.structure(again)) == hash(jax.tree.structure(one))
            assert bool(eqx.tree_equal(again, one)) and bool(again == one)


def unset_fields(value):
    """Fields that a module, or one inside it, declares and has not: their placeholder is not equal to its copy."""
    if isinstance(value, eqx.Module):
        names = {field.name for field in dataclasses.fields(value)}
        inside = list(vars(value).values())
        own = {f"{type(value).__name__}.{name}" for name in names ^ set(vars(value))}
    elif isinstance(value, dict | tuple | list):
        own, inside = set(), list(value.values()) if isinstance(value, dict) else list(value)
    else:
        own, inside = set(), []
    return own.union(*(unset_fields(one) for one in inside))

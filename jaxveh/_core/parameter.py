"""Parameters: array leaves of a model with a unit and a domain, and `where`, the only way to pick them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.tree_util as jtu
import numpy as np

from jaxveh._core.bijectors import AbstractBijector, Interval, Positive, Real
from jaxveh._core.errors import InputError, check, check_finite, check_positive, did_you_mean, float_array
from jaxveh._core.names import check_names
from jaxveh._core.parts import check_parts, check_static

Where = Callable[..., object]
"""Picks array leaves, as in `equinox.tree_at`: `lambda car: (car.front.B, car.rear.B)`.

It is always called with the object beside it in the arguments: in `state_space(car, ..., estimate=where)` the car, in
`fit_rig(law, rig, where)` the tyre, in `with_parameters(model, where)` and the fits to recordings the StateSpace, whose car is
`m.system.vehicle`. In results a parameter has its name in the car, whatever object contains the car: `front.B` in all cases.
"""

UNNAMED = {"named": False}
"""Metadata of a field that only contains the object with the parameters, such as a model's system: names omit it."""

_ADVICE = {
    False: "A parameter that is known exactly should not be estimated: leave it out of `where`.",
    True: "It is relative to the value: a parameter at zero needs a `scale`. Leave one that is known exactly out of `where`.",
}


def parameter(unit: str = "-", domain: AbstractBijector | None = None, scale: float | None = None, **kwargs):
    """Declare a field of an `eqx.Module` as a parameter: converted to a strong float array, with unit and domain.

    `scale` is the typical magnitude of a parameter that may be zero or of either sign (curvature, shifts): a
    relative prior spread refers to it. Positive parameters refer to their own value.
    """
    domain = Real() if domain is None else domain
    metadata = {"unit": unit, "domain": domain, "scale": scale}
    return eqx.field(converter=float_array, metadata=metadata, **kwargs)


def table(unit: str = "-", domain: AbstractBijector | None = None, scale: float | None = None, **kwargs):
    """Declare a parameter that may also be given as a list of numbers."""
    metadata = {"unit": unit, "domain": Real() if domain is None else domain, "scale": scale}
    return eqx.field(converter=_table_array, metadata=metadata, **kwargs)


def _table_array(value):
    return float_array(_of_numbers(value) if isinstance(value, list | tuple) else value)


def _of_numbers(values: list | tuple) -> Any:
    """A list of numbers as an array; what is none stays as it is, for a check that knows its name."""
    try:
        return np.asarray(values, float)
    except (TypeError, ValueError, OverflowError):
        return values


def positive(unit: str = "-", **kwargs):
    """Declare a positive parameter (its random walk and its prior are those of its logarithm)."""
    return parameter(unit, Positive(), **kwargs)


def check_parameters(module: eqx.Module) -> None:
    """Raise `InputError` unless every declared parameter of a module is finite, and within its domain if that is `Positive` or an
    `Interval`.

    A field that holds a module or a NamedTuple must have one of the kinds that its annotation names. For use in
    `__check_init__`; an option that is off (None, if that is its default) passes, and so do tracers.
    """
    check_parts(module)
    check_static(module)
    for field in dataclasses.fields(module):
        value, domain = getattr(module, field.name), field.metadata.get("domain")
        if domain is None or (value is None and field.default is None):
            continue
        name = f"{type(module).__name__}.{field.name}"
        if isinstance(domain, Positive):
            check_positive(name, value, field.metadata["unit"])
        else:
            check_finite(name, value)
        if isinstance(domain, Interval):
            low, high = domain.low, domain.high
            check(
                name, value, lambda v, low=low, high=high: (v > low) & (v < high), f"above {low:g} and below {high:g}"
            )


def strong(tree):
    """Return the tree with its declared parameters as their classes make them: strong float arrays, of the dtype of the others.

    `eqx.tree_at` puts in what it is given, without asking the class. A plain number would be a part of the program, and a weakly
    typed array another type: each would compile anew.
    """
    paths, treedef = jtu.tree_flatten_with_path(tree)
    loose = [i for i, (path, leaf) in enumerate(paths) if _is_loose(leaf) and "domain" in _declaration(tree, path)]
    if not loose:
        return tree
    leaves = [leaf for _, leaf in paths]
    others = {leaf.dtype for leaf in leaves if eqx.is_inexact_array(leaf) and not _is_loose(leaf)}
    dtype = max(others, key=lambda other: other.itemsize, default=jax.dtypes.canonicalize_dtype(float))
    for i in loose:
        leaves[i] = jnp.asarray(leaves[i], dtype)
    return jtu.tree_unflatten(treedef, leaves)


def _is_loose(leaf) -> bool:
    """Whether a leaf is a number that would be a part of a program, or that may change its dtype."""
    if isinstance(leaf, jax.Array):
        return leaf.weak_type and not jnp.issubdtype(leaf.dtype, jnp.bool_)
    return eqx.is_array_like(leaf) and not isinstance(leaf, bool)


def _declaration(tree, path) -> Any:
    """Return the metadata of the field that has the leaf."""
    return ({}, *(metadata for _, _, metadata in _owners(tree, path)))[-1]


def _owners(tree, path) -> Iterator[tuple[Any, Any, Any]]:
    """Each key of a leaf's path, with what it is a key of, and the metadata of the field's declaration."""
    owner, metadata = tree, {}
    for key in path:
        by_name = isinstance(key, jtu.GetAttrKey)
        metadata = _metadata(owner, key.name, metadata) if by_name else metadata
        yield key, owner, metadata
        owner = getattr(owner, key.name) if by_name else owner[getattr(key, "key", getattr(key, "idx", None))]


class Parameter(NamedTuple):
    """One chosen parameter: its path in the tree, its name (`front.B`), its state field (`front_B`), unit and domain."""

    path: str
    name: str
    field: str
    unit: str
    domain: AbstractBijector
    scale: float | None


class _Mark:
    """Stands in for a leaf while `where` is resolved, so that identity survives."""

    def __init__(self, index: int):
        self.index = index


def resolve(model, where: Where | None) -> tuple[Parameter, ...]:
    """Return the parameters that `where` picks from `model`, in the order of `where`; names come from the tree's paths.

    Raises `InputError` if `where` picks something that is not an array leaf, or the same leaf twice.
    """
    if where is None:
        return ()
    paths, treedef = jtu.tree_flatten_with_path(model)
    marks = [_Mark(i) for i in range(len(paths))]
    if not callable(where):
        raise InputError(f"where = {where!r}: must be a function, such as lambda car: (car.front.B, car.rear.B).")
    try:
        picked = where(jtu.tree_unflatten(treedef, marks))
    except (AttributeError, LookupError, TypeError) as error:
        there = dir(error.obj) if isinstance(error, AttributeError) else ()
        hint = did_you_mean([getattr(error, "name", None)], [name for name in there if not name.startswith("_")])
        raise InputError(f"where: {error}; it must pick leaves of {type(model).__name__}.{hint}") from None
    indices = []
    for leaf in jtu.tree_leaves(picked, is_leaf=lambda x: isinstance(x, _Mark)):
        if not isinstance(leaf, _Mark):
            raise InputError(f"where picked {leaf!r}: it must pick array leaves of {type(model).__name__}.")
        value = paths[leaf.index][1]
        # Not `is_inexact_array_like`, which fails for tracers.
        if not (eqx.is_inexact_array(value) or isinstance(value, float)):
            name = _path_name(paths[leaf.index][0])
            raise InputError(f"where picked {name} = {value!r}: it must pick array leaves of {type(model).__name__}.")
        indices.append(leaf.index)
    if not indices:
        raise InputError(f"where picked nothing from {type(model).__name__}: it must pick at least one leaf.")
    found = [_describe(model, paths[i][0]) for i in indices]
    if len(set(indices)) < len(indices):
        twice = [p.name for p, i in zip(found, indices, strict=True) if indices.count(i) > 1]
        raise InputError(f"where picked {twice[0]} twice: each leaf can be chosen only once.")
    return tuple(_tell_apart(found))


def every_parameter(model) -> dict[str, Parameter]:
    """Return all floating leaves of a model by name (`front.B`); leaves that would share a name have their full paths."""
    leaves = jtu.tree_flatten_with_path(model)[0]
    numbers = [path for path, leaf in leaves if eqx.is_inexact_array(leaf) or isinstance(leaf, float)]
    return {p.name: p for p in _tell_apart([_describe(model, path) for path in numbers])}


def _tell_apart(found: list[Parameter]) -> list[Parameter]:
    """Return the parameters, with their full paths as names where two would share a name."""
    names = [p.name for p in found]
    return [p if names.count(p.name) == 1 else _with_name(p, p.path) for p in found]


def _with_name(p: Parameter, name: str) -> Parameter:
    return p._replace(name=name, field=name.replace(".", "_"))


def _path_name(path) -> str:
    return ".".join(str(getattr(key, "name", getattr(key, "key", getattr(key, "idx", key)))) for key in path)


def _metadata(owner: Any, name: str, otherwise: Any) -> Any:
    """Return the metadata of the field's declaration; a NamedTuple inside a field has that field's metadata."""
    if not dataclasses.is_dataclass(owner):
        return otherwise
    return {f.name: f.metadata for f in dataclasses.fields(owner)}.get(name, {})


def _only_holds(owner: Any, metadata: Any) -> bool:
    """Whether the field itself is declared `UNNAMED`; fields of a NamedTuple inside it have no declaration of their own."""
    return dataclasses.is_dataclass(owner) and not metadata.get("named", True)


def _describe(model, path) -> Parameter:
    """Walk down to the module that owns the leaf and read its field's metadata."""
    metadata: Any = {}
    in_name = []
    for key, owner, metadata in _owners(model, path):
        if not _only_holds(owner, metadata):
            in_name.append(key)
    name = _path_name(in_name or path)
    return Parameter(
        path=_path_name(path),
        name=name,
        field=name.replace(".", "_"),
        unit=metadata.get("unit", "-"),
        domain=metadata.get("domain", Real()),
        scale=metadata.get("scale"),
    )


def pick(model, parameters: tuple[Parameter, ...]) -> list:
    """Return the leaves of these parameters, in order."""
    return [_get(model, p.path) for p in parameters]


def put(model, parameters: tuple[Parameter, ...], values):
    """Return the model with these leaves replaced by `values` (`None` removes a leaf)."""
    paths = [p.path for p in parameters]
    return eqx.tree_at(
        lambda m: [_get(m, path) for path in paths], model, replace=list(values), is_leaf=lambda leaf: leaf is None
    )


def _get(model, path: str):
    for part in path.split("."):
        model = (
            model[int(part)] if part.isdigit() else (model[part] if isinstance(model, dict) else getattr(model, part))
        )
    return model


def share_of(p: Parameter, relative: Mapping):
    """Return a mapping's entry for a parameter, by its name (`front.B`), otherwise by the last part (`B`); None if absent."""
    return relative.get(p.name, relative.get(p.name.split(".")[-1]))


def check_shares(what: str, parameters: tuple[Parameter, ...], relative) -> None:
    """Raise `InputError` if a mapping of spreads has a name of no parameter: a typing error would go unnoticed."""
    if isinstance(relative, Mapping):
        check_names(
            what, relative, [name for p in parameters for name in dict.fromkeys((p.name, p.name.split(".")[-1]))]
        )


def prior_spread(parameters: tuple[Parameter, ...], values, relative, what: str = "prior") -> list[jax.Array]:
    """Return standard deviations on the real line for a relative spread, one per parameter.

    `relative` is one number, or a mapping from parameter names (`front.B`, or the last part `B`) to numbers; a
    parameter whose domain is the whole line refers to its declared `scale`, otherwise to its absolute value.
    Raises `InputError` for a spread that is not positive, an unbounded parameter at zero without a scale, or a name
    of no parameter. `what` is the name of the spreads in messages.
    """
    check_shares(what, parameters, relative)
    spreads = []
    for p, value in zip(parameters, values, strict=True):
        share = relative
        if isinstance(relative, Mapping):
            share = share_of(p, relative)
            if share is None:
                raise InputError(f"{what}: no spread for {p.name}; there are: {', '.join(relative)}.")
        value = jnp.asarray(value)
        check(f"{what} spread of {p.name}", share, lambda _: True, "a relative standard deviation")
        share = jnp.asarray(share, value.dtype)
        if isinstance(p.domain, Real):
            spread = share * (abs(p.scale) if p.scale is not None else jnp.abs(value))
        elif isinstance(p.domain, Positive):
            spread = share
        else:
            spread = share * jnp.abs(value) / p.domain.slope(value)
        spreads.append(jnp.broadcast_to(spread, value.shape))
        check_positive(
            f"{what} spread of {p.name}", spread, advice=_ADVICE[p.scale is None and isinstance(p.domain, Real)]
        )
    return spreads

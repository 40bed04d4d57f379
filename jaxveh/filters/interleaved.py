"""Several filters that take turns on the same rows, each believing what the others said last."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError
from jaxveh._core.recording import Recording
from jaxveh._core.result import first_failure
from jaxveh.statespace import AbstractFilter, Row, StateSpace


class Turn(NamedTuple):
    """One of several filters that exchange results.

    `filter` and `model`; `listen(told)`: the system of the model, a car for example, of what is told; `tell(belief, row,
    told)`: what is told after its step, `told` with its own part in it. `told` is a pytree of the caller's, its leaves arrays.
    """

    filter: AbstractFilter
    model: StateSpace
    listen: Callable[[Any], Any]
    tell: Callable[[Any, Row, Any], Any]


class Interleaved(NamedTuple):
    """What filters that took turns made of a recording: by the turns' names `mean` and `std`, NamedTuples of each model's report
    with (T,) in each field; `kept`, what was asked for; `told` after each row, leaves (T, ...); `result` and `failed_at`, the
    first failing code (`jaxveh.Result`) of each and its row, 0 and -1 where all went well."""

    mean: dict[str, Any]
    std: dict[str, Any]
    kept: dict[str, Any]
    told: Any
    result: dict[str, jax.Array]
    failed_at: dict[str, jax.Array]


def interleave(
    turns: Mapping[str, Turn],
    recording: Recording | Row,
    told: Any,
    *,
    key: Any = None,
    keep: Callable[[Any], Any] | None = None,
) -> Interleaved:
    """Run filters side by side in one `lax.scan`; in each row all see what was told after the row before.

        turns = {
            "state": Turn(Cubature(), states, lambda told: told["car"], lambda belief, row, told: told | {"v": belief.mean.v_y}),
            "mass": Turn(Unscented(), mass, lambda told: told, lambda belief, row, told: told | {"car": put(belief.mean)}),
        }
        found = interleave(turns, recording, {"car": car, "v": 0.0})
        found.mean["mass"].mass

    Three small filters cost less than one of all states, and each can be written, tuned and switched off by itself (paper 002).
    The price: what the others say is taken for certain, so that spreads come out too small, and what two states say of each
    other is lost. The joint filter (`statespace.with_parameters`) is better wherever it is stable; `Consider` and `Dual` lie
    between.

    **Arguments**: `turns` by name; `recording`: of which each model takes its own inputs and channels, or `Row`s that all take;
    `told`: what is known before the first row; `key`: for particle filters; `keep(belief)`: further values of each row.
    Everything can be jitted, batched and differentiated; steps are checkpointed.

    **Raises** `InputError` where a filter, its model and the recording do not go together, and where what is told after a row has
    not the structure, shapes and dtypes of what was told before it.
    """
    _check_turns(turns)
    rows = {
        name: recording if isinstance(recording, Row) else turn.model.rows(recording) for name, turn in turns.items()
    }
    told = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.result_type(leaf)), told)
    keys = {name: None if key is None else jax.random.fold_in(key, i) for i, name in enumerate(turns)}
    shown, tolds = _scan(turns, told, rows, keys, keep)
    of = lambda place: {name: shown[name][place] for name in turns}
    first_of = lambda place: {name: first_failure(codes)[place] for name, codes in of(3).items()}
    return Interleaved(of(0), of(1), of(2), tolds, first_of(0), first_of(1))


def _scan(turns: Mapping[str, Turn], told: Any, rows: dict[str, Row], keys: dict[str, Any], keep: Callable | None):
    """Means, spreads, what was kept and codes by the turns' names, and what was told, of all rows."""
    at = lambda place: jax.tree.map(lambda leaf: leaf[place], rows)

    def after(stepped: dict, told: Any, row: dict) -> tuple[Any, Any, Any]:
        beliefs = {name: belief for name, (belief, _) in stepped.items()}
        shown = {}
        for name, turn in turns.items():
            told = turn.tell(beliefs[name], row[name], told)
            more = None if keep is None else keep(beliefs[name])
            shown[name] = (*beliefs[name].moments(turn.model), more, stepped[name][1].result)
        return told, beliefs, shown

    def step(carry, row):
        told, beliefs = carry
        stepped = {
            name: turn.filter.step(_with_system(turn, told), beliefs[name], row[name]) for name, turn in turns.items()
        }
        told, beliefs, shown = after(stepped, told, row)
        return (told, beliefs), (shown, told)

    first = at(0)
    begun = {name: turn.filter.init(_with_system(turn, told), first[name], keys[name]) for name, turn in turns.items()}
    later, beliefs, shown = after(begun, told, first)
    _check_alike(told, later)
    _, rest = jax.lax.scan(jax.checkpoint(step), (later, beliefs), at(slice(1, None)))
    join = lambda one, many: jnp.concatenate([jnp.asarray(one)[None], many])
    return jax.tree.map(join, (shown, later), rest)


def _with_system(turn: Turn, told: Any) -> StateSpace:
    return eqx.tree_at(lambda m: m.system, turn.model, turn.listen(told), is_leaf=lambda v: v is None)


def _check_turns(turns: Mapping[str, Turn]) -> None:
    if not turns:
        raise InputError("interleave: turns is empty: must name at least one Turn.")
    for name, turn in turns.items():
        if not isinstance(turn, Turn):
            raise InputError(f"interleave: turns[{name!r}] = {type(turn).__name__}: must be a filters.Turn.")
        turn.filter.check(turn.model)


def _check_alike(before: Any, after: Any) -> None:
    leaves = lambda tree: {
        jax.tree_util.keystr(path): f"{leaf.dtype}{list(leaf.shape)}"
        for path, leaf in jax.tree_util.tree_leaves_with_path(jax.tree.map(jnp.asarray, tree))
    }
    old, new = leaves(before), leaves(after)
    for name in {**old, **new}:
        if old.get(name) != new.get(name):
            raise InputError(
                f"interleave: told{name} was {old.get(name, 'not there')} and is {new.get(name, 'not there')} after a row: must "
                "keep its shape and dtype."
            )

"""Several filters that take turns on the same rows, each with the last results of the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check_kind, word_for
from jaxveh._core.recording import Recording, check_recording
from jaxveh._core.result import first_failure
from jaxveh.statespace import AbstractFilter, Row, StateSpace


class Turn(NamedTuple):
    """One of several filters that exchange results.

    `told`: the values that the filters exchange, a pytree of arrays that the caller defines. `filter` and `model`: the
    filter and its model; `listen(told)` returns the system of the model, such as a car, for these values;
    `tell(belief, row, told)` returns `told` with this filter's own results inserted after its step.
    """

    filter: AbstractFilter
    model: StateSpace
    listen: Callable[[Any], Any]
    tell: Callable[[Any, Row, Any], Any]


class Interleaved(NamedTuple):
    """Estimates of filters that took turns on a recording. By the names of the turns: `mean` and `std`, NamedTuples of
    each model's report with (T,) in each field; `kept`, the values of `keep`; `result` and `failed_at`, the first
    failing code (`jaxveh.Result`) of each filter and its row, 0 and -1 if none failed. `told`: the exchanged values
    after each row, leaves (T, ...)."""

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
    """Run several filters in one `lax.scan`; in each row all of them use the values `told` after the row before.

        turns = {
            "state": Turn(Cubature(), states, lambda told: told["car"], lambda belief, row, told: told | {"v": belief.mean.v_y}),
            "mass": Turn(Unscented(), mass, lambda told: told, lambda belief, row, told: told | {"car": put(belief.mean)}),
        }
        found = interleave(turns, recording, {"car": car, "v": 0.0})
        found.mean["mass"].mass

    Three small filters cost less than one with all states, and each can be written, tuned and switched off by itself
    (as in the paper of federated-ckf). In return, each filter takes the results of the others as exact, so that standard
    deviations are too small, and correlations between states of different filters are lost. The joint filter
    (`statespace.with_parameters`) is better wherever it is stable; `Consider` and `Dual` lie between the two.

    **Arguments**: `turns` by name; `recording`: each model takes its own inputs and channels from it; or `Row`s that
    all models take; `told`: the exchanged values before the first row; `key`: for particle filters; `keep(belief)`:
    further values to keep of each row. Everything can be jitted, batched and differentiated; steps are checkpointed.

    **Raises** `InputError` where a filter, its model and the recording do not agree, and where `told` changes its
    structure, shapes or dtypes in a row.
    """
    _check_turns(turns)
    if not isinstance(recording, Row):
        check_recording("interleave", recording)
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
    """By the turns' names, the means, standard deviations, kept values and codes of all rows; and `told` of all rows."""
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
    check_kind("interleave: turns", turns, Mapping, "Such as {'state': filters.Turn(...)}.")
    if not turns:
        raise InputError("interleave: turns is empty: must name at least one Turn.")
    for name, turn in turns.items():
        if not isinstance(turn, Turn):
            raise InputError(f"interleave: turns[{name!r}] = {word_for(turn)}: must be a filters.Turn.")
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

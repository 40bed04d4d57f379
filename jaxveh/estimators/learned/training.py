"""Training of many parameters of a state space, such as the weights of a network, by the likelihood of a filter."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check_positive, check_whole
from jaxveh._core.parameter import pick, put, resolve
from jaxveh._core.progress import Progress, silent
from jaxveh._core.recording import Recording, check_recording
from jaxveh.estimators.contract import PIECE_LENGTH, WARM_UP, cut_pieces, several_of
from jaxveh.filters import AbstractFilter
from jaxveh.filters import scan as scan_filter
from jaxveh.io import kit as io
from jaxveh.statespace import StateSpace, kit

TOLD = 25
"""Number of steps between two calls of `progress`."""


class Trained(NamedTuple):
    """`model`: the state space with the trained parameters. `history`: the cost per row of each step (negative log-likelihood and
    the prior's share), the mean over its pieces, (steps,)."""

    model: StateSpace
    history: jax.Array


def train(
    filter: AbstractFilter,
    model: StateSpace,
    recordings: Recording | Sequence[Recording],
    where: Callable[[StateSpace], Any],
    *,
    prior: float | Mapping[str, float] = 1.0,
    steps: int = 400,
    learning_rate: float = 0.02,
    batch: int = 16,
    key: jax.Array,
    piece: float = PIECE_LENGTH,
    warm_up: float = WARM_UP,
    progress: Progress = silent,
) -> Trained:
    """Maximise the filter's posterior over the leaves that `where` picks, such as arrays of weights, by Adam (optax) on pieces of
    the recordings.

    `fitting.prediction_error` is the better choice for a dozen parameters; here there may be hundreds, and hours of data. Each
    step uses `batch` pieces, drawn by `key`. Logs are cut into pieces of about `piece` seconds that overlap by `warm_up` seconds,
    in which the filter finds its state and which do not count. Parameters are optimised on their unconstrained scale (a stiffness
    as its logarithm). `prior`: standard deviation on that scale about the start, in units of the parameter's scale, one for all
    or by the last part of a name. It keeps parameters near their start where the data have little information.

    Needs the extra `learn`. **Raises** `InputError` for recordings too short for a piece and arguments out of range.
    """
    optax = io.require("optax", "training through a filter", "learn")
    _check(filter, model, learning_rate=learning_rate, piece=piece, warm_up=warm_up)
    for name, value in (("steps", steps), ("batch", batch)):
        check_whole(name, value, 1)
    filter.check(model)
    pieces, rows_of_warm_up = _pieces(model, recordings, piece, warm_up)
    count = jax.tree.leaves(pieces)[0].shape[0]
    chosen = resolve(model, where)
    start = [p.domain.inverse(value) for p, value in zip(chosen, pick(model, chosen), strict=True)]
    spreads = [_spread(p, prior) for p in chosen]
    rate = optax.cosine_decay_schedule(learning_rate, steps)
    search = optax.chain(optax.clip_by_global_norm(1.0), optax.adam(rate))
    in_log = count * (jax.tree.leaves(pieces)[0].shape[1] - rows_of_warm_up)

    def cost(numbers, drawn):
        values = [p.domain.forward(z) for p, z in zip(chosen, numbers, strict=True)]
        one = put(model, chosen, values)
        row = lambda rows: scan_filter(filter, one, rows, None, ("info.log_likelihood",)).info.log_likelihood
        told = jnp.mean(jax.vmap(row)(drawn)[:, rows_of_warm_up:])
        away = sum(jnp.sum(((z - first) / s) ** 2) for z, first, s in zip(numbers, start, spreads, strict=True))
        return 0.5 * away / in_log - told

    @eqx.filter_jit
    def go_on(state, key):
        def body(state, key):
            numbers, memory = state
            which = jax.random.choice(key, count, (min(batch, count),), replace=False)
            value, slope = jax.value_and_grad(cost)(numbers, jax.tree.map(lambda leaf: leaf[which], pieces))
            change, memory = _change(search, slope, memory)
            return (optax.apply_updates(numbers, change), memory), value

        return jax.lax.scan(body, state, jax.random.split(key, min(TOLD, steps)))

    return _walk(go_on, (start, search.init(start)), model, chosen, steps, key, progress)


def _change(search: Any, slope: Any, memory: Any) -> tuple[Any, Any]:
    """The optimiser's update. Optax counts in integers, which strict dtype promotion would refuse."""
    with jax.numpy_dtype_promotion("standard"):
        return search.update(slope, memory)


def _check(filter: AbstractFilter, model: StateSpace, **values: float) -> None:
    kit.check_told(filter, model)
    for name, value in values.items():
        check_positive(name, value)


def _walk(go_on, state, model, chosen, steps: int, key, progress: Progress) -> Trained:
    """All steps, with calls of `progress`."""
    history = []
    progress(0, steps, "train (compiling first)")
    for k in range(-(-steps // TOLD)):
        state, values = go_on(state, jax.random.fold_in(key, k))
        history.append(values)
        done = min((k + 1) * TOLD, steps)
        progress(done, steps, f"train: step {done}, cost {float(values[-1]):.4g} per row")
    numbers = [p.domain.forward(z) for p, z in zip(chosen, state[0], strict=True)]
    return Trained(put(model, chosen, numbers), jnp.concatenate(history)[:steps])


def _spread(p: Any, prior: float | Mapping[str, float]) -> float:
    """The prior standard deviation of a parameter on its unconstrained scale: a share of its scale if the parameter itself is
    unconstrained, otherwise that of its logarithm."""
    last = p.name.split(".")[-1]
    share = prior.get(last) if isinstance(prior, Mapping) else prior
    if share is None:
        raise InputError(f"train: prior: no standard deviation for {p.name}; add the key {last}.")
    check_positive(f"train: prior of {last}", share)
    return share * (abs(p.scale) if p.scale is not None and type(p.domain).__name__ == "Real" else 1.0)


def _pieces(model: StateSpace, recordings: Recording | Sequence[Recording], piece: float, warm_up: float):
    """Rows of all pieces, (pieces, T) in each leaf, and the number of warm-up rows; pieces are as long as the shortest."""
    logs = several_of(recordings)
    if not logs:
        raise InputError("train: no recording to learn from.")
    for log in logs:
        check_recording("train", log)
    cut = [cut_pieces(log, piece, warm_up) for log in logs]
    rows = min(len(one) for pieces, _ in cut for one in pieces)
    first = max(count for _, count in cut)
    if rows <= 2 * first:
        raise InputError(f"train: pieces of {rows} rows, {first} of them warm-up: the recordings must be longer.")
    made = [model.rows(one.rows(slice(0, rows))) for pieces, _ in cut for one in pieces]
    return jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *made), first

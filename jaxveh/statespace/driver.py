"""The scan over a recording, and its Estimate."""

from __future__ import annotations

import dataclasses
import enum
import functools
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import FilterError, check_flags, check_one_of, is_concrete, warn
from jaxveh._core.estimated import Estimated
from jaxveh._core.fresh_functions import note_function
from jaxveh._core.names import as_names
from jaxveh._core.parameter import strong
from jaxveh._core.recording import Recording
from jaxveh._core.result import Result, first_failure
from jaxveh.statespace.belief import Info
from jaxveh.statespace.capabilities import who_lacks
from jaxveh.statespace.contract import KEPT, AbstractFilter, check_told
from jaxveh.statespace.far_rows import warn_of_far_rows
from jaxveh.statespace.model import Row, StateSpace
from jaxveh.statespace.parameters import parameters_of
from jaxveh.statespace.told_rows import check_rows

FEW = 6
"""States up to which the steps of a batch are written out in scalars."""

SOME = 14
"""States up to which the steps of a batch are taken with its axis last. For 7 to 14 states, with jax 0.12, extended,
cubature, unscented, Gauss-Hermite and square-root filters, their smoothers, and consider, dual, H-infinity and matched ones
are four to nine times as fast, an iterated one 1.6, singular values 1.2; compiling takes 1.2 to 2.2 times as long. Not
measured for more states."""

TOGETHER = 64
"""Runs in one block of these: their matrices fit a processor core's own cache."""

WORTH = 10_000
"""Rows of all runs of a batch together from which it is written out: fewer take some milliseconds either way, and compile
faster otherwise. A small batch that is run thousands of times would still gain."""

SHOWN = ("mean", "std", "info")
"""The per-row parts of an `Estimate` by default."""


class Estimate(Estimated, eqx.Module):
    """The result of a filter on a recording.

    `time` (T,); `mean`, `std`: NamedTuples of the model's report with (T,) in each field, in physical units;
    `log_likelihood`: scalar, of all measurements; `info`: `filters.Info` with (T,) leaves; `result`: the first failing
    code (`jaxveh.Result`) and `failed_at` its row, 0 and -1 if there was no failure; `belief`: after the last row, ready
    for `filter.step`. `parameters` and `parameters_std`: `Parameters` with (T,) each, as in the car
    (`.front.B`); None if the model has none. Parts that were not kept are None, too.

    `save`, `load`, `to_xarray` and `from_xarray` keep all but the `belief`, which `filters.save_belief` keeps; NamedTuples are
    restored with the same names and fields.
    """

    by_row = ("mean", "std", "info", "parameters", "parameters_std")
    by_run = ("log_likelihood", "result", "failed_at")
    records: ClassVar = {"Info": Info}

    time: Any
    mean: Any
    std: Any
    log_likelihood: jax.Array
    info: Any
    result: jax.Array
    failed_at: jax.Array
    belief: Any
    parameters: Any
    parameters_std: Any


def run(
    filter, model: StateSpace, recording: Recording, *, key=None, keep: Sequence[str] = SHOWN, throw: bool = True
) -> Estimate:
    """Run a filter over a recording in one `lax.scan`; compiled once for each filter, model structure and length.

    **Arguments**: `filter` (`Unscented()`, `ParticleFilter(1000)`, `AuxiliaryParticleFilter(1000)`, ...), `model` (a
    `StateSpace`), `recording` of T rows with the model's inputs and measured channels (NaN: missing), `key` for particle filters.
    `keep`: the parts that the estimate keeps for every row: "mean", "std", "info", or fields of it such as "info.nis". A thousand
    runs spend most of their time on writing these: take `keep=()` if the log-likelihood is enough.

    **Returns** an `Estimate`: `mean.sideslip`, `std.sideslip`, ... (T,) in physical units, parameters, the log-likelihood.

    Gradients with respect to any array leaf of `model` work through `jax.grad` and `jax.value_and_grad`; steps are
    checkpointed. Inside jit the checks are skipped, and failures are left in `result`.

    **Raises** `InputError` if model, filter and recording do not match, and `FilterError` with step, time and reason if the
    filter failed. **Warns** (`JaxvehWarning`) if it went on but has remarks on rows (`info.remark`), and if rows are too far
    apart for the steps between them. `throw=False`: no `FilterError` and no warning.
    """
    return run_by(
        lambda model, rows: _compiled_scan(filter, model, rows, key, as_names(keep)), filter, model, recording, throw
    )


def run_by(
    scan: Callable[[StateSpace, Row], Estimate],
    filter: AbstractFilter,
    model: StateSpace,
    recording: Recording,
    throw: bool = True,
) -> Estimate:
    """The estimate that `scan(model, rows)` makes of the recording's rows, with the checks, errors and warnings of `run`."""
    check_flags(throw=throw)
    model = strong(model)
    check_told(filter, model)
    filter.check(model)
    note_function("run: transition", model.transition_function)
    note_function("run: observation", model.observation_function)
    rows = model.rows(recording)
    estimate = dataclasses.replace(scan(model, rows), time=recording.time)
    if throw:
        warn_of_far_rows(model, rows)
        raise_failure(estimate, filter, model, recording)
        warn_of_remarks(estimate, filter)
    return estimate


def scan(filter: AbstractFilter, model: StateSpace, rows: Row, key=None, keep: tuple[str, ...] = SHOWN) -> Estimate:
    """`run` without a recording and warnings, compiled, over rows with (T,) leaves.

    Under `jax.vmap` a Gaussian filter of up to 14 states is another program, if all runs together have `WORTH` rows or more.
    Up to six states, each scalar of the program holds the whole batch of runs: 14 times as fast for the log-likelihoods of
    1000 unscented filters of three states, five to seven times if all rows are kept. For more states the batch is the last
    axis of the matrices: six times as fast with 11 states. Differentiate the sum over the batch; a batch of the gradients of
    each run takes three times as long.

    **Raises** `InputError` for rows of another model, and a model that the filter does not support.
    """
    check_told(filter, model)
    check_rows("scan", model, rows, 1)
    filter.check(model)
    return _compiled_scan(filter, model, rows, key, as_names(keep))


@eqx.filter_jit
def _compiled_scan(filter: AbstractFilter, model: StateSpace, rows: Row, key, keep: tuple[str, ...]) -> Estimate:
    return scan_and_keep(filter, model, rows, key, _nothing, keep)[0]


def _nothing(belief) -> None:
    return None


def scan_and_keep(
    filter: AbstractFilter, model: StateSpace, rows: Row, key, of_belief: Callable, keep: tuple[str, ...] = SHOWN
) -> tuple[Estimate, Any]:
    """The estimate, and `of_belief(belief)` of every row, with (T, ...) leaves."""
    keep = as_names(keep)
    for name in keep:
        check_one_of("keep", name, (*SHOWN, *(f"info.{field}" for field in Info._fields)))
    form = functools.partial(scan_in_form, of_belief=of_belief, keep=keep)
    # A long run of which no row is shown need not equal a live loop to the last bit; written out, a run of three states takes
    # 180 instead of 203 ns per row (unscented, float64, jax 0.12; with older jax, twice as long as on whole arrays).
    shows_nothing = not keep and of_belief is _nothing and len(rows.t) >= WORTH
    alone = Steps.written_out if shows_nothing and numerics.pays_alone() else Steps.whole
    return in_form_for_batches(form, filter, model, rows, key, alone=alone)


class Steps(enum.Enum):
    """How steps are taken: on `whole` arrays, as separate programs; the same, but in a batch with its axis last (`batch_last`);
    `written_out` in scalars; and the same for rows that are known to be `complete`."""

    whole = "whole"
    batch_last = "batch last"
    written_out = "written out"
    complete = "complete"


def in_form_for_batches(
    form: Callable, filter: AbstractFilter, model: StateSpace, rows: Row, *more: Any, alone: Steps = Steps.whole
) -> Any:
    """`form(filter, model, rows, *more, steps=...)`: on whole arrays, but in a batch written out for up to `FEW` states, and
    with the batch's axis last for up to `SOME`. A single run takes steps of the kind `alone` for up to `FEW` states.

    If a written-out filter shares covariances and no row of a block of runs is missing, the covariances are computed once.
    """
    whole = functools.partial(form, steps=Steps.whole)
    if len(model.states) > SOME or who_lacks(filter, "written_out") is not None:
        return whole(filter, model, rows, *more)

    least = -(-WORTH // len(rows.t))
    if len(model.states) > FEW:
        last = functools.partial(form, steps=Steps.batch_last)
        return numerics.by_batch(whole, last, filter, model, rows, *more, least=least, most=TOGETHER)

    def many(filter, model, rows, *more):
        of = lambda steps: lambda: form(filter, model, rows, *more, steps=steps)
        if who_lacks(filter, "shares_covariances") is not None:
            return of(Steps.written_out)()
        return jax.lax.cond(any_run_misses(rows), of(Steps.written_out), of(Steps.complete))

    single = functools.partial(form, steps=alone)
    return numerics.by_batch(single, many, filter, model, rows, *more, least=least)


def any_run_misses(rows: Row) -> Any:
    """Whether any run of the block of runs has a number that is not finite, in the form for many of `numerics.by_batch`."""
    missing = jnp.stack([~jnp.isfinite(values).all() for values in jax.tree.leaves(rows)]).any()
    return jax.lax.pmax(missing.astype(jnp.int32), numerics.RUNS) > 0


def scan_in_form(
    filter: AbstractFilter, model: StateSpace, rows: Row, key, of_belief: Callable, keep: tuple[str, ...], steps: Steps,
    count: Any = None,
) -> tuple[Estimate, Any]:  # fmt: skip
    """The results of `scan_and_keep`, with steps of one kind; `count` as in `estimate_of`. After the last row that is there, the
    belief stays as it is."""
    whole, complete = steps is Steps.whole, steps is Steps.complete
    first, rest = jax.tree.map(lambda leaf: leaf[0], rows), jax.tree.map(lambda leaf: leaf[1:], rows)
    there = None if count is None else jnp.arange(1, len(rows.t)) < count

    def body(belief, given):
        row, here = given
        told = model, belief, row
        after, info = numerics.apart(filter._next, belief.count, *told) if whole else filter._next(*told)
        shown = estimate_of_row(model, after, info, keep)
        if here is not None:
            after = jax.tree.map(lambda new, old: jnp.where(here, new, old), after, belief)
        return after, (shown, of_belief(after))

    if complete:
        belief, info = numerics.write_out(lambda row: filter._first(model, row, key), first, complete=True)
    else:
        belief, info = filter.init(model, first, key)
    start = estimate_of_row(model, belief, info, keep), of_belief(belief)

    belief, rest = scan_by(steps, body, belief, (rest, there))
    shown, kept = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), start, rest)
    return estimate_of(model, rows.t, shown, belief, count), kept


def estimate_of_row(model: StateSpace, belief: Any, info: Info, keep: tuple[str, ...]) -> tuple[Any, Any, Shown]:
    """The log-likelihood and the result of a row, and what an estimate keeps of it."""
    mean, std = belief.moments(model) if {"mean", "std"} & set(keep) else (None, None)
    of_row = Shown(mean if "mean" in keep else None, std if "std" in keep else None, _kept_of(info, keep))
    return info.log_likelihood, info.result, of_row


def estimate_of(
    model: StateSpace, time: Any, shown: tuple[Any, Any, Shown], belief: Any, count: Any = None
) -> Estimate:
    """The estimate from `estimate_of_row` every row, (T,) leaves, and the `belief` after the last. `count`: how many of the rows,
    from the first on, are there, if not all: log-likelihood and result are those of these."""
    log_likelihood, results, (mean, std, info) = shown
    if count is not None:
        there = jnp.arange(len(time)) < count
        log_likelihood, results = (jnp.where(there, of_row, 0) for of_row in (log_likelihood, results))
    result, failed_at = first_failure(results)
    show = lambda report: None if report is None else parameters_of(model, report)
    total = jnp.sum(log_likelihood)
    return Estimate(time, mean, std, total, info, result, failed_at, belief, show(mean), show(std))


def scan_by(steps: Steps, body: Callable, start: Any, rows: Any, *, reverse: bool = False) -> tuple[Any, Any]:
    """`jax.lax.scan(body, start, rows, reverse=reverse)` with checkpointed steps of the kind `steps`."""
    if steps is Steps.whole:
        body = jax.checkpoint(body, prevent_cse=False, policy=jax.checkpoint_policies.save_only_these_names(KEPT))
        return jax.lax.scan(body, start, rows, reverse=reverse)
    if steps is Steps.batch_last:
        return numerics.scan_batch_last(body, start, rows, reverse=reverse)
    return numerics.scan_written_out(body, start, rows, reverse=reverse, complete=steps is Steps.complete)


class Shown(NamedTuple):
    """The kept parts of an estimate for one row; None for a part that is not kept."""

    mean: Any
    std: Any
    info: Any


def _kept_of(info: Info, keep: tuple[str, ...]) -> Info | None:
    """The kept fields of a row's info; remarks are always kept, so that they can be reported."""
    if "info" in keep:
        return info
    fields = {name.removeprefix("info.") for name in keep if name.startswith("info.")} | {"remark"}
    kept = info._replace(**{name: None for name in Info._fields if name not in fields})
    return kept if jax.tree.leaves(kept) else None


def raise_failure(estimate: Estimate, filter, model: StateSpace, recording: Recording) -> None:
    """Raise `FilterError` naming the row, the time, the reason and the values measured there; tracers pass."""
    if not is_concrete(estimate.result):
        return
    codes = np.asarray(estimate.result)
    if not codes.any():
        return
    k = int(np.asarray(estimate.failed_at).reshape(-1)[np.argmax(codes.reshape(-1) != 0)])
    reason = Result(int(codes.reshape(-1)[np.argmax(codes.reshape(-1) != 0)]))
    shown = ", ".join(f"{name} = {np.asarray(recording[name])[k]:.6g}" for name in (*model.inputs, *model.channels))
    raise FilterError(
        f"{type(filter).__name__} failed in row {k} (t = {np.asarray(recording.time)[k]:.6g} s; {shown}): {reason.message}. "
        "throw=False returns the estimate nonetheless."
    )


WORTH_TELLING = {Result.lookahead_misled: 0.05, Result.transport_not_converged: 0.0}
"""The share of rows above which a remark is reported: a look-ahead has some surprises by chance."""


def warn_of_remarks(estimate: Estimate, filter) -> None:
    """Warn of remarks that the filter made in more rows than chance explains; tracers pass."""
    remarks = None if estimate.info is None else estimate.info.remark
    if remarks is None or not is_concrete(remarks):
        return
    remarks = np.asarray(remarks)
    for reason, share in WORTH_TELLING.items():
        rows = int((remarks == reason).sum())
        if rows > share * remarks.size:
            warn(f"{type(filter).__name__}, in {rows} of {remarks.size} rows: {reason.message}.")

"""The scan over a recording, and the Estimate that comes out of it."""

from __future__ import annotations

import warnings
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import FilterError, JaxvehWarning, is_concrete
from jaxveh._core.recording import Recording
from jaxveh._core.result import Result, first_failure
from jaxveh.statespace.belief import Info
from jaxveh.statespace.contract import KEPT, AbstractFilter
from jaxveh.statespace.model import Row, StateSpace
from jaxveh.statespace.parameters import parameters_of


class Estimate(eqx.Module):
    """What a filter made of a recording.

    `time` (T,); `mean`, `std`: NamedTuples of the model's report with (T,) in each field, in physical units;
    `log_likelihood`: scalar, of all measurements; `info`: `filters.Info` with (T,) leaves; `result`: the first failing
    code (`jaxveh.Result`) and `failed_at` its row, 0 and -1 where all went well; `belief`: after the last row, ready
    for `filter.step`. `parameters` and `parameters_std`: `Parameters` with (T,) each, as in the car
    (`.front.B`); None without.
    """

    time: Any
    mean: Any
    std: Any
    log_likelihood: jax.Array
    info: Info
    result: jax.Array
    failed_at: jax.Array
    belief: Any
    parameters: Any
    parameters_std: Any

    def __getitem__(self, name: str):
        """The mean of a reported quantity by name, (T,)."""
        return getattr(self.mean, name)


def run(filter, model: StateSpace, recording: Recording, *, key=None, throw: bool = True) -> Estimate:
    """Run a filter over a recording in one `lax.scan`; compiled once for each filter, model structure and length.

    **Arguments**: `filter` (`Unscented()`, `ParticleFilter(1000)`, `AuxiliaryParticleFilter(1000)`, ...), `model` (a
    `StateSpace`), `recording` with the model's inputs and measured channels (NaN: missing), `key` for particle filters.

    Gradients with respect to any array leaf of `model` work through `jax.grad` and `jax.value_and_grad`; steps are
    checkpointed. Inside jit the checks are skipped, and failures are left in `result`.

    **Raises** `InputError` where model, filter and recording do not go together; `FilterError` with step, time and
    reason where the filter failed, and **warns** (`JaxvehWarning`) where it went on but remarks on rows (`info.remark`),
    unless `throw=False`.
    """
    filter.check(model)
    estimate = scan(filter, model, model.rows(recording), key)
    estimate = eqx.tree_at(lambda e: e.time, estimate, recording.time)
    if throw:
        raise_failure(estimate, filter, model, recording)
        warn_of_remarks(estimate, filter)
    return estimate


@eqx.filter_jit
def scan(filter: AbstractFilter, model: StateSpace, rows: Row, key=None) -> Estimate:
    """The compiled part of `run`, over rows with (T,) leaves."""
    return scan_and_keep(filter, model, rows, key, lambda belief: None)[0]


def scan_and_keep(filter: AbstractFilter, model: StateSpace, rows: Row, key, keep) -> tuple[Estimate, Any]:
    """The estimate, and `keep(belief)` of every row, with (T, ...) leaves."""
    first, rest = jax.tree.map(lambda leaf: leaf[0], rows), jax.tree.map(lambda leaf: leaf[1:], rows)
    belief, info = filter.init(model, first, key)
    start = (*belief.moments(model), info, keep(belief))

    def body(belief, row):
        belief, info = filter.step(model, belief, row)
        return belief, (*belief.moments(model), info, keep(belief))

    body = jax.checkpoint(body, prevent_cse=False, policy=jax.checkpoint_policies.save_only_these_names(KEPT))
    belief, rest = jax.lax.scan(body, belief, rest)
    mean, std, info, kept = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), start, rest)
    result, failed_at = first_failure(info.result)
    show = lambda report: parameters_of(model, report)
    total = jnp.sum(info.log_likelihood)
    return Estimate(rows.t, mean, std, total, info, result, failed_at, belief, show(mean), show(std)), kept


def raise_failure(estimate: Estimate, filter, model: StateSpace, recording: Recording) -> None:
    """Raise `FilterError` naming the row, the time, the reason and what was measured there; tracers pass."""
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
        "throw=False returns what there is."
    )


WORTH_TELLING = {Result.lookahead_misled: 0.05, Result.transport_not_converged: 0.0}
"""The share of rows above which a remark is told: of a look-ahead, some surprises are chance."""


def warn_of_remarks(estimate: Estimate, filter) -> None:
    """Warn of what the filter remarked on in more rows than chance has it; tracers pass."""
    remarks = estimate.info.remark
    if remarks is None or not is_concrete(remarks):
        return
    remarks = np.asarray(remarks)
    for reason, share in WORTH_TELLING.items():
        rows = int((remarks == reason).sum())
        if rows > share * remarks.size:
            warnings.warn(
                f"{type(filter).__name__}, in {rows} of {remarks.size} rows: {reason.message}.",
                JaxvehWarning,
                stacklevel=3,
            )

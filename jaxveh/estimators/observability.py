"""The observability report of a model's parameters along a recording or a manoeuvre."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_flags, check_kind, is_concrete
from jaxveh._core.lengths import common_length, lengthen, lengthen_time
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import Observability, observability_at
from jaxveh.statespace import Row, StateSpace, kit


def predict_measurements(model: StateSpace, rows: Row, start) -> tuple[dict, dict]:
    """The noise-free measurements along rows from a start state (parameters included, on the real line).

    **Returns** two mappings by channel of (T,) arrays: the predictions, and whether the channel was measured.
    """
    kit.check_model("predict_measurements", model)
    check_kind("rows", rows, Row, "model.rows(recording) makes them.")
    check_kind("start", start, type(model.prior.mean), "The usual one is model.prior.mean.")

    def body(state, pair):
        now, then = pair
        observed = model.observation(now.t, state, now.u)
        moved = model.transition(now.t, then.t, state, model.step_inputs(now.t, then.t, now.u, then.u))
        return moved, {name: getattr(observed, name) for name in model.channels}

    first = jax.tree.map(lambda leaf: leaf[:-1], rows)
    rest = jax.tree.map(lambda leaf: leaf[1:], rows)
    state, predicted = jax.lax.scan(jax.checkpoint(body, prevent_cse=False), start, (first, rest))
    last = model.observation(rows.t[-1], state, jax.tree.map(lambda leaf: leaf[-1], rows.u))
    predicted = {name: jnp.append(values, getattr(last, name)) for name, values in predicted.items()}
    return predicted, {name: jnp.isfinite(getattr(rows.y, name)) for name in model.channels}


def observe(model: StateSpace, recording: Recording, known_start: bool = True) -> Observability:
    """How well a recording with these inputs determines the model's parameters, at the prior's mean, without process noise.

    Of the measurements only their presence is used, not their values: a planned drive will do. `known_start=False` adds the start
    states as unknowns with the prior's spread.

    **Returns** `diagnostics.Observability`: Cramer-Rao bounds by name, the direction about which the recording says least, and
    `report()`, the same in words. Use float64. **Raises** `InputError` for a model without parameters.
    """
    check_flags(known_start=known_start)
    kit.check_model("observe", model)
    if model.chosen is None:
        raise InputError("observability: the model estimates no parameter; give `estimate=` or `with_parameters`.")
    rows, n = _of_common_length(model.rows(recording)), len(model.chosen.states)
    mean, spread = jnp.stack(model.prior.mean), jnp.sqrt(jnp.diagonal(model.prior.covariance()))
    order = jnp.concatenate([jnp.arange(n, mean.size), jnp.arange(n)])
    used = order[: mean.size if not known_start else mean.size - n]
    predict = eqx.filter_jit(Predicted(model, rows, mean, used))
    names = tuple(p.name for p in model.chosen.parameters)
    return observability_at(predict, mean[used], names, spread[used], nuisance=0 if known_start else n)


def _of_common_length(rows: Row) -> Row:
    """The rows, filled up with rows of which nothing is measured, so that drives of similar length share a program."""
    if not is_concrete(rows):
        return rows
    count = len(rows.t)
    length = common_length(count)
    unmeasured = jax.tree.map(lambda y: np.append(y, np.full(length - count, np.nan, y.dtype)), rows.y)
    return Row(lengthen_time(rows.t, length), lengthen(rows.u, length), lengthen(unmeasured, length))


class Predicted(eqx.Module):
    """The measurements over their noise, of all channels one after the other, as a function of the start's `used` entries (on the
    real line); the others are those of the `mean`. It is a tree of arrays, so that drives of one length share a program. Rows
    that are not measured have no part in it."""

    model: StateSpace
    rows: Row
    mean: jax.Array
    used: jax.Array

    def __call__(self, z):
        full = self.mean.at[self.used].set(z)
        predicted, present = predict_measurements(self.model, self.rows, type(self.model.prior.mean)(*full))
        white = kit.whiten(self.model.measurement_noise, predicted, present)
        return jnp.concatenate([white[name] for name in self.model.channels])

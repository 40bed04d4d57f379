"""The observability report of a model's parameters along a recording or a manoeuvre."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check_flags, check_kind
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
    rows, n = model.rows(recording), len(model.chosen.states)
    mean, spread = jnp.stack(model.prior.mean), jnp.sqrt(jnp.diagonal(model.prior.covariance()))
    order = jnp.concatenate([jnp.arange(n, mean.size), jnp.arange(n)])
    used = mean.size if not known_start else mean.size - n

    @jax.jit
    def predict(z):
        full = mean.at[order[:used]].set(z)
        predicted, present = predict_measurements(model, rows, type(model.prior.mean)(*full))
        white = kit.whiten(model.measurement_noise, predicted, present)
        return jnp.concatenate([white[name] for name in model.channels])

    names = tuple(p.name for p in model.chosen.parameters)
    at, spread = mean[order[:used]], spread[order[:used]]
    return observability_at(predict, at, names, spread, nuisance=0 if known_start else n)

"""Draws of states and measurements from a model."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import check_key
from jaxveh._core.names import record
from jaxveh._core.parameter import strong
from jaxveh._core.recording import TRUTH, Recording, check_recording
from jaxveh.statespace.dependent_noise import StateDependent
from jaxveh.statespace.model import Row, StateSpace, check_model


class Drawn(NamedTuple):
    """A draw: `states`, the state's NamedTuple with (T,) in each field; `recording` with the model's inputs, the measured
    channels and the true values of the model's report (`recording.truth`)."""

    states: Any
    recording: Recording


def draw(model: StateSpace, schedule: Recording, key) -> Drawn:
    """States and measurements drawn from the prior, the transition and the noises of a model.

    **Arguments**: `schedule`: a recording with the times and the model's inputs. If it has a measured channel, that channel is
    missing (NaN) in the same rows of the draw; its values do not matter otherwise (`Recording(times, {})` for a model without
    inputs). `key`: for all draws.

    Angles are drawn unwrapped. **Raises** `InputError` for a schedule without the model's inputs.
    """
    check_key("draw", key)
    check_model("draw", model)
    model = strong(model)
    states, rows = _drawn(model, schedule_rows(model, schedule), key)
    shown = _report(model, rows, states)
    truth = {f"{TRUTH}{name}": values for name, values in shown._asdict().items()}
    inputs = {name: schedule[name] for name in model.inputs}
    units = {name: schedule.unit(name) for name in (*model.inputs, *model.channels) if name in schedule}
    channels = {**inputs, **rows.y._asdict(), **truth}
    return Drawn(states, Recording(schedule.time, channels, units, source="drawn from a model"))


def schedule_rows(model: StateSpace, schedule: Recording) -> Row:
    """The rows of a schedule, (T,) leaves: measured channels that it does not have count as present in every row."""
    check_model("schedule_rows", model)
    check_recording("schedule", schedule)
    lacking = [name for name in model.channels if name not in schedule]
    return model.rows(schedule.replace(**{name: np.zeros(len(schedule)) for name in lacking}))


def draw_rows(model: StateSpace, rows: Row, key) -> tuple[Any, Row]:
    """A draw at the times and with the inputs of `rows` ((T,) leaves), for use inside jit: states with (T,) leaves, and rows
    whose measurements are missing where those of `rows` are."""
    prior_key, process_key, measurement_key = jax.random.split(key, 3)
    first = model.prior.sample(prior_key)
    before = jax.tree.map(lambda leaf: leaf[:-1], (rows.t, rows.u))
    after = jax.tree.map(lambda leaf: leaf[1:], (rows.t, rows.u))

    def move(x, given):
        ((t0, u0), (t1, u1)), count = given
        x = propagate(model, t0, t1, x, model.step_inputs(t0, t1, u0, u1))
        if model.process_noise is not None:
            noise = model.process_noise.over(t1 - t0).sample(jax.random.fold_in(process_key, count))
            x = x._replace(**{name: getattr(x, name) + value for name, value in noise.items()})
        return x, x

    counts = jnp.arange(rows.t.shape[0] - 1)
    _, rest = jax.lax.scan(move, first, ((before, after), counts))
    states = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, rest)
    seen = jax.vmap(model.observation)(rows.t, states, rows.u)
    error = _errors(model, rows, states, measurement_key)
    made = {}
    for name in model.channels:
        given = getattr(rows.y, name)
        made[name] = jnp.where(jnp.isfinite(given), getattr(seen, name) + error[name], jnp.nan)
    return states, rows._replace(y=record("Measurements", made))


def _errors(model: StateSpace, rows: Row, states: Any, key) -> dict:
    """Draws of the measurement noise in every row, (T,) by channel."""
    noise = model.measurement_noise
    if not isinstance(noise, StateDependent):
        return noise.sample(key, rows.t.shape)
    draw = lambda key, t, x, u: model.measurement_law(t, x, u).sample(key)
    return jax.vmap(draw)(jax.random.split(key, rows.t.shape[0]), rows.t, states, rows.u)


def propagate(model: StateSpace, t0, t1, x, u):
    """The transition of one state, each field in the dtype of the state, so that it can be carried through a scan."""
    to = lambda value, like: jnp.broadcast_to(jnp.asarray(value), jnp.shape(like)).astype(like.dtype)
    return jax.tree.map(to, model.transition(t0, t1, x, u), x)


_drawn = eqx.filter_jit(draw_rows)


@eqx.filter_jit
def _report(model: StateSpace, rows: Row, states: Any):
    shown = jax.vmap(model.report)(rows.t, states, rows.u)
    return jax.tree.map(lambda field: jnp.broadcast_to(field, rows.t.shape), shown)

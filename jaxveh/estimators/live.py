"""Estimates a row at a time, and the cleaning that both a log and a live loop go through."""

from __future__ import annotations

import abc
from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.names import record
from jaxveh._core.recording import Recording
from jaxveh.estimators.parameter_bands import Members
from jaxveh.numerics import apart
from jaxveh.statespace import AbstractFilter, Info, Row, StateSpace, kit


class AbstractCleaning(eqx.Module):
    """What a log goes through before a filter reads it, row by row, looking back only.

    A row is a time (s) and a mapping of `channels` to scalars, NaN where missing. What is returned is the memory for the next
    row, and the channels as the filter gets them.
    """

    @property
    @abc.abstractmethod
    def channels(self) -> tuple[str, ...]:
        """The channels that it reads; none where it hands on those of the model."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Those of them that every row must have; by default the model's inputs."""
        return ()

    @abc.abstractmethod
    def first(self, t: Any, values: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
        """The memory after the first row, and what the filter gets of it."""

    @abc.abstractmethod
    def next(self, memory: Any, t: Any, values: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
        """The same of the next row."""


class AsItIs(AbstractCleaning):
    """Nothing is changed."""

    @property
    def channels(self):
        return ()

    def first(self, t, values):
        return None, values

    def next(self, memory, t, values):
        return None, values


def clean_recording(cleaning: AbstractCleaning, recording: Recording) -> Recording:
    """The recording after its cleaning, with the same rows."""
    values = {name: recording[name] for name in cleaning.channels}
    if not values:
        return recording
    dtype = next(iter(values.values())).dtype
    time = recording.time
    if isinstance(time, np.ndarray) and dtype != np.float64:
        time = time - time[0]
    return recording.replace(**_clean_rows(cleaning, jnp.asarray(time, dtype), values))


@eqx.filter_jit
def _clean_rows(cleaning: AbstractCleaning, time: Any, values: dict[str, Any]) -> dict[str, Any]:
    first, rest = (
        jax.tree.map(lambda leaf: leaf[0], (time, values)),
        jax.tree.map(lambda leaf: leaf[1:], (time, values)),
    )
    memory, start = apart(cleaning.first, first[0], *first)
    body = lambda memory, row: apart(cleaning.next, row[0], memory, *row)
    _, rest = jax.lax.scan(body, memory, rest)
    return jax.tree.map(lambda a, b: jnp.concatenate([jnp.asarray(a)[None], b]), start, rest)


class LiveBelief(NamedTuple):
    """What a live estimator carries from row to row: the filter's belief, the cleaning's memory, and the beliefs of the members
    that the bands know of, if any."""

    belief: Any
    memory: Any
    members: Any = None


class LiveAnswer(NamedTuple):
    """What an estimator says of a row: `mean` and standard deviation `std` by name, as fields of the same NamedTuple that an
    Estimate has, and the filter's `info`."""

    mean: Any
    std: Any
    info: Info


class Live(eqx.Module):
    """An estimator that is given one row at a time, cleaning included, and says what `estimate` says of the same rows
    without smoothing.

        live = estimators.sideslip.live(calibration)
        belief, answer = live.init(t, {"v_x": ..., "a_x": ..., "a_y": ..., "yaw_rate": ...})
        belief, answer = live.step(belief, t, {...})
        answer.mean.sideslip, answer.std.sideslip

    Its bands know of the parameters' uncertainty where `members` stand for it (`parameter_bands`).

    Compiled once each. Inputs must be given; of measurements those that are not given, or NaN, are missing. Channels that the
    model does not read are not looked at. Where float32 rules, count time from the first row.
    """

    filter: AbstractFilter
    model: StateSpace
    cleaning: AbstractCleaning
    key: Any = None
    members: Members | None = None

    def init(self, t, channels: Mapping[str, Any]) -> tuple[LiveBelief, LiveAnswer]:
        """The belief after the first row, and what it says.

        **Raises** `InputError` for an input that is not given, and as the filter does.
        """
        self.filter.check(self.model)
        return live_init(self, self._row(t, channels))

    def step(self, belief: LiveBelief, t, channels: Mapping[str, Any]) -> tuple[LiveBelief, LiveAnswer]:
        """The belief after the next row, and what it says. **Raises** `InputError` for an input that is not given."""
        return live_step(self, belief, self._row(t, channels))

    def _row(self, t, channels: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
        """Time and channels as scalars: those that the cleaning reads, else those of the model; NaN for what is not given."""
        needed = self.cleaning.inputs or self.model.inputs
        missing = [name for name in needed if name not in channels]
        if missing:
            raise InputError(f"row: no value for the input(s) {', '.join(missing)}.")
        names = self.cleaning.channels or (*self.model.inputs, *self.model.channels)
        numbers = [channels.get(name, np.nan) for name in names]
        t, *values = kit.scalar_row(t, numbers, self.model.prior.mean[0].dtype)
        return t, dict(zip(names, values, strict=True))


@eqx.filter_jit
def live_init(live: Live, row: tuple) -> tuple[LiveBelief, LiveAnswer]:
    """What `Live.init` does, of a row's time and channels as scalars."""
    memory, values = apart(live.cleaning.first, row[0], *row)
    cleaned = _cleaned(live.model, row[0], values)
    belief, info = live.filter.init(live.model, cleaned, live.key)
    begin = lambda model: live.filter.init(model, cleaned, live.key)[0]
    others = None if live.members is None else eqx.filter_vmap(begin)(live.members.models)
    return LiveBelief(belief, memory, others), _answer(live, belief, others, info)


@eqx.filter_jit
def live_step(live: Live, before: LiveBelief, row: tuple) -> tuple[LiveBelief, LiveAnswer]:
    """What `Live.step` does, of a row's time and channels as scalars."""
    memory, values = apart(live.cleaning.next, row[0], before.memory, *row)
    cleaned = _cleaned(live.model, row[0], values)
    belief, info = live.filter.step(live.model, before.belief, cleaned)
    go_on = lambda model, belief: live.filter.step(model, belief, cleaned)[0]
    others = None if live.members is None else eqx.filter_vmap(go_on)(live.members.models, before.members)
    return LiveBelief(belief, memory, others), _answer(live, belief, others, info)


def _answer(live: Live, belief, others, info: Info) -> LiveAnswer:
    mean, std = belief.moments(live.model)
    if live.members is not None:
        means, stds = eqx.filter_vmap(lambda model, belief: belief.moments(model))(live.members.models, others)
        std = live.members.about(mean, means, stds)
    return LiveAnswer(mean, std, info)


def _cleaned(model: StateSpace, t, values: dict[str, Any]) -> Row:
    of = lambda kind, names: record(kind, {name: values[name] for name in names})
    return Row(t, of("Inputs", model.inputs), of("Measurements", model.channels))

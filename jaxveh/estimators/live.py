"""Estimates one row at a time, with the same cleaning for logs and live loops."""

from __future__ import annotations

import abc
from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check_key, check_kind, is_concrete
from jaxveh._core.lengths import common_length, lengthen, lengthen_time, shorten
from jaxveh._core.names import as_mapping, record
from jaxveh._core.parameter import check_parameters
from jaxveh._core.parts import check_parts
from jaxveh._core.recording import Recording, time_for
from jaxveh.estimators.parameter_bands import Members
from jaxveh.numerics import apart
from jaxveh.statespace import AbstractFilter, Info, Row, StateSpace, kit


class AbstractCleaning(eqx.Module):
    """Prepares the rows of a log for a filter, row by row, looking back only.

    A row is a time (s) and a mapping of `channels` to scalars, NaN where missing. The methods return the memory for the next
    row, and the channels for the filter. Declared parameters are checked as those of a method are.
    """

    def __check_init__(self):
        check_parameters(self)

    @property
    @abc.abstractmethod
    def channels(self) -> tuple[str, ...]:
        """The channels that it reads; empty if it passes on those of the model."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """The channels that every row must have; by default the model's inputs."""
        return ()

    @abc.abstractmethod
    def first(self, t: Any, values: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
        """The memory after the first row, and the channels for the filter."""

    @abc.abstractmethod
    def next(self, memory: Any, t: Any, values: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
        """The same for the next row."""


class AsItIs(AbstractCleaning):
    """Passes all channels on unchanged."""

    @property
    def channels(self):
        return ()

    def first(self, t, values):
        return None, values

    def next(self, memory, t, values):
        return None, values


def clean_recording(cleaning: AbstractCleaning, recording: Recording) -> Recording:
    """The recording after the `cleaning`, with the same rows."""
    values = {name: recording[name] for name in cleaning.channels}
    if not values:
        return recording
    dtype, rows = next(iter(values.values())).dtype, len(recording)
    time = time_for(recording, dtype)
    if not is_concrete(cleaning, time, values):
        return recording.replace(**_clean_rows(cleaning, jnp.asarray(time, dtype), values))
    length = common_length(rows)
    time = lengthen_time(np.asarray(time, dtype), length)
    return recording.replace(**shorten(_clean_rows(cleaning, time, lengthen(values, length)), rows))


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
    """The state of a live estimator between rows: the filter's belief, the cleaning's memory, and the beliefs of the members
    for the bands, if any."""

    belief: Any
    memory: Any
    members: Any = None


class LiveAnswer(NamedTuple):
    """The estimate of one row: `mean` and standard deviation `std` by name, as fields of the same NamedTuple as in an Estimate,
    and the filter's `info`."""

    mean: Any
    std: Any
    info: Info


class Live(eqx.Module):
    """An estimator for one row at a time, cleaning included. It gives the same results as `estimate` on the same rows without
    smoothing.

        live = estimators.sideslip.live(calibration)
        belief, answer = live.init(t, {"v_x": ..., "a_x": ..., "a_y": ..., "yaw_rate": ...})
        belief, answer = live.step(belief, t, {...})
        answer.mean.sideslip, answer.std.sideslip

    Its bands include the parameters' uncertainty if `members` are given (`parameter_bands`).

    `init` and `step` are compiled once each. Inputs must be given; a measurement that is not given, or NaN, counts as missing.
    Channels that the model does not read are ignored. In float32, count time from the first row.
    """

    filter: AbstractFilter
    model: StateSpace
    cleaning: AbstractCleaning
    key: Any = None
    members: Members | None = None

    def __check_init__(self):
        check_parts(self)
        if self.key is not None:
            check_key("Live", self.key)

    def init(self, t, channels: Mapping[str, Any]) -> tuple[LiveBelief, LiveAnswer]:
        """The belief after the first row, and its answer.

        **Raises** `InputError` for an input that is not given, and as the filter does.
        """
        self.filter.check(self.model)
        return live_init(self, self._row(t, channels))

    def step(self, belief: LiveBelief, t, channels: Mapping[str, Any]) -> tuple[LiveBelief, LiveAnswer]:
        """The belief after the next row, and its answer. **Raises** `InputError` for an input that is not given."""
        check_kind("belief", belief, LiveBelief, "`init` and `step` return it first.")
        return live_step(self, belief, self._row(t, channels))

    def _row(self, t, channels: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
        """Time and channels as scalars: the channels of the cleaning, otherwise of the model; NaN where not given."""
        channels = as_mapping(channels, "channels")
        needed = self.cleaning.inputs or self.model.inputs
        missing = [name for name in needed if name not in channels]
        if missing:
            raise InputError(f"row: no value for the input(s) {', '.join(missing)}.")
        names = self.cleaning.channels or (*self.model.inputs, *self.model.channels)
        numbers = [channels.get(name, np.nan) for name in names]
        t, *values = kit.scalar_row(t, numbers, self.model.dtype, tuple(names))
        return t, dict(zip(names, values, strict=True))


@eqx.filter_jit
def live_init(live: Live, row: tuple) -> tuple[LiveBelief, LiveAnswer]:
    """The compiled part of `Live.init`, for a row's time and channels as scalars."""
    memory, values = apart(live.cleaning.first, row[0], *row)
    cleaned = row_of(live.model, row[0], values)
    belief, info = live.filter.init(live.model, cleaned, live.key)
    begin = lambda model: live.filter.init(model, cleaned, live.key)[0]
    others = None if live.members is None else eqx.filter_vmap(begin)(live.members.models)
    return LiveBelief(belief, memory, others), _answer(live, belief, others, info)


@eqx.filter_jit
def live_step(live: Live, before: LiveBelief, row: tuple) -> tuple[LiveBelief, LiveAnswer]:
    """The compiled part of `Live.step`, for a row's time and channels as scalars."""
    memory, values = apart(live.cleaning.next, row[0], before.memory, *row)
    cleaned = row_of(live.model, row[0], values)
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


def row_of(model: StateSpace, t, values: dict[str, Any]) -> Row:
    """The model's row of a time (s) and values by channel."""
    of = lambda kind, names: record(kind, {name: values[name] for name in names})
    return Row(t, of("Inputs", model.inputs), of("Measurements", model.channels))

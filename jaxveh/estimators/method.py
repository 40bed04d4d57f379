"""A method for a quantity: what it reads, its memory from row to row, and its answer to each row, looking back only.

A quantity has many methods: a formula of the present measurements, an observer with a memory, a filter on a model. All of them
are an `AbstractMethod`, so that one driver follows a log, another answers live, and both give the same results.

A quantity is a module of `jaxveh.estimators`. It has, in addition to what its calibration needs (if it has one):

- `SHOWN`: the names that all its methods report, and their units.
- `METHODS`: `MethodOfCar` by name. `RECOMMENDED`: the name of the recommended one.
- `do_nothing(car, recording)`: the answer without any method, (T,) by the names of `SHOWN`.
- `estimate(source, recording, *, method=...)` and `live(source, *, method=...)`; `source` is a car's file, or a method with
  numbers of one's own. If one of its methods is an `AbstractSmoothable`, `estimate` has `smoothed=False`, too. They are made by
  `quantity.estimate_of` or `smoothable_estimate_of`, and `live_of`.
"""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.contracts import Checked, contract
from jaxveh._core.errors import InputError
from jaxveh._core.estimated import Estimated
from jaxveh._core.names import as_mapping, record
from jaxveh._core.own_results import instance_of, several
from jaxveh._core.parameter import check_parameters
from jaxveh._core.parts import check_parts
from jaxveh._core.result import Result, code
from jaxveh.estimators.contract import Need
from jaxveh.estimators.live import AbstractCleaning, AsItIs, row_of
from jaxveh.numerics import apart
from jaxveh.statespace import AbstractFilter, StateSpace, kit


class Answer(NamedTuple):
    """A method's answer to a row: `mean` and standard deviation `std` by name, NamedTuples with the same fields; `std` is NaN
    where the method gives none. `known`: the same fields, False where the drive does not determine the quantity now, so that
    the mean is a memory or a guess. `result`: a code of `jaxveh.Result`, 0 for success."""

    mean: Any
    std: Any
    known: Any
    result: Any


_MEMORY_AND_ANSWER = several(object, Answer, order="two, (memory, answer), the answer an Answer")


def _needs(who: str, method: Any, given: tuple, result: Any) -> None:
    """Raise `InputError` unless the needs of a method are a tuple of `Need`."""
    del method, given
    if not isinstance(result, tuple | list) or not all(isinstance(one, Need) for one in result):
        raise InputError(f"{who} = {result!r}: must be a tuple of Need, such as (Need('a_x', 'm/s^2'),).")


class AbstractMethod(Checked, eqx.Module):
    """A method. A row is a time (s) and a mapping of the channels of `needs` to scalars, NaN where not measured.

    Numbers that may be fitted are array leaves; those that a class declares as parameters are checked when it is made.
    Everything is a pure function of scalars: a batch is `jax.vmap`. **Raises** `InputError` for a parameter that is not finite,
    or not positive where it must be.
    """

    knows_places: ClassVar[bool] = False
    """Whether the method itself uses the places of the car's inertial unit and satellite antenna; otherwise it hears the
    measurements of the centre of gravity (`at_centre.AtCentre`). A method around another passes on that of the inner one."""

    _contract = contract(needs=_needs, first=_MEMORY_AND_ANSWER, next=_MEMORY_AND_ANSWER)

    def __check_init__(self):
        check_parameters(self)

    @property
    @abc.abstractmethod
    def needs(self) -> tuple[Need, ...]:
        """The channels that it reads. An `optional` channel that is missing from the log is NaN in every row."""

    @abc.abstractmethod
    def first(self, t: Any, values: dict[str, Any]) -> tuple[Any, Answer]:
        """The memory after the first row, and the answer to it."""

    @abc.abstractmethod
    def next(self, memory: Any, t: Any, values: dict[str, Any]) -> tuple[Any, Answer]:
        """The same for the next row."""


class AbstractSmoothable(AbstractMethod):
    """A method whose memory, a NamedTuple, has a `belief` about its states, a `sequential.Belief` with mean (n,) and covariance
    (n, n): along a log it can also look back from later rows (`follow` with `smoothed=True`).

    A row's belief is that of `ahead`, corrected by what the row measures; its answer is `say(memory)`.
    """

    _contract = contract(say=instance_of(Answer, "an Answer"))

    @abc.abstractmethod
    def ahead(self, memory: Any, t: Any, values: dict[str, Any]) -> Any:
        """The belief before the measurements of the next row, given the memory after the last: its covariance is
        `F P F^T + Q`, with the slope F of its mean."""

    @abc.abstractmethod
    def say(self, memory: Any) -> Answer:
        """The answer to the row of this memory, by the belief in it."""


class Answers(Estimated, eqx.Module):
    """A method's answers along a log: `time` (T,), and the fields of `Answer`, each (T,)."""

    by_row = ("mean", "std", "known", "result")

    time: Any
    mean: Any
    std: Any
    known: Any
    result: Any


def answer(mean: Mapping[str, Any], std: Mapping[str, Any] | None = None, known: Any = True) -> Answer:
    """An `Answer` of scalars by name. `std`: standard deviations by name, NaN where not given; `known`: one boolean, or
    booleans by name, True where not given. A mean that is not finite is unknown, and gives the code of a non-finite state.
    """
    some = jnp.asarray(next(iter(mean.values())))
    of = lambda values, default: {name: values.get(name, default) for name in mean}
    means = {name: jnp.asarray(value, some.dtype) for name, value in mean.items()}
    stds = {name: jnp.asarray(value, some.dtype) for name, value in of(std or {}, jnp.nan).items()}
    told = of(known, True) if isinstance(known, Mapping) else dict.fromkeys(mean, known)
    finite = {name: jnp.isfinite(value) for name, value in means.items()}
    told = {name: jnp.asarray(told[name], bool) & finite[name] for name in mean}
    lost = ~jnp.all(jnp.stack(list(finite.values())))
    result = jnp.where(lost, code(Result.non_finite_state), jnp.int32(0))
    return Answer(record("Answer", means), record("Answer", stds), record("Answer", told), result)


class Filtered(AbstractMethod):
    """A filter on a state space as a method. `cleaning` prepares the log for the filter.

    `told_by(model, belief, row)`: booleans by name for outputs that are not always known; by default all are known unless the
    filter failed. `shown`: the names of the outputs to show, by default all.
    """

    model: StateSpace
    filter: AbstractFilter
    reads: tuple[Need, ...] = eqx.field(static=True)
    cleaning: AbstractCleaning = AsItIs()
    told_by: Callable[..., Mapping[str, Any]] | None = eqx.field(static=True, default=None)
    shown: tuple[str, ...] | None = eqx.field(static=True, default=None)
    key: Any = None

    @property
    def needs(self):
        return self.reads

    def first(self, t, values):
        memory, cleaned = self.cleaning.first(t, values)
        row = row_of(self.model, t, cleaned)
        belief, info = self.filter.init(self.model, row, self.key)
        return (belief, memory), self._answer(belief, row, info)

    def next(self, memory, t, values):
        belief, memory = memory
        memory, cleaned = self.cleaning.next(memory, t, values)
        row = row_of(self.model, t, cleaned)
        belief, info = self.filter.step(self.model, belief, row)
        return (belief, memory), self._answer(belief, row, info)

    def _answer(self, belief, row, info) -> Answer:
        mean, std = belief.moments(self.model)
        names = self.shown or mean._fields
        told = {} if self.told_by is None else self.told_by(self.model, belief, row)
        well = info.result == 0
        known = {name: well & told.get(name, True) for name in names}
        said = answer(
            {name: getattr(mean, name) for name in names}, {name: getattr(std, name) for name in names}, known
        )
        return said._replace(result=jnp.where(well, said.result, info.result))


def dtype_of(method: AbstractMethod) -> Any:
    """The dtype of the method's numbers; if it has none, the default dtype."""
    leaves = jax.tree.leaves(eqx.filter(method, eqx.is_inexact_array))
    return jnp.result_type(*leaves) if leaves else jax.dtypes.canonicalize_dtype(float)


class LiveMethod(eqx.Module):
    """A method for one row at a time. It gives the same answers as `follow` on the same rows.

        live = estimators.speed.live(car)
        memory, answer = live.init(t, {"a_x": ..., "wheel_speed_fl": ..., ...})
        memory, answer = live.step(memory, t, {...})
        answer.mean.v_x, answer.std.v_x, answer.known.v_x

    `init` and `step` are compiled once each. A channel that is not given, or NaN, counts as not measured. In float32, count
    time from the first row.
    """

    method: AbstractMethod

    def __check_init__(self):
        check_parts(self)

    def init(self, t, channels: Mapping[str, Any]) -> tuple[Any, Answer]:
        """The memory after the first row, and the answer to it. **Raises** `InputError` for a needed channel not given."""
        return _first(self.method, *self._row(t, channels))

    def step(self, memory: Any, t, channels: Mapping[str, Any]) -> tuple[Any, Answer]:
        """The memory after the next row, and the answer to it."""
        return _next(self.method, memory, *self._row(t, channels))

    def _row(self, t, channels: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
        needs, channels = self.method.needs, as_mapping(channels, "channels")
        missing = [need.channel for need in needs if need.throughout and need.channel not in channels]
        if missing:
            raise InputError(f"row: no value for {', '.join(missing)}.")
        numbers = [channels.get(need.channel, np.nan) for need in needs]
        names = tuple(need.channel for need in needs)
        t, *values = kit.scalar_row(t, numbers, dtype_of(self.method), names)
        return t, dict(zip(names, values, strict=True))


@eqx.filter_jit
def _first(method, t, values):
    return apart(method.first, t, t, values)


@eqx.filter_jit
def _next(method, memory, t, values):
    return apart(method.next, t, memory, t, values)

"""Runs methods side by side, each reading the outputs of the others like channels of the log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check_kind, word_for
from jaxveh._core.names import as_pairs, record
from jaxveh.estimators.contract import Need
from jaxveh.estimators.method import AbstractMethod, Answer


class Exchange(AbstractMethod):
    """Methods by name, each of which may read an output of another.

        whole = Exchange(
            {"speed": speed.METHODS["slip_aware"].make(car), "sideslip": sideslip.METHODS["adapted_stiffness"].make(car)},
            gives={"v_x": "speed.v_x"},
        )
        found = kit.follow("whole", whole, log)             # the log needs no v_x
        found["sideslip_sideslip"], found.std.speed_v_x

    The review proposes to divide the task in this way (Chen, Gao, Xu 2013, conclusion 2), and the paper of federated-ckf does so.

    `gives`: the source of each such channel, as method and output name. A method reads the output of this row if its source comes
    earlier in `methods`, and that of the row before if it comes later; two methods may read each other. The channel counts as not
    measured (NaN) in the first row, where there is no earlier output, and wherever the output is not finite. Standard deviations
    are not passed on: the channel counts as a measurement with the noise that the reading method expects.

    An answer contains all outputs, named `<method>_<name>`; its result is the first code that is not 0.

    **Raises** `InputError` for an unknown source or an unknown output.
    """

    # Not a mapping: its order would be lost when it is passed to a compiled function.
    names: tuple[str, ...] = eqx.field(static=True)
    methods: tuple[AbstractMethod, ...]
    gives: tuple[tuple[str, str, str], ...] = eqx.field(static=True)

    def __init__(self, methods: Mapping[str, AbstractMethod], gives: Mapping[str, str]):
        named = as_pairs(methods, "Exchange: methods")
        self.names, self.methods = tuple(name for name, _ in named), tuple(method for _, method in named)
        self.gives = tuple(_source(channel, said) for channel, said in as_pairs(gives, "Exchange: gives"))

    def __check_init__(self):
        if not self.methods:
            raise InputError("Exchange: methods is empty: must name at least one.")
        for name, method in zip(self.names, self.methods, strict=True):
            if not isinstance(method, AbstractMethod):
                raise InputError(f"Exchange: methods[{name!r}] = {word_for(method)}: must be an estimators method.")
        read = {need.channel for method in self.methods for need in method.needs}
        for channel, giver, name in self.gives:
            if giver not in self.names:
                raise InputError(
                    f"Exchange: gives[{channel!r}] = {giver}.{name}: must begin with one of {', '.join(self.names)}."
                )
            if channel not in read:
                raise InputError(
                    f"Exchange: gives[{channel!r}]: no method reads it; they read {', '.join(sorted(read))}."
                )

    @property
    def needs(self):
        found: dict[str, Need] = {}
        given = {channel for channel, _, _ in self.gives}
        for method in self.methods:
            for need in method.needs:
                if need.channel in given:
                    continue
                last = found.setdefault(need.channel, need)
                found[need.channel] = last._replace(
                    optional=last.optional and need.optional, throughout=last.throughout or need.throughout
                )
        return tuple(found.values())

    def first(self, t, values):
        step = lambda name, method, own: method.first(t, own)
        return self._each(step, {}, t, values)

    def next(self, memory, t, values):
        memories, said = memory
        step = lambda name, method, own: method.next(memories[name], t, own)
        return self._each(step, said, t, values)

    def _each(self, step, said: dict[str, Any], t, values):
        memories, answers = {}, {}
        said = dict(said)
        for name, method in zip(self.names, self.methods, strict=True):
            read = {need.channel for need in method.needs}
            own = {channel: value for channel, value in values.items() if channel in read}
            own |= {
                channel: said.get(channel, jnp.full_like(t, jnp.nan)) for channel, _, _ in self.gives if channel in read
            }
            memories[name], answers[name] = step(name, method, own)
            said |= {
                channel: _value_of(answers[name], name, told, t) for channel, giver, told in self.gives if giver == name
            }
        return (memories, said), _together(answers)


def _source(channel: str, said: str) -> tuple[str, str, str]:
    """A channel, and the method and output that give it."""
    check_kind(f"Exchange: gives[{channel!r}]", said, str, "Write method.output, such as speed.v_x.")
    giver, _, name = said.partition(".")
    return channel, giver, name


def _value_of(answer: Answer, giver: str, name: str, like: Any) -> Any:
    if name not in answer.mean._fields:
        raise InputError(f"Exchange: {giver}.{name}: the method reports {', '.join(answer.mean._fields)}.")
    value = getattr(answer.mean, name).astype(like.dtype)
    return jnp.where(jnp.isfinite(value), value, jnp.nan)


def _together(answers: dict[str, Answer]) -> Answer:
    of = lambda part: record("Answer", {
        f"{method}_{name}": value
        for method, answer in answers.items() for name, value in getattr(answer, part)._asdict().items()
    })  # fmt: skip
    result = jnp.int32(0)
    for answer in answers.values():
        result = jnp.where(result == 0, answer.result, result)
    return Answer(of("mean"), of("std"), of("known"), result)

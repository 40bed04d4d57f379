"""A method whose rows are prepared first, looking back only: for a car whose channels say something else than those that the
method's equations contain."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

from jaxveh.estimators.contract import Need, join_needs
from jaxveh.estimators.live import AbstractCleaning
from jaxveh.estimators.method import AbstractMethod, AbstractSmoothable, Answer
from jaxveh.estimators.sequential import Belief


class AbstractPreparation(AbstractCleaning):
    """A cleaning between a log and a method, which may read more channels than the method does."""

    @property
    @abc.abstractmethod
    def more(self) -> tuple[Need, ...]:
        """The channels that it reads."""

    @property
    def makes(self) -> tuple[str, ...]:
        """The channels that it makes beside those that it reads."""
        return ()

    @property
    def channels(self):
        return tuple(need.channel for need in self.more)


class Chained(AbstractCleaning):
    """One cleaning after another: `after` reads what `before` has prepared."""

    before: AbstractPreparation
    after: AbstractCleaning

    @property
    def channels(self):
        made = set(self.before.makes)
        return tuple(dict.fromkeys([n for n in self.after.channels if n not in made] + [*self.before.channels]))

    @property
    def inputs(self):
        return self.after.inputs

    def first(self, t, values):
        return self._chained(self.before.first(t, values), self.after.first, t)

    def next(self, memory, t, values):
        after = lambda t, heard: self.after.next(memory[1], t, heard)
        return self._chained(self.before.next(memory[0], t, values), after, t)

    def _chained(self, prepared: tuple, after: Any, t: Any) -> tuple:
        before, heard = prepared
        memory, cleaned = after(t, heard)
        return (before, memory), cleaned


class PreparedMemory(NamedTuple):
    """The memory of the `inner` method and of the preparation, `prepared`; the inner method's belief if it can be smoothed."""

    inner: Any
    prepared: Any
    belief: Belief | None


class Prepared(AbstractMethod):
    """The method `inner` on rows after a `preparation`."""

    inner: AbstractMethod
    preparation: AbstractPreparation

    @property
    def needs(self):
        return join_needs(self.inner.needs, self.preparation.more)

    @property
    def knows_places(self):
        return self.inner.knows_places

    def first(self, t, values):
        prepared, heard = self.preparation.first(t, values)
        inner, said = self.inner.first(t, heard)
        return self._memory(inner, prepared), said

    def next(self, memory, t, values):
        prepared, heard = self.preparation.next(memory.prepared, t, values)
        inner, said = self.inner.next(memory.inner, t, heard)
        return self._memory(inner, prepared), said

    def _memory(self, inner: Any, prepared: Any) -> PreparedMemory:
        return PreparedMemory(inner, prepared, None)


class SmoothablePrepared(Prepared, AbstractSmoothable):
    """`Prepared` of a method that can be smoothed."""

    inner: AbstractSmoothable

    def _memory(self, inner, prepared):
        return PreparedMemory(inner, prepared, inner.belief)

    def ahead(self, memory, t, values) -> Belief:
        _, heard = self.preparation.next(memory.prepared, t, values)
        return self.inner.ahead(memory.inner._replace(belief=memory.belief), t, heard)

    def say(self, memory) -> Answer:
        return self.inner.say(memory.inner._replace(belief=memory.belief))


def prepare(method: AbstractMethod, preparation: AbstractPreparation) -> Prepared:
    """The method on prepared rows, which can be smoothed if the method can."""
    kind = SmoothablePrepared if isinstance(method, AbstractSmoothable) else Prepared
    return kind(method, preparation)

"""States that are considered but not estimated, and blocks of states that are estimated separately."""

from __future__ import annotations

from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.names import as_groups, as_names, as_several, check_names
from jaxveh.filters.gaussian.belief import GaussianBelief
from jaxveh.filters.gaussian.filter import AbstractRuleFilter, check_kind, with_spread
from jaxveh.filters.gaussian.wrapper import AbstractStateless
from jaxveh.statespace import Smoothing, StateSpace


class Consider(AbstractStateless):
    """`inner`, whose updates leave the states `names` unchanged (S. F. Schmidt 1966: the consider filter).

    Their mean and covariance stay those of the prediction. Their cross-covariances with the other states are kept, so
    that the standard deviations of the others include the uncertainty of the considered states:

        K of the considered rows = 0,    P_cc+ = P_cc-

    It is for parameters that the data do not determine, such as the mass on a level road.
    """

    rows_between: ClassVar[bool] = True
    inner: AbstractRuleFilter
    names: tuple[str, ...] = eqx.field(static=True, converter=as_names)

    def __check_init__(self):
        check_kind("Consider", self.inner, AbstractRuleFilter)

    def check(self, model):
        check_names("Consider.names", as_several(self.names, "Consider.names"), model.states)
        self.inner.check(model)

    def update(self, model, belief, row):
        after, info = self.inner.update(model, belief, row)
        kept = _among(model, self.names)
        vector = jnp.where(kept, belief.vector, after.vector)
        both = kept[:, None] & kept[None, :]
        return _with_covariance(self.inner, after, vector, jnp.where(both, belief.covariance, after.covariance)), info


class Dual(AbstractStateless):
    """`inner` of a joint model, with states and parameters estimated separately: dual estimation (E. Wan & A. Nelson 2001).

    After every row the covariances between the blocks of `groups` (tuples of states; a block of the remaining states is added)
    are set to zero, so that a measurement corrects each block only through the covariances of this step's prediction. By default
    the blocks are the model's own states and its chosen parameters. Correlations that build up between blocks over several rows
    are lost, and standard deviations are too small: the joint filter, without this wrapper, is better wherever it is stable.
    """

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    inner: AbstractRuleFilter
    groups: tuple[tuple[str, ...], ...] | None = eqx.field(static=True, default=None, converter=as_groups)

    def __check_init__(self):
        check_kind("Dual", self.inner, AbstractRuleFilter)

    def check(self, model):
        for group in self._blocks(model):
            check_names("Dual.groups", group, model.states)
        names = [name for group in self._blocks(model) for name in group]
        if len(set(names)) < len(names):
            raise InputError("Dual.groups: a state is in more than one group.")
        self.inner.check(model)

    def update(self, model, belief, row):
        after, info = self.inner.update(model, belief, row)
        blocks = self._blocks(model)
        place = np.array([next(i for i, group in enumerate(blocks) if name in group) for name in model.states])
        together = place[:, None] == place[None, :]
        return _with_covariance(self.inner, after, after.vector, jnp.where(together, after.covariance, 0)), info

    def _blocks(self, model: StateSpace) -> tuple[tuple[str, ...], ...]:
        given = self.groups
        if given is None:
            if model.chosen is None:
                raise InputError("Dual: the model has no chosen parameters; name the blocks of states in `groups`.")
            given = (model.chosen.states,)
        rest = tuple(name for name in model.states if not any(name in group for group in given))
        return (*given, rest) if rest else given


def _among(model: StateSpace, names: tuple[str, ...]) -> Any:
    return jnp.asarray([name in names for name in model.states])


def _with_covariance(
    filter: AbstractRuleFilter, belief: GaussianBelief, vector: Any, covariance: Any
) -> GaussianBelief:
    return with_spread(belief, vector, filter.form.start(covariance))

"""Extra process noise that shrinks as the state settles, or that follows the corrections."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check, check_positive
from jaxveh._core.names import as_pairs, check_names
from jaxveh.filters.gaussian.filter import AbstractGaussianFilter
from jaxveh.filters.gaussian.noises import covariance_in
from jaxveh.filters.wrappers.base import AbstractRemembering, Remembering
from jaxveh.statespace import AbstractNoise, AbstractProcessNoise, Gaussian, MultivariateGaussian, Smoothing, StateSpace


class ShrinkingProcess(AbstractRemembering):
    """`inner` with an extra process noise per step on some states, which shrinks, as in an adaptive unscented filter of
    mass and road grade (the experiment `mass-grade-aukf`).

    The variance of a state is q_c + q_v: the model's own, and q_v, at first the square of `extra` (standard deviations
    per step, by state). With d the change of the state's mean in the last row (eq 24)

        q_v <- lambda q_v,    lambda = |q_v - (d^2 + q_v) / 2| / (q_v + d^2)

    Errata: the paper's rate of the mass is read as d^2, so that units agree; its eq 25, which scales the covariance in every step
    and freezes the mass, is left out. Then lambda is at most 1/2: **the extra noise at least halves with each row,
    whatever the data**, so that the method is equivalent to a large prior (measured: final mass 2.46 against 2.35 %).
    For noise that follows the data, use `MatchedProcess`.
    """

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    noise_by_row: ClassVar[bool] = True
    inner: AbstractGaussianFilter
    extra: tuple[tuple[str, float], ...] = eqx.field(static=True)

    def __init__(self, inner: AbstractGaussianFilter, extra: Mapping[str, float]):
        self.inner, self.extra = inner, tuple(sorted(as_pairs(extra, "ShrinkingProcess.extra")))

    def __check_init__(self):
        _check_levels("ShrinkingProcess.extra", self.extra)

    def check(self, model):
        _check_states("ShrinkingProcess.extra", self.extra, model)
        self.inner.check(model)

    def start(self, model):
        return jnp.asarray([std**2 for _, std in self.extra], model.dtype)

    def believed_model(self, model, memory):
        return with_extra(model, {name: memory[i] for i, (name, _) in enumerate(self.extra)})

    def update(self, model, belief, row):
        after, info = self.update_inside(model, belief, row)
        d, q = _squared_changes(belief.inside, after.inside, self.extra), belief.memory
        # The extra noise may have shrunk to zero.
        total = numerics.or_one(q + d, q + d > 0)
        return Remembering(after.inside, q * jnp.abs(q - 0.5 * (d + q)) / total), info


class MatchedProcess(AbstractRemembering):
    """`inner` with an extra process noise on some states that matches the corrections (R. Mehra 1972; S. Akhlaghi, N. Zhou &
    Z. Huang 2017).

        q <- b q + (1 - b) (d^2 - Q),    b = `forgetting`

    with d the change of the state's mean by a row's measurement, whose mean square equals the process noise in a steady filter,
    and Q the model's own variance over the step. The extra variance per step is q, from zero up to the square of `most`
    (standard deviations per step, by state). It grows in a manoeuvre that the model does not explain, and falls again.
    """

    smooths: ClassVar[Smoothing] = Smoothing.gaussian
    noise_by_row: ClassVar[bool] = True
    inner: AbstractGaussianFilter
    most: tuple[tuple[str, float], ...] = eqx.field(static=True)
    forgetting: float = eqx.field(static=True)

    def __init__(self, inner: AbstractGaussianFilter, most: Mapping[str, float], forgetting: float = 0.95):
        self.inner, self.most, self.forgetting = inner, tuple(sorted(as_pairs(most, "MatchedProcess.most"))), forgetting

    def __check_init__(self):
        _check_levels("MatchedProcess.most", self.most)
        check("MatchedProcess.forgetting", self.forgetting, lambda b: (b > 0) & (b < 1), "between 0 and 1")

    def check(self, model):
        _check_states("MatchedProcess.most", self.most, model)
        self.inner.check(model)

    def start(self, model):
        nothing = jnp.zeros(len(self.most), model.dtype)
        # The excess of the squared corrections over the model's own variances, and these variances over the last step.
        return nothing, nothing

    def believed_model(self, model, memory):
        extra = jnp.clip(memory[0], 0.0, self._most(memory[0].dtype))
        return with_extra(model, {name: extra[i] for i, (name, _) in enumerate(self.most)})

    def predict_between(self, model, belief, t, u_next):
        own = jnp.zeros_like(belief.memory[1])
        if model.process_noise is not None:
            law, names = model.process_noise.over(t - belief.t), [name for name, _ in self.most]
            own = jnp.stack(
                [jnp.diagonal(covariance_in(law, model.states, own.dtype))[model.states.index(n)] for n in names]
            )
        moved = super().predict_between(model, belief, t, u_next)
        return Remembering(moved.inside, (belief.memory[0], own))

    def update(self, model, belief, row):
        after, info = self.update_inside(model, belief, row)
        d = _squared_changes(belief.inside, after.inside, self.most)
        excess, own = belief.memory
        learned = self.forgetting * excess + (1.0 - self.forgetting) * (d - own)
        learned = jnp.minimum(learned, self._most(d.dtype))
        # The first row is not used: its correction comes from the prior.
        return Remembering(after.inside, (jnp.where(belief.count > 0, learned, excess), own)), info

    def _most(self, dtype):
        return jnp.asarray([std**2 for _, std in self.most], dtype)


def _check_levels(what: str, levels: tuple[tuple[str, float], ...]) -> None:
    if not levels:
        raise InputError(f"{what} is empty: give the standard deviation per step of at least one state.")
    for name, std in levels:
        check_positive(f"{what} of {name}", std)


def _check_states(what: str, levels: tuple[tuple[str, float], ...], model: StateSpace) -> None:
    check_names(what, [name for name, _ in levels], model.states)


def _squared_changes(before: Any, after: Any, levels: tuple[tuple[str, float], ...]) -> Any:
    """The squared changes (k,) of the means of the named states from one belief to the other."""
    return jnp.square(jnp.stack([getattr(after.mean, name) - getattr(before.mean, name) for name, _ in levels]))


def with_extra(model: StateSpace, variances: Mapping[str, Any]) -> StateSpace:
    """The model with these additional variances per step on some states."""
    extra = Extra(model.process_noise, _gaussian(variances))
    return eqx.tree_at(lambda m: m.process_noise, model, extra, is_leaf=lambda x: x is None)


class Extra(AbstractProcessNoise):
    """The process noise `own`, which has a covariance or is None, with independent noise added every step."""

    own: AbstractProcessNoise | None
    added: Gaussian

    @property
    def law(self):
        return self._with(None if self.own is None else self.own.law)

    def over(self, dt):
        return self._with(None if self.own is None else self.own.over(dt))

    def _with(self, own: AbstractNoise | None) -> AbstractNoise:
        if own is not None and not isinstance(own, Gaussian):
            names = (*own.names, *[name for name in self.added.names if name not in own.names])
            dtype = self.added.std[0].dtype
            return MultivariateGaussian(
                names, covariance_in(own, names, dtype) + covariance_in(self.added, names, dtype)
            )
        total = {} if own is None else {name: jnp.square(std) for name, std in own.std._asdict().items()}
        for name, std in self.added.std._asdict().items():
            total[name] = total.get(name, 0.0) + jnp.square(std)
        return _gaussian(total)


def _gaussian(variances: Mapping[str, Any]) -> Gaussian:
    """A Gaussian with these variances; they may be zero, unlike those of a law that a user gives."""
    stds = {name: numerics.sqrt(variance) for name, variance in variances.items()}
    unit = Gaussian(dict.fromkeys(stds, 1.0))
    return eqx.tree_at(lambda law: law.std, unit, type(unit.std)(*stds.values()))

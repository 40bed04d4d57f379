"""The interacting multiple model filter: it also estimates which of several models holds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import InputError, check, float_array
from jaxveh._core.names import as_several
from jaxveh.filters.choosing import log_of
from jaxveh.filters.gaussian.belief import GaussianBelief
from jaxveh.filters.gaussian.filter import AbstractRuleFilter, check_kind, with_spread
from jaxveh.statespace import AbstractBelief, AbstractWrapper, Gradient, Info, StateSpace, kit


class MixtureBelief(AbstractBelief):
    """One Gaussian per mode, `modes`, and the `probabilities` (r,) of the modes."""

    modes: tuple[GaussianBelief, ...]
    probabilities: jax.Array

    @property
    def t(self):
        """Time of the last row, s."""
        return self.modes[0].t

    @property
    def u(self):
        """Inputs of the last row."""
        return self.modes[0].u

    @property
    def count(self):
        """The number of rows so far."""
        return self.modes[0].count

    @property
    def mean(self):
        """The mixture's mean, as the state's NamedTuple."""
        return _mixture_moments(self.probabilities, [(mode.mean, mode.std) for mode in self.modes])[0]

    @property
    def std(self):
        """The mixture's standard deviations, as the state's NamedTuple."""
        return _mixture_moments(self.probabilities, [(mode.mean, mode.std) for mode in self.modes])[1]

    @property
    def covariance(self):
        """The covariance (n, n) of the mixture, in the order of the state's fields."""
        return _of_modes(self.probabilities, self.modes)[1]

    def sample(self, key, draws):
        which, inside = jax.random.split(key)
        chosen = jax.random.categorical(which, log_of(self.probabilities), shape=(draws,))
        keys = jax.random.split(inside, len(self.modes))
        drawn = [mode.sample(k, draws) for mode, k in zip(self.modes, keys, strict=True)]
        return jax.tree.map(lambda *fields: jnp.stack(fields)[chosen, jnp.arange(draws)], *drawn)

    def moments(self, model):
        # One model makes the report for all modes: modes differ in parameters, and the report is a function of the states.
        return _mixture_moments(self.probabilities, [mode.moments(model) for mode in self.modes])


class InteractingModels(AbstractWrapper):
    """The interacting multiple model filter (H. Blom & Y. Bar-Shalom 1988; Bar-Shalom, Li & Kirubarajan, sec. 11.6.6).

    **Arguments**: `inner`: the Gaussian filter that all modes use; `variants`: functions from the model to each mode's
    model, such as `lambda model: eqx.tree_at(where_friction, model, 0.3)`, which must keep states and channels;
    `transition` (r, r): row i has the probabilities of changing from mode i to each mode in a step; `start` (r,):
    probabilities before the first row (default: equal).

    In each step, every mode starts from a mixture of the modes' Gaussians, weighted by the probabilities of having come
    from each mode; it is propagated by its own model, and its probability is weighted by its likelihood.
    `belief.probabilities` are those after the last row. Innovations are the mixture's.
    """

    has_covariance: ClassVar[bool] = True
    noise_by_row: ClassVar[bool] = True
    inner: AbstractRuleFilter
    variants: tuple[Callable[[StateSpace], StateSpace], ...] = eqx.field(static=True)
    transition: jax.Array = eqx.field(converter=lambda m: float_array(m if eqx.is_array(m) else np.asarray(m)))
    start: jax.Array | None = eqx.field(
        default=None,
        converter=lambda v: None if v is None else float_array(v if eqx.is_array(v) else np.asarray(v)),
    )

    @property
    def gradients(self):
        return Gradient.exact

    def __check_init__(self):
        check_kind("InteractingModels", self.inner, AbstractRuleFilter)
        r = len(as_several(self.variants, "InteractingModels.variants"))
        if r < 2:
            raise InputError(f"InteractingModels.variants has {r} member(s): must be at least two.")
        given: dict[str, tuple[Any, tuple[int, ...]]] = {"transition": (self.transition, (r, r))}
        if self.start is not None:
            given["start"] = self.start, (r,)
        for name, (value, shape) in given.items():
            if np.shape(value) != shape:
                raise InputError(
                    f"InteractingModels.{name} has shape {np.shape(value)}: must be {shape} for {r} variants."
                )
            stochastic = lambda p: (p >= 0).all() and bool(np.all(np.abs(np.sum(p, -1) - 1) < 1e-6))
            check(f"InteractingModels.{name}", value, stochastic, "probabilities whose rows sum to 1")

    def check(self, model):
        for variant in self.variants:
            mode = variant(model)
            self.inner.check(mode)
            if (mode.states, mode.channels, mode.inputs) != (model.states, model.channels, model.inputs):
                raise InputError("InteractingModels: a variant changes the model's states, channels or inputs.")

    def _init(self, model, row, key):
        r, dtype = len(self.variants), row.t.dtype
        before = jnp.full((r,), 1 / r, dtype) if self.start is None else self.start.astype(dtype)
        found = [self.inner.update(mode, self.inner.prior(mode, row), row) for mode in self._modes(model)]
        return self._weigh(model, row, before, found)

    def _step(self, model, belief, row):
        joint = self.transition.astype(row.t.dtype) * belief.probabilities[:, None]
        ahead = jnp.sum(joint, axis=0)
        # A mode of probability zero is not mixed: it continues from its own Gaussian, with zero weight.
        alone = jnp.eye(len(self.variants), dtype=joint.dtype)
        from_each = jnp.where(ahead > 0, joint / numerics.or_one(ahead, ahead > 0), alone)
        found = []
        for j, mode in enumerate(self._modes(model)):
            mixed = self._mix(belief, from_each[:, j], j)
            found.append(self.inner.update(mode, self.inner.predict_between(mode, mixed, row.t, row.u), row))
        return self._weigh(model, row, ahead, found)

    def _modes(self, model):
        return [variant(model) for variant in self.variants]

    def _mix(self, belief: MixtureBelief, weights, j: int) -> GaussianBelief:
        """The Gaussian with the moments of the mixture from which mode j starts."""
        mean, covariance = _of_modes(weights, belief.modes)
        return with_spread(belief.modes[j], mean, self.inner.form.start(covariance))

    def _weigh(self, model, row, before, found):
        beliefs, every_info = zip(*found, strict=True)
        logs = jnp.stack([info.log_likelihood for info in every_info])
        logs = jnp.where(before > 0, logs, -jnp.inf)
        top = numerics.largest(logs)
        weights = before * jnp.exp(logs - top)
        total = jnp.sum(weights)
        info = _mixture_info(model, row, before, every_info, top + jnp.log(total))
        return MixtureBelief(tuple(beliefs), weights / total), info


def mixed_covariance(weights: Any, vectors: Any, covariances: Any) -> tuple[Any, Any]:
    """Mean (n,) and covariance (n, n) of the mixture of Gaussians with these `weights` (r,), means and covariances."""
    mean = jnp.sum(weights[:, None] * vectors, axis=0)
    deviations = vectors - mean
    outer = deviations[:, :, None] * deviations[:, None, :]
    return mean, jnp.sum(weights[:, None, None] * (covariances + outer), axis=0)


def _of_modes(weights, modes):
    """Mean (n,) and covariance (n, n) of the mixture of the Gaussians `modes`."""
    stacked = lambda values: jnp.stack(list(values))
    return mixed_covariance(weights, stacked(mode.vector for mode in modes), stacked(mode.covariance for mode in modes))


def _mixture_moments(weights, moments):
    """Mean and standard deviation, as NamedTuples, of a mixture; `moments`: the (mean, standard deviation) of each part."""
    means, stds = zip(*moments, strict=True)
    mean = jax.tree.map(lambda *values: sum(w * v for w, v in zip(weights, values, strict=True)), *means)

    def spread(centre, *both):
        values, widths = both[: len(means)], both[len(means) :]
        parts = zip(weights, values, widths, strict=True)
        return numerics.sqrt(sum(w * (jnp.square(s) + jnp.square(v - centre)) for w, v, s in parts))

    return mean, jax.tree.map(spread, mean, *means, *stds)


def _mixture_info(model, row, weights, every_info, log_likelihood) -> Info:
    _, present = kit.presence(model, row)
    mean, std = _mixture_moments(weights, [(info.innovation, info.innovation_std) for info in every_info])
    nothing = jnp.full_like(log_likelihood, jnp.nan)
    results = jnp.stack([info.result for info in every_info])
    return Info(
        log_likelihood=log_likelihood,
        innovation=kit.by_channel(model, mean, present),
        innovation_std=kit.by_channel(model, std, present),
        nis=nothing,
        ess=nothing,
        result=kit.result_of_parts(jnp.where(weights > 0, results, 0), log_likelihood),
    )

"""Particles smeared by a kernel, so that states without process noise do not degenerate."""

import abc
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check
from jaxveh._core.names import as_names, check_names
from jaxveh.filters.particle import AbstractParticleFilter, ParticleBelief, check_all_particles
from jaxveh.statespace import AbstractTwoPartWrapper, StateSpace

KERNEL = 0x6B65726E
"""Folded into the step's key for the kernel's draws, so that they differ from the filter's own draws."""


class AbstractKernel(AbstractTwoPartWrapper):
    """A particle filter whose particles are replaced, before each step, by draws from kernels around them."""

    # No postponed annotations in this file: they would turn these into fields.
    has_covariance: ClassVar[bool] = True
    noise_by_row: ClassVar[bool] = True
    inner: eqx.AbstractVar[AbstractParticleFilter]

    def __check_init__(self):
        check_all_particles(type(self).__name__, self.inner)

    @abc.abstractmethod
    def smeared_states(self, model: StateSpace) -> tuple[str, ...]:
        """The states that the kernel acts on."""

    @abc.abstractmethod
    def kernel(self, dimension: int) -> tuple[float, float]:
        """The factor on each particle's distance from the mean, and the kernel's standard deviation over that of the
        particles."""

    def _predict(self, model, belief, row):
        names = self.smeared_states(model)
        if names:
            belief = eqx.tree_at(lambda b: b.particles, belief, self._draw(belief, names))
        return self.inner._predict(model, belief, row)

    def _draw(self, belief: ParticleBelief, names: tuple[str, ...]) -> Any:
        keeps, spread = self.kernel(len(names))
        values = jnp.stack([getattr(belief.particles, name) for name in names])
        mean = jnp.sum(belief.weights * values, axis=1, keepdims=True)
        factor = numerics.lower_factor((values - mean) * numerics.sqrt(belief.weights))
        key = jax.random.fold_in(jax.random.fold_in(belief.key, KERNEL), belief.count)
        draws = numerics.normal(key, values.shape, values.dtype)
        moved = mean + keeps * (values - mean) + spread * (factor @ draws)
        return belief.particles._replace(**dict(zip(names, moved, strict=True)))


class LiuWest(AbstractKernel):
    """`inner` with parameters drawn from a mixture of kernels around them, shrunk so that mean and covariance stay the same.

        theta <- a theta_i + (1 - a) mean + N(0, (1 - a^2) V),    a = (3 discount - 1) / (2 discount)

    (J. Liu & M. West 2001, here around any particle filter. Theirs is an auxiliary filter that looks ahead with the
    shrunk parameters and draws from the kernels after it has chosen ancestors; here `AuxiliaryParticleFilter` looks
    ahead with the drawn parameters.) `names`: the states that are parameters, by default those without process noise.
    Their posterior is smeared in each step, so that it never becomes sharp, however long the recording: compare discounts.
    """

    rows_between: ClassVar[bool] = True
    inner: AbstractParticleFilter
    discount: float = eqx.field(static=True, default=0.98)
    names: tuple[str, ...] | None = eqx.field(static=True, default=None, converter=as_names)

    def __check_init__(self):
        check("LiuWest.discount", self.discount, lambda d: (d > 1 / 3) & (d < 1), "above 1/3 and below 1")

    def check(self, model):
        self.inner.check(model)
        check_names("LiuWest.names", self.names or (), model.states)
        if not self.smeared_states(model):
            raise InputError("LiuWest: every state has process noise, so that none is a parameter. Give `names`.")

    def smeared_states(self, model):
        if self.names is not None:
            return self.names
        noisy = () if model.process_noise is None else model.process_noise.law.names
        return tuple(name for name in model.states if name not in noisy)

    def kernel(self, dimension):
        keeps = (3.0 * self.discount - 1.0) / (2.0 * self.discount)
        return keeps, (1.0 - keeps**2) ** 0.5


class Regularised(AbstractKernel):
    """`inner` whose particles are drawn from Gaussian kernels around them (C. Musso, N. Oudjane & F. Le Gland 2001).

    `bandwidth`: the kernel's standard deviation over that of the particles; None: the best value for a Gaussian of n
    states and N particles, (4 / (n + 2))^(1 / (n + 4)) N^(-1 / (n + 4)), times `share`. Particles are not shrunk
    towards the mean, so that covariances grow by the factor 1 + bandwidth^2 in each step.
    """

    inner: AbstractParticleFilter
    bandwidth: float | None = eqx.field(static=True, default=None)
    share: float = eqx.field(static=True, default=0.5)

    def __check_init__(self):
        if self.bandwidth is not None:
            check("Regularised.bandwidth", self.bandwidth, lambda v: v > 0, "positive")
        check("Regularised.share", self.share, lambda v: v > 0, "positive")

    def smeared_states(self, model):
        return model.states

    def kernel(self, dimension):
        if self.bandwidth is not None:
            return 1.0, self.bandwidth
        power = 1.0 / (dimension + 4.0)
        return 1.0, self.share * (4.0 / (dimension + 2.0)) ** power * self.inner.particles**-power

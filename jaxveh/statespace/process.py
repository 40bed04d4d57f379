"""Process noise: a law in continuous time, or the law of one step."""

from __future__ import annotations

import abc

import equinox as eqx
import jax.numpy as jnp

from jaxveh._core.errors import InputError
from jaxveh.statespace.noise import AbstractNoise, CauchyGaussianMixture, Independent, StudentT, combine


class AbstractProcessNoise(eqx.Module):
    """The noise that a step adds to the propagated state; `law` names its fields."""

    @abc.abstractmethod
    def over(self, dt) -> AbstractNoise:
        """The law of the noise gathered over `dt` seconds."""


class Continuous(AbstractProcessNoise):
    """White noise in continuous time: standard deviations in unit per root second, covariance `std^2 dt` a step."""

    law: AbstractNoise

    def __check_init__(self):
        laws = self.law.laws if isinstance(self.law, Independent) else (self.law,)
        for law in laws:
            if isinstance(law, (StudentT, CauchyGaussianMixture)):
                raise InputError(f"{type(law).__name__} as process noise is the law of one step: wrap it in Discrete.")

    def over(self, dt):
        return self.law.scaled(jnp.sqrt(dt))


class Discrete(AbstractProcessNoise):
    """The law of one step whatever its length, as papers print it."""

    law: AbstractNoise

    def over(self, dt):
        return self.law


class Both(AbstractProcessNoise):
    """Continuous noise on some fields, and a law a step on others."""

    continuous: Continuous
    discrete: Discrete

    @property
    def law(self):
        return combine(self.continuous.law, self.discrete.law)

    def over(self, dt):
        return combine(self.continuous.over(dt), self.discrete.over(dt))


def join(a: AbstractProcessNoise | None, b: AbstractProcessNoise | None) -> AbstractProcessNoise | None:
    """One process noise of two over disjoint fields."""
    parts = [p for p in (a, b) if p is not None]
    if len(parts) < 2:
        return parts[0] if parts else None
    split = [(p.continuous, p.discrete) if isinstance(p, Both) else (p,) for p in parts]
    flat = [p for group in split for p in group]
    continuous = combine(*[p.law for p in flat if isinstance(p, Continuous)])
    discrete = combine(*[p.law for p in flat if isinstance(p, Discrete)])
    if continuous is None:
        return Discrete(discrete)
    if discrete is None:
        return Continuous(continuous)
    return Both(Continuous(continuous), Discrete(discrete))

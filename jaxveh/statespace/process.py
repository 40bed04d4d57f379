"""Process noise: a law in continuous time, or the law of one step."""

from __future__ import annotations

import abc

import equinox as eqx

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_kind
from jaxveh.statespace.independent import combine
from jaxveh.statespace.noise import AbstractNoise


class AbstractProcessNoise(eqx.Module):
    """The noise that a step adds to the propagated state; `law` names its fields."""

    @property
    def grows_with_time(self) -> bool:
        """Whether one long step adds the same noise as several shorter ones, as for white noise in continuous time."""
        return False

    @abc.abstractmethod
    def over(self, dt) -> AbstractNoise:
        """The law of the noise accumulated over `dt` seconds (zero or more)."""


class Continuous(AbstractProcessNoise):
    """White noise in continuous time: standard deviations in unit per root second, covariance `std^2 dt` per step."""

    law: AbstractNoise

    def __check_init__(self):
        _check_law("Continuous", self.law)
        for law in self.law.parts:
            if not law.adds_up:
                raise InputError(f"{type(law).__name__} as process noise is the law of one step: wrap it in Discrete.")

    @property
    def grows_with_time(self):
        return True

    def over(self, dt):
        return self.law.times(numerics.sqrt(dt))  # whose derivative at zero is finite


class Discrete(AbstractProcessNoise):
    """The law of one step whatever its length, as printed in papers."""

    law: AbstractNoise

    def __check_init__(self):
        _check_law("Discrete", self.law)

    def over(self, dt):
        return self.law


def _check_law(who: str, law: object) -> None:
    check_kind(f"{who}: law", law, AbstractNoise, 'Such as Gaussian({"yaw_rate": 0.1}).')


class Together(AbstractProcessNoise):
    """Independent process noises over disjoint fields."""

    parts: tuple[AbstractProcessNoise, ...]

    @property
    def grows_with_time(self):
        return all(part.grows_with_time for part in self.parts)

    @property
    def law(self):
        return combine(*[part.law for part in self.parts])

    def over(self, dt):
        return combine(*[part.over(dt) for part in self.parts])


def join(a: AbstractProcessNoise | None, b: AbstractProcessNoise | None) -> AbstractProcessNoise | None:
    """Two process noises over disjoint fields as one; those in continuous time, and those per step, become one law each.

    One of a derived class stays beside them: what it changes would be lost.
    """
    if a is None or b is None:
        return a if b is None else b
    flat = [part for noise in (a, b) for part in (noise.parts if isinstance(noise, Together) else (noise,))]
    parts = [part for part in flat if type(part) not in (Continuous, Discrete)]
    for kind in (Discrete, Continuous):
        law = combine(*[part.law for part in flat if type(part) is kind])
        if law is not None:
            parts.insert(0, kind(law))
    return parts[0] if len(parts) == 1 else Together(tuple(parts))

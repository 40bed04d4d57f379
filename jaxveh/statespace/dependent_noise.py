"""Measurement noise whose law depends on the state and the inputs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx

from jaxveh._core.errors import InputError
from jaxveh._core.names import as_names
from jaxveh.statespace.noise import AbstractNoise, Gaussian


class StateDependent(eqx.Module):
    """A law of measurement noise for each state and input: stochastic volatility, a sensor that is worse in large slip.

    **Arguments**: `function(system, t, x, u) -> law`, of one point (a NamedTuple of scalars `x`), with `system` that of the
    `StateSpace`, so that gradients, fits and chosen parameters reach the numbers in it; a mapping of standard deviations (in the
    channels' units) becomes a `Gaussian`. `names`: the channels, every one of which the law must have.

        StateDependent(lambda system, t, x, u: {"returns": system.beta * jnp.exp(0.5 * x.h)}, "returns")

    Particle filters, guided ones included, weigh each particle by its own law: exact. Gaussian filters take the covariance at
    the mean of their prediction, without what the state's own spread adds to it, and learn nothing of the state from the
    noise's size; whoever estimates the size itself (volatility) needs particles. `Kalman` takes laws of the inputs alone.
    What needs one law for all rows (learned or varying variances, least squares, Cramer-Rao bounds, observers) refuses.
    """

    function: Callable = eqx.field(static=True)
    names: tuple[str, ...] = eqx.field(static=True, converter=as_names)

    def __check_init__(self):
        if not callable(self.function):
            raise InputError(
                f"StateDependent.function = {type(self.function).__name__}: must be a function of (system, t, x, u)."
            )
        if not self.names:
            raise InputError("StateDependent.names is empty: name at least one channel.")

    def at(self, system: Any, t: Any, x: Any, u: Any) -> AbstractNoise:
        """The law at one state."""
        law = self.function(system, t, x, u)
        law = Gaussian(law) if isinstance(law, Mapping) else law
        if not isinstance(law, AbstractNoise):
            raise InputError(
                f"StateDependent: its function returned {type(law).__name__}: must be a noise law, or a mapping of standard "
                "deviations."
            )
        if sorted(law.names) != sorted(self.names):
            raise InputError(
                f"StateDependent: its function returned a law of {', '.join(law.names)}: must be of {', '.join(self.names)}."
            )
        return law

    def around(self, wrap: Callable) -> StateDependent:
        """The same with the function `wrap(function)`, of another system or state."""
        return StateDependent(wrap(self.function), self.names)


MeasurementNoise = AbstractNoise | StateDependent
"""What a `StateSpace` takes as its measurement noise."""


def around(noise: MeasurementNoise, wrap: Callable) -> MeasurementNoise:
    """The noise of a model whose system or state is wrapped: a law that sees neither stays as it is."""
    return noise.around(wrap) if isinstance(noise, StateDependent) else noise


def check_fixed(who: str, noise: MeasurementNoise, advice: str) -> None:
    """Raise `InputError` unless the noise is one law for all states and inputs."""
    if isinstance(noise, StateDependent):
        raise InputError(
            f"{who}: the measurement noise of {', '.join(noise.names)} depends on the state (StateDependent): must be one law. "
            f"{advice}"
        )

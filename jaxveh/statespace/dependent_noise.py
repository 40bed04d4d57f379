"""Measurement noise whose law depends on the state and the inputs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx

from jaxveh._core.errors import InputError, check_takes, word_for
from jaxveh._core.names import as_names
from jaxveh.statespace.noise import AbstractNoise, Gaussian
from jaxveh.statespace.one_model import wide_levels


class StateDependent(eqx.Module):
    """A law of measurement noise that depends on state and input: stochastic volatility, a sensor that is worse in large slip.

    **Arguments**: `function(system, t, x, u) -> law`, at one point (a NamedTuple of scalars `x`), where `system` is that of the
    `StateSpace`, so that gradients, fits and chosen parameters include its numbers; a mapping of standard deviations (in the
    channels' units) becomes a `Gaussian`. `names`: the channels; the law must have every one of them.

        StateDependent(lambda system, t, x, u: {"returns": system.beta * jnp.exp(0.5 * x.h)}, "returns")

    Particle filters, including guided ones, weight each particle by its own law, which is exact. Gaussian filters use the
    covariance at the mean of their prediction: they neglect the spread of the state in it, and learn nothing about the state
    from the size of the noise. To estimate the size itself (volatility), use particles. `Kalman` accepts laws that depend on
    the inputs only. Methods that need one law for all rows (learned or varying variances, least squares, Cramer-Rao bounds,
    observers) raise.
    """

    function: Callable = eqx.field(static=True)
    names: tuple[str, ...] = eqx.field(static=True, converter=as_names)

    def __check_init__(self):
        check_takes("StateDependent.function", self.function, "system", "t", "x", "u")
        if not self.names:
            raise InputError("StateDependent.names is empty: name at least one channel.")

    def at(self, system: Any, t: Any, x: Any, u: Any) -> AbstractNoise:
        """The law at one state."""
        law = self.function(system, t, x, u)
        law = Gaussian(law) if isinstance(law, Mapping) else law
        if not isinstance(law, AbstractNoise):
            raise InputError(
                f"StateDependent: its function returned {word_for(law)}: must be a noise law, or a mapping of standard "
                "deviations."
            )
        if sorted(law.names) != sorted(self.names):
            raise InputError(
                f"StateDependent: its function returned a law of {', '.join(law.names)}: must be of {', '.join(self.names)}."
            )
        if wide := wide_levels("its law", law):
            raise InputError(f"StateDependent: {', '.join(wide)}: must be one number each.")
        return law

    def around(self, wrap: Callable) -> StateDependent:
        """The same noise with the function `wrap(function)`, for another system or state."""
        return StateDependent(wrap(self.function), self.names)


MeasurementNoise = AbstractNoise | StateDependent
"""The kinds of measurement noise of a `StateSpace`."""


def around(noise: MeasurementNoise, wrap: Callable) -> MeasurementNoise:
    """The noise of a model whose system or state is wrapped: a law that depends on neither stays unchanged."""
    return noise.around(wrap) if isinstance(noise, StateDependent) else noise


def check_fixed(who: str, noise: MeasurementNoise, advice: str) -> None:
    """Raise `InputError` unless the noise is one law for all states and inputs."""
    if isinstance(noise, StateDependent):
        raise InputError(
            f"{who}: the measurement noise of {', '.join(noise.names)} depends on the state (StateDependent): must be one law. "
            f"{advice}"
        )

"""Roads whose grade, bank and friction vary at random with distance, with a given spectrum."""

from __future__ import annotations

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check, check_positive, check_single, check_whole, is_concrete, word_for
from jaxveh._core.parameter import check_parameters, positive, table
from jaxveh.numerics import band_harmonics, gauss_markov_harmonics, sum_of_harmonics
from jaxveh.roads.base import AbstractRoad, Surface, place, surface


class Variation(eqx.Module):
    """A random function of distance: `std` times a sum of harmonics of equal energy with variance 1.

    `std`: its standard deviation (rad, or - for friction). `wavenumbers` (1/m) and `phases` (rad): (n,) each, drawn by
    `gauss_markov` or `band`.
    """

    std: jax.Array = positive("-")
    wavenumbers: jax.Array = table("1/m", scale=0.01)
    phases: jax.Array = table("rad", scale=1.0)

    def __check_init__(self):
        check_parameters(self)
        if np.ndim(self.wavenumbers) != 1 or np.shape(self.wavenumbers) != np.shape(self.phases):
            raise InputError(
                f"Variation: wavenumbers have the shape {np.shape(self.wavenumbers)}, phases {np.shape(self.phases)}: "
                "both must be (n,)."
            )

    def value(self, s: jax.Array) -> jax.Array:
        """The function at the distances s (m), in their shape."""
        return self.std * sum_of_harmonics(s, self.wavenumbers, self.phases)


def gauss_markov(std, length: float, key: jax.Array, *, shortest: float | None = None, count: int = 100) -> Variation:
    """A variation with the autocorrelation `std^2 exp(-|lag| / length)`: a first-order Gauss-Markov process.

    Its one-sided spectral density over the wavenumber n (1/m) is `4 std^2 L / (1 + (2 pi n L)^2)`, with L the
    correlation `length` (m). Wavelengths below the `shortest` (m, default length / 5) are left out, so that the function is
    differentiable, and the rest is scaled to `std`. `count` is the number of harmonics; each `key` gives one function.

    **Raises** `InputError` for values that are not positive.
    """
    check_single(length=length)
    check_positive("std", std)
    check_positive("length", length, "m")
    shortest = length / 5 if shortest is None else shortest
    check_single(shortest=shortest)
    check_positive("shortest", shortest, "m")
    check_whole("count", count)
    return Variation(std, *gauss_markov_harmonics(key, length, 1.0 / shortest, count))


def band(std, longest: float, shortest: float, key: jax.Array, *, count: int = 100) -> Variation:
    """A variation of standard deviation `std` whose wavelengths lie between `longest` and `shortest` (m).

    Its one-sided spectral density over the wavenumber is constant between `1 / longest` and `1 / shortest`.

    **Raises** `InputError` for values that are not positive, or a `longest` that is not above `shortest`.
    """
    check_single(longest=longest, shortest=shortest)
    check_positive("std", std)
    check_positive("shortest", shortest, "m")
    if is_concrete(shortest):
        check("longest", longest, lambda v: v > shortest, f"above shortest = {shortest:g} m")
    check_whole("count", count)
    return Variation(std, *band_harmonics(key, 1.0 / longest, 1.0 / shortest, count))


class RandomRoad(AbstractRoad):
    """A road whose grade, bank and friction vary at random with distance.

    `grade`, `bank`: variations about zero (rad), or None for none. `friction` (-, default 1): the median friction.
    `log_friction`: the variation of its logarithm, or None for none (friction stays positive).

    **Raises** `InputError` for a friction that is not positive, or a part that is not a `Variation`.
    """

    grade: Variation | None = None
    bank: Variation | None = None
    log_friction: Variation | None = None
    friction: jax.Array = positive("-", default=1.0)

    def __check_init__(self):
        for name in ("grade", "bank", "log_friction"):
            given = getattr(self, name)
            if given is not None and not isinstance(given, Variation):
                raise InputError(f"RandomRoad.{name} = {word_for(given)}: must be a Variation (roads.gauss_markov).")

    def at(self, s: Any, y: Any = 0.0) -> Surface:
        s, y = place(s, y, self.friction)
        friction = self.friction
        if self.log_friction is not None:
            friction = friction * jnp.exp(self.log_friction.value(s))
        slopes = [None if part is None else _angle(part.value(s)) for part in (self.grade, self.bank)]
        return surface(s, y, friction, *slopes)


def _angle(value: jax.Array) -> jax.Array:
    """An angle within a quarter turn, however large the sum of harmonics is; 0.1 rad is reduced by one part in 700."""
    return (math.pi / 2) * jnp.tanh(value * (2 / math.pi))

"""Speed from the wheels alone."""

from __future__ import annotations

import abc

import jax
import jax.numpy as jnp

from jaxveh.estimators.contract import Need
from jaxveh.estimators.method import AbstractMethod, answer

WHEEL_SPEEDS = tuple(Need(f"wheel_speed_{at}", "m/s") for at in ("fl", "fr", "rl", "rr"))


class AbstractOneWheel(AbstractMethod):
    """One of the four wheel speeds, chosen row by row; what the last rows said is held where no wheel speaks."""

    @abc.abstractmethod
    def choose(self, speeds: jax.Array) -> tuple[jax.Array, jax.Array]:
        """The speed of (4,) wheels, NaN where one does not speak, and whether one does."""

    @property
    def needs(self):
        return WHEEL_SPEEDS

    def first(self, t, values):
        return self.next(jnp.zeros_like(t), t, values)

    def next(self, memory, t, values):
        del t
        chosen, spoke = self.choose(jnp.stack([values[need.channel] for need in WHEEL_SPEEDS]))
        v_x = jnp.where(spoke, chosen, memory)
        return v_x, answer({"v_x": v_x}, known=spoke)


class FastestWheel(AbstractOneWheel):
    """The review's maximum: of a braking car the wheel that slips least."""

    def choose(self, speeds):
        there = ~jnp.isnan(speeds)
        return jnp.max(jnp.where(there, speeds, -jnp.inf)), there.any()


class SlowestWheel(AbstractOneWheel):
    """The review's minimum: of a driven car the wheel that slips least."""

    def choose(self, speeds):
        there = ~jnp.isnan(speeds)
        return jnp.min(jnp.where(there, speeds, jnp.inf)), there.any()

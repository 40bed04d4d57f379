"""What the paper's three estimators tell each other, and how those of parameters see the sensors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh.experiments.federated_ckf.model import MOVE, Planar, State, sensor_outputs
from jaxveh.statespace import LinearInput


class Told(NamedTuple):
    """What the estimators know of each other after a row: its time (s) and inputs, the car with the latest parameters, and the
    latest state; means alone, as the paper has it."""

    t: Any
    u: Any
    car: Planar
    state: Any


def propagate(told: Told, car: Planar, t, u) -> State:
    """Where the car is at `t` with these parameters, from where it was told to be."""
    path = LinearInput(told.t, jnp.where(t > told.t, t, told.t + 1.0), told.u, u)
    return MOVE(car, told.t, t, told.state, path)


def stays(system, t0, t1, x, u):
    """Parameters stay."""
    del system, t0, t1, u
    return x


class SeenThrough(eqx.Module):
    """What the sensors say of a car with the estimated parameters, `put(car, x)`, from where it was a row ago."""

    put: Callable = eqx.field(static=True)

    def __call__(self, told: Told, t, x, u):
        car, shape = self.put(told.car, x), jnp.shape(x[0])
        here = told._replace(state=jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, shape), told.state))
        return sensor_outputs(car, t, propagate(here, car, t, u), u)


def vector_and_covariance(belief) -> tuple[Any, Any]:
    """The mean (n,) and the covariance (n, n) of a Gaussian belief."""
    return jnp.stack(belief.mean), belief.covariance

"""The results that the paper's three estimators exchange, and the sensor model of those that estimate parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh.experiments.federated_ckf.model import MOVE, Planar, State, sensor_outputs
from jaxveh.statespace import LinearInput


class Told(NamedTuple):
    """The results that the estimators exchange after a row: its time (s) and inputs, the car with the latest parameters, and
    the latest state; only means, as in the paper."""

    t: Any
    u: Any
    car: Planar
    state: Any


def propagate(told: Told, car: Planar, t, u) -> State:
    """The state of the car at `t` with these parameters, from the state in `told`."""
    return MOVE(car, told.t, t, told.state, LinearInput(told.t, t, told.u, u))


def stays(system, t0, t1, x, u):
    """Parameters that stay as they are."""
    del system, t0, t1, u
    return x


class SeenThrough(eqx.Module):
    """The sensors of a car with the estimated parameters, `put(car, x)`, from its state one row before."""

    put: Callable = eqx.field(static=True)

    def __call__(self, told: Told, t, x, u):
        car, shape = self.put(told.car, x), jnp.shape(x[0])
        here = told._replace(state=jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, shape), told.state))
        return sensor_outputs(car, t, propagate(here, car, t, u), u)


def vector_and_covariance(belief) -> tuple[Any, Any]:
    """The mean (n,) and the covariance (n, n) of a Gaussian belief."""
    return jnp.stack(belief.mean), belief.covariance

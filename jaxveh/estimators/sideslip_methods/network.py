"""Sideslip by a neural network without a tyre model: section 1.4.7 of the review (its [56, 81])."""

from __future__ import annotations

import functools
import importlib.resources
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.method import AbstractMethod
from jaxveh.estimators.sideslip_methods.common import (
    A_Y,
    STEER,
    V_X,
    YAW_RATE,
    Guarded,
    guard,
    sideslip_answer,
    slowest_of,
)
from jaxveh.estimators.two_axles import linear_axles_of
from jaxveh.io import CarSpecification
from jaxveh.io import kit as io
from jaxveh.vehicles import GRAVITY

TIMES = (0.1, 0.4, 1.5)
"""s: time constants of the low-pass filters that are the network's memory."""

SIGNALS = 6
"""Number of low-passed signals: see `SideslipNetwork.signals`."""

FILE = "network.npz"
"""File of weights and biases, layer by layer, in this module's folder."""


class NetworkMemory(NamedTuple):
    """The time of the last row (s), and the low-passed signals (len(TIMES), SIGNALS)."""

    t: Any
    slow: Any


class SideslipNetwork(AbstractMethod):
    """The slip angle of the rear axle by a network with two hidden layers, from present and past measurements.

        beta = l_r r / v_x - slip,    slip and log standard deviation of slip = network(signals, low-passed signals, speed)

    The signals do not depend on the size of a car, so that one network serves all cars: the steer, the steer of a turn without
    slip, the measured lateral acceleration and that of the yaw rate, and the slip angles of the linear axles of the car's file.
    So the network may be right on cars that resemble those of its training (see `sideslip_review.network_training` for these).

    **Parameters**: of the car `front_axle_to_cg`, `rear_axle_to_cg` (m), `front_compliance`, `rear_compliance`, slip angle per
    lateral acceleration (rad/(m/s^2)), `steer_offset` (rad), `slowest` (m/s); `layers`: the network.
    """

    unit: ClassVar[float] = 0.05
    """rad: unit of the network's slip."""
    size: ClassVar[int] = SIGNALS * (1 + len(TIMES)) + 1
    """Number of the network's inputs."""
    layers: eqx.nn.MLP
    front_axle_to_cg: jax.Array = positive("m")
    rear_axle_to_cg: jax.Array = positive("m")
    front_compliance: jax.Array = positive("rad/(m/s^2)")
    rear_compliance: jax.Array = positive("rad/(m/s^2)")
    slowest: jax.Array = positive("m/s", default=3.0)
    steer_offset: jax.Array = parameter("rad", scale=0.02, default=0.0)

    @property
    def needs(self):
        return (V_X, STEER, YAW_RATE, A_Y)

    def signals(self, values) -> jax.Array:
        """The signals (SIGNALS,), each about 1 in ordinary driving."""
        v_x = jnp.maximum(values["v_x"], self.slowest)
        turn, push = values["yaw_rate"], values["a_y"]
        rolling = (self.front_axle_to_cg + self.rear_axle_to_cg) * turn / v_x
        return jnp.stack([
            (values["steer"] + self.steer_offset) / self.unit, rolling / self.unit, push / (0.3 * GRAVITY),
            turn * v_x / (0.3 * GRAVITY), self.front_compliance * push / self.unit, self.rear_compliance * push / self.unit,
        ])  # fmt: skip

    def first(self, t, values):
        now = self.signals(values)
        return self._answer(t, now, jnp.broadcast_to(now, (len(TIMES), SIGNALS)), values)

    def next(self, memory, t, values):
        now = self.signals(values)
        share = 1.0 - jnp.exp(-(t - memory.t) / jnp.asarray(TIMES, now.dtype))
        return self._answer(t, now, memory.slow + share[:, None] * (now - memory.slow), values)

    def features(self, now, slow, v_x) -> jax.Array:
        """(size,): the signals, their differences from the low-passed signals, and the speed."""
        return jnp.concatenate([now, (now - slow).reshape(-1), jnp.atleast_1d(v_x / 30.0)])

    def _answer(self, t, now, slow, values):
        v_x = jnp.maximum(values["v_x"], self.slowest)
        slip, spread = self.layers(self.features(now, slow, v_x))
        v_y = self.rear_axle_to_cg * values["yaw_rate"] - v_x * self.unit * slip
        std = v_x * self.unit * jnp.exp(jnp.clip(spread, -6.0, 3.0))
        return NetworkMemory(t, slow), sideslip_answer(v_y, v_x, std=std)


def layers_of(arrays: list[np.ndarray]) -> eqx.nn.MLP:
    """The network with these weights and biases, in alternating order."""
    width, depth = arrays[0].shape[0], len(arrays) // 2 - 1
    network = eqx.nn.MLP(SideslipNetwork.size, 2, width, depth, jnp.tanh, key=jax.random.key(0))
    where = lambda one: [leaf for layer in one.layers for leaf in (layer.weight, layer.bias)]
    return eqx.tree_at(where, network, [jnp.asarray(array) for array in arrays])


@functools.cache
def trained_arrays() -> tuple[np.ndarray, ...]:
    """The weights and biases of `sideslip_review.network_training`, in alternating order."""
    with importlib.resources.files(__package__).joinpath(FILE).open("rb") as file, np.load(file) as stored:
        return tuple(np.asarray(stored[name], float) for name in sorted(stored.files))


def sideslip_network(car: CarSpecification, layers: eqx.nn.MLP) -> SideslipNetwork:
    """The method with these `layers` for a car's file."""
    io.check_car_file("sideslip_network", car)
    told = linear_axles_of(car)
    wheelbase = told["front_axle_to_cg"] + told["rear_axle_to_cg"]
    compliance = lambda other, stiffness: told["mass"] * told[other] / (wheelbase * told[stiffness])
    return SideslipNetwork(
        layers, told["front_axle_to_cg"], told["rear_axle_to_cg"], compliance("rear_axle_to_cg", "front_cornering_stiffness"),
        compliance("front_axle_to_cg", "rear_cornering_stiffness"), slowest_of(car), -(car.steer_offset or 0.0),
    )  # fmt: skip


def neural_network(car: CarSpecification) -> Guarded:
    """Makes the trained network from a car's file."""
    layers = layers_of(list(trained_arrays()))
    return guard(car, sideslip_network(car, layers), (YAW_RATE, A_Y), (YAW_RATE, A_Y))

"""Load transfer: the wheel loads of a car without suspension as a function of its accelerations."""

from __future__ import annotations

import abc
from dataclasses import KW_ONLY
from typing import Any, ClassVar, Protocol

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import check_parameters, positive
from jaxveh.vehicles.shared import AbstractPlaneBody
from jaxveh.vehicles.wheels import Wheels


class AbstractLoadTransfer(eqx.Module):
    """The accelerations that determine the load transfer. `felt_accelerations` gives them at an instant. States, if there are
    any, are part of the car's state and zero in straight running.

    The longitudinal acceleration is the tyre force over the mass: air drag acts at the height of the centre of gravity and has
    no moment about it.
    """

    state_names: eqx.AbstractVar[tuple[str, ...]]
    inputs: eqx.AbstractVar[tuple[str, ...]]

    @abc.abstractmethod
    def felt_accelerations(self, x: Any, u: Any, guess: tuple[Any, Any]) -> tuple[Any, Any]:
        """The accelerations (a_x, a_y), m/s^2, that determine the loads; `guess` are those in a steady turn under the torques."""

    @abc.abstractmethod
    def rates(self, x: Any, a_x: Any, a_y: Any) -> tuple:
        """The time derivatives of the states for the tyres' force over mass `a_x`, `a_y` (m/s^2)."""


class AbstractImmediate(AbstractLoadTransfer):
    """Loads without lag, for which no state is needed."""

    state_names: ClassVar[tuple[str, ...]] = ()

    def rates(self, x, a_x, a_y):
        return ()


class StaticLoads(AbstractImmediate):
    """Constant loads, as at rest."""

    inputs: ClassVar[tuple[str, ...]] = ()

    def felt_accelerations(self, x, u, guess):
        return 0.0, 0.0


class QuasiStatic(AbstractImmediate):
    """Loads without lag, from the accelerations of a steady turn, `a_y = v_x yaw_rate`, and of the torques, `a_x = T / (m r)`.

    No tyre force is needed, so that there is no algebraic loop. If a car yaws without turning (on split friction, in a spin) it
    does not have this acceleration, and the loads are wrong. Cars without wheel spin limit a_x by the road's grip. `SevenDOF`
    does not; its braking torques must not exceed what the road can transmit.
    """

    inputs: ClassVar[tuple[str, ...]] = ()

    def felt_accelerations(self, x, u, guess):
        return guess


class LaggedLoads(AbstractLoadTransfer):
    """Loads that follow the accelerations due to the tyres with a first-order lag of `time` (s), that of roll and pitch.

    The states `a_x_felt`, `a_y_felt` (m/s^2) break the loop from forces through accelerations and loads back to forces. In a
    steady state the loads are those of the accelerations.
    """

    time: jax.Array = positive("s", default=0.1)
    state_names: ClassVar[tuple[str, ...]] = ("a_x_felt", "a_y_felt")
    inputs: ClassVar[tuple[str, ...]] = ()

    def __check_init__(self):
        check_parameters(self)

    def felt_accelerations(self, x, u, guess):
        return x.a_x_felt, x.a_y_felt

    def rates(self, x, a_x, a_y):
        return (a_x - x.a_x_felt) / self.time, (a_y - x.a_y_felt) / self.time


class MeasuredLoads(AbstractImmediate):
    """Loads from measured accelerations: `a_x` and `a_y` (m/s^2) become inputs, as in filters on real logs.

    An accelerometer also measures the deceleration by air drag, which is not corrected (at 45 m/s some 2 % of an axle's load).
    """

    inputs: ClassVar[tuple[str, ...]] = ("a_x", "a_y")

    def felt_accelerations(self, x, u, guess):
        return u.a_x, u.a_y


class AbstractShiftingLoads(AbstractPlaneBody):
    """A car whose wheel loads depend on accelerations.

    **Parameters** of the loads: `load_transfer`, how they depend on accelerations (`QuasiStatic`, `LaggedLoads`, ...).
    """

    _: KW_ONLY
    load_transfer: AbstractLoadTransfer = eqx.field(default_factory=LaggedLoads)


class AxleWeights(Protocol):
    """The parameters of axle loads: mass (kg), positions of the axles and height of the centre of gravity (m)."""

    @property
    def mass(self) -> Any: ...
    @property
    def front_axle_to_cg(self) -> Any: ...
    @property
    def rear_axle_to_cg(self) -> Any: ...
    @property
    def cg_height(self) -> Any: ...


class WheelWeights(AxleWeights, Protocol):
    """The parameters of the wheel loads of a car without roll: also the tracks (m) and the front axle's share of the lateral
    transfer (-; None: as the static loads are shared)."""

    @property
    def track_front(self) -> Any: ...
    @property
    def track_rear(self) -> Any: ...
    @property
    def front_roll_share(self) -> Any: ...


@numerics.fence_results
def planar_loads(car: WheelWeights, a_x: Any, a_y: Any, g_z: Any) -> Wheels:
    """The wheel loads, N, of a rigid car whose roll and pitch angles are negligible.

    In the road's plane, with a_x, a_y the signals of accelerometers at the centre of gravity (which include slopes), g_z gravity
    along z (upwards, so -9.81 on a level road), h the height of the centre of gravity and q the front axle's share of the
    lateral transfer:

        front axle:  m (-g_z b - a_x h) / (a + b),  moved to its right wheel:  q m a_y h / track_front
        rear axle:   m (-g_z a + a_x h) / (a + b),  moved to its right wheel:  (1 - q) m a_y h / track_rear

    Loads are never negative. If a wheel lifts, the other wheel carries the load of the axle; if an axle lifts, the other axle
    carries the car. The part of the moment that an axle on one wheel cannot take is taken by the other axle.
    """
    a, b = car.front_axle_to_cg, car.rear_axle_to_cg
    share = b / (a + b) if car.front_roll_share is None else car.front_roll_share
    moment = car.mass * car.cg_height * a_y
    track_front, track_rear = car.track_front, car.track_rear
    front, rear = axle_loads(car, a_x, g_z)
    half_front, half_rear = 0.5 * front, 0.5 * rear
    # The rear takes the part of the moment that the front leaves, then the front the part that the rear leaves. Both wheels of
    # an axle and the other axle use each result: computed once, a step of 7-DOF cars takes 180 instead of 192 ns (float32, 1000
    # runs).
    first_front = limit_transfer(share / track_front * moment, half_front)
    moved_rear = limit_transfer(moment * (1.0 / track_rear) - first_front * (track_front / track_rear), half_rear)
    moved_rear = numerics.fence(moved_rear)
    moved_front = limit_transfer(moment * (1.0 / track_front) - moved_rear * (track_rear / track_front), half_front)
    moved_front = numerics.fence(moved_front)
    return Wheels(half_front - moved_front, half_front + moved_front, half_rear - moved_rear, half_rear + moved_rear)


def limit_transfer(moved: Any, half: Any) -> Any:
    """The load that moves from the left to the right wheel, N, limited to `half` the axle's load."""
    return jnp.clip(moved, -half, half)


def axle_loads(car: AxleWeights, a_x: Any, g_z: Any) -> tuple[Any, Any]:
    """The loads of front and rear axle, N: `m (-g_z b - a_x h) / (a + b)` and the rest of the weight, neither below zero."""
    a, b = car.front_axle_to_cg, car.rear_axle_to_cg
    weight = -car.mass * g_z
    moved = car.mass * car.cg_height / (a + b) * a_x
    front = jnp.clip(weight * (b / (a + b)) - moved, 0.0, weight)
    return front, weight - front

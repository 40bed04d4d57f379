"""How the loads of a car without suspension follow its accelerations."""

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
    """Which accelerations shift the loads. `felt_accelerations` are those at an instant; states, where there are any, are the
    car's, and zero where it runs straight.

    Longitudinally it is what the tyres push, over the mass: the air's drag acts at the centre of gravity's height, so that in
    moments about it only forces of the road count.
    """

    state_names: eqx.AbstractVar[tuple[str, ...]]
    inputs: eqx.AbstractVar[tuple[str, ...]]

    @abc.abstractmethod
    def felt_accelerations(self, x: Any, u: Any, guess: tuple[Any, Any]) -> tuple[Any, Any]:
        """(a_x, a_y), m/s^2, that the loads feel; `guess` are those of the car in a steady turn under its torques."""

    @abc.abstractmethod
    def rates(self, x: Any, a_x: Any, a_y: Any) -> tuple:
        """The time derivatives of the states where the tyres push with a_x, a_y (m/s^2: force over mass)."""


class AbstractImmediate(AbstractLoadTransfer):
    """Loads that follow at once, and so need no state."""

    state_names: ClassVar[tuple[str, ...]] = ()

    def rates(self, x, a_x, a_y):
        return ()


class StaticLoads(AbstractImmediate):
    """Loads as at rest."""

    inputs: ClassVar[tuple[str, ...]] = ()

    def felt_accelerations(self, x, u, guess):
        return 0.0, 0.0


class QuasiStatic(AbstractImmediate):
    """Loads follow at once the accelerations of a steady turn, `a_y = v_x yaw_rate`, and of the torques, `a_x = T / (m r)`.

    They need no tyre force, so that there is no loop to solve. A car that yaws without turning (on two frictions, in a spin) has
    no such acceleration, and there the loads are wrong. Cars without wheel spins bound a_x by the road's grip; `SevenDOF`
    does not, and its braking torques must be those that the road holds.
    """

    inputs: ClassVar[tuple[str, ...]] = ()

    def felt_accelerations(self, x, u, guess):
        return guess


class LaggedLoads(AbstractLoadTransfer):
    """Loads follow the accelerations that the tyres make with a first-order lag of `time` (s), that of its roll and pitch.

    The states `a_x_felt`, `a_y_felt` (m/s^2) break the loop from forces over accelerations and loads back to forces; in a
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
    """Loads of accelerations that are measured: `a_x` and `a_y` (m/s^2) become inputs, as in filters on real logs.

    An accelerometer feels the air's drag, too; it is left in (at 45 m/s some 2 % of an axle's load).
    """

    inputs: ClassVar[tuple[str, ...]] = ("a_x", "a_y")

    def felt_accelerations(self, x, u, guess):
        return u.a_x, u.a_y


class AbstractShiftingLoads(AbstractPlaneBody):
    """A car whose wheel loads follow from accelerations.

    **Parameters** of the loads: `load_transfer`, by which they follow accelerations (`QuasiStatic`, `LaggedLoads`, ...).
    """

    _: KW_ONLY
    load_transfer: AbstractLoadTransfer = eqx.field(default_factory=LaggedLoads)


class AxleWeights(Protocol):
    """What the loads of axles depend on: mass (kg), places of the axles and height of the centre of gravity (m)."""

    @property
    def mass(self) -> Any: ...
    @property
    def front_axle_to_cg(self) -> Any: ...
    @property
    def rear_axle_to_cg(self) -> Any: ...
    @property
    def cg_height(self) -> Any: ...


class WheelWeights(AxleWeights, Protocol):
    """What the loads of an upright car's wheels depend on: besides, tracks (m) and the front axle's share of the lateral transfer
    (-; None: by the static loads)."""

    @property
    def track_front(self) -> Any: ...
    @property
    def track_rear(self) -> Any: ...
    @property
    def front_roll_share(self) -> Any: ...


@numerics.fence_results
def planar_loads(car: WheelWeights, a_x: Any, a_y: Any, g_z: Any) -> Wheels:
    """Wheel loads, N, of a rigid car whose body neither rolls nor pitches visibly.

    In the road's plane, with a_x, a_y what accelerometers at the centre of gravity say (slopes are in them), g_z gravity along
    z (upwards, so -9.81 on a level road), h the height of the centre of gravity and q the front axle's share of the lateral
    transfer:

        front axle:  m (-g_z b - a_x h) / (a + b),  moved to its right wheel:  q m a_y h / track_front
        rear axle:   m (-g_z a + a_x h) / (a + b),  moved to its right wheel:  (1 - q) m a_y h / track_rear

    No wheel is pulled down: one that lifts leaves the axle's load to the other, and an axle that lifts to the other axle. What
    an axle on one wheel cannot take of the moment the other axle takes.
    """
    a, b = car.front_axle_to_cg, car.rear_axle_to_cg
    share = b / (a + b) if car.front_roll_share is None else car.front_roll_share
    moment = car.mass * car.cg_height * a_y
    track_front, track_rear = car.track_front, car.track_rear
    front, rear = axle_loads(car, a_x, g_z)
    half_front, half_rear = 0.5 * front, 0.5 * rear
    # The rear takes what the front leaves of the moment, then the front what the rear leaves. Each is read by both wheels of
    # an axle and by the other axle: computed once it is 180 instead of 192 ns a step of 7-DOF cars (float32, 1000 runs).
    first_front = limit_transfer(share / track_front * moment, half_front)
    moved_rear = limit_transfer(moment * (1.0 / track_rear) - first_front * (track_front / track_rear), half_rear)
    moved_rear = numerics.fence(moved_rear)
    moved_front = limit_transfer(moment * (1.0 / track_front) - moved_rear * (track_rear / track_front), half_front)
    moved_front = numerics.fence(moved_front)
    return Wheels(half_front - moved_front, half_front + moved_front, half_rear - moved_rear, half_rear + moved_rear)


def limit_transfer(moved: Any, half: Any) -> Any:
    """What moves from the left to the right wheel, N, no more than `half` of the axle's load."""
    return jnp.clip(moved, -half, half)


def axle_loads(car: AxleWeights, a_x: Any, g_z: Any) -> tuple[Any, Any]:
    """Loads of the front and the rear axle, N: `m (-g_z b - a_x h) / (a + b)` and the rest of the weight, none below zero."""
    a, b = car.front_axle_to_cg, car.rear_axle_to_cg
    weight = -car.mass * g_z
    moved = car.mass * car.cg_height / (a + b) * a_x
    front = jnp.clip(weight * (b / (a + b)) - moved, 0.0, weight)
    return front, weight - front

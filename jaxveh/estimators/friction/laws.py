"""Axle forces of a car's file on a road of any friction, and the sensitivity of a force to that friction."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.car_file import lean_of
from jaxveh.estimators.delays import unit_delay
from jaxveh.estimators.friction import brush_curve
from jaxveh.estimators.two_axles import AbstractAxleForces
from jaxveh.io import CarSpecification
from jaxveh.tyres import kit as tyres
from jaxveh.vehicles import GRAVITY

LEAST_FRICTION = 0.02
"""Lower limit of the friction by which a slip is divided."""


class SimilarCurve(eqx.Module):
    """An axle's force over its slip, scaled by friction with the similarity method (Pacejka, 3rd ed., sec. 4.2):

        F = mu f D sin(C atan(x - E (x - atan x))),    x = k K s / (C D mu)

    `stiffness` K (N/rad, longitudinally N) at the static load, independent of friction; `peak` D (N) at the static load on the
    road on which the file's parameters hold; `shape` C, `bend` E (-). f is load over static load, k a factor on the stiffness.
    `brush` (-, 0 to 1): the share of the brush model's curve of the same stiffness and peak, which saturates later.
    """

    stiffness: jax.Array = positive("N/rad")
    peak: jax.Array = positive("N")
    shape: jax.Array = positive("-")
    bend: jax.Array = parameter("-", scale=2.0)
    brush: jax.Array = parameter("-", scale=1.0, default=0.0)

    def of_a_wheel(self, ratio=1.0) -> SimilarCurve:
        """The curve of one of the axle's two wheels, with `ratio` times its stiffness."""
        return SimilarCurve(0.5 * ratio * self.stiffness, 0.5 * self.peak, self.shape, self.bend, self.brush)

    def along(self, stiffness, shape) -> SimilarCurve:
        """The longitudinal curve of one of the axle's two wheels, with its own stiffness and shape C, and no bend."""
        return SimilarCurve(stiffness, 0.5 * self.peak, shape, jnp.zeros_like(self.bend), self.brush)

    def force(self, slip, friction, load=1.0, factor=1.0):
        """Force (N) of the axle at a slip (rad, or -), `load` over the static one, `factor` on the stiffness."""
        friction = jnp.maximum(friction, LEAST_FRICTION)
        x = self.stiffness * factor / (self.shape * self.peak) * slip / friction
        bent = x - self.bend * (x - numerics.arctan(x))
        magic = friction * load * self.peak * numerics.sin(self.shape * numerics.arctan(bent))
        later = brush_curve.force(slip, self.stiffness * factor * load, friction * load * self.peak)
        return magic + self.brush * (later - magic)

    def with_slope(self, slip, friction, load=1.0, factor=1.0):
        """The force (N) and its slope over the slip (N/rad)."""
        slip = jnp.asarray(slip)
        return jax.jvp(lambda s: self.force(s, friction, load, factor), (slip,), (jnp.ones_like(slip),))

    def sensitivity(self, slip, friction, load=1.0, factor=1.0):
        """The derivative of the force (N) by the friction's logarithm: `dF / d ln mu = F - s dF/ds`, for every tyre law that
        friction scales in this way. The linear part of a force contributes nothing to it.

        It bounds the accuracy: from a force with a standard deviation of `std` (N), that of ln mu is at least
        `std / |dF / d ln mu|`.
        """
        force, slope = self.with_slope(slip, friction, load, factor)
        return force - slip * slope


class PlanarCar(AbstractAxleForces):
    """The car's parameters that the methods need, each a leaf; `planar_car` has defaults for those that a file may lack.

    `lean` (-): by which share the measured lateral acceleration is larger because the body leans; `late` (s): the delay of the
    inertial sensors against the steering angle sensor."""

    front: SimilarCurve
    rear: SimilarCurve
    cg_height: jax.Array = parameter("m", scale=0.5)
    half_track: jax.Array = positive("m")
    front_drive: jax.Array = parameter("-", scale=0.5)
    front_brake: jax.Array = parameter("-", scale=0.5)
    lean: jax.Array = parameter("-", scale=0.05)
    late: jax.Array = positive("s")
    steer_offset: jax.Array = parameter("rad", scale=0.003, default=0.0)

    def static_loads(self):
        """Loads of both axles, N."""
        weight = self.mass * GRAVITY / self.wheelbase
        return weight * self.rear_axle_to_cg, weight * self.front_axle_to_cg

    def load_ratios(self, a_x):
        """Loads of both axles over the static ones under a longitudinal acceleration (m/s^2)."""
        moved = a_x * self.cg_height / GRAVITY
        least = lambda ratio: jnp.maximum(ratio, 0.1)
        return least(1.0 - moved / self.rear_axle_to_cg), least(1.0 + moved / self.front_axle_to_cg)

    def slip_angles(self, steer, v_x, v_y, yaw_rate, steer_rear=0.0):
        """Slip angles of both axles, rad, with the measured `steer` and the angle `steer_rear` of the rear wheels; `v_x` (m/s)
        well above zero."""
        front = steer - self.steer_offset - numerics.arctan((v_y + self.front_axle_to_cg * yaw_rate) / v_x)
        return front, steer_rear - numerics.arctan((v_y - self.rear_axle_to_cg * yaw_rate) / v_x)


def planar_car(car: CarSpecification) -> PlanarCar:
    """The car of a file. Missing values have defaults: a centre of gravity 0.55 m high, a track of 1.5 m, half of the drive and
    0.65 of the brakes in front; a tyre without a curve has the shape and the friction of `tyres.kit.GENERIC_TYRE`."""
    told = lambda value, otherwise: otherwise if value is None else value
    tracks = [track for track in (car.track_front, car.track_rear) if track is not None] or [1.5]
    weight = car.mass * GRAVITY / car.wheelbase
    curves = [
        _curve(getattr(car, axle), getattr(car, f"{axle}_cornering_stiffness"), load)
        for axle, load in (("front", weight * car.rear_axle_to_cg), ("rear", weight * car.front_axle_to_cg))
    ]
    return PlanarCar(
        mass=car.mass, yaw_inertia=car.yaw_inertia, front_axle_to_cg=car.front_axle_to_cg,
        rear_axle_to_cg=car.rear_axle_to_cg, cg_height=told(car.cg_height, 0.55), half_track=0.5 * sum(tracks) / len(tracks),
        front=curves[0], rear=curves[1], front_drive=told(car.front_drive, 0.5), front_brake=told(car.front_brake, 0.65),
        lean=lean_of(car), late=unit_delay(car), steer_offset=told(car.steer_offset, 0.0),
    )  # fmt: skip


def _curve(tyre, stiffness: float, load: float) -> SimilarCurve:
    ordinary = tyres.GENERIC_TYRE
    if tyre is None:
        return SimilarCurve(stiffness, ordinary.friction * load, ordinary.C, ordinary.E)
    peak = tyre.D if tyre.nominal_load is None else tyre.D * load / tyre.nominal_load
    return SimilarCurve(stiffness, peak, tyre.C, tyre.E)

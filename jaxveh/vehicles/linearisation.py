"""The linear single-track model of any car, with the same tyre slopes at zero slip."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from jaxveh._core.errors import check_has, check_kind
from jaxveh.tyres import AbstractDynamicTyre, AbstractTyre, Contact
from jaxveh.vehicles.base import GRAVITY, AbstractVehicle, innermost_car
from jaxveh.vehicles.fourteen_dof import FourteenDOF
from jaxveh.vehicles.linear_handling import LinearSingleTrack
from jaxveh.vehicles.steering import FrontSteering

SPEED = 20.0
"""m/s: the speed for tyres that need one."""


def linear_single_track(car: Any, *, cg_height: Any = None) -> LinearSingleTrack:
    """The linear single track with the mass, inertia and geometry of `car` and the slopes of its tyres under static loads.

    `car` is a single track, whose tyres are those of the axles, or a car with tracks, whose tyres are those of the wheels. In
    the second case the stiffness of an axle is twice that of a wheel with half its load. The `steering` is that of the car. The
    slope is that of the lateral force over slip angle at zero slip (of the steady force for a tyre with states). The centre of
    gravity is that of the whole car: that of a `FourteenDOF` lies some centimetres from that of its sprung mass. With a
    `cg_height` (m) the stiffness is proportional to load, see `LinearSingleTrack`. Of a car inside another (`AntiLock`,
    `Steered`, ...) it is the model of the inner one, and of a `LinearSingleTrack` that car itself with the given `cg_height`.

    **Raises** `InputError` for a car without mass, yaw inertia, axle distances or tyres.
    """
    car = innermost_car(car)
    if isinstance(car, LinearSingleTrack):
        return dataclasses.replace(car, cg_height=cg_height)
    check_kind(
        "linear_single_track: car", car, AbstractVehicle, "vehicles.from_specification makes one of a car's file."
    )
    needed = ("mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg", "front", "rear")
    check_has("linear_single_track: car", car, needed)
    whole = car.whole if isinstance(car, FourteenDOF) else car
    a, b = whole.front_axle_to_cg, whole.rear_axle_to_cg
    weight = whole.mass * GRAVITY / (a + b)
    wheels = 2.0 if hasattr(car, "track_front") else 1.0
    return LinearSingleTrack(
        mass=whole.mass,
        yaw_inertia=whole.yaw_inertia,
        front_axle_to_cg=a,
        rear_axle_to_cg=b,
        front_stiffness=wheels * settled_stiffness(car.front, weight * b / wheels),
        rear_stiffness=wheels * settled_stiffness(car.rear, weight * a / wheels),
        cg_height=cg_height,
        steering=getattr(car, "steering", FrontSteering()),
    )


def settled_stiffness(tyre: AbstractTyre, load: Any) -> jax.Array:
    """The slope of the lateral force over slip angle at zero slip, N/rad, under a `load` (N); for a tyre with states that of its
    steady force."""
    load = jnp.asarray(load)

    def force(slip_angle):
        contact = Contact(slip_angle=slip_angle, load=load, speed=jnp.asarray(SPEED, load.dtype))
        state = tyre.start(contact) if isinstance(tyre, AbstractDynamicTyre) else None
        return tyre.forces(contact, state).F_y

    zero = jnp.zeros_like(load)
    return jax.jvp(force, (zero,), (jnp.ones_like(zero),))[1]

"""Any car as the linear single track with the same slopes."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError
from jaxveh.tyres import AbstractDynamicTyre, AbstractTyre, Contact
from jaxveh.vehicles.base import GRAVITY
from jaxveh.vehicles.linear_handling import LinearSingleTrack
from jaxveh.vehicles.steering import FrontSteering

SPEED = 20.0
"""m/s: what tyres that ask for a speed are told."""


def linear_single_track(car: Any, *, cg_height: Any = None) -> LinearSingleTrack:
    """The linear single track with the mass, inertia and geometry of `car` and the slopes of its tyres at rest.

    `car` is a single track, whose tyres are the axles', or a car with tracks, whose tyres are the wheels': an axle's stiffness
    is then twice that of a wheel that carries half its load. Its `steering` is the car's. The slope is that of the lateral
    force over slip angle at zero slip (of the settled force, for a tyre with states). `cg_height` (m) makes stiffness
    proportional to load; see `LinearSingleTrack`.

    **Raises** `InputError` for a car without mass, yaw inertia, axle distances or tyres.
    """
    needed = ("mass", "yaw_inertia", "front_axle_to_cg", "rear_axle_to_cg", "front", "rear")
    missing = [name for name in needed if not hasattr(car, name)]
    if missing:
        raise InputError(f"linear_single_track: {type(car).__name__} has no {', '.join(missing)}.")
    a, b = car.front_axle_to_cg, car.rear_axle_to_cg
    weight = car.mass * GRAVITY / (a + b)
    wheels = 2.0 if hasattr(car, "track_front") else 1.0
    return LinearSingleTrack(
        mass=car.mass,
        yaw_inertia=car.yaw_inertia,
        front_axle_to_cg=a,
        rear_axle_to_cg=b,
        front_stiffness=wheels * settled_stiffness(car.front, weight * b / wheels),
        rear_stiffness=wheels * settled_stiffness(car.rear, weight * a / wheels),
        cg_height=cg_height,
        steering=getattr(car, "steering", FrontSteering()),
    )


def settled_stiffness(tyre: AbstractTyre, load: Any) -> jax.Array:
    """Slope of the lateral force over slip angle at zero slip, N/rad, under a `load` (N); of the settled force where the tyre has
    states."""
    load = jnp.asarray(load)

    def force(slip_angle):
        contact = Contact(slip_angle=slip_angle, load=load, speed=jnp.asarray(SPEED, load.dtype))
        state = tyre.start(contact) if isinstance(tyre, AbstractDynamicTyre) else None
        return tyre.forces(contact, state).F_y

    zero = jnp.zeros_like(load)
    return jax.jvp(force, (zero,), (jnp.ones_like(zero),))[1]

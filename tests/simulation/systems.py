"""Cars for simulations."""

import jax.numpy as jnp

from jaxveh import tyres, vehicles

NUMBERS = dict(
    mass=1500.0, yaw_inertia=2500.0, front_axle_to_cg=1.2, rear_axle_to_cg=1.4, track_front=1.5, track_rear=1.52, cg_height=0.5
)  # fmt: skip


def seven(**more):
    """A 7-DOF car on brush tyres."""
    tyre = tyres.Brush(80000.0, 60000.0, 1.0)
    return vehicles.SevenDOF(**NUMBERS, front=tyre, rear=tyre, **more)


def light(**more):
    """The same without spins: nothing in it is stiff, and it compiles in a third of the time."""
    tyre = tyres.Brush(80000.0, 60000.0, 1.0)
    return vehicles.TwoTrack3DOF(**NUMBERS, front=tyre, rear=tyre, **more)


def peak(values):
    return float(jnp.max(jnp.abs(jnp.asarray(values))))

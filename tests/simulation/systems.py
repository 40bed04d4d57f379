"""Cars for simulations."""

import jax.numpy as jnp

from jaxveh import tyres, vehicles


def seven(**more):
    """A 7-DOF car on brush tyres."""
    tyre = tyres.Brush(80000.0, 60000.0, 1.0)
    return vehicles.SevenDOF(1500.0, 2500.0, 1.2, 1.4, 1.5, 1.52, 0.5, tyre, tyre, **more)


def light(**more):
    """The same without spins: nothing in it is stiff, and it compiles in a third of the time."""
    tyre = tyres.Brush(80000.0, 60000.0, 1.0)
    return vehicles.TwoTrack3DOF(1500.0, 2500.0, 1.2, 1.4, 1.5, 1.52, 0.5, tyre, tyre, **more)


def peak(values):
    return float(jnp.max(jnp.abs(jnp.asarray(values))))

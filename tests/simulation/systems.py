"""Cars for simulations."""

import numpy as np

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


def lightest(**more):
    """The same on one track, for what asks nothing of a wheel: half of that again."""
    tyre = tyres.Brush(160000.0, 120000.0, 1.0)
    numbers = {name: value for name, value in NUMBERS.items() if not name.startswith("track")}
    return vehicles.SingleTrack3DOF(**numbers, front=tyre, rear=tyre, **more)


def peak(values):
    return float(np.max(np.abs(np.asarray(values))))

"""The simple end of the vehicle family, with a state and inputs of each in general position."""

import jax.numpy as jnp
import numpy as np

from jaxveh import vehicles
from jaxveh._core.names import record
from jaxveh.statespace import cast

LINEAR = {
    "mass": 1500.0,
    "yaw_inertia": 2600.0,
    "front_axle_to_cg": 1.2,
    "rear_axle_to_cg": 1.5,
    "front_stiffness": 80e3,
    "rear_stiffness": 110e3,
}


def linear(**more):
    return vehicles.LinearSingleTrack(**{**LINEAR, **more})


def limited(vehicle):
    return vehicles.Commanded(
        vehicle,
        vehicles.SteerLimits(-0.6, 0.6, -0.5, 0.5),
        vehicles.AccelerationLimits(11.5, 7.0, -12.0, 50.0),
    )


MAKERS = {
    "longitudinal": lambda: vehicles.Longitudinal(1500.0, 0.31, 1.1, drag=0.4, rolling_resistance=0.012),
    "kinematic": lambda: vehicles.Kinematic(2.7, 1.5),
    "trailer": lambda: vehicles.KinematicTrailer(2.7, 6.0, 0.8),
    "linear": linear,
    "linear with loads": lambda: linear(cg_height=0.55),
    "crawl": lambda: vehicles.KinematicCrawl(linear(cg_height=0.55, crawl_speed=0.1)),
    "commanded kinematic": lambda: limited(vehicles.Kinematic(2.7, 1.5)),
    "commanded linear": lambda: limited(linear(cg_height=0.55)),
    "commanded single track": lambda: limited(
        vehicles.build(vehicles.sets.passenger_car(), vehicles.SingleTrack, cg_height=0.54)
    ),
}

VALUES = {
    "v_x": 12.0, "v_y": 0.3, "sideslip": 0.04, "yaw": 0.5, "yaw_rate": 0.2, "hitch_angle": -0.3, "steer": 0.08,
    "drive_torque": 300.0, "brake_torque": 120.0, "v_x_rate": 1.5, "steer_rate": 0.1, "acceleration": 1.2,
}  # fmt: skip


def point(vehicle, dtype=float, **replaced):
    """A state and inputs, fields replaced by name (in whichever of the two they are)."""
    values = {name: jnp.asarray(np.asarray(value, dtype)) for name, value in {**VALUES, **replaced}.items()}
    x = vehicle.state_type(**{name: values[name] for name in vehicle.state_type._fields})
    return x, record("Inputs", {name: values[name] for name in vehicle.inputs})


def made(name, dtype=float):
    return cast(MAKERS[name](), dtype)

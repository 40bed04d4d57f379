"""The parameters of the car with fourteen degrees of freedom."""

from __future__ import annotations

from dataclasses import KW_ONLY
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh._core.parameter import parameter, positive
from jaxveh.vehicles.drive import AbstractDriven
from jaxveh.vehicles.two_track import AbstractTwoTrack


class Whole(NamedTuple):
    """Body and wheels of a car together: `mass` (kg), `yaw_inertia` (kg m^2, about the centre of gravity of the whole car), and
    the distances of the axles from it (m)."""

    mass: Any
    yaw_inertia: Any
    front_axle_to_cg: Any
    rear_axle_to_cg: Any


class AbstractSuspendedTwoTrack(AbstractDriven, AbstractTwoTrack):
    """A two-track car with suspensions, whose wheels have masses of their own.

    **Parameters** of body and suspensions: `sprung_mass` (kg), `unsprung_mass_front`, `unsprung_mass_rear` (kg, per wheel);
    `roll_inertia`, `pitch_inertia`, `yaw_inertia` (kg m^2, of the sprung mass about its centre of gravity), `roll_yaw_product`
    (kg m^2, the integral of x z dm). The distances of the axles and `cg_height` are also those of the sprung mass, at rest.
    `spring_`, `damper_`, `anti_roll_` `front` and `rear` (N/m, N s/m at the wheel; N per m of difference of the wheels'
    travels); `roll_centre_` (m over the road), `pitch_slope_` (-); `tyre_stiffness` (N/m), `tyre_damping` (N s/m);
    `wheel_inertia` (kg m^2, about the axle; that about other axes belongs to the body); `toe_` (rad, inwards), `camber_` (rad,
    tops outwards), `ackermann` (-; 0: both front wheels have the same angle, 1: their axes meet in one point on the line of the
    rear axle). `wheel_radius` is the unloaded radius.
    """

    _: KW_ONLY
    sprung_mass: jax.Array = positive("kg")
    unsprung_mass_front: jax.Array = positive("kg")
    unsprung_mass_rear: jax.Array = positive("kg")
    roll_inertia: jax.Array = positive("kg m^2")
    pitch_inertia: jax.Array = positive("kg m^2")
    yaw_inertia: jax.Array = positive("kg m^2")
    spring_front: jax.Array = positive("N/m")
    spring_rear: jax.Array = positive("N/m")
    damper_front: jax.Array = parameter("N s/m", scale=1500.0)
    damper_rear: jax.Array = parameter("N s/m", scale=1500.0)
    roll_yaw_product: jax.Array = parameter("kg m^2", scale=50.0, default=0.0)
    anti_roll_front: jax.Array = parameter("N/m", scale=1e4, default=0.0)
    anti_roll_rear: jax.Array = parameter("N/m", scale=1e4, default=0.0)
    roll_centre_front: jax.Array = parameter("m", scale=0.1, default=0.0)
    roll_centre_rear: jax.Array = parameter("m", scale=0.1, default=0.0)
    pitch_slope_front: jax.Array = parameter("-", scale=0.1, default=0.0)
    pitch_slope_rear: jax.Array = parameter("-", scale=0.1, default=0.0)
    tyre_stiffness: jax.Array = positive("N/m", default=2.2e5)
    tyre_damping: jax.Array = parameter("N s/m", scale=100.0, default=50.0)
    wheel_inertia: jax.Array = positive("kg m^2", default=1.2)
    toe_front: jax.Array = parameter("rad", scale=0.005, default=0.0)
    toe_rear: jax.Array = parameter("rad", scale=0.005, default=0.0)
    camber_front: jax.Array = parameter("rad", scale=0.02, default=0.0)
    camber_rear: jax.Array = parameter("rad", scale=0.02, default=0.0)
    ackermann: jax.Array = parameter("-", scale=1.0, default=0.0)

    @property
    def mass(self) -> jax.Array:
        """The mass of the whole car, kg."""
        return self.sprung_mass + 2.0 * (self.unsprung_mass_front + self.unsprung_mass_rear)

    @property
    def whole(self) -> Whole:
        """The car with its wheels, at rest: its centre of gravity is not that of the sprung mass."""
        length = self.front_axle_to_cg + self.rear_axle_to_cg
        front, rear = 2.0 * self.unsprung_mass_front, 2.0 * self.unsprung_mass_rear
        a = (self.sprung_mass * self.front_axle_to_cg + rear * length) / self.mass
        b = length - a
        inertia = self.yaw_inertia + self.sprung_mass * jnp.square(a - self.front_axle_to_cg)
        inertia = inertia + front * (jnp.square(a) + 0.25 * jnp.square(self.track_front))
        return Whole(self.mass, inertia + rear * (jnp.square(b) + 0.25 * jnp.square(self.track_rear)), a, b)

"""The linear single-track model that is kinematic at crawl speed."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_positive, word_for
from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.base import AbstractVehicle, Motion, over_ground, with_batch_shape
from jaxveh.vehicles.linear_handling import LinearSingleTrack


class KinematicCrawl(AbstractVehicle):
    """`vehicle` without wheel slip below the speed `below` (m/s, 0.1 by default): CommonRoad's ST model (Althoff & Würsching,
    CommonRoad: Vehicle Models, 2020).

    Below this speed, with beta_0 = atan(b tan(delta) / L) and v the speed of the centre of gravity along its path, the car moves
    with the sideslip beta_0 and the yaw rate `v cos(beta_0) tan(delta) / L`, and the states follow the steer:

        dbeta/dt = b ddelta/dt / (L cos^2(delta) (1 + (b tan(delta) / L)^2))
        dr/dt    = (dv/dt cos(beta) tan(delta) - v sin(beta) dbeta/dt tan(delta) + v cos(beta) ddelta/dt / cos^2(delta)) / L

    At this speed the motion jumps between the kinematic one and that of the states. If a smooth model is needed, use the
    vehicle's own `crawl_speed` instead. To reproduce CommonRoad's numbers the vehicle's `crawl_speed` must not exceed `below`.

    **Erratum**: commonroad-vehicle-models 3.0.2 has tan^2(delta) for tan(delta) inside the last square of dbeta/dt.

    **Inputs**: those of the vehicle, `steer_rate` (rad/s) and `v_x_rate` (m/s^2).

    **Raises** `InputError` for a vehicle other than `LinearSingleTrack`, a vehicle with steered rear wheels, or a speed that is
    not positive.
    """

    vehicle: LinearSingleTrack
    below: float = eqx.field(static=True, default=0.1)

    def __check_init__(self):
        if not isinstance(self.vehicle, LinearSingleTrack):
            raise InputError(f"KinematicCrawl.vehicle = {word_for(self.vehicle)}: must be a LinearSingleTrack.")
        if not self.vehicle.steering.front_alone:
            raise InputError(
                f"KinematicCrawl.vehicle.steering = {word_for(self.vehicle.steering)}: must steer only the front wheels. "
                "Use the vehicle without KinematicCrawl: its own crawl_speed works with any steering."
            )
        check_positive("KinematicCrawl.below", self.below, "m/s")

    @property
    def inputs(self):
        return ("steer", "v_x", "v_x_rate", "steer_rate")

    @property
    def state_type(self):
        return self.vehicle.state_type

    @property
    def units(self):
        return self.vehicle.units | {"steer_rate": "rad/s", "v_x_rate": "m/s^2"}

    @property
    def wheel_positions(self):
        return self.vehicle.wheel_positions

    def start(self, t, u, **values):
        return self.vehicle.start(t, u, **values)

    def motion(self, x, u):
        slipping, slow = self.vehicle.motion(x, u), self._slow(u)
        bend = numerics.tan(u.steer) / self.vehicle.wheelbase
        sideslip = numerics.arctan(self.vehicle.rear_axle_to_cg * bend)
        v_x = u.v_x * numerics.cos(sideslip)
        v_y = u.v_x * numerics.sin(sideslip)
        return Motion(
            0.0,
            0.0,
            x.yaw,
            jnp.where(slow, v_x, slipping.v_x),
            jnp.where(slow, v_y, slipping.v_y),
            jnp.where(slow, v_x * bend, x.yaw_rate),
        )

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        rates, outputs = self.vehicle.evaluate(t, x, u, ground)
        slow, moves = self._slow(u), self.motion(x, u)
        length = self.vehicle.wheelbase
        tangent = numerics.tan(u.steer)
        # d tan(delta) / dt
        bending = (1.0 + tangent * tangent) * u.steer_rate
        lean = self.vehicle.rear_axle_to_cg / length
        sideslip_rate = lean * bending / (1.0 + (lean * tangent) * (lean * tangent))
        along, across = numerics.cos(x.sideslip), numerics.sin(x.sideslip)
        turned = u.v_x_rate * along * tangent - u.v_x * across * sideslip_rate * tangent + u.v_x * along * bending
        yaw_acceleration = jnp.where(slow, turned / length, rates.yaw_rate)
        rates = rates._replace(
            sideslip=jnp.where(slow, sideslip_rate, rates.sideslip), yaw=moves.yaw_rate, yaw_rate=yaw_acceleration
        )
        shown = outputs._replace(
            v_x=moves.v_x,
            v_y=moves.v_y,
            yaw_rate=moves.yaw_rate,
            yaw_acceleration=yaw_acceleration,
            **over_ground(moves.yaw, moves.v_x, moves.v_y),
        )
        return rates, with_batch_shape(shown)

    def _slow(self, u):
        return jnp.abs(u.v_x) < self.below

"""A kinematic single-track model with a trailer."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import check
from jaxveh._core.parameter import parameter, positive
from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.base import OVER_GROUND, Motion, given_or_zero, over_ground, with_batch_shape
from jaxveh.vehicles.kinematic import AbstractKinematic
from jaxveh.vehicles.steering import STEER_UNITS
from jaxveh.vehicles.wheels import gravity, is_straight


class KinematicTrailerState(NamedTuple):
    """The `yaw` of the car and the `hitch_angle` (rad): the trailer's yaw less the car's, unwrapped."""

    yaw: Any
    hitch_angle: Any


class KinematicTrailerOutputs(NamedTuple):
    """The kinematic outputs at the car's rear axle: speeds m/s, angles rad, rates rad/s, accelerations m/s^2 (signals of an
    ideal accelerometer in a turn of constant speed and steer); `trailer_yaw` (rad), and `trailer_v_x` (m/s), the speed of the
    trailer's axle along the trailer; `speed` and `course` over ground."""

    v_x: Any
    v_y: Any
    yaw: Any
    yaw_rate: Any
    a_x: Any
    a_y: Any
    sideslip: Any
    hitch_angle: Any
    hitch_rate: Any
    trailer_yaw: Any
    trailer_v_x: Any
    speed: Any
    course: Any


UNITS = {
    **dict.fromkeys(("v_x", "v_y", "trailer_v_x"), "m/s"),
    **dict.fromkeys(("a_x", "a_y"), "m/s^2"),
    **dict.fromkeys(("yaw", "sideslip", "hitch_angle", "trailer_yaw"), "rad"),
    **dict.fromkeys(("yaw_rate", "hitch_rate"), "rad/s"),
    **OVER_GROUND,
    **STEER_UNITS,
}


class KinematicTrailer(AbstractKinematic):
    """A kinematic single track with a one-axle trailer, without wheel slip. Position and speeds are those of the rear axle.

    With delta the steer, r the yaw rate, alpha the hitch angle, c the distance of the hitch behind the rear axle and l the
    distance from the hitch to the trailer's axle (S. M. LaValle, Planning Algorithms, 2006, sec. 13.1.2, and CommonRoad's KST
    model for c = 0):

        dyaw/dt   = v_x tan(delta) / L
        dalpha/dt = -(v_x sin(alpha) + c r cos(alpha)) / l - r

    A rear axle steered by delta_r moves to the left with v_y = v_x tan(delta_r): the yaw rate is that of `Kinematic`, and
    c r - v_y replaces c r. At `hitch_limit` (rad to both sides, a right angle by default) the trailer touches the car, and the
    angle does not grow further.

    **Parameters**: `wheelbase` L (m), `trailer_length` l (m), `hitch_behind_axle` c (m; 0: the hitch is on the rear axle).

    **Inputs**: those of `steering` (`steer`, rad at the road wheels) and `v_x` (m/s).

    **Raises** `InputError` for parameters outside their domain.
    """

    trailer_length: jax.Array = positive("m")
    hitch_behind_axle: jax.Array = parameter("m", scale=1.0, default=0.0)
    hitch_limit: float = eqx.field(static=True, default=math.pi / 2)

    def __check_init__(self):
        check("KinematicTrailer.hitch_limit", self.hitch_limit, lambda v: (v > 0) & (v <= math.pi), "in (0, pi] rad")

    @property
    def state_type(self):
        return KinematicTrailerState

    @property
    def units(self):
        return dict(UNITS)

    @property
    def wheel_positions(self):
        """The positions of the car's wheels; those of the trailer are not included."""
        front, rear = (self.wheelbase, 0.0), (0.0, 0.0)
        return front, front, rear, rear

    def start(self, t, u, **values):
        return given_or_zero(KinematicTrailerState, values, u.v_x, self.wheelbase)

    def motion(self, x, u):
        yaw_rate = u.v_x * self.curvature(u)
        aside = self.rear_aside(u)
        v_y = jnp.zeros_like(yaw_rate) if is_straight(aside) else u.v_x * aside
        return Motion(0.0, 0.0, x.yaw, u.v_x, v_y, yaw_rate)

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        del t
        g_x, g_y, _ = gravity(ground)
        moves = self.motion(x, u)
        yaw_rate = moves.yaw_rate
        sine, cosine = numerics.sin(x.hitch_angle), numerics.cos(x.hitch_angle)
        # The hitch moves with (v_x, v_y - c r) in the car's axes. The component across the trailer is l times the trailer's yaw
        # rate.
        aside = self.rear_aside(u)
        swing = self.hitch_behind_axle * yaw_rate
        swing = swing if is_straight(aside) else swing - moves.v_y
        turning = -(u.v_x * sine + swing * cosine) / self.trailer_length - yaw_rate
        outwards = turning * jnp.sign(x.hitch_angle) > 0
        hitch_rate = jnp.where((jnp.abs(x.hitch_angle) >= self.hitch_limit) & outwards, 0.0, turning)
        outputs = KinematicTrailerOutputs(
            v_x=u.v_x,
            v_y=moves.v_y,
            yaw=x.yaw,
            yaw_rate=yaw_rate,
            a_x=-g_x if is_straight(aside) else -moves.v_y * yaw_rate - g_x,
            a_y=u.v_x * yaw_rate - g_y,
            sideslip=aside if is_straight(aside) else numerics.arctan(aside),
            hitch_angle=x.hitch_angle,
            hitch_rate=hitch_rate,
            trailer_yaw=x.yaw + x.hitch_angle,
            trailer_v_x=u.v_x * cosine - swing * sine,
            **over_ground(x.yaw, u.v_x, moves.v_y),
        )
        return KinematicTrailerState(yaw_rate, hitch_rate), with_batch_shape(outputs)

"""The kinematic single-track model: wheels without slip."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax

from jaxveh import numerics
from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.base import OVER_GROUND, Motion, given_or_zero, over_ground, with_batch_shape
from jaxveh.vehicles.steering import STEER_UNITS, AbstractSteeredByRoadWheels, axle_angles
from jaxveh.vehicles.wheels import gravity, is_straight


class KinematicState(NamedTuple):
    """`yaw` (rad, unwrapped)."""

    yaw: Any


class KinematicOutputs(NamedTuple):
    """The kinematic outputs at the reference point: speeds m/s, angles rad, rates rad/s, accelerations m/s^2.

    `a_x` and `a_y` are the signals of an ideal accelerometer in a turn of constant speed and steer. `sideslip` follows from the
    steer, in the same way forwards, backwards and at standstill. `curvature` (1/m) is the yaw rate over `v_x`, which is the
    curvature of the rear axle's path if the rear axle is not steered. `speed` and `course` are over ground.
    """

    v_x: Any
    v_y: Any
    yaw: Any
    yaw_rate: Any
    a_x: Any
    a_y: Any
    sideslip: Any
    curvature: Any
    speed: Any
    course: Any


UNITS = {
    **dict.fromkeys(("v_x", "v_y"), "m/s"),
    **dict.fromkeys(("a_x", "a_y"), "m/s^2"),
    **dict.fromkeys(("yaw", "sideslip"), "rad"),
    "yaw_rate": "rad/s",
    "curvature": "1/m",
    **OVER_GROUND,
    **STEER_UNITS,
}


class AbstractKinematic(AbstractSteeredByRoadWheels):
    """A car without wheel slip, steered at a given speed.

    **Raises** `InputError` for parameters outside their domain.
    """

    wheelbase: jax.Array = positive("m")

    def __check_init__(self):
        check_parameters(self)

    @property
    def inputs(self):
        return (*self.steering.inputs, "v_x")

    def curvature(self, u: Any) -> Any:
        """The yaw rate over `v_x`, 1/m: the curvature of the rear axle's path if this axle is not steered."""
        front, rear = self._tangents(u)
        return (front if is_straight(rear) else front - rear) / self.wheelbase

    def rear_aside(self, u: Any) -> Any:
        """The lateral over the forward speed at the rear axle (-); 0.0 if it is not steered."""
        return self._tangents(u)[1]

    def _tangents(self, u: Any) -> tuple[Any, Any]:
        front, rear = axle_angles(self.steering.angles(self, u, u.v_x))
        return numerics.tan(front), rear if is_straight(rear) else numerics.tan(rear)


class Kinematic(AbstractKinematic):
    """A single track without wheel slip: accurate at walking speed, and the usual model for path planning.

    With delta_f and delta_r the angles of the axles, L the wheelbase and d the distance of the reference point ahead of the rear
    axle (R. Rajamani, Vehicle Dynamics and Control, 2nd ed., sec. 2.2, with v_x along the car instead of the speed along the
    path):

        dyaw/dt = v_x (tan(delta_f) - tan(delta_r)) / L,    v_y = v_x tan(delta_r) + d dyaw/dt,    sideslip = atan(v_y / v_x)

    **Parameters**: `wheelbase` (m), `rear_axle_to_reference` (m, the distance d of the reference point of position and speeds
    ahead of the rear axle; 0: the rear axle itself).

    **Inputs**: those of `steering` (`steer`, rad at the road wheels) and `v_x` (m/s), which is the same at all points of the
    car's longitudinal axis.

    **Raises** `InputError` for parameters outside their domain.
    """

    rear_axle_to_reference: jax.Array = parameter("m", scale=1.0, default=0.0)

    @property
    def state_type(self):
        return KinematicState

    @property
    def units(self):
        return dict(UNITS)

    @property
    def wheel_positions(self):
        front = (self.wheelbase - self.rear_axle_to_reference, 0.0)
        rear = (-self.rear_axle_to_reference, 0.0)
        return front, front, rear, rear

    def start(self, t, u, **values):
        return given_or_zero(KinematicState, values, u.v_x, self.wheelbase)

    def motion(self, x, u):
        yaw_rate = u.v_x * self.curvature(u)
        turning, aside = self.rear_axle_to_reference * yaw_rate, self.rear_aside(u)
        return Motion(0.0, 0.0, x.yaw, u.v_x, turning if is_straight(aside) else turning + u.v_x * aside, yaw_rate)

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        del t
        g_x, g_y, _ = gravity(ground)
        moves, curvature, aside = self.motion(x, u), self.curvature(u), self.rear_aside(u)
        lean = self.rear_axle_to_reference * curvature
        outputs = KinematicOutputs(
            v_x=u.v_x,
            v_y=moves.v_y,
            yaw=x.yaw,
            yaw_rate=moves.yaw_rate,
            a_x=-moves.v_y * moves.yaw_rate - g_x,
            a_y=u.v_x * moves.yaw_rate - g_y,
            sideslip=numerics.arctan(lean if is_straight(aside) else lean + aside),
            curvature=curvature,
            **over_ground(x.yaw, u.v_x, moves.v_y),
        )
        return KinematicState(moves.yaw_rate), with_batch_shape(outputs)

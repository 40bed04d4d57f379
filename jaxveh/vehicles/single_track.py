"""The single-track (bicycle) model: lateral velocity, yaw and yaw rate at a given forward speed."""

from __future__ import annotations

from dataclasses import KW_ONLY
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check
from jaxveh._core.names import record_type
from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh.roads import LEVEL, Ground
from jaxveh.tyres import Contact, Forces
from jaxveh.vehicles.base import GRAVITY, OVER_GROUND, Motion, over_ground, with_batch_shape
from jaxveh.vehicles.given_speed import longitudinal_acceleration
from jaxveh.vehicles.shared import AbstractOnAxleTyres
from jaxveh.vehicles.slip import regularised_speed, slip_angle
from jaxveh.vehicles.steering import STEER_UNITS, axle_angles
from jaxveh.vehicles.wheels import gravity, is_straight, travel_direction


class SingleTrackState(NamedTuple):
    """The lateral velocity of the centre of gravity `v_y` (m/s), `yaw` (rad, unwrapped) and `yaw_rate` (rad/s)."""

    v_y: Any
    yaw: Any
    yaw_rate: Any


class SingleTrackOutputs(NamedTuple):
    """The outputs of a single track at one instant, at the centre of gravity, in the body's axes.

    Speeds are in m/s, angles in rad, rates in rad/s, accelerations (those of an ideal accelerometer) in m/s^2, axle forces (in
    the wheel's axes) and loads in N. `sideslip` is `atan2(v_y, v_x)`, zero at standstill; `speed` and `course` are over ground.
    """

    v_x: Any
    v_y: Any
    yaw: Any
    yaw_rate: Any
    yaw_acceleration: Any
    a_x: Any
    a_y: Any
    sideslip: Any
    slip_angle_front: Any
    slip_angle_rear: Any
    F_yf: Any
    F_yr: Any
    load_front: Any
    load_rear: Any
    speed: Any
    course: Any


UNITS = {
    **dict.fromkeys(("v_x", "v_y"), "m/s"),
    **dict.fromkeys(("a_x", "a_y", "v_x_rate"), "m/s^2"),
    **dict.fromkeys(("yaw", "sideslip", "slip_angle_front", "slip_angle_rear"), "rad"),
    "yaw_rate": "rad/s",
    "yaw_acceleration": "rad/s^2",
    **dict.fromkeys(("F_yf", "F_yr", "load_front", "load_rear"), "N"),
    **OVER_GROUND,
    **STEER_UNITS,
}


class SingleTrack(AbstractOnAxleTyres):
    """A vehicle on one track: two axles, a given forward speed, no roll.

    In the body's axes, with delta the angle of the front road wheels, a and b the distances of the axles from the centre of
    gravity and F the lateral forces of the axles (paper of Bao, Sabbioni et al. 2015, in the body's axes with v_x given):

        m (dv_y/dt + v_x r) = F_f cos(delta) + F_r
        J_z dr/dt           = a F_f cos(delta) - b F_r
        alpha_f = delta - atan2(v_y + a r, v_x),   alpha_r = -atan2(v_y - b r, v_x)

    Steered rear wheels enter in the same way. Longitudinal forces and moments enter if the tyre law has them. Slip angles are
    those of `slip_angle`, regularised so that standstill is a regular point.

    **Parameters**: `cg_height` (m; None: axle loads are constant), `steer_offset` (rad: the angle of the front road wheels is
    `u.steer + steer_offset`).

    **Inputs** u: those of `steering` (`steer`, rad at the road wheels), `v_x` (m/s) and, with a `cg_height`, the longitudinal
    acceleration: either `a_x`, the signal of an ideal accelerometer at the centre of gravity, or `v_x_rate = dv_x/dt`, from
    which `a_x = v_x_rate - v_y r`. The load `m a_x h / (a + b)` moves from the front to the rear axle.

    **Raises** `InputError` for a mass, inertia, distance or height that is not positive, and for a tyre that is not a tyre of
    `jaxveh.tyres`.
    """

    _: KW_ONLY
    cg_height: jax.Array | None = positive("m", default=None)
    steer_offset: jax.Array = parameter("rad", scale=0.02, default=0.0)
    own_states: ClassVar[tuple[str, ...]] = SingleTrackState._fields

    def __check_init__(self):
        check_parameters(self)
        check(
            "SingleTrack.steer_offset", self.steer_offset, lambda v: abs(v) < 1.0, "within 1 rad",
            "It is an angle at the road wheels in rad, not degrees.",
        )  # fmt: skip

    @property
    def inputs(self):
        told = (*self.steering.inputs, "v_x")
        return told if self.cg_height is None else (*told, "a_x")

    @property
    def state_type(self):
        """`SingleTrackState`, followed by the states of dynamic tyres as `front_<name>`, `rear_<name>`."""
        extra = self.tyres.state_names
        return record_type("SingleTrackState", (*self.own_states, *extra)) if extra else SingleTrackState

    @property
    def units(self):
        return dict(UNITS)

    def static_loads(self) -> tuple[jax.Array, jax.Array]:
        """The loads of front and rear axle at rest on a level road, N."""
        per_length = self.mass * GRAVITY / self.wheelbase
        return per_length * self.rear_axle_to_cg, per_length * self.front_axle_to_cg

    def motion(self, x, u):
        return Motion(0.0, 0.0, x.yaw, u.v_x, x.v_y, x.yaw_rate)

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        del t
        front_turn, rear_turn = self._directions(u)
        contacts = self._contacts(x, u, front_turn, rear_turn, ground)
        tyres = self.tyres
        states = tyres.states(x)
        front, rear = tyres.forces(contacts, states)
        F_f, F_r = _across(front, front_turn), _across(rear, rear_turn)
        moment = self.front_axle_to_cg * F_f - self.rear_axle_to_cg * F_r + (front.M_z + rear.M_z)
        a_y = (F_f + F_r) / self.mass
        yaw_acceleration = moment / self.yaw_inertia
        drift = a_y - u.v_x * x.yaw_rate if ground is LEVEL else a_y + gravity(ground)[1] - u.v_x * x.yaw_rate
        rates = SingleTrackState(v_y=drift, yaw=x.yaw_rate, yaw_rate=yaw_acceleration)
        outputs = SingleTrackOutputs(
            v_x=u.v_x,
            v_y=x.v_y,
            yaw=x.yaw,
            yaw_rate=x.yaw_rate,
            yaw_acceleration=yaw_acceleration,
            a_x=longitudinal_acceleration(x, u, gravity(ground)[0]),
            a_y=a_y,
            sideslip=numerics.arctan2(x.v_y, u.v_x),
            slip_angle_front=contacts[0].slip_angle,
            slip_angle_rear=contacts[1].slip_angle,
            F_yf=front.F_y,
            F_yr=rear.F_y,
            load_front=contacts[0].load,
            load_rear=contacts[1].load,
            **over_ground(x.yaw, u.v_x, x.v_y),
        )
        return self.state_type(*rates, *tyres.rates(contacts, states)), with_batch_shape(outputs)

    def loads(self, x, u, ground: Ground = LEVEL) -> tuple[jax.Array, jax.Array]:
        """The loads of front and rear axle, N; they can become negative, where a real car would lift an axle."""
        front, rear = self.static_loads()
        if ground is not LEVEL:
            pressed = -gravity(ground)[2] / GRAVITY
            front, rear = front * pressed, rear * pressed
        if self.cg_height is None:
            return front, rear
        if not (hasattr(u, "a_x") or hasattr(u, "v_x_rate")):
            raise InputError(
                f"inputs = {', '.join(u._fields)}: a car with a cg_height needs a_x (or v_x_rate) among them."
            )
        a_x = longitudinal_acceleration(x, u, gravity(ground)[0])
        moved = self.mass * a_x * self.cg_height / self.wheelbase
        return front - moved, rear + moved

    def contacts(self, x, u, ground: Ground = LEVEL) -> tuple[Contact, Contact]:
        """The contacts of front and rear axle with the road: slip angles, loads, speeds."""
        return self._contacts(x, u, *self._directions(u), ground)

    def _directions(self, u) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        """(cosine, sine) of each axle's angle; (1.0, 0.0) for a rear axle that is not steered."""
        front, rear = axle_angles(self.steering.angles(self, u, u.v_x))
        front = front + self.steer_offset
        turned = (1.0, 0.0) if is_straight(rear) else (numerics.cos(rear), numerics.sin(rear))
        return (numerics.cos(front), numerics.sin(front)), turned

    def _contacts(self, x, u, front_turn, rear_turn, ground: Ground) -> tuple[Contact, Contact]:
        front_load, rear_load = self.loads(x, u, ground)
        friction = 0.5 * (ground.friction_fl + ground.friction_fr)
        front = self._contact(u.v_x, x.v_y + self.front_axle_to_cg * x.yaw_rate, front_turn, front_load, friction)
        friction = 0.5 * (ground.friction_rl + ground.friction_rr)
        rear = self._contact(u.v_x, x.v_y - self.rear_axle_to_cg * x.yaw_rate, rear_turn, rear_load, friction)
        return front, rear

    def _contact(self, v_x, v_y, turn: tuple[Any, Any], load, friction) -> Contact:
        cosine, sine = turn
        along, across = (v_x, v_y) if is_straight(sine) else (v_x * cosine + v_y * sine, v_y * cosine - v_x * sine)
        return Contact(
            slip_angle=slip_angle(along, across, self.slip_floor),
            load=load,
            friction=friction,
            speed=jnp.abs(along),
            slip_speed=regularised_speed(along, self.slip_floor),
            direction=travel_direction(along),
        )


def _across(forces: Forces, turn: tuple[Any, Any]) -> Any:
    """The lateral force of an axle in the car's axes, N."""
    cosine, sine = turn
    return forces.F_y if is_straight(sine) else forces.F_y * cosine + forces.F_x * sine

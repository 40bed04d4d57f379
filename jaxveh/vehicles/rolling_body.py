"""The rolling body: accelerations of the coupled motions, and wheel loads through springs and dampers."""

from __future__ import annotations

from dataclasses import KW_ONLY
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import check
from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh.vehicles.base import GRAVITY, Motion
from jaxveh.vehicles.load_transfer import axle_loads, limit_transfer
from jaxveh.vehicles.two_track import AbstractLoadedTwoTrack
from jaxveh.vehicles.wheels import Wheels

NOT_NEGATIVE = ("roll_damping_front", "roll_damping_rear", "roll_centre_front", "roll_centre_rear")


class AbstractRollingTwoTrack(AbstractLoadedTwoTrack):
    """A two-track car with a rolling body: its speed states are those of a point on the roll axis, which does not move relative
    to the wheels.

    **Parameters** of the rolling body: `sprung_mass` (kg, the mass that rolls), `roll_inertia` (kg m^2, of the sprung mass about
    its own centre of gravity), `roll_yaw_product` (kg m^2, the integral of x z dm over the mass that rolls, about the point of
    the roll axis below the car's centre of gravity), `unsprung_height` (m, of the centre of gravity of the mass that does not
    roll), `roll_centre_front`, `roll_centre_rear` (m over the road), `roll_stiffness_front`, `roll_stiffness_rear` (N m/rad, of
    springs and bars), `roll_damping_front`, `roll_damping_rear` (N m s/rad). `load_transfer` gives the accelerations for the
    axle loads and for the part of the lateral load transfer that does not pass through springs and dampers.

    **Raises** `InputError` if the springs are too soft to hold the body upright.
    """

    _: KW_ONLY
    sprung_mass: jax.Array = positive("kg")
    roll_inertia: jax.Array = positive("kg m^2")
    roll_stiffness_front: jax.Array = positive("N m/rad")
    roll_stiffness_rear: jax.Array = positive("N m/rad")
    roll_damping_front: jax.Array = parameter("N m s/rad", scale=1000.0, default=2000.0)
    roll_damping_rear: jax.Array = parameter("N m s/rad", scale=1000.0, default=2000.0)
    roll_centre_front: jax.Array = parameter("m", scale=0.1, default=0.05)
    roll_centre_rear: jax.Array = parameter("m", scale=0.1, default=0.1)
    roll_yaw_product: jax.Array = parameter("kg m^2", scale=50.0, default=0.0)
    unsprung_height: jax.Array = positive("m", default=0.32)

    def __check_init__(self):
        check_parameters(self)
        check_rolling_body(self)

    def motion(self, x, u):
        """The motion of the centre of gravity of the whole car, which moves with roll. A given speed is that of this point."""
        ahead, aside = swing(self, x)
        return Motion(0.0, 0.0, x.yaw, x.v_x + ahead if hasattr(x, "v_x") else u.v_x, x.v_y + aside, x.yaw_rate)

    def wheel_speed(self, x, u):
        """The forward speed of the point on the roll axis, m/s."""
        return x.v_x if hasattr(x, "v_x") else u.v_x - swing(self, x)[0]

    def loads(self, x: Any, a_x: Any, a_y: Any, g_z: Any) -> Wheels:
        return roll_loads(self, x, a_x, a_y, g_z)


def check_rolling_body(car: AbstractRollingTwoTrack) -> None:
    """Raise `InputError` unless the springs hold the body upright and its masses and inertias are physically possible."""
    kind = type(car).__name__
    for name in NOT_NEGATIVE:
        check(f"{kind}.{name}", getattr(car, name), lambda v: v >= 0, "at least 0")
    check(f"{kind}.sprung_mass - {kind}.mass", car.sprung_mass - car.mass, lambda v: v <= 0, "at most 0 (kg)")
    spare = car.yaw_inertia * car.roll_inertia - jnp.square(car.roll_yaw_product)
    check(
        f"{kind}: yaw_inertia * roll_inertia - roll_yaw_product^2", spare, lambda v: v > 0,
        "positive (kg^2 m^4), so that kinetic energy is positive",
    )  # fmt: skip
    geometry = roll_geometry(car)
    check(f"{kind}: height of the sprung mass over the roll axis", geometry.arm, lambda v: v > 0, "positive (m)")
    left = car.roll_stiffness_front + car.roll_stiffness_rear - car.sprung_mass * GRAVITY * geometry.arm
    check(
        f"{kind}: roll stiffness less sprung weight times its height over the roll axis", left, lambda v: v > 0,
        "positive (N m/rad), or the body falls over",
    )  # fmt: skip


class RollGeometry(NamedTuple):
    """The heights (m) of the sprung mass over the road and over the roll axis (`arm`), and the mass (kg) that does not roll."""

    sprung_height: Any
    arm: Any
    unsprung_mass: Any


def roll_geometry(car: AbstractRollingTwoTrack) -> RollGeometry:
    """The position of the sprung mass, from the centre of gravity of the whole car and the height of the unsprung mass.

    The roll axis joins the roll centres. Its height below the centre of gravity is used; its slope is neglected.
    """
    a, b = car.front_axle_to_cg, car.rear_axle_to_cg
    unsprung = car.mass - car.sprung_mass
    height = (car.mass * car.cg_height - unsprung * car.unsprung_height) / car.sprung_mass
    axis = (b * car.roll_centre_front + a * car.roll_centre_rear) / (a + b)
    return RollGeometry(height, height - axis, unsprung)


def swing(car: AbstractRollingTwoTrack, x: Any) -> tuple[Any, Any]:
    """The velocity (forward, left; m/s) of the whole car's centre of gravity relative to the point on the roll axis below it.

    Roll moves the centre of gravity by -h m_s / m sin(phi) to the left. With the yaw rate r and the roll rate p its relative
    velocity in the car's axes is (h m_s / m) (r sin(phi), -p cos(phi)).
    """
    lever = roll_geometry(car).arm * car.sprung_mass / car.mass
    return lever * x.yaw_rate * numerics.sin(x.roll), -lever * x.roll_rate * numerics.cos(x.roll)


class RollAccelerations(NamedTuple):
    """The solution of the equations of motion: `a_x`, `a_y` (m/s^2) of the point on the roll axis without gravity, `yaw`, `roll`
    (rad/s^2)."""

    a_x: Any
    a_y: Any
    yaw: Any
    roll: Any


def roll_accelerations(car: AbstractRollingTwoTrack, x: Any, X: Any, Y: Any, N: Any, g_z: Any) -> RollAccelerations:
    """Solve the equations of motion for the accelerations under forces X, Y (N) and a moment N (N m) about the vertical.

    With phi the roll, p its rate, r the yaw rate, h the arm, S = m_s h, s and c the sine and cosine of phi, the kinetic energy

        T = m (v_x^2 + v_y^2) / 2 + S (v_x r s - v_y p c) + (I_x + S h) p^2 / 2 + (I_z + S h s^2) r^2 / 2 - I_xz p r

    gives by Lagrange's equations in quasi-velocities (a_x = dv_x/dt - v_y r - g_x, a_y = dv_y/dt + v_x r - g_y)

        m a_x + S s dr/dt + 2 S c p r                                   = X
        m a_y - S c dp/dt + S s (p^2 + r^2)                             = Y
        (I_z + S h s^2) dr/dt - I_xz dp/dt + 2 S h s c p r + S s a_x    = N
        (I_x + S h) dp/dt - I_xz dr/dt - S c a_y - S h s c r^2          = -S g_z s - K phi - C p

    a_x and a_y are eliminated, which leaves two equations. X / m and Y / m are the accelerations of the centre of gravity.
    """
    h = roll_geometry(car).arm
    S, s, c = car.sprung_mass * h, numerics.sin(x.roll), numerics.cos(x.roll)
    p, r = x.roll_rate, x.yaw_rate
    stiffness, damping = (
        getattr(car, f"roll_{n}_front") + getattr(car, f"roll_{n}_rear") for n in ("stiffness", "damping")
    )
    side = Y - S * s * (p * p + r * r)
    rolling = -S * g_z * s - stiffness * x.roll - damping * p + S * h * s * c * r * r + S * c * side / car.mass
    ahead = X - 2.0 * S * c * p * r
    turning = N - 2.0 * S * h * s * c * p * r - S * s * ahead / car.mass
    I_r = car.yaw_inertia + S * h * s * s - jnp.square(S * s) / car.mass
    I_p = car.roll_inertia + S * h - jnp.square(S * c) / car.mass
    determinant = I_r * I_p - jnp.square(car.roll_yaw_product)
    yaw = (I_p * turning + car.roll_yaw_product * rolling) / determinant
    roll = (I_r * rolling + car.roll_yaw_product * turning) / determinant
    return RollAccelerations((ahead - S * s * yaw) / car.mass, (side + S * c * roll) / car.mass, yaw, roll)


def roll_loads(car: AbstractRollingTwoTrack, x: Any, a_x: Any, a_y: Any, g_z: Any) -> Wheels:
    """The wheel loads, N, of a car whose body rolls on springs and dampers.

    On each axle, with its share of the masses m_s and m_u at rest, this load moves from the left to the right wheel (W. F. & D.
    L. Milliken, Race Car Vehicle Dynamics, ch. 18):

        (K phi + C p + share a_y (m_s h_rc + m_u h_u)) / track

    The part of springs and dampers follows the roll of the body. The parts of the roll centres (h_rc) and of the unsprung mass
    depend on the a_y of `load_transfer`, the axle loads on its a_x. Loads are never negative: if a wheel lifts, the other wheel
    carries the load of the axle.
    """
    a, b = car.front_axle_to_cg, car.rear_axle_to_cg
    unsprung = roll_geometry(car).unsprung_mass
    front, rear = axle_loads(car, a_x, g_z)
    loads = []
    for axle, load, share, track in (
        ("front", front, b / (a + b), car.track_front),
        ("rear", rear, a / (a + b), car.track_rear),
    ):
        stiffness, damping, centre = (
            getattr(car, f"roll_{name}_{axle}") for name in ("stiffness", "damping", "centre")
        )
        direct = share * (car.sprung_mass * centre + unsprung * car.unsprung_height) * a_y
        half = 0.5 * load
        moved = limit_transfer((stiffness * x.roll + damping * x.roll_rate + direct) / track, half)
        loads += [half - moved, half + moved]
    return Wheels(*loads)


def roll_outputs(x: Any, acceleration: Any) -> dict:
    """The outputs of the roll motion: roll (rad), its rate (rad/s) and acceleration (rad/s^2)."""
    return {"roll": x.roll, "roll_rate": x.roll_rate, "roll_acceleration": acceleration}

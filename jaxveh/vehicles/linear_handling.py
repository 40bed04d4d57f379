"""The textbook linear single-track model and its handling in closed form."""

from __future__ import annotations

from dataclasses import KW_ONLY
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.parameter import positive
from jaxveh.roads import LEVEL, Ground
from jaxveh.vehicles.base import GRAVITY, Motion, given_or_zero, over_ground, with_batch_shape
from jaxveh.vehicles.lateral_system import LateralSystem
from jaxveh.vehicles.shared import AbstractOneTrack
from jaxveh.vehicles.single_track import UNITS, SingleTrackOutputs
from jaxveh.vehicles.slip import regularised_speed
from jaxveh.vehicles.steering import axle_angles
from jaxveh.vehicles.wheels import gravity, is_straight


class LinearSingleTrackState(NamedTuple):
    """`sideslip` of the centre of gravity (rad), `yaw` (rad, unwrapped) and `yaw_rate` (rad/s)."""

    sideslip: Any
    yaw: Any
    yaw_rate: Any


class LinearSingleTrack(AbstractOneTrack):
    """The single-track model for small angles, linear in steer, sideslip and yaw rate at a given speed v.

    With C_f, C_r the axles' cornering stiffnesses, a and b their distances from the centre of gravity (P. Riekert & T. E.
    Schunck 1940; R. Rajamani, Vehicle Dynamics and Control, 2nd ed., sec. 2.3):

        m v (dbeta/dt + r) = F_f + F_r,      J_z dr/dt = a F_f - b F_r
        F_f = C_f (delta - beta - a r / v),  F_r = C_r (-beta + b r / v)

    A rear axle steered by delta_r has the force `C_r (delta_r - beta + b r / v)`. Gains and responses are those to `steer`, with
    the rear angle that `steering` gives for it. For small angles the speed along the car and that along the path are equal. Here
    `v_x` is the speed along the path, so that the velocity has the components `v cos(beta)` and `v sin(beta)`. In backward
    travel (v < 0) the slip angles reverse sign, as the tyre forces do. Below `crawl_speed` (m/s) |v| in the
    denominators is `regularised_speed`, so that standstill is a regular point. A bank of the road adds the force `m g_y`; the
    road's friction has no effect, as in any linear law.

    **Parameters**: `front_stiffness`, `rear_stiffness` (N/rad, of the axle at rest on a level road), `cg_height` (m; None: the
    stiffnesses are constant). With a height the stiffnesses are proportional to the axle loads, of which `m a_x h / (a + b)`
    moves to the rear, as in CommonRoad's ST model.

    **Inputs**: those of `steering` (`steer`, rad at the road wheels), `v_x` (m/s) and, with a `cg_height`, `v_x_rate = dv_x/dt`
    (m/s^2).

    **Raises** `InputError` for parameters that are not positive.
    """

    _: KW_ONLY
    front_stiffness: jax.Array = positive("N/rad")
    rear_stiffness: jax.Array = positive("N/rad")
    cg_height: jax.Array | None = positive("m", default=None)

    @property
    def inputs(self):
        told = (*self.steering.inputs, "v_x")
        return told if self.cg_height is None else (*told, "v_x_rate")

    @property
    def state_type(self):
        return LinearSingleTrackState

    @property
    def units(self):
        return dict(UNITS)

    def start(self, t, u, **values):
        return given_or_zero(LinearSingleTrackState, values, u.v_x, self.mass)

    def motion(self, x, u):
        along, across = numerics.cos(x.sideslip), numerics.sin(x.sideslip)
        return Motion(0.0, 0.0, x.yaw, u.v_x * along, u.v_x * across, x.yaw_rate)

    def evaluate(self, t, x, u, ground: Ground = LEVEL):
        del t
        a, b = self.front_axle_to_cg, self.rear_axle_to_cg
        speed = regularised_speed(u.v_x, self.slip_floor)
        way = u.v_x / speed
        front, rear = self.load_shares(u, ground)
        steer, steer_rear = axle_angles(self.steering.angles(self, u, u.v_x))
        slip_front = way * (steer - x.sideslip) - a * x.yaw_rate / speed
        aside = -way * x.sideslip if is_straight(steer_rear) else way * (steer_rear - x.sideslip)
        slip_rear = aside + b * x.yaw_rate / speed
        F_yf = front * self.front_stiffness * slip_front
        F_yr = rear * self.rear_stiffness * slip_rear
        g_x, g_y, _ = gravity(ground)
        a_y = (F_yf + F_yr) / self.mass
        yaw_acceleration = (a * F_yf - b * F_yr) / self.yaw_inertia
        rates = LinearSingleTrackState(way * (a_y + g_y) / speed - x.yaw_rate, x.yaw_rate, yaw_acceleration)
        moves = self.motion(x, u)
        weight = self.mass * GRAVITY / self.wheelbase
        outputs = SingleTrackOutputs(
            v_x=moves.v_x,
            v_y=moves.v_y,
            yaw=x.yaw,
            yaw_rate=x.yaw_rate,
            yaw_acceleration=yaw_acceleration,
            a_x=(0.0 if self.cg_height is None else u.v_x_rate) - g_x,
            a_y=a_y,
            sideslip=x.sideslip,
            slip_angle_front=slip_front,
            slip_angle_rear=slip_rear,
            F_yf=F_yf,
            F_yr=F_yr,
            load_front=front * weight * b,
            load_rear=rear * weight * a,
            **over_ground(x.yaw, moves.v_x, moves.v_y),
        )
        return rates, with_batch_shape(outputs)

    def load_shares(self, u, ground: Ground = LEVEL) -> tuple[Any, Any]:
        """The loads of front and rear axle over those at rest on a level road (-); they multiply the stiffnesses."""
        if self.cg_height is None:
            return 1.0, 1.0
        if not hasattr(u, "v_x_rate"):
            raise InputError(f"inputs = {', '.join(u._fields)}: a car with a cg_height needs v_x_rate among them.")
        g_x, _, g_z = gravity(ground)
        moved = (u.v_x_rate - g_x) * self.cg_height / GRAVITY
        pressed = -g_z / GRAVITY
        return pressed - moved / self.rear_axle_to_cg, pressed + moved / self.front_axle_to_cg

    def system(self, speed: Any) -> LateralSystem:
        """The system matrices at a constant forward `speed` (m/s, any shape) on a level road. They agree with `evaluate` above
        the crawl speed. **Raises** `InputError` for a speed that is not positive, or a `steering` without the input `steer`."""
        check_positive("LinearSingleTrack.system: speed", speed, "m/s")
        v = speed
        m, J, a, b = self.mass, self.yaw_inertia, self.front_axle_to_cg, self.rear_axle_to_cg
        C_f, C_r = self.front_stiffness, self.rear_stiffness
        leverage = a * C_f - b * C_r
        _, behind = self.steering.axle_gains(v)
        push, moment = (C_f, a * C_f) if is_straight(behind) else (C_f + C_r * behind, a * C_f - b * C_r * behind)
        return LateralSystem(
            a_11=-(C_f + C_r) / (m * v),
            a_12=-leverage / (m * v * v) - 1.0,
            a_21=numerics.as_wide_as(-leverage / J, v),
            a_22=-(a * a * C_f + b * b * C_r) / (J * v),
            b_1=push / (m * v),
            b_2=numerics.as_wide_as(moment / J, v),
            speed=v,
        )

    @property
    def understeer_gradient(self) -> jax.Array:
        """K = m / L (b / C_f - a / C_r), rad s^2/m: in a steady turn of radius R the steer is `L / R + K a_y` (T. D. Gillespie,
        Fundamentals of Vehicle Dynamics, ch. 6, also the source of the speeds and gains below)."""
        bending = self.rear_axle_to_cg / self.front_stiffness - self.front_axle_to_cg / self.rear_stiffness
        return self.mass / self.wheelbase * bending

    @property
    def understeer_gradient_deg_per_g(self) -> jax.Array:
        """The understeer gradient in the usual unit: degrees at the road wheels per g of lateral acceleration."""
        return jnp.rad2deg(self.understeer_gradient) * GRAVITY

    @property
    def characteristic_speed(self) -> jax.Array:
        """sqrt(L / K), m/s, at which the yaw-rate gain of an understeering car is greatest; infinite for other cars."""
        return _speed(self.wheelbase, self.understeer_gradient)

    @property
    def critical_speed(self) -> jax.Array:
        """sqrt(-L / K), m/s, above which an oversteering car is unstable; infinite for other cars."""
        return _speed(self.wheelbase, -self.understeer_gradient)

    def yaw_rate_gain(self, speed: Any) -> Any:
        """The steady yaw rate over steer, (1 - k) v / (L + K v^2), 1/s, with the ratio k of rear to front angle."""
        return self._turning(speed) * speed / self._steadiness(speed)

    def lateral_acceleration_gain(self, speed: Any) -> Any:
        """The steady lateral acceleration over steer, (1 - k) v^2 / (L + K v^2), m/s^2 per rad."""
        return self._turning(speed) * speed * speed / self._steadiness(speed)

    def sideslip_gain(self, speed: Any) -> Any:
        """The steady sideslip over steer, k + (1 - k) (b - a m v^2 / (L C_r)) / (L + K v^2) (-). If the rear axle is not steered,
        it is positive at low speed, where the rear runs on a smaller circle, and negative at high speed (M. Mitschke & H.
        Wallentowitz, Dynamik der Kraftfahrzeuge, the chapter on the linear single-track model)."""
        pushed = self.front_axle_to_cg * self.mass * speed * speed / (self.wheelbase * self.rear_stiffness)
        trailing = (self.rear_axle_to_cg - pushed) / self._steadiness(speed)
        _, behind = self.steering.axle_gains(speed)
        return trailing if is_straight(behind) else behind + (1.0 - behind) * trailing

    def _turning(self, speed):
        """The part of the steer that turns the car (-): the difference of the angles of front and rear axle over the steer."""
        return 1.0 - self.steering.axle_gains(speed)[1]

    def _steadiness(self, speed):
        """L + K v^2, m: the steer over the path's curvature; zero at the critical speed."""
        return self.wheelbase + self.understeer_gradient * speed * speed


def _speed(wheelbase, gradient):
    """sqrt(L / K) if K is positive, otherwise infinite."""
    held = gradient > 0
    return jnp.where(held, numerics.sqrt(wheelbase / numerics.or_one(gradient, held)), jnp.inf)

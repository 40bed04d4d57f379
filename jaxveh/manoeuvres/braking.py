"""Open-loop braking: in a turn with constant steer, and straight ahead over changing friction."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import check, check_at_least, check_known, check_positive, float_array
from jaxveh._core.parameter import parameter
from jaxveh.manoeuvres.base import AbstractManoeuvre, PedalInputs, as_time, check_drive
from jaxveh.numerics import smooth_ramp, smooth_step

_LAST_SPEED = 0.5
"""Below this speed (m/s) the demanded deceleration fades out, so that it ends smoothly at standstill."""


class Braking(AbstractManoeuvre):
    """A smooth ramp to a constant steer, then a smooth ramp to a constant brake torque.

    `v_x` and `v_x_rate` are the demanded speed and its rate: `deceleration` from `brake_at` on, down to standstill. For
    cars driven by torques, `drive_torque` falls to zero while `brake_torque` rises.
    """

    ramp: float = eqx.field(static=True)
    start: float = eqx.field(static=True)
    brake_at: float = eqx.field(static=True)
    brake_ramp: float = eqx.field(static=True)
    duration: float = eqx.field(static=True)
    speed: jax.Array = parameter("m/s")
    steer: jax.Array = parameter("rad", scale=0.1)
    deceleration: jax.Array = parameter("m/s^2", scale=5.0)
    brake_torque: jax.Array = parameter("N m", scale=1000.0)
    drive_torque: jax.Array = parameter("N m", scale=100.0)

    def inputs(self, t: Any) -> PedalInputs:
        t = as_time(t, self.steer)
        pressed = smooth_step((t - self.brake_at) / self.brake_ramp)
        v_x, v_x_rate = jax.jvp(self._v_x, (t,), (jnp.ones_like(t),))
        return PedalInputs(
            steer=self.steer * smooth_step((t - self.start) / self.ramp),
            v_x=v_x,
            v_x_rate=v_x_rate,
            drive_torque=self.drive_torque * (1.0 - pressed),
            brake_torque=self.brake_torque * pressed,
        )

    def _v_x(self, t):
        half = self.brake_ramp / 2
        lost = self.deceleration * smooth_ramp(t - self.brake_at - half, half)
        return smooth_ramp(self.speed - lost, _LAST_SPEED)


def braking_in_a_turn(
    speed, steer, deceleration=5.0, *, mass=1500.0, wheel_radius=0.3, drive_torque=0.0, ramp: float = 1.0,
    start: float = 0.5, brake_at: float = 5.0, brake_ramp: float = 0.3, duration: float = 10.0,
) -> Braking:  # fmt: skip
    """Braking in a turn with a constant `steer` (rad at the road wheels), from `speed` (m/s) (ISO 7975).

    The steer rises over `ramp` from `start` on; the brakes act from `brake_at` on, and rise over `brake_ramp` (s) to
    `deceleration` (m/s^2). For cars driven by torques, the brake torque is `mass wheel_radius deceleration` (kg, m),
    and before braking there is a constant `drive_torque` (N m, both at the wheels).

    **Raises** `InputError` for values out of range, or a brake that is not fully applied within the duration.
    """
    check_drive(speed, duration, steer)
    check_known(ramp=ramp, start=start, brake_at=brake_at, brake_ramp=brake_ramp)
    check_positive("deceleration", deceleration, "m/s^2")
    check_positive("mass", mass, "kg")
    check_positive("wheel_radius", wheel_radius, "m")
    check_at_least("drive_torque", drive_torque, 0.0)
    check_at_least("start", start, 0.0)
    check_positive("ramp", ramp, "s")
    check_positive("brake_ramp", brake_ramp, "s")
    check("brake_at", brake_at, lambda v: v >= start + ramp, f"at least start + ramp = {start + ramp:g} s")
    end = brake_at + brake_ramp
    check("duration", duration, lambda d: d >= end, f"at least brake_at + brake_ramp = {end:g} s")
    return Braking(
        ramp=float(ramp), start=float(start), brake_at=float(brake_at), brake_ramp=float(brake_ramp),
        duration=float(duration), speed=speed, steer=steer, deceleration=deceleration,
        brake_torque=float_array(mass) * float_array(wheel_radius) * float_array(deceleration), drive_torque=drive_torque,
    )  # fmt: skip


def mu_jump_braking(
    speed, deceleration=8.0, *, mass=1500.0, wheel_radius=0.3, brake_at: float = 1.0, brake_ramp: float = 0.3,
    duration: float = 8.0,
) -> Braking:  # fmt: skip
    """Braking straight ahead with a constant brake torque, for a road with a jump of friction (`roads.MuJump`) or split
    friction.

    Arguments and errors are those of `braking_in_a_turn`; the steer is zero.
    """
    check_known(brake_at=brake_at)
    check_positive("brake_at", brake_at, "s")
    return braking_in_a_turn(
        speed, 0.0, deceleration, mass=mass, wheel_radius=wheel_radius, start=0.0, ramp=brake_at,
        brake_at=brake_at, brake_ramp=brake_ramp, duration=duration,
    )  # fmt: skip

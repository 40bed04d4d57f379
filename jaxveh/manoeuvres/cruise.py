"""Driving straight ahead with varying speed and pedals, for the estimation of mass and grade."""

from __future__ import annotations

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import check_at_least, check_key, check_positive, check_single, check_whole
from jaxveh._core.parameter import parameter
from jaxveh.manoeuvres.base import AbstractManoeuvre, PedalInputs, as_time, check_drive
from jaxveh.manoeuvres.speeds import AbstractSpeed, SteadySpeed, wavering_speed
from jaxveh.numerics import gauss_markov_harmonics, smooth_ramp, sum_of_harmonics


class Cruise(AbstractManoeuvre):
    """Driving straight ahead at a given speed over time, with coloured noise on the pedals.

    The pedals are the noise only: `drive_torque` where it is positive and `brake_torque` where it is negative (within a tenth of
    its standard deviation about zero both are positive, and their difference is the noise). `SpeedControl` holds the speed and
    adds these pedals; `jaxveh.simulate` wraps it around this manoeuvre if the car is driven by torques.
    """

    adds_to_pedals: ClassVar[bool] = True
    speed: AbstractSpeed
    duration: float = eqx.field(static=True)
    pedal_noise: jax.Array = parameter("N m", scale=100.0)
    frequencies: jax.Array = parameter("Hz", scale=1.0)
    phases: jax.Array = parameter("rad", scale=1.0)

    def inputs(self, t: Any) -> PedalInputs:
        t = as_time(t, self.pedal_noise)
        v_x, v_x_rate = self.speed.at(t)
        noise = sum_of_harmonics(t, self.frequencies, self.phases)
        return PedalInputs(
            steer=jnp.zeros_like(t),
            v_x=v_x,
            v_x_rate=v_x_rate,
            drive_torque=self.pedal_noise * smooth_ramp(noise, 0.1),
            brake_torque=self.pedal_noise * smooth_ramp(-noise, 0.1),
        )


def cruise(
    speed, key: jax.Array, *, speed_std=2.0, speed_time: float = 10.0, pedal_noise=50.0, pedal_time: float = 2.0,
    count: int = 40, duration: float = 120.0,
) -> Cruise:  # fmt: skip
    """Driving straight ahead at about `speed` (m/s) to estimate mass and grade; `key` draws speed and pedals.

    `speed_std` (m/s): standard deviation of the demanded speed, with the correlation time `speed_time` (s); zero gives
    a constant speed. `pedal_noise` (N m, total at the wheels): standard deviation of the coloured noise on the pedals,
    with the correlation time `pedal_time` (s) and no frequencies above 4 Hz.

    **Raises** `InputError` for values out of range.
    """
    check_drive(speed, duration)
    check_single(speed_time=speed_time, pedal_time=pedal_time)
    check_at_least("speed_std", speed_std, 0.0)
    check_at_least("pedal_noise", pedal_noise, 0.0)
    check_positive("speed_time", speed_time, "s")
    check_positive("pedal_time", pedal_time, "s")
    check_whole("count", count)
    check_key("cruise", key)
    wander, foot = jax.random.split(key)
    held = not eqx.is_array(speed_std) and speed_std == 0
    wanted = SteadySpeed(speed) if held else wavering_speed(speed, speed_std, wander, time=speed_time, count=count)
    frequencies, phases = gauss_markov_harmonics(foot, pedal_time, 4.0, count)
    return Cruise(
        speed=wanted, duration=float(duration), pedal_noise=pedal_noise, frequencies=frequencies, phases=phases
    )

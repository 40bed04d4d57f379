"""Speed control by the pedals: torques that make a car follow the driver's demanded speed."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.names import record
from jaxveh._core.parameter import positive
from jaxveh.manoeuvres.base import AbstractManoeuvre, PedalInputs
from jaxveh.manoeuvres.driver import AbstractDriver, Motion, as_driver, driver_state
from jaxveh.numerics import smooth_clip, smooth_ramp, smooth_step
from jaxveh.vehicles import GRAVITY, kit

AIR_DENSITY = 1.2
"""The density of air, kg/m^3, at 20 degrees Celsius near sea level."""

_EDGE = 0.1
"""The width of the smooth transition from drive to brake and of the rounded limits, m/s^2."""

_CRAWL = 0.5
"""Below this speed (m/s) the compensated rolling resistance fades to zero."""


class SpeedControl(AbstractDriver):
    """The steering of a driver or a manoeuvre, with pedals that make the car follow its demanded speed.

    The demanded acceleration is `v_x_rate + gain e + integral`, with `e = v_x - motion.v_x` and
    `d integral/dt = gain e / integral_time`. The force is `mass` times this acceleration, plus air drag and rolling resistance.
    It is limited to `drive_limit` and `brake_limit` with smooth corners; while a limit acts, the integral is constant
    (conditional integration, K. J. Astrom and T. Hagglund, Advanced PID Control, sec. 3.5), so that it does not wind up. A
    positive force becomes `drive_torque`, a negative one `brake_torque` (N m, total at the wheels, never negative; within 0.1
    m/s^2 of zero both are positive, for a smooth transition). The pedals of the wrapped driver are added.

    **Parameters**: `mass` (kg), `wheel_radius` (m), `gain` (1/s), `integral_time` (s), `drag_area` (m^2: drag
    coefficient times area), `rolling_resistance` (-), `drive_limit` and `brake_limit` (m/s^2). By default the gain is 1/s and the
    integral time 4 s; for a car with a `wheelbase` (m) of less than 2 m, these times are shorter by the root of the wheelbase
    over 2 m (Froude's law).

    **States**: those of the driver, and `speed_integral` (m/s^2).

    **Raises** `InputError` for parameters that are not positive, for `driver` of another type, or a driver without `v_x`.
    """

    driver: AbstractDriver
    mass: jax.Array = positive("kg")
    wheel_radius: jax.Array = positive("m")
    gain: jax.Array = positive("1/s")
    integral_time: jax.Array = positive("s")
    drag_area: jax.Array = positive("m^2")
    rolling_resistance: jax.Array = positive("-")
    drive_limit: jax.Array = positive("m/s^2")
    brake_limit: jax.Array = positive("m/s^2")
    duration: float = eqx.field(static=True)

    def __init__(
        self, driver: AbstractDriver | AbstractManoeuvre, mass, *, wheel_radius=0.3, gain=None,
        integral_time=None, drag_area=0.7, rolling_resistance=0.012, drive_limit=4.0, brake_limit=9.0, wheelbase=None,
    ):  # fmt: skip
        self.driver = as_driver(driver)
        self.duration = self.driver.duration
        self.mass, self.wheel_radius = mass, wheel_radius
        if wheelbase is not None:
            check_positive("SpeedControl: wheelbase", wheelbase, "m")
        size = 1.0 if wheelbase is None else kit.small_size(wheelbase)
        self.gain = 1.0 / size if gain is None else gain
        self.integral_time = 4.0 * size if integral_time is None else integral_time
        self.drag_area, self.rolling_resistance = drag_area, rolling_resistance
        self.drive_limit, self.brake_limit = drive_limit, brake_limit

    @property
    def state_names(self):
        return (*self.driver.state_names, "speed_integral")

    @property
    def fastest_rate(self):
        own = jnp.maximum(self.gain, 1.0 / self.integral_time)
        return None if self.driver.fastest_rate is None else jnp.maximum(own, self.driver.fastest_rate)

    def start(self, t: Any, motion: Motion) -> Any:
        return driver_state(self.state_names)(*self.driver.start(t, motion), jnp.zeros_like(motion.v_x))

    def inputs(self, t: Any, motion: Motion, state: Any) -> Any:
        """The `PedalInputs`; if the driver gives angles of other wheels (`steer_rear`, `steer_fl` ...), these are included."""
        u, wanted, _ = self._pedal_inputs(t, motion, state)
        own = getattr(u, "drive_torque", 0.0) - getattr(u, "brake_torque", 0.0)
        torque, edge = self.mass * self.wheel_radius * wanted + own, self.mass * self.wheel_radius * _EDGE
        pedals = smooth_ramp(torque, edge), smooth_ramp(-torque, edge)
        angles = {name: getattr(u, name) for name in kit.STEER_UNITS if name != "steer" and hasattr(u, name)}
        v_x_rate = u.v_x_rate if hasattr(u, "v_x_rate") else jnp.zeros_like(u.v_x)
        known = PedalInputs(u.steer, u.v_x, v_x_rate, *pedals)
        return record("PedalInputs", known._asdict() | angles) if angles else known

    def derivatives(self, t: Any, motion: Motion, state: Any) -> Any:
        u, _, cut = self._pedal_inputs(t, motion, state)
        free = 1.0 - smooth_step(jnp.abs(cut) / _EDGE)
        rate = free * self.gain * (u.v_x - motion.v_x) / self.integral_time
        return driver_state(self.state_names)(*self.driver.derivatives(t, motion, self._inner(state)), rate)

    def _pedal_inputs(self, t, motion, state):
        """The driver's inputs, the acceleration by the pedals after the limits, and the part of it that the limits add."""
        u = self.driver.inputs(t, motion, self._inner(state))
        if not hasattr(u, "v_x"):
            raise InputError(f"SpeedControl: the driver gives {', '.join(u._fields)}, but no v_x to follow.")
        v = motion.v_x
        resistance = GRAVITY * self.rolling_resistance * v / numerics.hypot(v, _CRAWL)
        drag = 0.5 * AIR_DENSITY * self.drag_area * v * abs(v) / self.mass
        wish = getattr(u, "v_x_rate", 0.0) + self.gain * (u.v_x - v) + state.speed_integral + drag + resistance
        held = smooth_clip(wish, -self.brake_limit, self.drive_limit, _EDGE)
        return u, held, held - wish

    def _inner(self, state):
        return driver_state(self.driver.state_names)(*state[:-1])

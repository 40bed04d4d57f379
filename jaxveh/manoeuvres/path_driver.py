"""A driver with preview, who steers towards a point ahead on the path."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_positive, check_single, word_for
from jaxveh._core.parameter import parameter, positive
from jaxveh.manoeuvres.base import DriverInputs
from jaxveh.manoeuvres.driver import AbstractDriver, Motion, driver_state
from jaxveh.manoeuvres.paths import AbstractPath
from jaxveh.manoeuvres.speeds import AbstractSpeed
from jaxveh.numerics import smooth_clip
from jaxveh.vehicles import kit, regularised_speed

_CRAWL = 1.0
"""Below this speed (m/s; less for small cars) course and curvature are regularised, so that standstill is an ordinary point."""


class PathDriver(AbstractDriver):
    """A driver with single-point preview, who turns the wheel until the arc of the car meets the path's point ahead.

    In axes along the car's course (yaw + sideslip), the path's point at the distance v_x T_p is (ahead, left). The arc to it has
    the curvature kappa, the arc of the car has kappa_now, and the wheel turns at the rate

        kappa = 2 left / (ahead^2 + left^2),   kappa_now = yaw_rate / v_x,
        d steer/dt = gain (wheelbase + understeer_gradient v_x^2) (kappa - kappa_now) / reaction_lag.

    For small angles `kappa v_x^2` is the acceleration that takes a point mass to the path after T_p: MacAdam's optimal preview
    (C. C. MacAdam, J. Dyn. Syst. Meas. Control 102 (1980)) with all weight on one point. Because kappa_now is measured and not
    computed from the steer, a car whose understeer gradient differs from `understeer_gradient` also stays on the path. Steer and
    its rate stay within `steer_limit` and `rate_limit` with smooth corners. Of the future, only the path is used.
    The driver is for driving forwards.

    **Parameters**: `preview_time` T_p (s), `reaction_lag` (s), `wheelbase` (m), `understeer_gradient` (rad s^2/m, the steer at
    the road wheels beyond the geometric one for a lateral acceleration of 1 m/s^2), `gain` (-; below 0.8, or with a lag above
    0.15 s, the car weaves at high speed), `steer_limit` (rad), `rate_limit` (rad/s), `shortest_preview` (m, at standstill).

    **State**: `steer` (rad at the road wheels). **Inputs**: `steer`, and `v_x`, `v_x_rate` of the demanded `speed`.

    **Raises** `InputError` for parameters out of range, or if path or speed are of another type.
    """

    path: AbstractPath
    speed: AbstractSpeed
    duration: float = eqx.field(static=True)
    preview_time: jax.Array = positive("s", default=0.6)
    reaction_lag: jax.Array = positive("s", default=0.1)
    wheelbase: jax.Array = positive("m", default=2.7)
    understeer_gradient: jax.Array = parameter("rad s^2/m", scale=0.005, default=0.003)
    gain: jax.Array = positive("-", default=1.0)
    steer_limit: jax.Array = positive("rad", default=0.5)
    rate_limit: jax.Array = positive("rad/s", default=1.0)
    shortest_preview: jax.Array = positive("m", default=2.0)

    def __check_init__(self):
        for name, kind in (("path", AbstractPath), ("speed", AbstractSpeed)):
            if not isinstance(getattr(self, name), kind):
                given = word_for(getattr(self, name))
                raise InputError(f"PathDriver.{name} = {given}: must be a {name} of jaxveh.manoeuvres.")
        check_single(**{"PathDriver.duration": self.duration})
        check_positive("PathDriver.duration", self.duration, "s")

    @property
    def state_names(self):
        return ("steer",)

    @property
    def fastest_rate(self):
        return self.gain / self.reaction_lag

    def start(self, t: Any, motion: Motion) -> Any:
        """The state with the steer of the arc to the point ahead in steady state."""
        curvature, needed = self._arc(motion)
        return driver_state(self.state_names)(self._limit(needed * curvature))

    def inputs(self, t: Any, motion: Motion, state: Any) -> DriverInputs:
        v_x, v_x_rate = self.speed.at(t)
        shape = jnp.shape(state.steer)
        return DriverInputs(state.steer, jnp.broadcast_to(v_x, shape), jnp.broadcast_to(v_x_rate, shape))

    def derivatives(self, t: Any, motion: Motion, state: Any) -> Any:
        curvature, needed = self._arc(motion)
        now = motion.yaw_rate / regularised_speed(motion.v_x, self._crawl)
        wish = self._limit(state.steer + self.gain * needed * (curvature - now))
        rate = (wish - state.steer) / self.reaction_lag
        return driver_state(self.state_names)(smooth_clip(rate, -self.rate_limit, self.rate_limit, self.rate_limit / 8))

    def _arc(self, motion: Motion) -> tuple[jax.Array, jax.Array]:
        """The curvature of the arc to the point ahead (1/m), and the steer per curvature in steady state (rad m)."""
        course = motion.yaw + numerics.arctan2(motion.v_y, regularised_speed(motion.v_x, self._crawl))
        distance = numerics.hypot(self.preview_time * motion.v_x, self.shortest_preview)
        target = self.path.preview(motion.x, motion.y, course, distance)
        square = target.ahead * target.ahead + target.left * target.left
        curvature = 2.0 * target.left / numerics.or_one(square, square > 0)
        return curvature, self.wheelbase + self.understeer_gradient * motion.v_x * motion.v_x

    @property
    def _crawl(self) -> jax.Array:
        return _CRAWL * kit.small_size(self.wheelbase)

    def _limit(self, steer: jax.Array) -> jax.Array:
        return smooth_clip(steer, -self.steer_limit, self.steer_limit, self.steer_limit / 8)

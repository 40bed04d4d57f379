"""A driver who looks ahead on a path and steers for the point that he sees."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError
from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh.manoeuvres.base import DriverInputs
from jaxveh.manoeuvres.driver import AbstractDriver, Motion, driver_state
from jaxveh.manoeuvres.paths import AbstractPath
from jaxveh.manoeuvres.speeds import AbstractSpeed
from jaxveh.numerics import smooth_clip

_CRAWL = 1.0
"""Below this speed (m/s) the car's course tends to its heading."""


class PathDriver(AbstractDriver):
    """Single-point preview: the arc from the car, along its course, to the path's point at the preview distance.

    With the car's course psi + beta and the point (ahead, left) seen along it at the distance v_x T_p, the arc has the
    curvature

        kappa = 2 left / (ahead^2 + left^2),

    which for small angles is the acceleration that takes a point mass to the path after T_p: MacAdam's optimal preview
    (C. C. MacAdam, J. Dyn. Syst. Meas. Control 102 (1980)) with all weight on one point. The steer for it in steady
    state is `gain (wheelbase + understeer_gradient v_x^2) kappa`. It comes after the `reaction_lag` (first order), held
    within `steer_limit` and `rate_limit` with smooth corners. Nothing of the future is used but the path.

    **Parameters**: `preview_time` T_p (s), `reaction_lag` (s), `wheelbase` (m), `understeer_gradient` (rad s^2/m, the
    steer at the road wheels that a lateral acceleration of 1 m/s^2 needs beyond the geometric one), `gain` (-),
    `steer_limit` (rad), `rate_limit` (rad/s), `shortest_preview` (m, at standstill).

    **State**: `steer` (rad at the road wheels). **Inputs**: `steer`, and `v_x`, `v_x_rate` of the wanted `speed`.

    **Raises** `InputError` for parameters out of range, a path or a speed that is none.
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
    shortest_preview: jax.Array = positive("m", default=3.0)

    def __check_init__(self):
        check_parameters(self)
        for name, kind in (("path", AbstractPath), ("speed", AbstractSpeed)):
            if not isinstance(getattr(self, name), kind):
                given = type(getattr(self, name)).__name__
                raise InputError(f"PathDriver.{name} = {given}: must be a {name} of jaxveh.manoeuvres.")

    @property
    def state_names(self):
        return ("steer",)

    def start(self, t: Any, motion: Motion) -> Any:
        return driver_state(self.state_names)(self.wish(motion))

    def inputs(self, t: Any, motion: Motion, state: Any) -> DriverInputs:
        v_x, v_x_rate = self.speed.at(t)
        shape = jnp.shape(state.steer)
        return DriverInputs(state.steer, jnp.broadcast_to(v_x, shape), jnp.broadcast_to(v_x_rate, shape))

    def derivatives(self, t: Any, motion: Motion, state: Any) -> Any:
        rate = (self.wish(motion) - state.steer) / self.reaction_lag
        return driver_state(self.state_names)(smooth_clip(rate, -self.rate_limit, self.rate_limit, self.rate_limit / 8))

    def wish(self, motion: Motion) -> jax.Array:
        """The steer that the driver would hold, rad at the road wheels, but for his lag."""
        course = motion.yaw + numerics.arctan2(motion.v_y, numerics.hypot(motion.v_x, _CRAWL))
        distance = numerics.hypot(self.preview_time * motion.v_x, self.shortest_preview)
        target = self.path.preview(motion.x, motion.y, course, distance)
        square = target.ahead * target.ahead + target.left * target.left
        curvature = 2.0 * target.left / jnp.where(square > 0, square, 1.0)
        needed = self.wheelbase + self.understeer_gradient * motion.v_x * motion.v_x
        return smooth_clip(self.gain * needed * curvature, -self.steer_limit, self.steer_limit, self.steer_limit / 8)

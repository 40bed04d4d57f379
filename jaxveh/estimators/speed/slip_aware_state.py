"""What the recommended speed believes, remembers and hears."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.parameter import positive
from jaxveh.estimators.speed.car_numbers import SpeedCar
from jaxveh.estimators.speed.gaussian import Belief
from jaxveh.estimators.speed.wheels import AT
from jaxveh.vehicles import GRAVITY

LEFT = np.array([1, -1, 1, -1])
FRONT = np.array([True, True, False, False])
RADII = slice(6, 10)
"""Where the radii are in the state."""

HELD = ("a_x", "a_y", "yaw_rate", "steer", "drive_torque", *(f"brake_torque_{at}" for at in AT))
"""What is held between two of its samples."""

PATIENCE = 0.3
"""s: for so long a sample is held, then the channel is silent."""


class SpeedState(NamedTuple):
    """`rolled`: what wheels without slip say on the mean, `(1 + radius) v_x` (m/s); `force`: what tyres and air push, over the
    mass (m/s^2); `slope`: gravity along the road (m/s^2, uphill positive); `offset` (m/s^2) and `gain` (-) of the accelerometer;
    `radius`: by how much the radii make all wheels' speeds too large (-), and each wheel's beyond that; how much softer than the
    file says the tyres of an axle slip (-, on the logarithm).

    With the wheels' speed as a state, not the car's, no wheel can tell what the wheels have in common. (A filter of v_x, linear
    about a speed that moves, would soon think that it knows.)"""

    rolled: Any
    force: Any
    slope: Any
    offset: Any
    gain: Any
    radius: Any
    radius_fl: Any
    radius_fr: Any
    radius_rl: Any
    radius_rr: Any
    softness_front: Any
    softness_rear: Any

    @property
    def v_x(self) -> Any:
        """The car's speed, m/s."""
        return self.rolled / (1.0 + self.radius)


class Spreads(eqx.Module):
    """Standard deviations that the filter begins with, of its random walks, and of what is measured.

    `slope_walk` and so on are per root second; a slope also falls back to level with `slope_time`, a softness to the file's with
    `softness_time` (s), in which it forgets as much as it spreads. `wheel` (m/s) is what edges of
    teeth leave, `wheel_share` (-) goes with the speed; `slip_share` (-) is of the slip that is expected, and `limit_slip` (-)
    the slip that nobody knows at a force of the whole load, less with its fourth power. `turn` (m/s per rad/s) is of the wheels'
    places.
    """

    slope: jax.Array = positive("m/s^2", default=0.3)
    slope_time: jax.Array = positive("s", default=15.0)
    slope_walk: jax.Array = positive("m/s^2/sqrt(s)", default=0.15)
    offset: jax.Array = positive("m/s^2", default=0.12)
    offset_walk: jax.Array = positive("m/s^2/sqrt(s)", default=2e-3)
    gain: jax.Array = positive("-", default=0.012)
    radius: jax.Array = positive("-", default=0.004)
    radius_walk: jax.Array = positive("1/sqrt(s)", default=1e-4)
    softness: jax.Array = positive("-", default=0.35)
    softness_time: jax.Array = positive("s", default=300.0)
    force_walk: jax.Array = positive("m/s^2/sqrt(s)", default=6.0)
    speed_walk: jax.Array = positive("m/s/sqrt(s)", default=0.02)
    a_x: jax.Array = positive("m/s^2", default=0.1)
    wheel: jax.Array = positive("m/s", default=0.04)
    wheel_share: jax.Array = positive("-", default=1e-3)
    slip_share: jax.Array = positive("-", default=0.25)
    peak_slip: jax.Array = positive("-", default=0.3)
    limit_slip: jax.Array = positive("-", default=0.03)
    suspicion_time: jax.Array = positive("s", default=0.4)
    other_slip: jax.Array = positive("-", default=0.015)
    repeats: jax.Array = positive("-", default=25.0)
    turn: jax.Array = positive("m/s per rad/s", default=0.05)
    satellite: jax.Array = positive("m/s", default=0.06)


class Memory(NamedTuple):
    """The belief and its time; what was heard last and when, by channel; each wheel's low-passed speed and trust; the car's
    low-passed acceleration; since when no wheel was trusted, and since when all say zero."""

    belief: Belief
    t: Any
    heard: dict[str, Any]
    at: dict[str, Any]
    smooth: Any
    smooth_at: Any
    trust: Any
    suspicion: Any
    rate: Any
    lost: Any
    zero: Any


class Said(NamedTuple):
    """What the wheels are expected to say, `speed`, and without slip, `rolling` (m/s); the `slip` in it and the force over load,
    `share` (-), (4,) each."""

    speed: Any
    rolling: Any
    slip: Any
    share: Any


def of_axles(front: Any, rear: Any) -> Any:
    return jnp.where(FRONT, front, rear)


def beyond(far: Any) -> Any:
    """1 where |far| <= 1, else its inverse to the eighth power; safe for what is huge."""
    size = jnp.clip(jnp.abs(far), 1.0, 1e3)
    return 1.0 / jnp.square(jnp.square(jnp.square(size)))


def wheel_loads(car: SpeedCar, force: Any, a_y: Any) -> Any:
    """The wheels' loads, N, (4,), under a longitudinal force over the mass and a lateral acceleration (m/s^2); none lifts off."""
    at_rest = of_axles(*car.loads)
    pitched = 0.5 * car.mass * force * car.cg_height / car.wheelbase
    rolled = 2.0 * a_y / GRAVITY * car.cg_height / (0.5 * (car.track_front + car.track_rear))
    return jnp.maximum(
        at_rest * (1.0 - LEFT.astype(rolled.dtype) * rolled) + of_axles(-pitched, pitched), 0.1 * at_rest
    )

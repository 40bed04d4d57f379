"""What the recommended filter of speed remembers, and how sure it is of what."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.parameter import positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.sequential import Belief
from jaxveh.estimators.speed.wheels import AT

LEFT = np.array([1, -1, 1, -1])
"""1 of wheels on the left, -1 of those on the right; front left first."""

FRONT = np.array([True, True, False, False])
"""Which of them are in front."""

RADII = slice(6, 10)
"""Where the radii are in the state."""

HELD = ("a_x", "a_y", "yaw_rate", "steer", "drive_torque", *(f"brake_torque_{at}" for at in AT))
"""What is held between two of its samples."""

MAY_HELP = tuple(
    Need(name, unit, optional=True)
    for name, unit in (
        ("a_x", "m/s^2"), ("a_y", "m/s^2"), ("yaw_rate", "rad/s"), ("steer", "rad"), ("steering_wheel", "rad"), ("speed", "m/s"),
        ("drive_torque", "N m"), *[(f"brake_torque_{at}", "N m") for at in AT], *[(f"torque_{at}", "N m") for at in AT],
    )
)  # fmt: skip
"""Channels that are read where a log has them."""

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

    `slope_walk` and so on are per root second; a slope falls back to level with `slope_time` (s), a softness to the file's with
    `softness_time` (s), in which it forgets as much as it spreads. `radius` is of each wheel's own, and of what all have in
    common half of it. `wheel` (m/s) is what edges of teeth leave, `wheel_share` (-) goes with the speed.

    What follows lasts, so that `repeats` samples of it count as one: `slip_share` (-) of the slip that is expected; `peak_slip`
    (-), the slip that nobody knows at a force of the whole load, less with its fourth power; `limit_slip` (-) of a wheel that has
    been at its limit lately (it forgets with `suspicion_time`, s), which is expected to slip by as much more; `other_slip` (-)
    of all wheels where one is at its limit, and the others' forces are not those of the shares; `turn` (m/s per rad/s) of
    the wheels' places.
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
    """The belief and its time; what was heard last and when, by channel; each wheel's low-passed speed, when that was heard, its
    trust, and the suspicion that it is at its limit; the car's low-passed acceleration; since when no wheel was trusted."""

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


class Said(NamedTuple):
    """What the wheels are expected to say, `speed`, and without slip, `rolling` (m/s); the `slip` in it and the force over load,
    `share` (-), (4,) each."""

    speed: Any
    rolling: Any
    slip: Any
    share: Any


def front_rear(front: Any, rear: Any) -> Any:
    """What the wheels of an axle have in common, (4,)."""
    return jnp.where(FRONT, front, rear)


def beyond(far: Any) -> Any:
    """1 where |far| <= 1, else its inverse to the eighth power; safe for what is huge."""
    size = jnp.clip(jnp.abs(far), 1.0, 1e3)
    return 1.0 / jnp.square(jnp.square(jnp.square(size)))


def own_radii(std: Any) -> Any:
    """The covariance of a state whose four radii have equal spreads `std`, less their mean, and nothing else one."""
    free = jnp.eye(4, dtype=std.dtype) - 0.25
    return jnp.zeros((12, 12), std.dtype).at[RADII, RADII].set(free * jnp.square(std))

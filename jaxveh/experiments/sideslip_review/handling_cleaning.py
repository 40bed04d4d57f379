"""The cleaning of a real log for the handling model and the single tracks, causal."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from jaxveh._core.recording import Recording
from jaxveh.estimators import kit
from jaxveh.sensors import LowPass

STEER_RATE = 3.0
"""rad/s at the road wheels: no driver steers faster; a sample beyond it is a spike, and the last one is held."""

LONGEST_SPIKE = 0.1
"""s: a longer change is no spike."""

A_X_CUTOFF = 1.6
"""Hz: the axle loads follow the longitudinal acceleration, not its vibration."""

BLIND = (
    kit.Need("steer", "rad", throughout=True),
    kit.Need("v_x", "m/s", throughout=True),
    kit.Need("a_x", "m/s^2", throughout=True),
    kit.Need("a_y", "m/s^2"),
    kit.Need("yaw_rate", "rad/s"),
)
"""The channels from which sideslip is estimated blind."""


class HandlingMemory(NamedTuple):
    """The last steer (rad) that was no spike and its time (s); the previous row as measured; and the state of the low-pass."""

    steer: Any
    steer_time: Any
    t: Any
    a_x: Any
    a_y: Any
    yaw_rate: Any
    low_pass: Any


class HandlingCleaning(kit.AbstractCleaning):
    """Steer spikes held, a_x low-passed (first order, settled at the first row), and repeated measurements as missing.

    Loggers repeat the last value if a sensor is slower than the log: a row in which neither `yaw_rate` nor `a_y` changes has
    no new information, and counting it twice would make a filter overconfident. `steer_rate` (rad/s) and `longest` (s)
    define a spike.
    """

    steer_rate: float = eqx.field(static=True, default=STEER_RATE)
    longest: float = eqx.field(static=True, default=LONGEST_SPIKE)
    cutoff: float = eqx.field(static=True, default=A_X_CUTOFF)

    @property
    def channels(self):
        return tuple(need.channel for need in BLIND)

    def first(self, t, values):
        state = self._low_pass(values["a_x"]).start(values["a_x"])
        return HandlingMemory(values["steer"], t, t, values["a_x"], values["a_y"], values["yaw_rate"], state), values

    def next(self, memory, t, values):
        steer, a_x, a_y, yaw_rate = (values[name] for name in ("steer", "a_x", "a_y", "yaw_rate"))
        jumps = jnp.abs(steer - memory.steer) > self.steer_rate * (t - memory.t)
        spike = jumps & (t - memory.steer_time < self.longest)
        steer = jnp.where(spike, memory.steer, steer)
        state = self._low_pass(a_x).step(memory.low_pass, memory.a_x, a_x, t - memory.t)
        repeated = (yaw_rate == memory.yaw_rate) & (a_y == memory.a_y)
        news = lambda value: jnp.where(repeated, jnp.nan, value)
        after = HandlingMemory(steer, jnp.where(spike, memory.steer_time, t), t, a_x, a_y, yaw_rate, state)
        found = {"steer": steer, "a_x": state[0], "a_y": news(a_y), "yaw_rate": news(yaw_rate)}
        return after, values | found

    def _low_pass(self, like) -> LowPass:
        return LowPass(jnp.asarray(self.cutoff, like.dtype), 1)


def clean(recording: Recording) -> Recording:
    """The log with steer spikes held, a_x low-passed, and repeated measurements as missing: see `HandlingCleaning`.

    **Raises** `InputError` if a channel is missing, or if an input is NaN (fill it on request first).
    """
    kit.check_needs("sideslip review", BLIND, recording)
    return kit.clean_recording(HandlingCleaning(), recording)

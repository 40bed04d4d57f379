"""The cleaning of a log's row before the filter, which only looks back."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.estimators.at_centre import LONGEST_SILENCE, moved_to_centre
from jaxveh.estimators.live import AbstractCleaning
from jaxveh.estimators.misfit import Roughness, learn_roughness, no_roughness
from jaxveh.estimators.navigation.system import BALANCE, ROLLS, STANDS, Navigator, Parts, channels_of, misfit_of
from jaxveh.estimators.navigation.window import Past, Window, empty_window, look_back, rotate, window_after
from jaxveh.estimators.rear_steer import CHANNEL, rear_angle
from jaxveh.vehicles import GRAVITY

FELT = ("a_x", "a_y", "yaw_rate")
MORE = ("a_z", "roll_rate", "pitch_rate")

SMOOTH = 0.03
"""s: time constant of the low-pass filter that differentiates the yaw rate to the yaw acceleration."""


class Felt(NamedTuple):
    """The last row: its time `t` (s); the unit's last measurements by channel, `held`, and their time, `spoke` (s); the
    low-passed yaw rate, `smooth` (rad/s); the roughness of the lateral acceleration, `rough`; the `window` of the past; the angle
    of steered rear wheels, late by half of the time over which the axle's force is averaged, `steer_rear` (rad)."""

    t: Any
    held: dict[str, Any]
    spoke: Any
    smooth: Any
    rough: Roughness
    window: Window
    steer_rear: Any


class Cleaning(AbstractCleaning):
    """Holds the inertial unit's last measurements, converts them from the unit's position to the centre of gravity, and
    integrates them over the lags of the `system`."""

    system: Navigator

    @property
    def parts(self) -> Parts:
        """The measurements that the navigation uses."""
        return self.system.parts

    @property
    def unit(self) -> tuple[str, ...]:
        """The channels of the inertial unit."""
        return FELT + MORE if self.parts.three_more else FELT

    @property
    def channels(self):
        wheels = ("wheel_speed_rl", "wheel_speed_rr") if self.parts.wheels else ()
        seen = ("lane_offset", "lane_heading") if self.parts.camera else ()
        return (*self.unit, "speed", "course", *(("heading",) if self.parts.heading else ()), *wheels, *seen)

    def first(self, t, values):
        nothing = jnp.zeros_like(t)
        start = {name: nothing + (GRAVITY if name == "a_z" else 0.0) for name in self.unit}
        spoken = jnp.where(jnp.isnan(values["yaw_rate"]), start["yaw_rate"], values["yaw_rate"])
        rough = no_roughness(values["a_y"])
        rear = rear_angle(values, nothing)
        memory = Felt(t, start, t - 2.0 * LONGEST_SILENCE, spoken, rough, empty_window(t), rear)
        return self._with_row(memory, t, values)

    def next(self, memory, t, values):
        return self._with_row(memory, t, values)

    def _with_row(self, memory: Felt, t, values):
        dt = t - memory.t
        said = jnp.isfinite(values["a_x"]) & jnp.isfinite(values["a_y"]) & jnp.isfinite(values["yaw_rate"])
        held = {name: jnp.where(jnp.isnan(values[name]), old, values[name]) for name, old in memory.held.items()}
        silent = t - memory.spoke > LONGEST_SILENCE
        spoke = jnp.where(said, t, memory.spoke)
        slow = jnp.where(silent, held["yaw_rate"], memory.smooth)
        smooth = slow + (1.0 - jnp.exp(-dt / SMOOTH)) * (held["yaw_rate"] - slow)
        yaw_acceleration = (held["yaw_rate"] - smooth) / SMOOTH
        before, now = self._at_centre(memory.held, 0.0), self._at_centre(held, yaw_acceleration)
        lost = silent | (dt > LONGEST_SILENCE)
        window = self._window(memory.window, before, now, dt, lost)
        step = jnp.clip(t - memory.spoke, 1e-3, LONGEST_SILENCE)
        rough = learn_roughness(memory.rough, jnp.where(said, values["a_y"], jnp.nan), step)
        cleaned = now | {"step": step, "rough": numerics.sqrt(rough.variance)}
        cleaned |= {misfit_of(name): jnp.ones_like(t) for name in channels_of(self.parts)}
        pasts = {}
        for name, lag in self.system.lags.items():
            past = pasts[name] = look_back(window, lag)
            cleaned |= {f"{name}_{what}": value for what, value in past._asdict().items()}
        cleaned |= self._measured(values, pasts, said)
        if self.parts.wheels:
            apart = values["wheel_speed_rr"] - values["wheel_speed_rl"] - self.system.track * held["yaw_rate"]
            cleaned["wheels_apart"] = jnp.where(jnp.isnan(apart), 0.0, apart)
        cleaned["felt"] = t - spoke <= LONGEST_SILENCE
        rear = cleaned[CHANNEL] = self._rear_steer(memory.steer_rear, values, dt)
        return Felt(t, held, spoke, smooth, rough, window, rear), cleaned

    def _rear_steer(self, last: Any, values, dt: Any) -> Any:
        """The angle of the rear wheels (rad) at the time of the axle's balance."""
        now = rear_angle(values, jnp.zeros_like(dt))
        if self.parts.axle == "none":
            return now
        return last + dt / (0.5 * self.system.axle_time + dt) * (now - last)

    def _at_centre(self, held, yaw_acceleration) -> dict[str, Any]:
        """Accelerations of the centre of gravity in a plane motion; other channels unchanged."""
        place = self.system.unit_x, self.system.unit_y
        a_x, a_y = moved_to_centre(held["a_x"], held["a_y"], held["yaw_rate"], yaw_acceleration, *place)
        return held | {"a_x": a_x, "a_y": a_y}

    def _window(self, window: Window, before, now, dt, lost) -> Window:
        middle = lambda name: 0.5 * (before[name] + now[name])
        turned = dt * middle("yaw_rate")
        gained = rotate(dt * middle("a_x"), dt * middle("a_y"), 0.5 * turned)
        rolled = now["roll_rate"] if self.parts.three_more else jnp.zeros_like(dt)
        piece = Window(dt, turned, *gained, now["yaw_rate"], rolled)
        after = window_after(window, piece, self.system.longest_lag)
        return jax.tree.map(lambda new, none: jnp.where(lost, none, new), after, empty_window(dt))

    def _measured(self, values, pasts: dict[str, Past], said) -> dict[str, Any]:
        """The measurements of satellites, wheels and camera where the window covers their lag, and the pseudo-measurements of
        zero."""
        known = lambda name, value: jnp.where(pasts[name].covered, value, jnp.nan)
        # Without a measurement of the inertial unit there is no information on the axle, either.
        nothing = jnp.where(said, jnp.zeros_like(values["a_y"]), jnp.nan)
        seen = {name: known("sky", values[name]) for name in ("speed", "course")}
        seen |= {ROLLS: nothing, f"{STANDS}_roll": nothing, f"{STANDS}_pitch": nothing}
        if self.parts.axle != "none":
            seen[BALANCE] = known("whole", nothing)
        if self.parts.heading:
            seen["heading"] = known("sky", values["heading"])
        if self.parts.wheels:
            seen["wheel_speed"] = 0.5 * (jnp.abs(values["wheel_speed_rl"]) + jnp.abs(values["wheel_speed_rr"]))
        if self.parts.camera:
            seen |= {name: known("camera", values[name]) for name in ("lane_offset", "lane_heading")}
        if self.parts.three_more:
            seen["a_z"] = values["a_z"]
        return seen

"""What is made of a log's row before the filter sees it: looking back only."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh.estimators.live import AbstractCleaning
from jaxveh.estimators.navigation.observed import BALANCE, ROLLS, STANDS
from jaxveh.estimators.navigation.system import Navigator, Parts
from jaxveh.estimators.navigation.window import Past, Window, empty_window, look_back, rotate, window_after
from jaxveh.vehicles import GRAVITY

FELT = ("a_x", "a_y", "yaw_rate")
MORE = ("a_z", "roll_rate", "pitch_rate")

SMOOTH = 0.03
"""s: the yaw acceleration is the yaw rate's slope behind a low-pass of this time."""

LONGEST_SILENCE = 0.25
"""s: an inertial unit that has been silent for longer is no witness: all must begin anew."""


class Felt(NamedTuple):
    """The last row: its time (s), what the unit said last by channel, when (s), the yaw rate behind a low-pass (rad/s), and the
    last moments of the satellites' lag, and of the camera's where there is one."""

    t: Any
    held: dict[str, Any]
    spoke: Any
    smooth: Any
    window: Window
    camera: Window | None


class Cleaning(AbstractCleaning):
    """Holds what the inertial unit said last, moves it from the unit's place to the centre of gravity, and looks back by the lags
    of the `system`."""

    system: Navigator

    @property
    def parts(self) -> Parts:
        """What is read."""
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
        camera = empty_window(t) if self.parts.camera else None
        spoken = jnp.where(jnp.isnan(values["yaw_rate"]), start["yaw_rate"], values["yaw_rate"])
        memory = Felt(t, start, t - 2.0 * LONGEST_SILENCE, spoken, empty_window(t), camera)
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
        window = self._window(memory.window, before, now, dt, lost, self.system.lag)
        past = look_back(window, self.system.lag)
        step = jnp.clip(t - memory.spoke, 1e-3, LONGEST_SILENCE)
        cleaned = now | past._asdict() | {"yaw_acceleration": yaw_acceleration, "step": step}
        cleaned |= self._measured(values, past, said)
        camera = memory.camera
        if camera is not None:
            camera = self._window(camera, before, now, dt, lost, self.system.camera_lag)
            cleaned |= self._seen(values, look_back(camera, self.system.camera_lag))
        cleaned["felt"] = t - spoke <= LONGEST_SILENCE
        return Felt(t, held, spoke, smooth, window, camera), cleaned

    def _at_centre(self, held, yaw_acceleration) -> dict[str, Any]:
        """Accelerations of the centre of gravity in a plane motion; the other channels as they are."""
        turns = jnp.square(held["yaw_rate"])
        moved = {
            "a_x": held["a_x"] + yaw_acceleration * self.system.unit_y + turns * self.system.unit_x,
            "a_y": held["a_y"] - yaw_acceleration * self.system.unit_x + turns * self.system.unit_y,
        }
        return held | moved

    def _window(self, window: Window, before, now, dt, lost, lag) -> Window:
        middle = lambda name: 0.5 * (before[name] + now[name])
        turned = dt * middle("yaw_rate")
        gained = rotate(dt * middle("a_x"), dt * middle("a_y"), 0.5 * turned)
        rolled = now["roll_rate"] if self.parts.three_more else jnp.zeros_like(dt)
        piece = Window(dt, turned, *gained, now["yaw_rate"], rolled)
        after = window_after(window, piece, lag)
        return jax.tree.map(lambda new, none: jnp.where(lost, none, new), after, empty_window(dt))

    def _measured(self, values, past: Past, said) -> dict[str, Any]:
        """What satellites and wheels said, where the past that it is of is known; and what is measured to be nothing."""
        known = lambda value: jnp.where(past.covered, value, jnp.nan)
        # An unit that is silent says nothing of the axle either.
        nothing = jnp.where(said, jnp.zeros_like(past.turned), jnp.nan)
        seen = {"speed": known(values["speed"]), "course": known(values["course"])}
        seen |= {BALANCE: nothing, ROLLS: nothing, f"{STANDS}_roll": nothing, f"{STANDS}_pitch": nothing}
        if self.parts.heading:
            seen["heading"] = known(values["heading"])
        if self.parts.wheels:
            seen["wheel_speed"] = 0.5 * (jnp.abs(values["wheel_speed_rl"]) + jnp.abs(values["wheel_speed_rr"]))
        if self.parts.three_more:
            seen["a_z"] = values["a_z"]
        return seen

    def _seen(self, values, past: Past) -> dict[str, Any]:
        known = lambda value: jnp.where(past.covered, value, jnp.nan)
        return {
            "camera_turned": past.turned,
            "camera_gained_x": past.gained_x,
            "camera_gained_y": past.gained_y,
            "lane_offset": known(values["lane_offset"]),
            "lane_heading": known(values["lane_heading"]),
        }

"""Open-loop steering at constant speed; all shapes are twice continuously differentiable in time."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import check, check_at_least, check_known, check_positive
from jaxveh.manoeuvres.base import AbstractSteering, check_drive, window
from jaxveh.numerics import smooth_step


class DoubleLaneChange(AbstractSteering):
    """One sine period of steer to change lanes, a pause, and the mirrored period to change back.

    Each period is faded in and out over an eighth of it, so that its peaks stay at plus and minus `steer`.
    """

    _: KW_ONLY
    start: float = eqx.field(static=True)
    period: float = eqx.field(static=True)
    pause: float = eqx.field(static=True)

    def form(self, t: jax.Array) -> jax.Array:
        back = self.start + self.period + self.pause
        return self._change(t, self.start) - self._change(t, back)

    def _change(self, t, start):
        # Outside its window the sine's argument is held: large arguments lose accuracy in float32.
        inside = jnp.clip(t - start, 0.0, self.period)
        fade = window(t, start, start + self.period, self.period / 8)
        return numerics.sin(inside * (2 * math.pi / self.period)) * fade


class StepSteer(AbstractSteering):
    """Straight ahead until `start`, then a smooth ramp of length `ramp` to a constant `steer`."""

    _: KW_ONLY
    ramp: float = eqx.field(static=True)
    start: float = eqx.field(static=True)

    def form(self, t: jax.Array) -> jax.Array:
        return smooth_step((t - self.start) / self.ramp)


class SweptSine(AbstractSteering):
    """A sine whose frequency rises linearly over the duration, with smooth edges of length `edge` at both ends."""

    _: KW_ONLY
    from_frequency: float = eqx.field(static=True)
    to_frequency: float = eqx.field(static=True)
    edge: float = eqx.field(static=True)

    def form(self, t: jax.Array) -> jax.Array:
        rise = (self.to_frequency - self.from_frequency) / (2 * self.duration)
        turns = t * (self.from_frequency + rise * t)
        wave = numerics.sin((2 * math.pi) * turns) * window(t, 0.0, self.duration, self.edge)
        return wave


def double_lane_change(
    speed, steer, *, start: float = 0.5, period: float = 2.5, pause: float = 0.5, duration: float = 7.0
) -> DoubleLaneChange:
    """A double lane change at `speed` (m/s) with steer peaks of plus and minus `steer` (rad at the road wheels).

    The car drives straight ahead until `start`; then follow one sine `period` (left first for positive steer), a
    `pause` and the mirrored period, and it drives straight ahead until `duration` (all in s). The paper of Bao,
    Sabbioni et al. (2015) shows no steering trace: the shape is our choice.

    **Raises** `InputError` for values out of range, or where the two periods do not fit into the duration.
    """
    check_drive(speed, duration, steer)
    check_known(start=start, pause=pause, period=period)
    check_at_least("start", start, 0.0)
    check_at_least("pause", pause, 0.0)
    check_positive("period", period, "s")
    end = start + 2 * period + pause
    check("duration", duration, lambda d: d >= end, f"at least start + 2 period + pause = {end:g} s")
    return DoubleLaneChange(
        start=float(start), period=float(period), pause=float(pause), duration=float(duration), speed=speed, steer=steer
    )


def step_steer(speed, steer, *, ramp: float = 0.2, start: float = 1.0, duration: float = 7.0) -> StepSteer:
    """A steer step to `steer` (rad at the road wheels) at `speed` (m/s): straight ahead until `start`, a smooth `ramp`
    (s), then constant steer.

    **Raises** `InputError` for values out of range, or where the ramp does not end within the duration.
    """
    check_drive(speed, duration, steer)
    check_known(start=start, ramp=ramp)
    check_at_least("start", start, 0.0)
    check_positive("ramp", ramp, "s", "A step without a ramp has no derivative; for a sharp one use 0.01 s.")
    check("duration", duration, lambda d: d >= start + ramp, f"at least start + ramp = {start + ramp:g} s")
    return StepSteer(duration=float(duration), speed=speed, steer=steer, ramp=float(ramp), start=float(start))


def swept_sine(
    speed,
    steer,
    from_frequency: float = 0.2,
    to_frequency: float = 2.0,
    duration: float = 20.0,
    *,
    edge: float = 0.5,
) -> SweptSine:
    """A sine steer of amplitude `steer` (rad at the road wheels) at `speed` (m/s) with a linearly rising frequency.

    `from_frequency` (Hz, at the start), `to_frequency` (Hz, at the end), `edge` (s): length of the smooth fades at both ends.

    **Raises** `InputError` for values out of range, or edges that together are longer than the duration.
    """
    check_drive(speed, duration, steer)
    check_known(from_frequency=from_frequency, to_frequency=to_frequency, edge=edge)
    check_positive("from_frequency", from_frequency, "Hz")
    check_positive("to_frequency", to_frequency, "Hz")
    check_positive("edge", edge, "s")
    check("edge", edge, lambda e: 2 * e <= duration, f"at most half the duration, {duration / 2:g} s")
    return SweptSine(
        from_frequency=float(from_frequency), to_frequency=float(to_frequency), edge=float(edge),
        duration=float(duration), speed=speed, steer=steer,
    )  # fmt: skip

"""Open-loop steering at constant speed, as in standards: sine with dwell, ramp, slalom.

All of them are three times continuously differentiable in time: the corners of a shape are rounded over an `edge`.
"""

from __future__ import annotations

import math
from dataclasses import KW_ONLY

import equinox as eqx
import jax

from jaxveh import numerics
from jaxveh._core.errors import check, check_at_least, check_known, check_positive
from jaxveh.manoeuvres.base import AbstractSteering, check_drive
from jaxveh.numerics import smooth_ramp


class AbstractRounded(AbstractSteering):
    """Steering from `start` (s) on, with corners rounded over `edge` (s)."""

    _: KW_ONLY
    edge: float = eqx.field(static=True)
    start: float = eqx.field(static=True)

    def since(self, t: jax.Array, begin: float) -> jax.Array:
        """The time since `begin` (s), zero before it, with a rounded corner."""
        return smooth_ramp(t - begin, self.edge / 2)


class SineWithDwell(AbstractRounded):
    """One sine period of steer whose second peak is held for a while (FMVSS 126: 49 CFR 571.126, S7.9).

    The phase of the sine runs at its frequency and stands still during the dwell. It starts and stops smoothly within
    `edge`, half of it before and half of it after the corner, so that the quarters of the sine keep their lengths.
    """

    _: KW_ONLY
    frequency: float = eqx.field(static=True)
    dwell: float = eqx.field(static=True)

    def form(self, t: jax.Array) -> jax.Array:
        period, held = 1.0 / self.frequency, self.start + 0.75 / self.frequency
        runs = ((self.start, held), (held + self.dwell, self.start + period + self.dwell))
        running = sum(self.since(t, begin) - self.since(t, end) for begin, end in runs)
        return numerics.sin((2 * math.pi * self.frequency) * running)


class RampSteer(AbstractRounded):
    """Steer that grows linearly over `rise` from `start` on and is then constant (ISO 4138, constant speed, variable steer)."""

    _: KW_ONLY
    rise: float = eqx.field(static=True)

    def form(self, t: jax.Array) -> jax.Array:
        rising = self.since(t, self.start) - self.since(t, self.start + self.rise)
        return rising / self.rise


class Slalom(AbstractRounded):
    """A number of sine periods of steer, as in a slalom between cones."""

    _: KW_ONLY
    frequency: float = eqx.field(static=True)
    periods: float = eqx.field(static=True)

    def form(self, t: jax.Array) -> jax.Array:
        running = self.since(t, self.start) - self.since(t, self.start + self.periods / self.frequency)
        return numerics.sin((2 * math.pi * self.frequency) * running)


def sine_with_dwell(
    speed,
    steer,
    *,
    frequency: float = 0.7,
    dwell: float = 0.5,
    edge: float = 0.05,
    start: float = 1.0,
    duration: float = 6.0,
) -> SineWithDwell:
    """The sine with dwell of FMVSS 126 at `speed` (m/s): peaks of `steer` and minus `steer` (rad at the road wheels).

    A sine of 0.7 Hz from `start` (s) on, a `dwell` of 0.5 s at its second peak (after three quarters), then its last
    quarter (49 CFR 571.126, S7.9; there the speed is 80 km/h, and the steer is in multiples of the steering wheel's
    angle at 0.3 g). `edge` (s): the time over which the phase starts and stops. During `dwell - edge` of the dwell the
    steer is exactly at the peak, and during the rest within 2e-4 of it at the default values.

    In the standard the car coasts (S7.9). Here the demanded speed is constant; for a car driven by torques, `simulate`
    holds it by a driver with pedals (`SpeedControl`).

    **Raises** `InputError` for values out of range, or a sine that does not end within the duration.
    """
    check_drive(speed, duration, steer)
    check_known(frequency=frequency, dwell=dwell, edge=edge, start=start)
    check_positive("frequency", frequency, "Hz")
    check_positive("dwell", dwell, "s")
    _check_edge(edge, start, min(dwell, 0.25 / frequency))
    end = start + 1 / frequency + dwell + edge / 2
    check("duration", duration, lambda d: d >= end, f"at least start + period + dwell + edge / 2 = {end:g} s")
    return SineWithDwell(
        frequency=float(frequency), dwell=float(dwell), edge=float(edge), start=float(start),
        duration=float(duration), speed=speed, steer=steer,
    )  # fmt: skip


def ramp_steer(
    speed, steer, *, rise: float = 20.0, edge: float = 0.5, start: float = 1.0, duration: float | None = None
) -> RampSteer:
    """Steer that grows at a constant rate to `steer` (rad at the road wheels) at `speed` (m/s) and is then constant.

    `rise` (s): the time over which it grows, from `start` (s) on; if it is long enough, the car is in steady state
    throughout (ISO 4138, constant speed with variable steer). `edge` (s, over which corners are rounded). `duration`
    (s): by default until 2 s after the end.

    **Raises** `InputError` for values out of range, or a ramp that does not end within the duration.
    """
    check_known(rise=rise, edge=edge, start=start)
    end = start + rise + edge / 2
    duration = end + 2.0 if duration is None else duration
    check_drive(speed, duration, steer)
    check_positive("rise", rise, "s")
    _check_edge(edge, start, rise)
    check("duration", duration, lambda d: d >= end, f"at least start + rise + edge / 2 = {end:g} s")
    return RampSteer(
        rise=float(rise), edge=float(edge), start=float(start), duration=float(duration), speed=speed, steer=steer
    )


def slalom(
    speed, steer, *, frequency: float = 0.5, periods: float = 4.0, edge: float = 0.2, start: float = 1.0,
    duration: float | None = None,
) -> Slalom:  # fmt: skip
    """Sine periods of steer with peaks of `steer` (rad at the road wheels) at `speed` (m/s), open loop.

    `frequency` (Hz); `periods`: their number, from `start` (s) on. For cones at a distance d from each other the
    frequency is `speed / (2 d)`. `edge` (s, over which the phase starts and stops). `duration` (s): by default until 1
    s after the end. For a slalom in closed loop see `slalom_course`.

    **Raises** `InputError` for values out of range, or periods that do not end within the duration.
    """
    check_known(frequency=frequency, periods=periods, edge=edge, start=start)
    check_positive("frequency", frequency, "Hz")
    check_positive("periods", periods)
    end = start + periods / frequency + edge / 2
    duration = end + 1.0 if duration is None else duration
    check_drive(speed, duration, steer)
    _check_edge(edge, start, min(0.25, periods) / frequency)
    check("duration", duration, lambda d: d >= end, f"at least start + periods / frequency + edge / 2 = {end:g} s")
    return Slalom(
        frequency=float(frequency), periods=float(periods), edge=float(edge), start=float(start),
        duration=float(duration), speed=speed, steer=steer,
    )  # fmt: skip


def _check_edge(edge: float, start: float, most: float) -> None:
    check_positive("edge", edge, "s", "A corner without an edge has no derivative; for a sharp one use 0.01 s.")
    check("edge", edge, lambda v: v <= most, f"at most {most:g} s, the part of the shape that contains it")
    check_at_least("start", start, edge / 2, "The first edge begins edge / 2 before the start.")

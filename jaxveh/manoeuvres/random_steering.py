"""Random steering in a band of frequencies, for identification."""

from __future__ import annotations

from dataclasses import KW_ONLY

import equinox as eqx
import jax

from jaxveh._core.errors import check, check_known, check_positive, check_whole
from jaxveh._core.parameter import parameter
from jaxveh.manoeuvres.base import AbstractSteering, check_drive, window
from jaxveh.numerics import band_harmonics, sum_of_harmonics


class RandomSteering(AbstractSteering):
    """Random steer at a constant speed, white between two frequencies, with smooth edges at both ends.

    `steer` (rad) is its standard deviation; `frequencies` (Hz) and `phases` (rad) are those of its harmonics, (n,).
    """

    _: KW_ONLY
    edge: float = eqx.field(static=True)
    frequencies: jax.Array = parameter("Hz", scale=1.0)
    phases: jax.Array = parameter("rad", scale=1.0)

    def form(self, t: jax.Array) -> jax.Array:
        wave = sum_of_harmonics(t, self.frequencies, self.phases) * window(t, 0.0, self.duration, self.edge)
        return wave


def random_steering(
    speed, steer, key: jax.Array, *, lowest: float = 0.1, highest: float = 2.0, count: int = 60, edge: float = 1.0,
    duration: float = 60.0,
) -> RandomSteering:  # fmt: skip
    """Random steer of standard deviation `steer` (rad at the road wheels) at `speed` (m/s) (ISO 7401, random input).

    The steer is white between the frequencies `lowest` and `highest` (Hz): `count` harmonics of equal amplitude, each
    with a random frequency in its own equal part of the band and a random phase, drawn from `key`. `edge` (s): length
    of the smooth fades at both ends.

    **Raises** `InputError` for values out of range.
    """
    check_drive(speed, duration, steer)
    check_known(lowest=lowest, highest=highest, edge=edge)
    check_positive("lowest", lowest, "Hz")
    check("highest", highest, lambda v: v > lowest, f"above lowest = {lowest:g} Hz")
    check_whole("count", count)
    check_positive("edge", edge, "s")
    check("edge", edge, lambda e: 2 * e <= duration, f"at most half the duration, {duration / 2:g} s")
    frequencies, phases = band_harmonics(key, lowest, highest, count)
    return RandomSteering(
        edge=float(edge), duration=float(duration), speed=speed, steer=steer, frequencies=frequencies, phases=phases
    )

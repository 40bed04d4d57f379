"""The numbers of ISO 4138: the growth of the steer with the lateral acceleration in steady turns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_kind, check_positive
from jaxveh._core.host import on_host
from jaxveh._core.recording import Recording
from jaxveh.diagnostics.drive_channels import (
    LONGEST_GAP,
    channel,
    seconds,
    sideslip,
    sideslip_channels,
    within_gaps,
)

LINEAR_A_Y = 4.0
"""Lateral acceleration up to which passenger cars count as linear, m/s^2."""

SLOWEST = 2.0
"""Speed below which turns are not used, m/s."""

FEWEST = 5

STEADY = 0.5
"""Largest rate of the lateral acceleration over a second in a steady row, m/s^3; our choice."""

SETTLED = 1.0
"""Time after an unsteady row during which rows are left out, s; our choice."""


class SteadyTurns(NamedTuple):
    """Rows of steady turns, (n,) each: `a_y` (m/s^2), `steer` and `sideslip` (rad).

    `geometric_steer`: wheelbase times curvature (rad; None without a wheelbase).
    """

    a_y: np.ndarray
    steer: np.ndarray
    sideslip: np.ndarray
    geometric_steer: np.ndarray | None


class Understeer(NamedTuple):
    """Slopes of straight lines through the linear range, rad s^2/m.

    `gradient`: ISO 4138's understeer gradient at the road wheels, the slope of the steer beyond the geometric one;
    `sideslip_gradient`: the slope of the sideslip; `rows`: the number of rows.
    """

    gradient: float
    sideslip_gradient: float
    rows: int


@on_host
def steady_turns(recording: Recording, wheelbase: float | None = None, *, steady: float = STEADY) -> SteadyTurns:
    """Return the quasi-steady rows of a drive, such as a slow ramp of steer, or a circle at slowly rising speed.

    Left out are rows below `SLOWEST`, rows about which the lateral acceleration changes by more than `steady` (m/s^3) within
    a second, rows within `SETTLED` after those, and rows in gaps of more than `LONGEST_GAP` (0.5 s) in a channel that is
    used. Curvature is `yaw_rate / v_x`.

    **Raises** `InputError` for a missing channel, a wheelbase that is not positive, or if no row is steady.
    """
    check_positive("steady", steady, "m/s^3")
    v_x = channel(recording, "v_x")
    moves = (v_x >= SLOWEST) & _is_settled(seconds(recording), channel(recording, "a_y"), steady)
    used = {"v_x", "a_y", "steer", *sideslip_channels(recording)} | ({"yaw_rate"} if wheelbase is not None else set())
    for name in sorted(used):
        moves &= ~within_gaps(recording, name)
    if not moves.any():
        raise InputError(
            f"steady_turns: there is no row in which the car is faster than {SLOWEST:g} m/s and its lateral acceleration changes "
            f"by less than {steady:g} m/s^3, outside gaps of more than {LONGEST_GAP:g} s in {', '.join(sorted(used))}: drive "
            "more slowly into the turn."
        )
    geometric = None
    if wheelbase is not None:
        check_positive("wheelbase", wheelbase, "m")
        geometric = float(wheelbase) * channel(recording, "yaw_rate")[moves] / v_x[moves]
    return SteadyTurns(
        channel(recording, "a_y")[moves],
        channel(recording, "steer")[moves],
        sideslip(recording)[moves],
        geometric,
    )


def _is_settled(time: np.ndarray, a_y: np.ndarray, steady: float) -> np.ndarray:
    """Whether each row and the rows of the last `SETTLED` seconds before it are steady."""
    before, after = np.clip(time - 0.5, time[0], time[-1]), np.clip(time + 0.5, time[0], time[-1])
    rate = np.abs(np.interp(after, time, a_y) - np.interp(before, time, a_y)) / np.where(
        after > before, after - before, 1.0
    )
    unsteady = np.append(time[rate > steady], np.inf)
    last = np.concatenate([[-np.inf], unsteady])[np.searchsorted(unsteady, time, side="right")]
    return time - last > SETTLED


@on_host
def understeer(turns: SteadyTurns, *, above: float = 0.2, linear: float = LINEAR_A_Y) -> Understeer:
    """Return the gradients of ISO 4138 in the linear range, by least squares over rows with `above` <= |a_y| <= `linear` (m/s^2).

    **Raises** `InputError` if there is no wheelbase, or there are too few rows in the range.
    """
    check_kind("understeer: turns", turns, SteadyTurns, "steady_turns finds them in a recording.")
    if turns.geometric_steer is None:
        raise InputError("understeer: the geometric steer is unknown; give `steady_turns` the car's wheelbase (m).")
    size = np.abs(turns.a_y)
    rows = (size >= above) & (size <= linear)
    if rows.sum() < FEWEST or np.ptp(turns.a_y[rows]) < 0.1 * linear:
        raise InputError(
            f"understeer: {int(rows.sum())} rows with |a_y| between {above:g} and {linear:g} m/s^2, over too small a range; "
            "the drive must cross the range slowly (ramp-steer, steady-circle)."
        )
    slope = lambda values: float(np.polyfit(turns.a_y[rows], values[rows], 1)[0])
    return Understeer(slope(turns.steer - turns.geometric_steer), slope(turns.sideslip), int(rows.sum()))

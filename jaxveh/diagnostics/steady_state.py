"""The numbers of ISO 4138: how the steer grows with the lateral acceleration in steady turns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_positive
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
"""m/s^2: the lateral acceleration up to which passenger cars are taken as linear."""

SLOWEST = 2.0
"""m/s: below it nothing is said of turns."""

FEWEST = 5

STEADY = 0.5
"""m/s^3: rows count as steady while the lateral acceleration changes by less in a second; ours."""

SETTLED = 1.0
"""s: how long rows after an unsteady one are left out; ours."""


class SteadyTurns(NamedTuple):
    """Rows of steady turns, (n,) each: `a_y` (m/s^2), `steer` and `sideslip` (rad), `geometric_steer` = wheelbase times
    curvature (rad; None without a wheelbase)."""

    a_y: np.ndarray
    steer: np.ndarray
    sideslip: np.ndarray
    geometric_steer: np.ndarray | None


class Understeer(NamedTuple):
    """Slopes of straight lines through the linear range, rad s^2/m: `gradient` (ISO 4138's understeer gradient at the road
    wheels: of the steer beyond the geometric one) and `sideslip_gradient`; `rows`: how many were used."""

    gradient: float
    sideslip_gradient: float
    rows: int


def steady_turns(recording: Recording, wheelbase: float | None = None, *, steady: float = STEADY) -> SteadyTurns:
    """The quasi-steady rows of a drive: a slow ramp of steer, a circle at slowly rising speed.

    Left out are rows below `SLOWEST`, those about which the lateral acceleration changes by more than `steady` (m/s^3) within
    a second, what follows them within `SETTLED`, and those in gaps of more than `LONGEST_GAP` (0.5 s) of a channel that they
    are made of. Curvature is `yaw_rate / v_x`.

    **Raises** `InputError` for a channel that is not there, a wheelbase that is not positive, or where no row is steady.
    """
    check_positive("steady", steady, "m/s^3")
    v_x = channel(recording, "v_x")
    moves = (v_x >= SLOWEST) & _is_settled(seconds(recording), channel(recording, "a_y"), steady)
    used = {"v_x", "a_y", "steer", *sideslip_channels(recording)} | ({"yaw_rate"} if wheelbase is not None else set())
    for name in sorted(used):
        moves &= ~within_gaps(recording, name)
    if not moves.any():
        raise InputError(
            f"steady_turns: in no row the car is faster than {SLOWEST:g} m/s and its lateral acceleration changes by less than "
            f"{steady:g} m/s^3, outside gaps of more than {LONGEST_GAP:g} s in {', '.join(sorted(used))}: drive more slowly into "
            "the turn."
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
    """Whether each row, and those of the last `SETTLED` seconds, are steady."""
    before, after = np.clip(time - 0.5, time[0], time[-1]), np.clip(time + 0.5, time[0], time[-1])
    rate = np.abs(np.interp(after, time, a_y) - np.interp(before, time, a_y)) / np.where(
        after > before, after - before, 1.0
    )
    unsteady = np.append(time[rate > steady], np.inf)
    last = np.concatenate([[-np.inf], unsteady])[np.searchsorted(unsteady, time, side="right")]
    return time - last > SETTLED


def understeer(turns: SteadyTurns, *, above: float = 0.2, linear: float = LINEAR_A_Y) -> Understeer:
    """The gradients of ISO 4138 in the linear range, by least squares over rows with `above` <= |a_y| <= `linear` (m/s^2).

    **Raises** `InputError` without a wheelbase, or with too few rows in the range.
    """
    if turns.geometric_steer is None:
        raise InputError("understeer: the geometric steer is not known; give `steady_turns` the car's wheelbase (m).")
    size = np.abs(turns.a_y)
    rows = (size >= above) & (size <= linear)
    if rows.sum() < FEWEST or np.ptp(turns.a_y[rows]) < 0.1 * linear:
        raise InputError(
            f"understeer: {int(rows.sum())} rows with |a_y| between {above:g} and {linear:g} m/s^2, over too small a range; "
            "the drive must go through it slowly (ramp-steer, steady-circle)."
        )
    slope = lambda values: float(np.polyfit(turns.a_y[rows], values[rows], 1)[0])
    return Understeer(slope(turns.steer - turns.geometric_steer), slope(turns.sideslip), int(rows.sum()))

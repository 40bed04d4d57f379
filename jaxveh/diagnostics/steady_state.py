"""The numbers of ISO 4138: how the steer grows with the lateral acceleration in steady turns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.recording import Recording
from jaxveh.diagnostics.drive_channels import channel, sideslip

LINEAR = 4.0
"""m/s^2: the lateral acceleration up to which passenger cars are taken as linear."""

SLOWEST = 2.0
"""m/s: below it nothing is said of turns."""

FEWEST = 5


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


def steady_turns(recording: Recording, wheelbase: float | None = None) -> SteadyTurns:
    """The rows of a drive that is quasi-steady throughout: a slow ramp of steer, a circle at slowly rising speed.

    Curvature is `yaw_rate / v_x`; rows below `SLOWEST` are left out.

    **Raises** `InputError` for a channel that is not there, or a wheelbase that is not positive.
    """
    v_x = channel(recording, "v_x")
    moves = v_x >= SLOWEST
    geometric = None
    if wheelbase is not None:
        check_positive("wheelbase", wheelbase, "m")
        geometric = float(wheelbase) * channel(recording, "yaw_rate")[moves] / v_x[moves]
    return SteadyTurns(
        channel(recording, "a_y")[moves], channel(recording, "steer")[moves], sideslip(recording)[moves], geometric
    )


def understeer(turns: SteadyTurns, *, above: float = 0.2, linear: float = LINEAR) -> Understeer:
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

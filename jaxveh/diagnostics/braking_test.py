"""The numbers of a braking test (UN Regulation No. 13-H)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.host import on_host
from jaxveh._core.recording import Recording
from jaxveh.diagnostics.drive_channels import channel, check_gaps, crossing, has, seconds

PRESSED = 0.01
"""Share of the largest brake torque above which the brake counts as pressed; without that channel, share of the initial speed
that is lost when it counts as pressed."""

BETWEEN = (0.8, 0.1)
"""Shares of the initial speed between which the deceleration counts as fully developed (UN R13-H, annex 3, 1.1.3)."""


class BrakingTest(NamedTuple):
    """The numbers of a braking test; those at lower speeds are NaN if the car does not become that slow.

    `begins`: the time when the brake is pressed (s). `speed`: at that time (m/s). `mean_deceleration` (m/s^2): the mean fully
    developed deceleration (v_b^2 - v_e^2) / (2 (s_e - s_b)) of UN R13-H, with `v_b`, `v_e` 0.8 and 0.1 of the initial speed.
    `distance` (m): from the beginning to a tenth of the initial speed. `peak_deceleration` (m/s^2). `most_slip`: the largest
    absolute slip ratio of any wheel while braking (-; NaN if the recording has none).
    """

    begins: float
    speed: float
    mean_deceleration: float
    distance: float
    peak_deceleration: float
    most_slip: float


@on_host
def braking_test(recording: Recording) -> BrakingTest:
    """Return the numbers of a drive with one braking.

    The distance is the integral of `v_x`. Slip ratios count while the car is faster than a tenth of its initial speed.

    **Raises** `InputError` if `v_x` is missing, the car does not brake, or a channel has a gap of more than `LONGEST_GAP`
    (0.5 s) when the brake is pressed or while the car brakes.
    """
    time, v_x = seconds(recording), channel(recording, "v_x")
    begins = _begins(recording, time, v_x)
    speed = float(np.interp(begins, time, v_x))
    way = np.concatenate([[0.0], np.cumsum(np.diff(time) * (v_x[1:] + v_x[:-1]) / 2)])
    place = lambda at: float(np.interp(at, time, way)) if np.isfinite(at) else float("nan")
    v_b, v_e = (share * speed for share in BETWEEN)
    at_b, at_e = (crossing(time, -v_x, -v, begins) for v in (v_b, v_e))
    end = at_e if np.isfinite(at_e) else float(time[-1])
    check_gaps(recording, "v_x", begins, end, "braking_test")
    rate = -np.gradient(v_x, time)
    braked = (time >= begins) & (v_x > v_e)
    slips = [f"slip_ratio_{wheel}" for wheel in ("fl", "fr", "rl", "rr") if has(recording, f"slip_ratio_{wheel}")]
    for name in slips:
        check_gaps(recording, name, begins, end, "braking_test")
    most = max((float(np.max(np.abs(channel(recording, name)[braked]))) for name in slips), default=float("nan"))
    return BrakingTest(
        begins, speed, (v_b**2 - v_e**2) / (2 * (place(at_e) - place(at_b))), place(at_e) - place(begins),
        float(np.max(rate[braked])), most,
    )  # fmt: skip


def _begins(recording: Recording, time: np.ndarray, v_x: np.ndarray) -> float:
    if has(recording, "brake_torque"):
        torque = channel(recording, "brake_torque")
        begins = crossing(time, torque, PRESSED * float(np.max(torque))) if np.max(torque) > 0 else float("nan")
    else:
        begins = crossing(time, v_x[0] - v_x, PRESSED * v_x[0])
    if not np.isfinite(begins) or not begins < time[-1]:
        raise InputError("braking_test: the car does not brake in this drive.")
    check_gaps(recording, "brake_torque" if has(recording, "brake_torque") else "v_x", begins, begins, "braking_test")
    return begins

"""Fits the front axle's stiffness and the steer offset, once sideslip is known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jaxveh._core.recording import Recording
from jaxveh.estimators.coarse_log import coarse
from jaxveh.estimators.rear_steer import with_rear_angle
from jaxveh.filters import Extended, smooth
from jaxveh.statespace import StateSpace

LARGEST_SHARE = 0.6
"""Share of the rear axle's grip: the straight line is fitted to forces up to this."""


FEWEST = 20
"""The least number of rows for the fit."""


class FrontAxle(NamedTuple):
    """The front axle's values for a car's file: the stiffness in N/rad, and the reading of the steer channel in rad when the
    car runs straight."""

    front_cornering_stiffness: float
    steer_offset: float


def front_axle(model: StateSpace, recordings: Sequence[Recording]) -> FrontAxle | None:
    """Least squares of slip angles on forces: `steer - v_y / v_x - a yaw_rate / v_x = F / stiffness + offset`.

    Forces and v_y are those of a calibrated `rear_axle_model` on the logs; rows beyond `LARGEST_SHARE` or too slow are not
    counted. None if too few rows are left, or if the slip angle does not grow with the force: then the channel is not a
    steering angle.
    """
    seen = [_seen(model, one) for one in recordings]
    slip, force = (np.concatenate(values) for values in zip(*seen, strict=True))
    if len(slip) < FEWEST:
        return None
    design = np.stack([force, np.ones_like(force)], axis=1)
    (softness, offset), *_ = np.linalg.lstsq(design, slip, rcond=None)
    return FrontAxle(1.0 / float(softness), float(offset)) if softness > 0 else None


def _seen(model: StateSpace, recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Slip angles (rad) and forces (N) of the front axle in the rows that count."""
    s = model.system
    log = coarse(with_rear_angle("sideslip", s.rear_steer, recording), float(s.wheelbase))
    found = smooth(Extended(), model, log.select([*model.inputs, *model.channels]))
    rows = model.rows(log)
    share, rear = (np.asarray(one) for one in s.shares(rows.u))
    v_x, yaw_rate = np.asarray(rows.u.v_x), np.asarray(rows.u.yaw_rate) - float(s.yaw_rate_offset)
    told = np.asarray(recording["steer"])
    known = np.isfinite(told)
    steer = np.interp(np.asarray(log.time), np.asarray(recording.time)[known], told[known])
    counted = np.isfinite(np.asarray(log[model.channels[0]])) & (np.abs(rear) < LARGEST_SHARE * float(s.grip))
    slip = steer - np.arctan2(np.asarray(found.mean.v_y) + float(s.front_axle_to_cg) * yaw_rate, v_x)
    return slip[counted], (share * np.asarray(s.loads(rows.u)[0]))[counted]

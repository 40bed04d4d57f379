"""The numbers of ISO 7401 for a step of the steering."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.recording import Recording
from jaxveh.diagnostics.drive_channels import channel, check_gaps, crossing, peak, seconds

RESPONSE_SHARE = 0.9
"""Share of the steady value at which the response time is taken."""


class StepResponse(NamedTuple):
    """How one quantity answers a step of the steering (ISO 7401, step input). Times in s from the `reference`.

    `reference`: the instant (s, the recording's time) when half of the steer is turned. `steer`: the step's height (rad).
    `steady`: the steady value, `gain` = steady / steer. `response_time`: to `RESPONSE_SHARE` of the steady value. `peak`,
    `peak_response_time`, `overshoot` = peak / steady - 1; where the response creeps up without a peak, NaN, NaN and 0.
    """

    reference: float
    steer: float
    steady: float
    gain: float
    response_time: float
    peak: float
    peak_response_time: float
    overshoot: float


def step_response(recording: Recording, output: str = "yaw_rate", *, average: float = 0.5) -> StepResponse:
    """The numbers of ISO 7401 of one `output` in a drive whose `steer` is a step.

    The steady value is the mean over the last `average` seconds, values before the step are those of the first row. All
    are of what the recording says: filter a noisy log first. `sensors.low_pass` is causal, and so makes late what it filters:
    times are right only where `steer` is filtered alike.

    **Raises** `InputError` where a channel is missing or has a gap of more than `LONGEST_GAP` (0.5 s), there is no step, or
    the averaging begins before the steer is held.
    """
    check_positive("average", average, "s")
    time, steer, values = seconds(recording), channel(recording, "steer"), channel(recording, output)
    for name in ("steer", output):
        check_gaps(recording, name, time[0], time[-1], "step_response")
    last = time >= time[-1] - average
    steer, values = steer - steer[0], values - values[0]
    height, steady = float(np.mean(steer[last])), float(np.mean(values[last]))
    reach = float(np.max(np.abs(steer)))
    if not reach > 0 or np.ptp(steer[last]) > 0.05 * reach or abs(height) < 0.5 * reach:
        raise InputError(
            f"step_response: the steer is no step that is held over the last {average:g} s; it ends at {height:g} rad and "
            f"reaches {reach:g} rad. A longer drive, or a shorter `average`, may do."
        )
    reference = crossing(time, steer / height, 0.5)
    if steady == 0:
        raise InputError(f"step_response: {output} does not answer the steer at all.")
    risen = values / steady
    when, top = peak(time, np.where(time >= reference, risen, -np.inf))
    peaks = top > 1 and when < time[last][0]
    return StepResponse(
        reference=reference,
        steer=height,
        steady=steady,
        gain=steady / height,
        response_time=crossing(time, risen, RESPONSE_SHARE, reference) - reference,
        peak=top * steady if peaks else float("nan"),
        peak_response_time=when - reference if peaks else float("nan"),
        overshoot=top - 1 if peaks else 0.0,
    )

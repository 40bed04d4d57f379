"""The numbers of ISO 7401 for a step of the steering."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.host import on_host
from jaxveh._core.recording import Recording
from jaxveh.diagnostics.drive_channels import channel, check_gaps, crossing, peak, seconds

RESPONSE_SHARE = 0.9
"""Share of the steady value that defines the response time."""


class StepResponse(NamedTuple):
    """The response of one quantity to a step of the steering (ISO 7401, step input). Times in s from the `reference`.

    `reference`: the instant (s, the recording's time) at half of the step. `steer`: the step's height (rad).
    `steady`: the steady value, `gain` = steady / steer. `response_time`: to `RESPONSE_SHARE` of the steady value. `peak`,
    `peak_response_time`, `overshoot` = peak / steady - 1; for a response without a peak these are NaN, NaN and 0.
    """

    reference: float
    steer: float
    steady: float
    gain: float
    response_time: float
    peak: float
    peak_response_time: float
    overshoot: float


@on_host
def step_response(recording: Recording, output: str = "yaw_rate", *, average: float = 0.5) -> StepResponse:
    """Return the numbers of ISO 7401 of one `output` in a drive whose `steer` is a step.

    The steady value is the mean over the last `average` seconds; the values before the step are those of the first row. The
    recording is not filtered: filter a noisy log first. `sensors.low_pass` is causal and delays the filtered channel: times are
    right only if `steer` is filtered in the same way.

    **Raises** `InputError` if a channel is missing or has a gap of more than `LONGEST_GAP` (0.5 s), there is no step, or
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
            f"step_response: the steer is not a step that is held over the last {average:g} s; it ends at {height:g} rad and "
            f"reaches {reach:g} rad. Try a longer drive, or a shorter `average`."
        )
    reference = crossing(time, steer / height, 0.5)
    if steady == 0:
        raise InputError(f"step_response: {output} does not respond to the steer.")
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

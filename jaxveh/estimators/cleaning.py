"""What a real log needs before a filter may read it: every rule looks back only, so that a live loop can follow it."""

from __future__ import annotations

import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.recording import Recording
from jaxveh.sensors import low_pass

STEER_RATE = 3.0
"""rad/s at the road wheels: no driver steers faster, so that a sample beyond it is a spike and the last one is held."""

A_X_CUTOFF = 1.6
"""Hz: the axle loads follow the longitudinal acceleration, not its vibration."""

BLIND_CHANNELS = ("steer", "v_x", "a_x", "a_y", "yaw_rate")
"""The channels that sideslip is estimated from, blind."""


def clean(recording: Recording) -> Recording:
    """The log with steer spikes held, a_x low-passed (first order), and repeated measurements as missing.

    Loggers repeat the last value where a sensor was slower than the log: a row in which neither `yaw_rate` nor `a_y` moved
    holds no news, and counting it twice would make a filter too sure. Host side, causal.

    **Raises** `InputError` where a channel is missing, or an input is NaN (fill it on request first).
    """
    missing = [name for name in BLIND_CHANNELS if name not in recording]
    if missing:
        raise InputError(
            f"log lacks {', '.join(missing)}: sideslip is estimated from {', '.join(BLIND_CHANNELS)}. Name them in a channel map."
        )
    for name in ("steer", "v_x", "a_x"):
        gaps = int(np.isnan(np.asarray(recording[name])).sum())
        if gaps:
            raise InputError(
                f"input channel {name} is NaN in {gaps} rows: an input must be known. "
                f'Fill it on request: recording.fill("{name}", "linear", max_gap=0.1).'
            )
    steer = _hold_spikes(np.array(recording["steer"]), np.asarray(recording.time), STEER_RATE)
    yaw_rate, a_y = np.asarray(recording["yaw_rate"]), np.asarray(recording["a_y"])
    repeated = np.append(False, (np.diff(yaw_rate) == 0) & (np.diff(a_y) == 0))
    cleaned = recording.replace(
        steer=steer, yaw_rate=np.where(repeated, np.nan, yaw_rate), a_y=np.where(repeated, np.nan, a_y)
    )
    return low_pass(cleaned, ["a_x"], A_X_CUTOFF, 1)


def _hold_spikes(values: np.ndarray, time: np.ndarray, rate: float) -> np.ndarray:
    """Values that jump faster than `rate` from the last good one are replaced by it, for a tenth of a second at most."""
    last = 0
    for k in range(1, len(values)):
        if abs(values[k] - values[last]) > rate * (time[k] - time[k - 1]) and time[k] - time[last] < 0.1:
            values[k] = values[last]
        else:
            last = k
    return values

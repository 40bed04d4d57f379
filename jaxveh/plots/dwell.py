"""A sine with dwell against the criteria of FMVSS 126."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh._core.recording import Recording
from jaxveh.diagnostics import SineWithDwellTest, drive_channels, kit
from jaxveh.diagnostics import sine_with_dwell as measure
from jaxveh.plots.panels import GREY, line, note, stack
from jaxveh.plots.style import CYCLE, SHADE, label_above, legend, style

ALLOWED, FORBIDDEN = CYCLE[2], CYCLE[1]


def sine_with_dwell(
    recording: Recording,
    *,
    steering_ratio: float = 16.0,
    steer_at_03g: float | None = None,
    displacement_limit: float = kit.DISPLACEMENT,
    figure: Any = None,
) -> Any:
    """Draw steer, yaw rate and, if the recording has a position, the lateral displacement, with the criteria of FMVSS 126.

    Marked are the yaw rate 1.0 s and 1.75 s after the completion of steer with its limits (35 % and 20 % of the peak), and the
    lateral displacement 1.07 s after the beginning of steer, with its limit if it has one. The numbers are those of
    `jaxveh.diagnostics.sine_with_dwell`, which explains the arguments; curves and marks are as recorded, including the offsets
    that it removes.

    **Returns** the figure. **Raises** `InputError` if the steer is not a sine with dwell, or the drive ends too early.
    """
    found = measure(
        recording, steering_ratio=steering_ratio, steer_at_03g=steer_at_03g, displacement_limit=displacement_limit
    )
    placed = drive_channels.has(recording, "x", "y", "yaw")
    with style():
        figure, axes = stack(figure, 3 if placed else 2, 1.7)
        line(axes[0], recording, "steer")
        for at, words in ((found.begins, "begins"), (found.completed, "completed")):
            axes[0].axvline(at, color=GREY, linewidth=0.7, linestyle=":")
            axes[0].annotate(words, (at, 0.04), xycoords=("data", "axes fraction"), xytext=(3, 0), fontsize=7.5,
                             textcoords="offset points", color=GREY)  # fmt: skip
        line(axes[1], recording, "yaw_rate")
        _mark_yaw(axes[1], recording, found)
        if placed:
            _way(axes[2], recording, found, displacement_limit)
        note(axes[0], f"FMVSS 126: {_words(found)}")
        legend(figure, axes)
    return figure


def _words(found: SineWithDwellTest) -> str:
    if found.passed:
        return "passed" if found.responsive else f"passed (no limit of displacement below {kit.DISPLACED_FROM:g} A)"
    if found.passed is None:
        return "yaw rate within its limits; displacement not judged without the steer at 0.3 g"
    failed = ["yaw rate left too high"] * (not found.stable) + ["displacement too small"] * (found.responsive is False)
    return f"failed ({', '.join(failed)})"


def _mark_yaw(ax: Any, recording: Recording, found: SineWithDwellTest) -> None:
    time, yaw_rate = drive_channels.seconds(recording), np.degrees(drive_channels.channel(recording, "yaw_rate"))
    at_peak = float(np.interp(found.peak_at, time, yaw_rate))
    side = np.sign(at_peak) or 1.0
    ax.plot([found.peak_at], [at_peak], "s", color=GREY, markersize=4.5, label="first peak after the reversal")
    for (after, limit), ratio in zip(kit.YAW_RATE_LIMITS.items(), (found.ratio_1_00, found.ratio_1_75), strict=True):
        at = found.completed + after
        top = side * limit * np.degrees(found.peak)
        ax.plot([at, at], [0.0, top], color=FORBIDDEN, linewidth=1.4)
        ax.plot([at - 0.12, at + 0.12], [top, top], color=FORBIDDEN, linewidth=1.8, label="limit")
        _dot(ax, at, float(np.interp(at, time, yaw_rate)), ratio <= limit)
    ax.axvline(found.completed, color=GREY, linewidth=0.7, linestyle=":")
    words = [
        f"{round(100 * ratio) + 0:d} % of the peak after {after:g} s (at most {100 * limit:.0f} %)"
        for (after, limit), ratio in zip(kit.YAW_RATE_LIMITS.items(), (found.ratio_1_00, found.ratio_1_75), strict=True)
    ]
    note(ax, ",  ".join(words))


def _dot(ax: Any, at: float, value: float, allowed: bool) -> None:
    shade, words = (ALLOWED, "within the limit") if allowed else (FORBIDDEN, "beyond the limit")
    ax.plot([at], [value], "o", color=shade, markersize=5, label=words)


def _way(ax: Any, recording: Recording, found: SineWithDwellTest, limit: float) -> None:
    """Draw the displacement of the car to the left of its initial straight path."""
    time, yaw = drive_channels.seconds(recording), drive_channels.channel(recording, "yaw")[0]
    x, y = (drive_channels.channel(recording, name) for name in ("x", "y"))
    left = y * np.cos(yaw) - x * np.sin(yaw)
    left = left - left[0]
    at = found.begins + kit.DISPLACED_AFTER
    there = float(np.interp(at, time, left))
    side = np.sign(there) * np.sign(found.displacement) or 1.0
    ax.plot(time, left, color=CYCLE[0], linewidth=1.2)
    ax.axvspan(found.begins, at, color=SHADE, linewidth=0, zorder=0)
    asked = found.responsive is not None
    if asked:
        ax.plot([at - 0.12, at + 0.12], [side * limit] * 2, color=FORBIDDEN, linewidth=1.8, label="limit")
        _dot(ax, at, there, bool(found.responsive))
    else:
        ax.plot([at], [there], "o", color=GREY, markersize=5, label="not judged")
    label_above(ax, "lateral displacement [m]")
    # The scale is limited, because the motion long after the instant would hide it.
    reach = 3.0 * max(abs(there), limit)
    low, high = ax.get_ylim()
    ax.set_ylim(max(low, -reach), min(high, reach))
    words = f"at least {limit:g} m" if asked else "not judged"
    note(ax, f"{found.displacement:.2f} m {kit.DISPLACED_AFTER:g} s after the steer begins ({words})")

"""Figures of braking: speeds of car and wheels, slips, deceleration and torque."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxveh._core.errors import InputError, check_positive
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import BrakingTest, braking_test, drive_channels
from jaxveh.plots.panels import WHEELS, has_wheels, note, stack, wheels
from jaxveh.plots.style import COLOURS, CYCLE, label_above, legend, style


def braking(recording: Recording, *, wheel_radius: float | None = None, figure: Any = None) -> Any:
    """Draw the car's speed, the wheel speeds (spin times `wheel_radius`, m), slip ratios, deceleration, and brake torque.

    Without a `wheel_radius` each wheel has the radius with which it rolls freely in the first row. Panels whose channels are
    missing from the recording are left out. The numbers above are those of `jaxveh.diagnostics.braking_test` (UN R13-H).

    **Returns** the figure. **Raises** `InputError` if the car does not brake, or `v_x` is missing.
    """
    if wheel_radius is not None:
        check_positive("wheel_radius", wheel_radius, "m")
    found = braking_test(recording)
    time, v_x = drive_channels.seconds(recording), drive_channels.channel(recording, "v_x")
    panels = {"speed": True, "slip": has_wheels(recording, "slip_ratio"), "deceleration": True,
              "torque": drive_channels.has(recording, "brake_torque")}  # fmt: skip
    with style():
        figure, axes = stack(figure, sum(panels.values()))
        at = dict(zip([name for name, there in panels.items() if there], axes, strict=True))
        if has_wheels(recording, "omega"):
            wheels(at["speed"], recording, "omega", _radii(recording, v_x, wheel_radius), "")
        at["speed"].plot(time, v_x, color=COLOURS["truth"], linewidth=1.6, zorder=1.9, label="car")
        label_above(at["speed"], "speed [m/s]")
        note(at["speed"], _words(found))
        if panels["slip"]:
            wheels(at["slip"], recording, "slip_ratio", 100.0, "slip ratio [%]")
            note(at["slip"], f"at most {100 * found.most_slip:.0f} % down to a tenth of the speed")
        at["deceleration"].plot(time, -np.gradient(v_x, time), color=CYCLE[2], linewidth=1.2)
        label_above(at["deceleration"], "deceleration [m/s²]")
        note(at["deceleration"], f"at most {found.peak_deceleration:.2f} m/s²")
        if panels["torque"]:
            torque = drive_channels.channel(recording, "brake_torque")
            at["torque"].plot(time, torque / 1e3, color=CYCLE[3], linewidth=1.2)
            label_above(at["torque"], "brake torque, all wheels [kN m]")
        for ax in axes:
            ax.axvline(found.begins, color="#666666", linewidth=0.7, linestyle=":")
        legend(figure, axes)
    return figure


def _words(found: BrakingTest) -> str:
    if not np.isfinite(found.mean_deceleration):
        return f"brakes from {found.speed:.1f} m/s; does not reach a tenth of it"
    return (
        f"from {found.speed:.1f} m/s: mean fully developed deceleration {found.mean_deceleration:.2f} m/s², "
        f"{found.distance:.1f} m to a tenth"
    )


def _radii(recording: Recording, v_x: np.ndarray, given: float | None) -> dict[str, float]:
    """Return the factor from a wheel's spin to its speed, m, by wheel."""
    if given is not None:
        return dict.fromkeys(WHEELS, float(given))
    spins = {wheel: float(drive_channels.channel(recording, f"omega_{wheel}")[0]) for wheel in WHEELS}
    if not v_x[0] > 0 or not all(spin > 0 for spin in spins.values()):
        raise InputError("plots.braking: the wheels do not turn in the first row; give their `wheel_radius` (m).")
    return {wheel: float(v_x[0]) / spin for wheel, spin in spins.items()}

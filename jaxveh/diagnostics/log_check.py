"""Is this log fit to estimate from? All checks in one call."""

from __future__ import annotations

from jaxveh._core.recording import Recording
from jaxveh.diagnostics.log_delays import check_delays
from jaxveh.diagnostics.log_findings import LogFinding, LogView
from jaxveh.diagnostics.log_plausibility import check_plausibility
from jaxveh.diagnostics.log_samples import check_samples
from jaxveh.diagnostics.log_sampling import check_sampling
from jaxveh.diagnostics.log_signs import check_signs, check_units, check_wheel_speeds
from jaxveh.diagnostics.log_steering import check_steering
from jaxveh.io import CarSpecification, kit, with_road_steer

CHECKS = (
    check_sampling,
    check_samples,
    check_units,
    check_wheel_speeds,
    check_signs,
    check_delays,
    check_steering,
    check_plausibility,
)


def check_log(recording: Recording, *, car: CarSpecification | None = None) -> list[LogFinding]:
    """Look at a log before trusting it: every check's findings, good and bad, in the order of `CHECKS`.

    **Arguments**: `recording` with channels of the usual names (`v_x`, `v_y`, `yaw_rate`, `a_x`, `a_y`, `steer`) in SI; what
    is missing is not checked. `car`: as `io.read_car` gives it; with it, scale and offset of the steering, delays
    and understeer are held against a linear single track, without it against what is usual, and `steer` may be told by
    `steering_wheel` and the file's ratio.

    Rates, jitter, gaps and missing samples; repeated, frozen and coarse values and spikes; magnitudes; signs and units
    by what channels must agree on; delays by cross-correlation; steering scale and offset; grip and the car's own numbers.
    Host side, in NumPy; nothing is changed. Simulated truth (`true.` channels) is not looked at.

    **Raises** `InputError` for a car whose rear wheels are steered: nothing here knows their angles.
    """
    if car is not None:
        kit.check_front_steered(car, "check_log")
    log = LogView.of(recording if car is None else with_road_steer(car, recording), car)
    return [finding for check in CHECKS for finding in check(log)]

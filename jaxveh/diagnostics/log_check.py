"""All checks of a log in one call."""

from __future__ import annotations

from jaxveh._core.host import on_host
from jaxveh._core.recording import Recording, check_recording
from jaxveh.diagnostics.log_delays import check_delays
from jaxveh.diagnostics.log_findings import LogFinding, LogView
from jaxveh.diagnostics.log_magnitudes import check_gravity, check_units
from jaxveh.diagnostics.log_names import check_names
from jaxveh.diagnostics.log_plausibility import check_plausibility
from jaxveh.diagnostics.log_rates import check_rates
from jaxveh.diagnostics.log_samples import check_samples
from jaxveh.diagnostics.log_sampling import check_sampling
from jaxveh.diagnostics.log_signs import check_signs
from jaxveh.diagnostics.log_steering import check_steering
from jaxveh.diagnostics.log_wheels import check_wheel_speeds
from jaxveh.io import CarSpecification, with_road_steer
from jaxveh.io import kit as io

CHECKS = (
    check_names,
    check_sampling,
    check_samples,
    check_units,
    check_gravity,
    check_wheel_speeds,
    check_signs,
    check_rates,
    check_delays,
    check_steering,
    check_plausibility,
)


@on_host
def check_log(recording: Recording, *, car: CarSpecification | None = None) -> list[LogFinding]:
    """Check a log before its data are used; return the findings of every check, good and bad, in the order of `CHECKS`.

    **Arguments**: `recording` with channels of the usual names (`v_x`, `v_y`, `yaw_rate`, `a_x`, `a_y`, `steer`) in SI;
    missing channels are not checked. `car`: as `io.read_car` reads it; with it, scale and offset of the steering, delays
    and understeer are compared with a linear single track, without it with usual values, and a missing `steer` is computed
    from `steering_wheel` and the file's ratio.

    The checks are: names that only look like known ones; rates, jitter, gaps and missing samples; repeated, frozen and coarse
    values and spikes; magnitudes; signs and units, from relations between channels, of angles with their rates and of the wheels
    with each other; delays, by cross-correlation; steering scale and offset; grip and the car's numbers.
    They run on the host in NumPy, and change nothing. Simulated truth (`true.` channels) is not checked.

    For a car whose rear wheels are steered, their angle `steer_rear` (rad) is part of the car's model (`io.with_road_steer`); if
    it is missing, that is an error, and nothing is compared with the car.
    """
    check_recording("check_log", recording)
    if car is not None:
        io.check_car_file("check_log", car)
        recording = with_road_steer(car, recording)
    log = LogView.of(recording, car)
    unknown = [] if car is None or car.steers_front_alone or log.has("steer_rear") else [_no_rear_angle(car)]
    log = LogView.of(recording, None) if unknown else log
    return unknown + [finding for check in CHECKS for finding in check(log)]


def _no_rear_angle(car: CarSpecification) -> LogFinding:
    """The finding that the log does not tell the angle of the rear wheels, which the car's file says are steered."""
    others = (
        "steer, steering_wheel or the rear wheels' angle" if car.steering == "four-wheel" else "the rear wheels' angle"
    )
    message = (
        f'is missing, but the car\'s file has steering = "{car.steering}": nothing is compared with the car. Name the column of '
        f"{others} in the channel map, or leave the steering out of the file if they stay straight."
    )
    return LogFinding("error", "steer_rear", message, {})

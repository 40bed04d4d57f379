"""Prior knowledge of any car before its log is read: the start of a fit of `RearAxle`, and its uncertainty."""

from __future__ import annotations

from typing import Any

from jaxveh._core.errors import InputError, check_kind
from jaxveh.estimators.car_file import lean_of
from jaxveh.estimators.rear_axle import USUAL_WHEELBASE, RearAxle
from jaxveh.estimators.rear_steer import rear_steer_of
from jaxveh.io import CarSpecification
from jaxveh.io import kit as io
from jaxveh.sensors import LowPass
from jaxveh.statespace import kit
from jaxveh.vehicles import GRAVITY

CG_HEIGHT_SHARE = 0.19
"""Share of the wheelbase: the height of the centre of gravity above ground, if the car's file does not give it."""

GRIP = 1.0
"""The largest lateral force of an axle over its load, if the car's file does not give it."""

SPREADS = {
    "stiffness": 0.3, "grip": 0.3, "shape": 0.25, "yaw_inertia": 0.15, "cg_height": 0.25,
    "a_y_gain": 0.045, "a_y_offset": 1.0, "yaw_rate_offset": 1.0, "heading_offset": 1.0,
    "bank": 0.7, "slip_error": 0.7, "force_noise": 0.7, "slip_noise": 0.7,
    "process_noise.law.std.v_y": 0.3, "process_noise.law.std.stiffening": 0.5,
}  # fmt: skip
"""Relative standard deviations by name, on each parameter's real line (unbounded ones in units of their declared scale).
Those of stiffness and inertia are the usual errors of car files; those of the noises are wide. That of `a_y_gain` contains a
race car (1.01) and a soft saloon (1.15) where a file has no `roll_gradient`, and half of one that it has."""

TIMING = 0.01
"""s: the standard deviation of what is left of the delay of a_y against the yaw rate, for a car of the usual size. Clocks and
filters of two channels of one car differ by some ms; 10 ms are 0.1 m/s in a turn of 1 g. Fitted, this delay explains what the
model lacks: 30 to 70 ms were found where 10 ms are right. Without it the 95 % bands contained less than 80 % of the rows on 17
of 27 drives of another simulator, whose a_y is 10 ms later than its yaw rate; with it on one. It scales with the car's size,
because 10 ms are too much for a car of 1:10: its bands were 1.4 times as bad there (CRPS) as without."""

STOOD = {"yaw_rate_offset": 0.1, "a_y_offset": 0.7}
"""The same for a car that stood (in units of the offsets' scales): gyroscopes hardly drift within a log; where cars stand,
roads are banked by about 0.015 rad, which an accelerometer cannot distinguish from its offset."""


def chosen_parameters(model: Any):
    """The parameters and noise levels that a calibration fits.

    The ellipse, shares and drag are not among them, and there is no asymmetry: when fitted, they absorbed features of one span
    only. The errors on the rest of real logs then were 0.33 and 0.37 degrees (Ferrari, first 30 and 60 s), and 0.25 and 0.31
    without them; 5.9 with and 3.7 without them (F1TENTH, 60 s), but 3.4 with and 4.2 without them (30 s); 31 simulated drives
    and the Genesis showed no difference; 12 s pieces of the Ferrari were better with them (0.20) than without (0.24).

    Nor can a log choose how many to fit. With the likelihood of the half that a fit did not use as the criterion, for 15 settings
    of those logs (noises alone, sensors, stiffness, all of these), the F1TENTH's first 30 s would keep the file's tyres (17.7
    instead of 4.2 degrees), the reversed Genesis would fit the noises alone (0.62, 0.63), and the other logs all parameters.
    """
    kit.check_model("chosen_parameters", model)
    check_kind(
        "chosen_parameters: model.system", model.system, RearAxle, "estimators.sideslip.model returns such a model."
    )
    s, noise = model.system, model.process_noise.law.std
    axle = [s.stiffness, s.grip, s.shape]
    body = [s.yaw_inertia, s.cg_height]
    sensors = [s.yaw_rate_offset, s.a_y_gain, s.a_y_offset, s.heading_offset]
    levels = [s.bank, s.slip_error, s.force_noise, s.slip_noise, noise.v_y, noise.stiffening]
    return (*axle, *body, *sensors, *levels)


def unfitted_spreads(system: RearAxle) -> dict[str, float]:
    """Standard deviations of parameters that a log does not tell and a calibration does not fit, by name, in their units."""
    return {"a_y_delay_error": TIMING * float(system.wheelbase / USUAL_WHEELBASE) ** 0.5}


def car_of(car: CarSpecification | RearAxle) -> RearAxle:
    """The rear axle of a car's file without calibration; missing values are scaled with the car's size."""
    if isinstance(car, RearAxle):
        return car
    io.check_car_file("sideslip", car)
    a, b = car.front_axle_to_cg, car.rear_axle_to_cg
    load = car.mass * GRAVITY * a / (a + b)
    size = (a + b) / USUAL_WHEELBASE
    time = size**0.5
    tyre = car.rear
    if tyre is not None:
        scale = load / tyre.nominal_load if tyre.nominal_load is not None else 1.0
        stiffness, grip = scale * tyre.B * tyre.C * tyre.D, scale * tyre.D
    elif car.rear_cornering_stiffness is not None:
        stiffness, grip = car.rear_cornering_stiffness, GRIP * load
    else:
        raise InputError(
            "sideslip: the car's file has no rear_cornering_stiffness, and no rear coefficients: give one."
        )
    told = {"drag": car.drag, "front_drive": car.front_drive, "brake_share": car.front_brake}
    usual = {"drag": 0.45 * size**2}
    sensor_x, sensor_y, _ = car.sensor_position or (0.0, 0.0, 0.0)
    late = 0.0 if car.low_pass is None else LowPass(car.low_pass).delay
    return RearAxle(
        sensor_delay=late, sensor_x=sensor_x, sensor_y=sensor_y, a_y_gain=1.0 + lean_of(car),
        mass=car.mass, yaw_inertia=car.yaw_inertia, front_axle_to_cg=a, rear_axle_to_cg=b,
        cg_height=car.cg_height or CG_HEIGHT_SHARE * (a + b),
        stiffness=stiffness / load, grip=grip / load,
        rear_steer=rear_steer_of(car),
        force_noise=0.01 * time**0.5, slip_noise=0.001 * time**0.5, bank_time=15.0 * time, slip_time=2.0 * time,
        **usual | {name: value for name, value in told.items() if value is not None},
    )  # fmt: skip

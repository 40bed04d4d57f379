"""Closed-loop manoeuvres: a path, a speed, and a driver that follows them."""

from __future__ import annotations

import math

from jaxveh._core.errors import InputError, check_known, check_positive, check_single, is_concrete
from jaxveh.manoeuvres.base import check_drive, check_speed
from jaxveh.manoeuvres.cones import centre_line, check_slalom, iso_3888_1, iso_3888_2
from jaxveh.manoeuvres.path_driver import PathDriver
from jaxveh.manoeuvres.paths import Circle, Sine
from jaxveh.manoeuvres.speeds import ChangingSpeed, SteadySpeed


def iso_lane_change(
    speed=80 / 3.6,
    width: float = 1.8,
    *,
    start: float = 30.0,
    lead: float = 4.0,
    duration: float | None = None,
    **driver,
) -> PathDriver:
    """The double lane change of ISO 3888-1 in closed loop at `speed` (m/s) with a car of a `width` (m).

    The course is `iso_3888_1(width, start)`; the car starts at the origin along x. `lead` (m): see `centre_line`.
    `duration` (s): by default until 15 m after the course. `driver`: parameters of the `PathDriver` by name.

    **Raises** `InputError` for values out of range.
    """
    path = centre_line(iso_3888_1(width, start), lead)
    return _driver(path, speed, start + 140.0, duration, driver)


def iso_obstacle_avoidance(
    speed=45 / 3.6,
    width: float = 1.8,
    *,
    start: float = 30.0,
    lead: float = 1.0,
    duration: float | None = None,
    preview_time=0.5,
    **driver,
) -> PathDriver:
    """The obstacle avoidance of ISO 3888-2 in closed loop at `speed` (m/s) with a car of a `width` (m).

    The course is `iso_3888_2(width, start)`; otherwise as in `iso_lane_change`; `preview_time` (s): that of the driver.
    """
    path = centre_line(iso_3888_2(width, start), lead)
    return _driver(path, speed, start + 76.0, duration, {"preview_time": preview_time, **driver})


def slalom_course(
    speed, amplitude=1.5, *, spacing=18.0, count: int = 6, start: float = 30.0, duration: float | None = None, **driver
) -> PathDriver:
    """A slalom in closed loop at `speed` (m/s): a sine path of this `amplitude` (m) that passes cones on alternating sides.

    `count` cones stand `spacing` (m) apart along x, at the positions of `slalom_cones(spacing, count, start)`. The path
    leaves the x axis at `start` (m) to the left and passes the first cone, 1.5 spacings further on, on its right; it
    has its full amplitude at every cone. The driver cuts the corners a little: at 14 m/s a car is 1.1 to 1.2 m beside
    the cones. Otherwise as in `iso_lane_change`.
    """
    check_slalom(spacing, count, start)
    # Half a wavelength more at either end, in which the sine fades in and out.
    path = Sine(amplitude, 2.0 * spacing, start, count / 2 + 1)
    return _driver(path, speed, start + (count + 3) * spacing, duration, driver)


def steady_circle(
    radius=40.0, from_speed=5.0, to_speed=16.0, *, time: float = 60.0, start: float = 2.0, duration: float | None = None,
    **driver,
) -> PathDriver:  # fmt: skip
    """A circle of this `radius` (m, negative to the right) at a slowly rising speed (ISO 4138, constant radius).

    The speed rises from `from_speed` to `to_speed` (m/s) within `time` (s) from `start` (s) on; the defaults end at
    6.4 m/s^2, which a passenger car on a dry road can follow. `duration` (s): by default until 2 s after the rise. The
    car starts at the origin along x. `driver`: parameters of the `PathDriver` by name.

    **Raises** `InputError` for values out of range.
    """
    check_known(time=time, start=start)
    duration = start + time + 2.0 if duration is None else duration
    check_speed("from_speed", from_speed)
    check_speed("to_speed", to_speed)
    check_drive(to_speed, duration)
    speed = ChangingSpeed(from_speed, to_speed, float(start), float(time))
    return PathDriver(path=Circle(radius), speed=speed, duration=float(duration), **driver)


def _driver(path, speed, length: float, duration: float | None, driver: dict) -> PathDriver:
    if duration is None:
        if not is_concrete(speed, length):
            raise InputError("duration = None: none follows from a traced speed, start or spacing; give it in s.")
        check_speed("speed", speed)
        check_single(speed=speed)
        check_positive("speed", speed, "m/s")
        duration = math.ceil(100 * length / float(speed)) / 100
    check_drive(speed, duration)
    return PathDriver(path=path, speed=SteadySpeed(speed), duration=float(duration), **driver)

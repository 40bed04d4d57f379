"""Ready-made suites of a production car and of a test car, with the sources of the numbers."""

from __future__ import annotations

import math

from jaxveh._core.errors import check_flags
from jaxveh.sensors.gnss import GNSS
from jaxveh.sensors.imu import IMU
from jaxveh.sensors.low_pass import LowPass
from jaxveh.sensors.optical import OpticalSideslip
from jaxveh.sensors.sensor_set import position_of
from jaxveh.sensors.signal import Signal
from jaxveh.sensors.steering_angle import SteeringAngle
from jaxveh.sensors.suite import Suite
from jaxveh.sensors.wheel_speeds import WheelSpeeds
from jaxveh.vehicles import GRAVITY
from jaxveh.vehicles import kit as vehicles

_DEGREE = math.pi / 180
_KMH = 1 / 3.6


def production_car(
    wheel_radius: float | None = None, *, steering_ratio: float | None = None, gnss: bool = True
) -> Suite:
    """The sensors of the stability control and the navigation of a series car; `needs` lists the vehicle outputs that
    they require.

    - Inertial unit, 100 Hz, delay 10 ms: `a_x`, `a_y`, `yaw_rate`. Limits 4.2 g and 163 deg/s, steps of 0.0001274 g and
      0.005 deg/s: Bosch MM7.10 and MM5.10 (data sheet; CAN list in the ABS M5 Kit manual). Second-order low-pass of 15
      Hz, noise of 0.05 m/s^2 and 0.1 deg/s, offsets of 0.1 m/s^2 and 0.2 deg/s that drift slowly: our choice, typical
      of such units.
    - Steering angle, 100 Hz: steps of 0.1 deg, at most 780 deg (Bosch LWS, data sheet); 0.5 deg offset and 1 deg of play
      at the wheel: our choice. With `steering_ratio` it sends `steering_wheel`, computed from `steer`. Without it, it
      sends `steer`, and the numbers are those of the steering wheel divided by 16.
    - Wheel speeds, 50 Hz, delay 20 ms, if `wheel_radius` (m, as stored in the control unit) is given: 48 teeth, timed
      edges, zero below 1 km/h, steps of 1/64 km/h, radii off by up to 0.5 %: our choice.
    - Satellite navigation, 5 Hz, delay 0.15 s: 0.05 m/s along and across (the specified velocity accuracy of receivers
      like the u-blox M8), 0.1 m/s upwards, no course below 1 m/s; delay, limit and the factor of two are our choice.

    `gnss=False` leaves out satellite navigation.
    """
    check_flags(gnss=gnss)
    wheels = () if wheel_radius is None else (_wheels(wheel_radius),)
    satellites = (_satellites(),) if gnss else ()
    return Suite((_esc(), _steering(steering_ratio), *wheels, *satellites))


def proving_ground_car(
    wheel_radius: float | None = None,
    *,
    steering_ratio: float | None = None,
    optical_position: tuple[float, float, float] = (2.2, 0.0, 0.0),
) -> Suite:
    """The sensors of a car on the proving ground: a precise inertial unit, an optical sensor, and the car's own sensors.

    - Six-axis inertial unit, 100 Hz, delay 2 ms: noise 0.01 m/s^2 and 0.02 deg/s, offsets 0.005 m/s^2 and 0.01 deg/s, 0.1 % of
      gain, low-pass 40 Hz; limits 10 g and 300 deg/s. Our choice, typical of navigation-grade test systems.
    - Optical sensor at `optical_position` (m) from the centre of gravity, 250 Hz, delay 6 ms: `v_x`, `v_y` with noise
      of 0.05 m/s and a gain error of 0.2 %, NaN below 0.3 m/s. Our choice, so that the error of the sideslip at 20 m/s
      is mostly within 0.5 deg (the error that ISO 15037-1 allows, as cited by makers of such systems).
    - Steering angle and wheel speeds as in `production_car`; satellite navigation with position, 20 Hz, delay 20 ms,
      0.02 m/s, 0.02 m: our choice, typical of carrier-phase receivers.
    """
    precise = Signal(noise=0.01, bias=0.005, scale=1e-3, drift=1e-4, saturation=10 * GRAVITY)
    gyro = Signal(noise=0.02 * _DEGREE, bias=0.01 * _DEGREE, scale=1e-3, drift=1e-3 * _DEGREE, saturation=300 * _DEGREE)
    axes = {
        **dict.fromkeys(("a_x", "a_y", "a_z"), precise),
        **dict.fromkeys(("roll_rate", "pitch_rate", "yaw_rate"), gyro),
    }
    velocity = Signal(noise=0.05, scale=2e-3)
    wheels = () if wheel_radius is None else (_wheels(wheel_radius),)
    inertial = IMU(axes, low_pass=LowPass(40.0), rate=100.0, delay=0.002)
    place = position_of("optical_position", optical_position)
    optical = OpticalSideslip({"v_x": velocity, "v_y": velocity}, place, lowest=0.3, rate=250.0, delay=0.006)
    satellites = GNSS(along=0.02, across=0.02, lowest=0.3, position=Signal(noise=0.02), rate=20.0, delay=0.02)
    return Suite((inertial, optical, _steering(steering_ratio), satellites, *wheels))


def _satellites() -> GNSS:
    return GNSS(along=0.05, across=0.05, lowest=1.0, climb=Signal(noise=0.1), rate=5.0, delay=0.15)


def _esc() -> IMU:
    acceleration = Signal(
        noise=0.05, bias=0.1, drift=2e-3, drift_time=600.0, saturation=4.2 * GRAVITY, quantisation=1.274e-4 * GRAVITY
    )
    rate = Signal(
        noise=0.1 * _DEGREE,
        bias=0.2 * _DEGREE,
        drift=0.01 * _DEGREE,
        drift_time=600.0,
        saturation=163 * _DEGREE,
        quantisation=0.005 * _DEGREE,
    )
    return IMU(
        {"a_x": acceleration, "a_y": acceleration, "yaw_rate": rate}, low_pass=LowPass(15.0), rate=100.0, delay=0.01
    )


def _steering(ratio: float | None) -> SteeringAngle:
    at_wheel = 1.0 if ratio is not None else 1 / 16.0
    unit = _DEGREE * at_wheel
    signal = Signal(bias=0.5 * unit, saturation=780 * unit, quantisation=0.1 * unit)
    channel = "steer" if ratio is None else "steering_wheel"
    return SteeringAngle(signal, backlash=1.0 * unit, ratio=ratio, channel=channel, rate=100.0)


def _wheels(radius: float) -> WheelSpeeds:
    errors = dict(zip(vehicles.CORNERS, (0.002, -0.003, 0.005, -0.001), strict=True))
    signals = {f"wheel_speed_{w}": Signal(scale=error, quantisation=_KMH / 64) for w, error in errors.items()}
    return WheelSpeeds(signals, radius=radius, lowest=_KMH, tooth_error=0.01, rate=50.0, delay=0.02)

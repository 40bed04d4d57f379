"""Parameters, states and transition of a car with an inertial unit and satellite navigation."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.names import record_type
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.navigation.window import rotate
from jaxveh.estimators.rear_steer import CHANNEL
from jaxveh.estimators.two_axles import AbstractTwoAxles
from jaxveh.vehicles import GRAVITY

SLOWEST = 0.5
"""m/s: below this speed the direction of the velocity is not used."""


ROLLS, BALANCE = "rolls", "slip_balance"
"""m/s: pseudo-measurements of zero: the lateral velocity of the rear axle, which is small without lateral forces; and its
lateral velocity beyond the one that its force implies."""

STANDS = "stands"
"""rad: pseudo-measurements of zero: roll and pitch of the body beyond its equilibrium on the springs."""


class Parts(NamedTuple):
    """The parts of a navigation in addition to accelerations, yaw rate, speed and course. `three_more`: the inertial unit's other
    axes; `heading`: the one from two antennas; `wheels`: the speeds of the rear wheels; `camera`: one that sees the lane; `axle`:
    the tyre law of the rear axle, "none", "linear" or "saturating"; `adapts`: the stiffness of the rear axle is estimated;
    `rear_steer`: the rear wheels are steered."""

    three_more: bool = False
    heading: bool = False
    wheels: bool = False
    camera: bool = False
    axle: str = "none"
    adapts: bool = False
    rear_steer: bool = False


PLAIN = Parts()
"""Three axes and satellites only."""


class Navigator(AbstractTwoAxles):
    """An inertial unit on a car with satellite navigation.

    - `lag` (s): delay of the satellites beyond that of the inertial unit; `sensor_lag` (s): delay of the inertial unit, its
      low-pass filter included; `camera_lag` (s): delay of the camera beyond that of the inertial unit.
    - `unit_x`, `unit_y`, `antenna_x`, `antenna_y`, `antenna_z` (m): positions of the inertial unit and of the antenna (of two,
      the one whose velocity is measured) from the centre of gravity.
    - `along`, `across` (m/s): standard deviations of the satellites' velocity; `heading_error` (rad): that of two antennas.
    - `bank_time`, `grade_time` (s): time constants of bank and grade, first-order Gauss-Markov processes.
    - `dip_gradient` (rad s^2/m): pitch angle per m/s^2 of braking.
    - `wheel_error` (m/s), `wheel_slip_error` (s^2/m): standard deviation of the rear wheels' speed, and its increase with
      acceleration, as a share of speed; `track` (m): rear track, for the difference of both wheels' speeds; `lean_error` (rad):
      standard deviation of the body's roll and pitch on its springs.
    - `mass`, `yaw_inertia`, `front_axle_to_cg`, `rear_axle_to_cg`, `cg_height` (kg, kg m^2, m); `stiffness` (1/rad) and `grip`
      (-): cornering stiffness and largest lateral force of the rear axle over its load; `shape` (-): sharpness of the curve's
      bend; `axle_time` (s): time over which force and slip are averaged; `slip_growth` (-): growth of the slip angle's error
      with force over load; `slip_noise` (rad sqrt s): its white part; `force_noise` (-): error of the averaged force over load.
      Without a tyre law the slip angle is within `rolling_slip` (rad) plus `slip_gradient` (rad s^2/m) times force over mass.
      `slip_time` (s): time constant of lasting errors: these, `slip_error`, and those of the body's attitude.
    - `lane_error` (m), `lane_angle_error` (rad): standard deviations of the camera; `bend_time` (s): time constant of the lane's
      curvature; `camera_x` (m): distance ahead of the centre of gravity at which the camera measures the lane offset.
    """

    lag: jax.Array = parameter("s", scale=0.1, default=0.125)
    sensor_lag: jax.Array = parameter("s", scale=0.02, default=0.025)
    camera_lag: jax.Array = parameter("s", scale=0.1, default=0.055)
    unit_x: jax.Array = parameter("m", default=0.0)
    unit_y: jax.Array = parameter("m", default=0.0)
    antenna_x: jax.Array = parameter("m", default=0.0)
    antenna_y: jax.Array = parameter("m", default=0.0)
    antenna_z: jax.Array = parameter("m", default=0.0)
    along: jax.Array = positive("m/s", default=0.05)
    across: jax.Array = positive("m/s", default=0.05)
    heading_error: jax.Array = positive("rad", default=0.004)
    bank_time: jax.Array = positive("s", default=7.0)
    grade_time: jax.Array = positive("s", default=10.0)
    dip_gradient: jax.Array = parameter("rad s^2/m", scale=0.003, default=0.004)
    wheel_error: jax.Array = positive("m/s", default=0.5)
    wheel_slip_error: jax.Array = positive("s^2/m", default=0.01)
    track: jax.Array = positive("m", default=1.5)
    lean_error: jax.Array = positive("rad", default=0.01)
    mass: jax.Array = positive("kg", default=1500.0)
    yaw_inertia: jax.Array = positive("kg m^2", default=2500.0)
    front_axle_to_cg: jax.Array = positive("m", default=1.2)
    rear_axle_to_cg: jax.Array = positive("m", default=1.5)
    cg_height: jax.Array = positive("m", default=0.55)
    stiffness: jax.Array = positive("1/rad", default=16.0)
    grip: jax.Array = positive("-", default=1.0)
    shape: jax.Array = positive("-", default=2.5)
    slip_growth: jax.Array = positive("-", default=3.0)
    # No multiple of a usual step, so that the rows that it covers do not depend on rounding.
    axle_time: jax.Array = positive("s", default=0.19)
    rolling_slip: jax.Array = positive("rad", default=0.002)
    slip_gradient: jax.Array = positive("rad s^2/m", default=0.006)
    slip_time: jax.Array = positive("s", default=1.5)
    slip_noise: jax.Array = positive("rad s^0.5", default=5e-4)
    force_noise: jax.Array = positive("-", default=0.01)
    lane_error: jax.Array = positive("m", default=0.03)
    lane_angle_error: jax.Array = positive("rad", default=0.004)
    bend_time: jax.Array = positive("s", default=3.0)
    camera_x: jax.Array = parameter("m", default=0.0)
    parts: Parts = eqx.field(static=True, default=PLAIN)

    @property
    def lags(self) -> dict[str, Any]:
        """The lags (s) by name: of the satellites (`sky`), of the `camera`, and to the middle and the beginning of the time over
        which the axle's force is averaged (`half`, `whole`)."""
        lags = {"sky": self.lag}
        if self.parts.camera:
            lags["camera"] = self.camera_lag
        if self.parts.axle != "none":
            lags |= {"half": 0.5 * self.axle_time, "whole": self.axle_time}
        return lags

    @property
    def longest_lag(self) -> Any:
        """The longest lag, s."""
        return numerics.largest(jnp.stack(list(self.lags.values())))

    def forces(self, x, u) -> tuple[Any, Any]:
        """Forces on the car over its mass (m/s^2), forward and to the left: the measured accelerations less their biases, and
        less gravity in a body that rolls and pitches on its springs."""
        dipped = -GRAVITY * x.dip if self.parts.three_more else 0.0
        leant = GRAVITY * x.lean if self.parts.three_more else 0.0
        # Without gyroscopes about these axes the body is taken to be in equilibrium on its springs.
        stands = (1.0, 1.0) if self.parts.three_more else self.gains(x)
        return (u.a_x - x.bias_a_x - dipped) / stands[0], (u.a_y - x.bias_a_y - leant) / stands[1]

    def gains(self, x) -> tuple[Any, Any]:
        """The measured accelerations of a body on its springs over those of an upright body."""
        return 1.0 + GRAVITY * self.dip_gradient, 1.0 + GRAVITY * x.lean_gradient

    def accelerations(self, x, u) -> tuple[Any, Any]:
        """Accelerations of the centre of gravity over ground (m/s^2), in the car's axes: the forces over mass less gravity along
        a sloping road."""
        f_x, f_y = self.forces(x, u)
        return f_x - GRAVITY * x.grade, f_y - GRAVITY * x.bank

    def tilts(self, x, u) -> tuple[Any, Any]:
        """Roll and pitch (rad) of the body against the horizon, in the axes of ISO 8855."""
        f_x, f_y = self.forces(x, u)
        if self.parts.three_more:
            return x.bank + x.lean, x.dip - x.grade
        return x.bank + x.lean_gradient * f_y, -self.dip_gradient * f_x - x.grade

    def heading_rate(self, x, u) -> Any:
        """Rate of the yaw angle (rad/s), about the vertical, to the left: the body rolls and pitches, and its gyroscopes with it
        (`(q sin(roll) + r cos(roll)) / cos(pitch)` of the pitch rate q and yaw rate r that it feels)."""
        roll, pitch = self.tilts(x, u)
        rate, upright = u.yaw_rate - x.bias_yaw_rate, numerics.cos(pitch)
        if self.parts.three_more:
            return (rate * numerics.cos(roll) + (u.pitch_rate - x.bias_pitch_rate) * numerics.sin(roll)) / upright
        # A body that keeps its roll and pitch turns about the vertical alone.
        return rate / (numerics.cos(roll) * upright)


def states_of(parts: Parts) -> dict[str, tuple[float, float, float]]:
    """The states: mean and standard deviation of the prior, and the standard deviation of the noise (per root second).

    Velocity (m/s) and yaw (rad) at the centre of gravity; `bias_` of each axis (m/s^2, rad/s); `bank`, `grade` (rad) of the road;
    `lean_gradient` (rad s^2/m): roll on the springs per m/s^2; `lean`, `dip` (rad): roll and pitch on the springs; `wheel_scale`
    (-): relative error of the rear wheels' speed; `wheel_slip` (s^2/m): their slip per m/s^2 of acceleration; `slip_error` (rad):
    error of the axle's tyre law without a force; `stiffening`, `gripping` (-): logarithms of its stiffness and grip over those of
    the file; `lane_offset` (m) and `lane_heading` (rad) against the lane, to the left; the lane's `bend` (1/m).
    """
    degree = jnp.pi / 180
    walk = lambda std, time: std * (2.0 / time) ** 0.5
    states = {
        "v_x": (0.0, 1.0, 0.02),
        "v_y": (0.0, 0.5, 0.02),
        "yaw": (0.0, 0.03, 5e-4),
        "bias_a_x": (0.0, 0.1, 2e-3),
        "bias_a_y": (0.0, 0.1, 2e-3),
        "bias_yaw_rate": (0.0, 0.2 * degree, 0.01 * degree),
        "bank": (0.0, 0.02, walk(0.02, 7.0)),
        "grade": (0.0, 0.02, walk(0.02, 10.0)),
        "lean_gradient": (0.008, 0.005, 1e-5),
    }
    if parts.three_more:
        states |= {
            "lean": (0.0, 0.02, 1e-3),
            "dip": (0.0, 0.02, 1e-3),
            "bias_a_z": (0.0, 0.1, 2e-3),
            "bias_roll_rate": (0.0, 0.2 * degree, 0.01 * degree),
            "bias_pitch_rate": (0.0, 0.2 * degree, 0.01 * degree),
        }
    if parts.wheels:
        states |= {"wheel_scale": (0.0, 0.01, 1e-4), "wheel_slip": (0.0, 0.01, 1e-5)}
    if parts.axle != "none":
        states |= {"slip_error": (0.0, 0.002, walk(0.002, 1.5))}
    if parts.adapts:
        # Files of cars are wrong by factors of 0.6 to 1.6; roads have less grip than the one of the file.
        states |= {"stiffening": (0.0, 0.3, 0.01)}
        if parts.axle == "saturating":
            states |= {"gripping": (0.0, 0.3, 0.05)}
    if parts.camera:
        states |= {
            "lane_offset": (0.0, 1.0, 0.01),
            "lane_heading": (0.0, 0.05, 1e-3),
            "bend": (0.0, 0.002, walk(0.002, 3.0)),
        }
    return states


def state_type(parts: Parts) -> Any:
    """The NamedTuple of the states."""
    return record_type("NavigationState", states_of(parts))


def channels_of(parts: Parts) -> tuple[str, ...]:
    """The channels of measurements and of pseudo-measurements of zero."""
    named = {
        "heading": parts.heading,
        "wheel_speed": parts.wheels,
        ROLLS: parts.axle == "none",
        BALANCE: parts.axle != "none",
        "lane_offset": parts.camera,
        "lane_heading": parts.camera,
        "a_z": parts.three_more,
        f"{STANDS}_roll": parts.three_more,
        f"{STANDS}_pitch": parts.three_more,
    }
    return ("speed", "course", *(name for name, there in named.items() if there))


def misfit_of(channel: str) -> str:
    """The name of the input by how much a channel's variance exceeds the one that is assumed."""
    return f"misfit_{channel}"


def inputs_of(parts: Parts) -> tuple[str, ...]:
    """The model's inputs, which `cleaning` makes from a log.

    Accelerations at the centre of gravity (m/s^2) and rates (rad/s), held where the unit has no measurement; the `step` (s) since
    the unit's last measurement; the roughness of the lateral acceleration, `rough` (m/s^2); the difference of the rear wheels'
    speeds beyond that of turning, `wheels_apart` (m/s); the angle of steered rear wheels, `steer_rear` (rad); for each of
    `Navigator.lags` the fields of `window.Past`, as `sky_turned` and so on; and the misfit of each channel.
    """
    names = ("sky", *(("camera",) if parts.camera else ()), *(("half", "whole") if parts.axle != "none" else ()))
    pasts = tuple(f"{name}_{what}" for name in names for what in ("turned", "gained_x", "gained_y", "spun", "rolled"))
    more = ("a_z", "roll_rate", "pitch_rate") if parts.three_more else ()
    more += ("wheels_apart",) if parts.wheels else ()
    more += (CHANNEL,) if parts.rear_steer else ()
    return ("a_x", "a_y", "yaw_rate", "step", "rough", *pasts, *more, *[misfit_of(name) for name in channels_of(parts)])


def transition(system: Navigator, t0, t1, x, u):
    """The state after a step: the velocity is integrated from accelerations and yaw rate at the middle of the step; slow states
    decay to zero."""
    dt, parts = t1 - t0, system.parts
    now = u.at(0.5 * (t0 + t1))
    a_x, a_y = system.accelerations(x, now)
    turned = dt * (now.yaw_rate - x.bias_yaw_rate)
    headed = dt * system.heading_rate(x, now)
    # Accelerometers lean as the gyroscope does: the velocity, which both drive, turns by what it feels.
    v_x, v_y = rotate(x.v_x, x.v_y, turned)
    gained_x, gained_y = rotate(dt * a_x, dt * a_y, 0.5 * turned)
    fade = lambda time: jnp.exp(-dt / time)
    moved = {
        "v_x": v_x + gained_x,
        "v_y": v_y + gained_y,
        "yaw": x.yaw + headed,
        "bank": fade(system.bank_time) * x.bank,
        "grade": fade(system.grade_time) * x.grade,
    }
    if parts.three_more:
        moved["lean"] = x.lean + dt * (now.roll_rate - x.bias_roll_rate)
        moved["dip"] = x.dip + dt * (now.pitch_rate - x.bias_pitch_rate)
    if parts.axle != "none":
        moved["slip_error"] = fade(system.slip_time) * x.slip_error
    if parts.camera:
        middle = x.lane_heading + 0.5 * (headed - dt * x.v_x * x.bend)
        moved["lane_heading"] = x.lane_heading + headed - dt * x.v_x * x.bend
        ahead, aside = 0.5 * (x.v_x + moved["v_x"]), 0.5 * (x.v_y + moved["v_y"])
        moved["lane_offset"] = x.lane_offset + dt * (ahead * numerics.sin(middle) + aside * numerics.cos(middle))
        moved["bend"] = fade(system.bend_time) * x.bend
    return x._replace(**moved)

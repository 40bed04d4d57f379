"""The numbers of a car that finds its way by an inertial unit and satellites, and how its velocity moves between two fixes."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.names import record_type
from jaxveh._core.parameter import check_parameters, parameter, positive
from jaxveh.estimators.navigation.window import rotate
from jaxveh.vehicles import GRAVITY

SLOWEST = 0.5
"""m/s: slower, the direction of the velocity is not looked at."""


class Parts(NamedTuple):
    """What a navigation reads beside accelerations, yaw rate, speed and course: the inertial unit's other `three_more` axes, the
    `heading` of two antennas, the rear `wheels`, a `camera` that sees the lane; and which law its rear axle has: `axle` is
    "none", "linear" or "saturating", whose stiffness is found on the way where it `adapts`."""

    three_more: bool = False
    heading: bool = False
    wheels: bool = False
    camera: bool = False
    axle: str = "none"
    adapts: bool = False


PLAIN = Parts()
"""Three axes and satellites, nothing else."""


class Navigator(eqx.Module):
    """An inertial unit on a car with satellites.

    - `lag` (s): by how much satellites speak later than the inertial unit of what was true at one time; `sensor_lag`: by how
      much the latter is late itself, its low-pass included; `camera_lag` (s): as `lag`, of the camera.
    - `unit_x`, `unit_y`, `antenna_x`, `antenna_y`, `antenna_z` (m): places of the inertial unit and of the antenna (of two the
      one whose velocity is told) from the centre of gravity.
    - `along`, `across` (m/s): standard deviations of the satellites' velocity; `heading_error` (rad) of two antennas.
    - `bank_time`, `grade_time` (s): memories of the slow tilts, first-order Gauss-Markov.
    - `dip_gradient` (rad s^2/m): by how much the nose dips for each m/s^2 of braking.
    - `wheel_error` (m/s), `wheel_slip_error` (s^2/m): standard deviation of the rear wheels' speed, and what of it comes with
      acceleration, as a share of speed; `track` (m), by which the two are known to agree; `lean_error` (rad): of a body's roll by
      its springs.
    - `mass`, `yaw_inertia`, `front_axle_to_cg`, `rear_axle_to_cg`, `cg_height` (kg, kg m^2, m); `stiffness` (1/rad) and `grip`
      (-): cornering stiffness and largest lateral force of the rear axle over its load, `shape` (-): how sharply the curve
      between bends; `axle_time` (s): over which force and slip are averaged; `slip_growth` (-): by how much the slip angle's
      error grows with force over load; `slip_noise` (rad sqrt s): its white part, `force_noise` (-): of the averaged force over
      load. Where no law is taken, the slip angle is within `rolling_slip` (rad) and `slip_gradient` (rad s^2/m) times the force
      over mass. `slip_time` (s): memory of errors that last, these, that of `slip_error`, and of how the body stands.
    - `lane_error` (m), `lane_angle_error` (rad), `bend_time` (s): of the camera, and the memory of the lane's curvature;
      `camera_x` (m): where it says how far the lane's middle is away, ahead of the centre of gravity.
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
    # No multiple of a usual step: whether the rows reach back so far should not hang on rounding.
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

    def __check_init__(self):
        check_parameters(self)

    @property
    def wheelbase(self) -> Any:
        """Distance of the axles, m."""
        return self.front_axle_to_cg + self.rear_axle_to_cg

    @property
    def lags(self) -> dict[str, Any]:
        """By how much is looked back (s): to what satellites saw (`sky`), a `camera`, and to middle and begin of the time over
        which the axle's force is averaged (`half`, `whole`)."""
        lags = {"sky": self.lag}
        if self.parts.camera:
            lags["camera"] = self.camera_lag
        if self.parts.axle != "none":
            lags |= {"half": 0.5 * self.axle_time, "whole": self.axle_time}
        return lags

    @property
    def longest_lag(self) -> Any:
        """The longest of them, s."""
        return jnp.max(jnp.stack(list(self.lags.values())))

    def forces(self, x, u) -> tuple[Any, Any]:
        """Forces on the car over its mass (m/s^2), forward and to the left: what accelerometers feel less their biases, and less
        gravity in a body that leans and dips on its springs."""
        dipped = -GRAVITY * x.dip if self.parts.three_more else 0.0
        leant = GRAVITY * x.lean if self.parts.three_more else 0.0
        # Without gyroscopes about these axes the body is taken to stand where its springs hold it.
        stands = (1.0, 1.0) if self.parts.three_more else self.gains(x)
        return (u.a_x - x.bias_a_x - dipped) / stands[0], (u.a_y - x.bias_a_y - leant) / stands[1]

    def gains(self, x) -> tuple[Any, Any]:
        """What accelerometers of a body on its springs feel, over what they would feel in one that stays upright."""
        return 1.0 + GRAVITY * self.dip_gradient, 1.0 + GRAVITY * x.lean_gradient

    def accelerations(self, x, u) -> tuple[Any, Any]:
        """Of the centre of gravity over ground (m/s^2), in the car's axes: the forces less gravity along a sloping road."""
        f_x, f_y = self.forces(x, u)
        return f_x - GRAVITY * x.grade, f_y - GRAVITY * x.bank

    def tilts(self, x, u) -> tuple[Any, Any]:
        """Roll and pitch (rad) of the body against the horizon, in the axes of ISO 8855."""
        f_x, f_y = self.forces(x, u)
        if self.parts.three_more:
            return x.bank + x.lean, x.dip - x.grade
        return x.bank + x.lean_gradient * f_y, -self.dip_gradient * f_x - x.grade


def states_of(parts: Parts) -> dict[str, tuple[float, float, float]]:
    """The states: mean and standard deviation of the prior, and the standard deviation of the noise (per root second).

    Speeds (m/s) and yaw (rad) at the centre of gravity; `bias_` of each axis (m/s^2, rad/s); `bank`, `grade` (rad) that the car
    stands on; `lean_gradient` (rad s^2/m): roll on its springs for each m/s^2; `lean`, `dip` (rad): roll and pitch on its
    springs; `wheel_scale` (-) of the rear wheels' speed, and their `wheel_slip` (s^2/m) for each m/s^2 of push; `slip_error`
    (rad) of the axle's law without a force, `stiffening`: the logarithm of its stiffness over the file's; `lane_offset` (m),
    `lane_heading` (rad) against the lane, to the left, and its `bend` (1/m).
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
        states |= {"stiffening": (0.0, 0.15, 0.01)}
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


def inputs_of(parts: Parts) -> tuple[str, ...]:
    """What `cleaning` makes of a log for the model.

    Accelerations at the centre of gravity (m/s^2) and rates (rad/s), held where the unit is silent; the `step` (s) that the row
    stands for; how `rough` the lateral acceleration is (m/s^2); how far the rear wheels' speeds are `wheels_apart` beyond what
    turning makes of them (m/s); and of each of `Navigator.lags` what `window.Past` says, as
    `sky_turned` and so on.
    """
    names = ("sky", *(("camera",) if parts.camera else ()), *(("half", "whole") if parts.axle != "none" else ()))
    pasts = tuple(f"{name}_{what}" for name in names for what in ("turned", "gained_x", "gained_y", "spun", "rolled"))
    more = ("a_z", "roll_rate", "pitch_rate") if parts.three_more else ()
    more += ("wheels_apart",) if parts.wheels else ()
    return ("a_x", "a_y", "yaw_rate", "step", "rough", *pasts, *more)


def transition(system: Navigator, t0, t1, x, u):
    """Velocity by what was felt: turned by the gyroscope, its middle value between two rows. What is slow fades to nothing."""
    dt, parts = t1 - t0, system.parts
    now = u.at(0.5 * (t0 + t1))
    a_x, a_y = system.accelerations(x, now)
    turned = dt * (now.yaw_rate - x.bias_yaw_rate)
    v_x, v_y = rotate(x.v_x, x.v_y, turned)
    gained_x, gained_y = rotate(dt * a_x, dt * a_y, 0.5 * turned)
    fade = lambda time: jnp.exp(-dt / time)
    moved = {
        "v_x": v_x + gained_x,
        "v_y": v_y + gained_y,
        "yaw": x.yaw + turned,
        "bank": fade(system.bank_time) * x.bank,
        "grade": fade(system.grade_time) * x.grade,
    }
    if parts.three_more:
        moved["lean"] = x.lean + dt * (now.roll_rate - x.bias_roll_rate)
        moved["dip"] = x.dip + dt * (now.pitch_rate - x.bias_pitch_rate)
    if parts.axle != "none":
        moved["slip_error"] = fade(system.slip_time) * x.slip_error
    if parts.camera:
        middle = x.lane_heading + 0.5 * (turned - dt * x.v_x * x.bend)
        moved["lane_heading"] = x.lane_heading + turned - dt * x.v_x * x.bend
        ahead, aside = 0.5 * (x.v_x + moved["v_x"]), 0.5 * (x.v_y + moved["v_y"])
        moved["lane_offset"] = x.lane_offset + dt * (ahead * numerics.sin(middle) + aside * numerics.cos(middle))
        moved["bend"] = fade(system.bend_time) * x.bend
    return x._replace(**moved)

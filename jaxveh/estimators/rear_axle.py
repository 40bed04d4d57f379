"""Sideslip from inertial sensors: lateral velocity is integrated from acceleration and corrected by the slip angle at which the
rear axle has its force."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.bijectors import Interval
from jaxveh._core.errors import check_kind
from jaxveh._core.names import record_type
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.rear_steer import RearSteer
from jaxveh.estimators.two_axles import AbstractTwoAxles
from jaxveh.statespace import Continuous, Gaussian, Prior, StateDependent, StateSpace
from jaxveh.vehicles import GRAVITY

USUAL_WHEELBASE = 2.6
"""m: the wheelbase for which times and speeds are stated. Cars that differ only in size show the same accelerations at times
and speeds that scale with its square root (Froude's law)."""

SLOWEST = 1.4
"""m/s, for a car of `USUAL_WHEELBASE`: below it, a slip angle is the quotient of two small numbers."""

STEEPEST = 0.04
"""rad: upper limit for the standard deviation of roads' bank, so that a sliding car is not explained by a banked road."""

SATURATED = 0.95
"""Share of the grip above which the curve's slip angle no longer grows: so large a force shows that the axle slides, but not
how much."""

BEND = 0.05
"""Share of the grip over which this limit sets in."""

LARGEST_SLIP = 1.2
"""rad: upper limit of the axle's slip angle, beyond which the tangent would grow without bound."""

LEAST_GRIP = 0.05
"""Lower limit of the squared share of lateral grip, however large the longitudinal force."""


LONGEST_STEP, LOST = 1.0, 3.0
"""s and m/s: a longer step is a gap between two drives, after which lateral velocity has about this standard deviation."""


class RearAxleState(NamedTuple):
    """Lateral velocity `v_y` (m/s) at the accelerometer; `bank` of the road and `slip_error` of the curve, in units of their
    standard deviations in `RearAxle`; `stiffening`, the logarithm of the axle's stiffness over the calibrated stiffness."""

    v_y: Any
    bank: Any
    slip_error: Any
    stiffening: Any


class RearAxleReport(NamedTuple):
    """The outputs of an Estimate: `v_y` (m/s) and `sideslip` (rad) of the centre of gravity, `slip_angle_rear` (rad), lateral
    forces of the axles (N), `bank` of the road (rad, positive where the left side is higher), `slip_error` (rad) of the curve,
    `stiffness_rear` (N/rad); `reference_sideslip` (rad): the reading of a reference turned by `heading_offset`."""

    v_y: Any
    sideslip: Any
    slip_angle_rear: Any
    F_yf: Any
    F_yr: Any
    bank: Any
    slip_error: Any
    stiffness_rear: Any
    reference_sideslip: Any


class RearAxle(AbstractTwoAxles):
    """A car reduced to the rear axle, for estimating sideslip; it needs no steer of front wheels, nor any front axle parameter.

    - `mass`, `yaw_inertia`, `front_axle_to_cg`, `rear_axle_to_cg`, `cg_height` (kg, kg m^2, m).
    - `stiffness` (1/rad): cornering stiffness over load; `grip` (-): largest lateral force over load; `shape` (-): how sharply
      the curve bends, `F / load = stiffness a / (1 + |stiffness a / grip|^shape)^(1 / shape)`, whose inverse has a closed form.
    - `yaw_rate_offset` (rad/s), `a_y_gain` (-; roll makes it larger than one), `a_y_offset` (m/s^2): of the sensors.
    - `sensor_x`, `sensor_y` (m): position of the accelerometer, forward and left of the centre of gravity. Its height is not
      used: the effect of a rolling body is part of `a_y_gain`.
    - `a_y_delay` (s): the delay of a log's accelerometer, and `sensor_delay` (s): the delay of the low-pass of a_x, a_y and
      the yaw rate; they do not affect the states, and are corrected beforehand. `a_y_delay_error` (s): what is left of the
      delay of a_y against the yaw rate; it is not fitted, only its uncertainty is part of the bands (`rear_axle_prior.TIMING`).
    - `drag` (N/(m/s)^2), `front_drive`, `brake_share` (-): longitudinal force `F_x = m a_x + drag v_x^2`, divided by the front
      axle's shares of driving and braking; `ellipse` (-): how much of it counts, `sqrt(1 - (ellipse F_x / (grip load))^2)`.
    - `heading_offset` (rad): the angle of a sideslip reference (an INS) against the car; does not affect the states.
    - `bank` (rad), `slip_error` (rad): standard deviations of the states of these names, first-order Gauss-Markov with
      correlation times `bank_time` and `slip_time` (s).
    - `rear_steer`: how the rear wheels are steered, None where they are not.
    - `force_noise` (sqrt s), `slip_noise` (rad sqrt s): densities of white noise, of the force over load and of the slip angle.

    Inputs: see `INPUTS`. Axes of ISO 8855; a positive slip angle gives a positive lateral force.
    """

    yaw_inertia: jax.Array = positive("kg m^2")
    cg_height: jax.Array = positive("m")
    stiffness: jax.Array = positive("1/rad")
    grip: jax.Array = positive("-", default=1.0)
    shape: jax.Array = positive("-", default=2.0)
    yaw_rate_offset: jax.Array = parameter("rad/s", scale=0.005, default=0.0)
    a_y_gain: jax.Array = positive("-", default=1.06)
    a_y_offset: jax.Array = parameter("m/s^2", scale=0.2, default=0.0)
    sensor_x: jax.Array = parameter("m", default=0.0)
    sensor_y: jax.Array = parameter("m", default=0.0)
    a_y_delay: jax.Array = parameter("s", default=0.0)
    sensor_delay: jax.Array = parameter("s", default=0.0)
    a_y_delay_error: jax.Array = parameter("s", scale=0.01, default=0.0)
    drag: jax.Array = parameter("N s^2/m^2", scale=0.4, default=0.45)
    front_drive: jax.Array = parameter("-", scale=0.1, default=0.0)
    brake_share: jax.Array = parameter("-", scale=0.1, default=0.6)
    ellipse: jax.Array = positive("-", default=0.7)
    heading_offset: jax.Array = parameter("rad", scale=0.003, default=0.0)
    bank: jax.Array = parameter("rad", Interval(0.0, STEEPEST), default=0.02)
    slip_error: jax.Array = positive("rad", default=0.004)
    force_noise: jax.Array = positive("s^0.5", default=0.01)
    slip_noise: jax.Array = positive("rad s^0.5", default=0.001)
    bank_time: jax.Array = positive("s", default=15.0)
    slip_time: jax.Array = positive("s", default=2.0)
    rear_steer: RearSteer | None = None

    def __check_init__(self):
        if self.rear_steer is not None:
            check_kind("RearAxle.rear_steer", self.rear_steer, RearSteer)

    def shares(self, u) -> tuple[Any, Any]:
        """Lateral force over load of the front axle and of the rear axle, from the sensors: ISO 8855 signs."""
        a, b = self.front_axle_to_cg, self.rear_axle_to_cg
        moment = self.yaw_inertia * u.yaw_acceleration
        a_y = self.specific_force(u.a_y_smooth, u.yaw_rate_smooth) - self.sensor_x * u.yaw_acceleration
        front, rear = self.loads(u)
        F_yf, F_yr = (b * self.mass * a_y + moment) / self.wheelbase, (a * self.mass * a_y - moment) / self.wheelbase
        return F_yf / front, F_yr / rear

    def loads(self, u) -> tuple[Any, Any]:
        """Loads of the axles, N."""
        moved = u.a_x * self.cg_height
        per_length = self.mass / self.wheelbase
        return (
            per_length * (GRAVITY * self.rear_axle_to_cg - moved),
            per_length * (GRAVITY * self.front_axle_to_cg + moved),
        )

    def specific_force(self, a_y, yaw_rate) -> Any:
        """Lateral acceleration less gravity's share, m/s^2, on the car's centre line level with the accelerometer."""
        return (a_y - self.a_y_offset) / self.a_y_gain + self.sensor_y * yaw_rate**2

    def slides(self, u, yaw_rate, steer, slip_angle=0.0) -> Any:
        """v_y of the accelerometer if the rear axle, whose wheels are turned by `steer` (rad), has this slip angle, m/s; without
        one it rolls."""
        behind = (self.rear_axle_to_cg + self.sensor_x) * (yaw_rate - self.yaw_rate_offset)
        return behind - u.v_x * numerics.tan(slip_angle - steer)

    def v_y_now(self, x: RearAxleState, u) -> Any:
        """v_y of the accelerometer, m/s. The state is the integral of an a_y that is late by `a_y_delay_error`."""
        late = self.a_y_delay_error * self.specific_force(u.a_y, u.yaw_rate)
        return x.v_y + jnp.where(u.v_x >= rolling_below(self.wheelbase), late, 0.0)

    def left_for_turning(self, u) -> Any:
        """The share of the rear axle's lateral grip that the longitudinal force leaves."""
        F_x = self.mass * u.a_x + self.drag * u.v_x**2
        driving, braking = jnp.maximum(F_x, 0.0), jnp.minimum(F_x, 0.0)
        own = (1 - self.front_drive) * driving + (1 - self.brake_share) * braking
        return numerics.sqrt(jnp.maximum(1 - (self.ellipse * own / (self.grip * self.loads(u)[1])) ** 2, LEAST_GRIP))

    def slip_angle(self, x: RearAxleState, u) -> tuple[Any, Any]:
        """The slip angle (rad) at which the curve has the axle's force, and its slope over the force's share of load."""
        left = self.left_for_turning(u)
        share = self.shares(u)[1] / left
        # A little more than zero: the slope of a power is not defined at zero.
        asked = numerics.sqrt(jnp.square(share) + 1e-16) / self.grip
        knee = SATURATED - BEND
        used = jnp.where(asked < knee, asked, knee + BEND * jnp.tanh(jnp.maximum(asked - knee, 0.0) / BEND))
        rest = 1 - used**self.shape
        angle = share / self.stiffness * (used / asked) * rest ** (-1 / self.shape)
        slope = rest ** (-1 - 1 / self.shape) / self.stiffness
        softer = jnp.exp(-x.stiffening)
        return jnp.clip(angle * softer, -LARGEST_SLIP, LARGEST_SLIP), slope * softer / left


def rolling_below(wheelbase) -> Any:
    """m/s: below this speed a car of this wheelbase (m) is assumed to roll without slip at its rear axle."""
    return SLOWEST * (wheelbase / USUAL_WHEELBASE) ** 0.5


def transition(system: RearAxle, t0, t1, x: RearAxleState, u) -> RearAxleState:
    """Integrate the acceleration. Where it is unknown, v_y is that of a steady turn's force, and below the speed of
    `rolling_below` the rear axle rolls without slip."""
    dt = t1 - t0
    felt = system.specific_force(u.a_y, u.yaw_rate) - (u.turning - u.v_x * system.yaw_rate_offset)
    moving = x.v_y + dt * (felt - GRAVITY * system.bank * x.bank)
    rolling = numerics.as_wide_as(system.slides(u, u.yaw_rate, steer_of(u)), x.v_y)
    fade = lambda time: jnp.exp(-dt / time)
    slip_error = fade(system.slip_time) * x.slip_error
    sliding = system.slides(u, u.yaw_rate, steer_of(u), system.slip_angle(x, u)[0])
    steady = sliding - u.v_x * system.slip_error * slip_error
    v_y = jnp.where((u.felt > 0) & (dt < LONGEST_STEP), moving, steady)
    return RearAxleState(
        v_y=jnp.where(u.v_x >= rolling_below(system.wheelbase), v_y, rolling),
        bank=fade(system.bank_time) * x.bank,
        slip_error=slip_error,
        stiffening=x.stiffening,
    )


class BegunAnew(Continuous):
    """White noise in continuous time; after a step too long to integrate over, v_y is unknown."""

    def over(self, dt):
        law = super().over(dt)
        lost = jnp.where(dt >= LONGEST_STEP, LOST, 0.0).astype(law.std.v_y.dtype)
        return Gaussian(law.std._replace(v_y=law.std.v_y + lost))


CHANNEL = "slip_balance"
"""m/s: v_y by the curve's slip angle less v_y by the state. It is measured as 0 in every row in which the force is known."""


def observation(system: RearAxle, t, x: RearAxleState, u):
    """The balance of slip angles; the low-passed balance is that of `u.lag` seconds ago, and the change of v_y since is
    added."""
    del t
    angle, _ = system.slip_angle(x, u)
    then = system.slides(u, u.yaw_rate_smooth, steer_of(u, "steer_rear_smooth"), angle)
    steady = system.a_y_offset / system.a_y_gain - u.v_x * system.yaw_rate_offset + GRAVITY * system.bank * x.bank
    since = u.a_y_lead / system.a_y_gain - u.turning_lead - u.lag * steady
    return record_type("Measurements", (CHANNEL,))(
        then + since - system.v_y_now(x, u) - u.v_x * system.slip_error * x.slip_error
    )


def balance_noise(system: RearAxle, t, x: RearAxleState, u) -> dict[str, Any]:
    """The balance's standard deviation, m/s: the axle's force is uncertain, and its slip angle even more so where the curve is
    flat."""
    del t
    angle, slope = system.slip_angle(x, u)
    density = numerics.sqrt((system.force_noise * slope) ** 2 + system.slip_noise**2)
    return {CHANNEL: u.v_x * (1 + numerics.tan(angle) ** 2) * density / numerics.sqrt(u.step)}


def report(system: RearAxle, t, x: RearAxleState, u) -> RearAxleReport:
    """The outputs of an Estimate."""
    del t
    like = jnp.zeros_like(x.v_y)
    yaw_rate = u.yaw_rate - system.yaw_rate_offset
    v_y = system.v_y_now(x, u) - system.sensor_x * yaw_rate
    sideslip = numerics.arctan2(v_y, u.v_x + like)
    front, rear = system.loads(u)
    F_f, F_r = system.shares(u)
    at_rear = v_y - system.rear_axle_to_cg * yaw_rate
    # Below this speed the axle is taken to roll.
    steer = jnp.where(u.v_x >= rolling_below(system.wheelbase), steer_of(u), 0.0) if system.rear_steer else 0.0
    return RearAxleReport(
        v_y=v_y,
        sideslip=sideslip,
        slip_angle_rear=steer - numerics.arctan2(at_rear, u.v_x + like),
        F_yf=F_f * front + like,
        F_yr=F_r * rear + like,
        bank=system.bank * x.bank,
        slip_error=system.slip_error * x.slip_error,
        stiffness_rear=system.stiffness * rear * jnp.exp(x.stiffening),
        reference_sideslip=sideslip + system.heading_offset,
    )


INPUTS = (
    "v_x", "a_x", "yaw_rate", "turning", "a_y", "yaw_rate_smooth", "yaw_acceleration", "a_y_smooth", "a_y_lead",
    "turning_lead", "lag", "step", "felt",
)  # fmt: skip
"""The inputs that `cleaning` and `coarse_log` derive from a log.

- `v_x` (m/s), `a_x` (m/s^2, low-passed), `yaw_rate` (rad/s).
- For integrating v_y until the next row: `a_y` (m/s^2) and `turning`, v_x yaw_rate (m/s^2).
- For the axle's force, low-passed: `yaw_rate_smooth` (rad/s), `yaw_acceleration` (rad/s^2), `a_y_smooth` (m/s^2).
- The lead of the integrals of a_y and of v_x yaw_rate over their own low-pass, `a_y_lead` and `turning_lead` (m/s), and its
  delay, `lag` (s).
- The time that a row covers, `step` (s), and whether the acceleration of that time is known, `felt` (1 or 0); where it is
  unknown, the other inputs are those of a steady turn, a_y = v_x yaw_rate.
"""


STEERED = ("steer_rear", "steer_rear_smooth")
"""Further inputs of a car with steered rear wheels: their angle, and the same through the low-pass of the axle's force, rad."""


def steer_of(u: Any, name: str = "steer_rear") -> Any:
    """The angle of the rear wheels among the inputs, rad; 0 where they are not steered."""
    return getattr(u, name, 0.0)


def rear_axle_model(system: RearAxle) -> StateSpace:
    """The state space for a real log, with initial noise levels for a fit (stated in the code, unit by unit)."""
    check_kind("system", system, RearAxle)
    quick = (system.wheelbase / USUAL_WHEELBASE) ** -0.5
    unit = lambda time: (2.0 / time) ** 0.5
    noise = {
        "v_y": 0.02, "bank": unit(system.bank_time), "slip_error": unit(system.slip_time), "stiffening": 0.01 * quick**0.5,
    }  # fmt: skip
    return StateSpace(
        system=system,
        transition=transition,
        observation=observation,
        report=report,
        process_noise=BegunAnew(Gaussian(noise)),
        measurement_noise=StateDependent(balance_noise, CHANNEL),
        prior=Prior(
            RearAxleState(0.0, 0.0, 0.0, 0.0),
            Gaussian({"v_y": 0.2, "bank": 1.0, "slip_error": 1.0, "stiffening": 0.001}),
        ),
        inputs=INPUTS if system.rear_steer is None else INPUTS + STEERED,
    )

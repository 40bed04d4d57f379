"""Grade and mass in one filter, from speed, accelerometer and torques of a car on a straight road or in a bend."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.names import record_type
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.body_motion import (
    SILENCE,
    SLOWEST,
    SPEEDS,
    BodyMotion,
    away_from_zero,
    driven_share,
    passing_speed,
)
from jaxveh.estimators.car_file import number_of, numbers_in
from jaxveh.estimators.contract import Need
from jaxveh.estimators.delays import satellite_lag, unit_delay
from jaxveh.estimators.drive_force import AbstractDriveForce
from jaxveh.estimators.lateral import motion_of
from jaxveh.estimators.method import AbstractSmoothable, answer
from jaxveh.estimators.misfit import Misfit, Roughness, learn_roughness, no_misfit, no_roughness
from jaxveh.estimators.rear_steer import rear_angle, rolls_across
from jaxveh.estimators.sequential import Belief, Measurement, belief_of, correct_by_each, move, spread_of
from jaxveh.estimators.sliding import Sliding, indications_of_sliding
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY

ALONG = (
    Need("a_x", "m/s^2"),
    *SPEEDS,
    Need("a_y", "m/s^2", optional=True),
    Need("yaw_rate", "rad/s", optional=True),
)
"""Channels for the longitudinal motion and, in bends, for the lateral motion."""

TORQUES = (Need("drive_torque", "N m", optional=True), Need("brake_torque", "N m", optional=True))

SATELLITES = (Need("speed", "m/s", optional=True), Need("climb_rate", "m/s", optional=True))

State = record_type(
    "PullingState", ("v_x", "grade", "grade_rate", "a_x_bias", "log_mass", "rolling_bias", "wheel_scale", "slip")
)

WHEELS_DELAY = 0.045
"""s: delay of the wheels' speed. Against an inertial unit, which is late, too, it is less: `Pulling.wheel_delay`."""

WIDEST = math.radians(0.8)
"""rad: with a larger standard deviation, the grade counts as unknown."""

WIDEST_MASS = 0.05
"""With a larger standard deviation of its logarithm, the mass counts as unknown."""

OF_THE_TORQUES = 0.03
"""Relative standard deviation of the mass by errors of the torques and of the wheel radius in the car's file, which no drive
shows: a force that is 3 % too large in all rows is a mass that is 3 % too large."""


class PullingMemory(NamedTuple):
    """The last measurements, whether the car slides, and the belief; how noisy the log is: the `misfit` of wheels, satellites,
    climb rate and forces, and the `roughness` of a_x."""

    motion: Any
    slides: Any
    belief: Belief
    misfit: Misfit
    roughness: Roughness


class Torques(NamedTuple):
    """The torques of a row, `drive` and `brake` (N m, zero where unknown), and whether both are measured, `told`."""

    drive: Any
    brake: Any
    told: Any


class Pulling(AbstractSmoothable, AbstractDriveForce):
    """Grade, mass and the accelerometer's offset, by an extended Kalman filter:

        d v_x = f_x + v_y r - g sin(grade),    f_x = (a_x - a_x_bias) / (1 + g pitch_gradient)
        f_x = (T / radius - drag v^2 - 4 J_w / radius^2 dv_x/dt) / mass - g rolling - f_y (l_r / l) steer

    The first equation is kinematics and does not contain the mass; it cannot distinguish a constant grade from the offset.
    The second, used where torques are measured, is the balance of forces: the offset is the accelerometer's excess over it,
    the mass follows from the acceleration per torque. The difference of rolling resistance and air drag from the car's file
    is a further state, with a standard deviation (`rolling_spread`) that limits how well the offset can be known. Wheels that
    brake or drive slip (`slip` of the speed per m/s^2, also a state). Grades change with distance (`grade_length`,
    `grade_edge`). A climb rate from satellites measures the grade directly, `v_x sin(grade)`, with a delay (H. Bae, J. Ryu,
    J. Gerdes 2001). Made from a car's file it hears the wheels also where a log has a `v_x`: one that is estimated from them is
    late on hills. Brake torques are assumed correct within a share `brake_doubt`. (A. Vahidi et al. 2005 and P. Lingman, B.
    Schmidtbauer 2003, with an accelerometer and its offset.) How noisy the log is, beyond the noises below, is learned: of
    the measurements as their `Misfit`, of a_x as its `Roughness`.

    **Parameters**: of the car those of `AbstractDriveForce`, `mass` (kg), `rear_axle_to_cg`, `wheelbase` (m), `rear_compliance`,
    `pitch_gradient` (rad/(m/s^2)); of the belief `mass_spread` (-), `grade_spread` (rad), `a_x_offset`, `a_x_offset_spread`,
    `rolling_spread` (m/s^2); of the sensors `wheel_noise`, `told_noise` (of a channel `v_x` from another estimator, with
    correlated errors), `satellite_noise`, `climb_noise` (m/s), `wheel_delay` and the satellites' `delay` (s), `force_noise`
    (m/s^2), whose correlation time is `force_time` (s).
    """

    motion: BodyMotion
    mass: jax.Array = positive("kg")
    rear_axle_to_cg: jax.Array = positive("m")
    wheelbase: jax.Array = positive("m")
    rear_compliance: jax.Array = parameter("rad/(m/s^2)", scale=0.01, default=0.0)
    pitch_gradient: jax.Array = parameter("rad/(m/s^2)", scale=0.005, default=0.0)
    mass_spread: jax.Array = positive("-", default=0.15)
    grade_spread: jax.Array = positive("rad", default=0.03)
    grade_length: jax.Array = positive("m", default=200.0)
    grade_edge: jax.Array = positive("m", default=6.0)
    a_x_offset: jax.Array = parameter("m/s^2", scale=0.1, default=0.0)
    a_x_offset_spread: jax.Array = positive("m/s^2", default=0.06)
    rolling_spread: jax.Array = positive("m/s^2", default=0.025)
    wheel_noise: jax.Array = positive("m/s", default=0.03)
    told_noise: jax.Array = positive("m/s", default=0.05)
    wheel_delay: jax.Array = parameter("s", scale=0.02, default=0.02)
    satellite_noise: jax.Array = positive("m/s", default=0.06)
    climb_noise: jax.Array = positive("m/s", default=0.12)
    delay: jax.Array = parameter("s", scale=0.1, default=0.14)
    force_noise: jax.Array = positive("m/s^2", default=0.05)
    force_time: jax.Array = positive("s", default=1.0)
    slip: jax.Array = positive("1/(m/s^2)", default=0.003)
    slip_spread: jax.Array = positive("1/(m/s^2)", default=0.003)
    brake_doubt: jax.Array = positive("-", default=0.1)
    sliding: Sliding = eqx.field(default_factory=Sliding)

    @property
    def needs(self):
        return (*ALONG, *TORQUES, *SATELLITES)

    def first(self, t, values):
        motion, heard = self.motion.first(t, values)
        stds = {
            "v_x": 1.0, "grade": self.grade_spread, "grade_rate": 0.01, "a_x_bias": self.a_x_offset_spread,
            "log_mass": self.mass_spread, "rolling_bias": self.rolling_spread, "wheel_scale": 0.005, "slip": self.slip_spread,
        }  # fmt: skip
        belief = belief_of(State, {"v_x": heard["v_x"], "a_x_bias": self.a_x_offset, "slip": self.slip}, stds, t)
        slides = self.sliding.start(t)
        heard = heard | {"rough": jnp.zeros_like(t)}
        belief, misfit = self._measured(belief, slides.doubt, heard, values, no_misfit(4, t))
        memory = PullingMemory(motion, slides, belief, misfit, no_roughness(values["a_x"]))
        return memory, self.say(memory)

    def next(self, memory, t, values):
        motion, slides, heard = self._hear(memory, t, values)
        belief = self._ahead(memory.belief, slides.doubt, heard, memory.roughness)
        rough = learn_roughness(memory.roughness, values["a_x"], heard["dt"])
        heard = heard | {"rough": memory.roughness.variance}
        belief, misfit = self._measured(belief, slides.doubt, heard, values, memory.misfit)
        memory = PullingMemory(motion, slides, belief, misfit, rough)
        return memory, self.say(memory)

    def ahead(self, memory, t, values):
        _, slides, heard = self._hear(memory, t, values)
        return self._ahead(memory.belief, slides.doubt, heard, memory.roughness)

    def _hear(self, memory, t, values):
        """The motion, whether the car slides, and the completed row."""
        motion, heard = self.motion.next(memory.motion, t, values)
        v_x = State(*memory.belief.mean).v_x
        return (
            motion,
            self.sliding.next(memory.slides, heard, v_x, self._rolls_across(v_x, heard), self.wheelbase),
            heard,
        )

    def _ahead(self, belief: Belief, doubt, heard, roughness: Roughness) -> Belief:
        dt = heard["dt"]
        fast = passing_speed(State(*belief.mean).v_x)
        slow, quick = fast / self.grade_length, fast / self.grade_edge
        walk = 2.0 * jnp.square(self.grade_spread) * slow * quick * (slow + quick)
        # While a car slides, its rate of speed has an unknown part.
        slides = 2.0 * self.sliding.gathering * jnp.square(doubt.across * heard["yaw_rate"])
        per_second = {
            "v_x": 4e-5 + dt * roughness.variance + slides,
            "grade_rate": walk, "a_x_bias": 4e-6, "log_mass": 1e-8, "rolling_bias": 1e-6,
            "wheel_scale": 1e-9,
        }  # fmt: skip

        def step(x):
            return x._replace(
                v_x=x.v_x + dt * self._speeds_up(x, heard),
                grade=x.grade * jnp.exp(-dt * slow) + dt * x.grade_rate,
                grade_rate=x.grade_rate * jnp.exp(-dt * quick),
            )

        return move(belief, step, {name: value * dt for name, value in per_second.items()}, State)

    def _felt(self, x, heard):
        """Specific force along the road, m/s^2."""
        return (heard["a_x"] - x.a_x_bias) / (1.0 + GRAVITY * self.pitch_gradient)

    def _rolls_across(self, v_x, heard):
        """Lateral speed of the centre of gravity if the rear axle does not slide, m/s."""
        slip = self.rear_compliance * heard["a_y"] * (v_x / away_from_zero(v_x))
        return self.rear_axle_to_cg * heard["yaw_rate"] + rolls_across(heard, v_x) - v_x * slip

    def _speeds_up(self, x, heard):
        v_y = self._rolls_across(x.v_x, heard)
        return self._felt(x, heard) + v_y * heard["yaw_rate"] - GRAVITY * numerics.sin(x.grade)

    def _measured(self, belief: Belief, slides, heard, values, misfit: Misfit) -> tuple[Belief, Misfit]:
        """The belief after the row's measurements, and by how much their noise exceeds the assumed one."""
        v_x, torques = State(*belief.mean).v_x, _torques_of(values)
        measured = (
            self._wheels(v_x, torques, slides, heard),
            self._satellites(v_x, slides, heard, values),
            self._climb(heard, values),
            self._forces(v_x, torques, slides, heard),
        )
        return correct_by_each(belief, measured, misfit, heard["dt"], State)

    def _wheels(self, v_x, torques: Torques, slides, heard) -> Measurement:
        """The speed of the wheels, of which those that brake or drive slip."""
        # All wheels brake; in a car that drives both axles, the wheels that give the speed are driven, too.
        size = self.wheel_radius * self.mass
        pushing, slowing = torques.drive * 2.0 * driven_share(self.motion.front_share) / size, torques.brake / size

        def residual(x):
            ago = x.v_x - self.wheel_delay * self._speeds_up(x, heard)
            return heard["v_x"] - ago * (1.0 + x.wheel_scale + x.slip * (pushing - slowing))

        noise = jnp.where(heard["speed_told"], self.told_noise, self.wheel_noise)
        slips = jnp.square(noise) + jnp.square(0.002 * v_x * (slowing + pushing))
        slips = slips + 2.0 * self.sliding.staying / _step(heard) * jnp.square(slides.along)
        return Measurement(residual, slips, heard["speed_spoke"], 3.0)

    def _satellites(self, v_x, slides, heard, values) -> Measurement:
        """The speed over ground, which is late."""
        there = ~jnp.isnan(values["speed"])
        # That of a car that slides laterally exceeds its v_x.
        drifts = jnp.square(jnp.square(slides.across) / (2.0 * passing_speed(v_x)))
        residual = lambda x: jnp.where(there, values["speed"], 0.0) - self._late_speed(x, heard)
        return Measurement(residual, jnp.square(self.satellite_noise) + drifts, there & (v_x > 1.0), 3.0)

    def _climb(self, heard, values) -> Measurement:
        """The climb rate over ground, `v_x sin(grade)`, which is as late."""
        there = ~jnp.isnan(values["climb_rate"])

        def residual(x):
            passes = jnp.where(jnp.isnan(values["speed"]), self._late_speed(x, heard), values["speed"])
            rises = passes * numerics.sin(x.grade - self.delay * x.grade_rate)
            return jnp.where(there, values["climb_rate"], 0.0) - rises

        return Measurement(residual, jnp.square(self.climb_noise), there, 3.0)

    def _forces(self, v_x, torques: Torques, slides, heard) -> Measurement:
        """The balance of forces: the specific force less that of torques, rolling, air and the steered wheels."""
        # The front wheels are turned by this much more than the rear ones.
        steer = self.wheelbase * heard["yaw_rate"] / away_from_zero(v_x)
        turning = heard["a_y"] * (self.rear_axle_to_cg / self.wheelbase * steer + rear_angle(heard))
        size = self.wheel_radius * self.mass
        slowing = torques.brake / size

        def residual(x):
            force = self.drive_force(torques.drive - torques.brake, v_x, self._speeds_up(x, heard))
            pull = force * jnp.exp(-x.log_mass) / self.mass
            return self._felt(x, heard) - (pull - GRAVITY * self.rolling_resistance + x.rolling_bias - turning)

        doubt = jnp.square(self.brake_doubt * slowing) + jnp.square(0.3 * turning)
        # Wheels that spin or lock transmit less than their torque.
        lost = (slowing + jnp.abs(torques.drive) / size) * slides.along / (slides.along + 0.01 * passing_speed(v_x))
        white = jnp.square(self.force_noise) + doubt + jnp.square(lost)
        lasting = 2.0 * self.force_time / _step(heard) * white
        there = torques.told & (heard["pull_silence"] < SILENCE) & (v_x > SLOWEST)
        return Measurement(residual, lasting + heard["rough"], there, 3.0)

    def _late_speed(self, x, heard):
        """The speed (m/s) at the time that satellites tell of."""
        return x.v_x - self.delay * self._speeds_up(x, heard)

    def say(self, memory):
        motion, belief = memory.motion, memory.belief
        x = State(*belief.mean)
        wide = {name: spread_of(belief, {name: 1.0}, State) for name in State._fields}
        mass = self.mass * jnp.exp(x.log_mass)
        relative = numerics.hypot(wide["log_mass"], OF_THE_TORQUES)
        said = {"grade": x.grade, "mass": mass, "v_x": x.v_x, "a_x_bias": x.a_x_bias}
        stds = {
            "grade": wide["grade"],
            "mass": mass * relative,
            "v_x": wide["v_x"],
            "a_x_bias": wide["a_x_bias"],
        }
        there = jnp.maximum(motion.pull_silence, motion.speed_silence) < SILENCE
        known = {"grade": there & (wide["grade"] < WIDEST), "mass": relative < WIDEST_MASS, "v_x": there}
        return answer(said, stds, known)


def _torques_of(values) -> Torques:
    drive, brake = values["drive_torque"], values["brake_torque"]
    told = ~(jnp.isnan(drive) | jnp.isnan(brake))
    return Torques(jnp.where(told, drive, 0.0), jnp.where(told, brake, 0.0), told)


def _step(heard):
    """The time since the last row, s, away from zero."""
    return jnp.maximum(heard["dt"], 1e-3)


def pulling_filter(car: CarSpecification, who: str, **options: Any) -> Pulling:
    """The filter for a car's file. **Raises** `InputError` for a file without `wheel_radius`, which converts a torque into a
    force."""
    stiffness = car.rear_cornering_stiffness
    compliance = 0.0 if stiffness is None else car.mass * car.front_axle_to_cg / (car.wheelbase * stiffness)
    return Pulling(
        motion_of(car, wheels_first=True),
        mass=car.mass,
        wheel_radius=number_of(car, "wheel_radius", who, "m"),
        rear_axle_to_cg=car.rear_axle_to_cg,
        wheelbase=car.wheelbase,
        rear_compliance=compliance,
        sliding=indications_of_sliding(car),
        delay=satellite_lag(car),
        wheel_delay=WHEELS_DELAY - unit_delay(car),
        **numbers_in(car, "wheel_inertia", "drag", "rolling_resistance", "pitch_gradient"),
        **options,
    )

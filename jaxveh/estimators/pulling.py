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
from jaxveh.estimators import mass_and_grade
from jaxveh.estimators.body_motion import (
    SILENCE,
    SLOWEST,
    SPEEDS,
    BodyMotion,
    away_from_zero,
    driven_share,
    hold,
)
from jaxveh.estimators.car_file import number_of, numbers_in
from jaxveh.estimators.contract import Need
from jaxveh.estimators.drive_force import AbstractDriveForce
from jaxveh.estimators.lateral import motion_of
from jaxveh.estimators.live import AbstractCleaning
from jaxveh.estimators.method import AbstractSmoothable, Filtered, answer
from jaxveh.estimators.misfit import Misfit, Roughness, learn_roughness, no_misfit, no_roughness
from jaxveh.estimators.sequential import Belief, Measurement, belief_of, correct_by_each, move, spread_of
from jaxveh.estimators.sliding import Sliding
from jaxveh.filters import Extended
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

WIDEST = math.radians(0.8)
"""rad: with a larger standard deviation, the grade counts as unknown."""

WIDEST_MASS = 0.05
"""With a larger standard deviation of its logarithm, the mass counts as unknown."""

OF_THE_CAR = 0.03
"""Relative standard deviation of the mass by errors of the torques and of the wheel radius in the car's file, which no drive
shows: a force that is 3 % too large in all rows is a mass that is 3 % too large."""

JOINT = (*ALONG, *[need._replace(optional=False) for need in TORQUES])
"""The channels of the filter of `mass_and_grade`."""


class PullingMemory(NamedTuple):
    """The last measurements, whether the car slides, and the belief; how noisy the log is: the `misfit` of wheels, satellites,
    climb rate and forces, and the `roughness` of a_x."""

    motion: Any
    slides: Any
    belief: Belief
    misfit: Misfit
    roughness: Roughness


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
        fast = jnp.maximum(jnp.abs(State(*belief.mean).v_x), SLOWEST)
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
        """Lateral speed of a rear axle that does not slide, m/s."""
        slip = self.rear_compliance * heard["a_y"] * (v_x / away_from_zero(v_x))
        return self.rear_axle_to_cg * heard["yaw_rate"] - v_x * slip

    def _speeds_up(self, x, heard):
        v_y = self._rolls_across(x.v_x, heard)
        return self._felt(x, heard) + v_y * heard["yaw_rate"] - GRAVITY * numerics.sin(x.grade)

    def _measured(self, belief: Belief, slides, heard, values, misfit: Misfit) -> tuple[Belief, Misfit]:
        v_x, dt = State(*belief.mean).v_x, jnp.maximum(heard["dt"], 1e-3)
        fast = jnp.maximum(jnp.abs(v_x), SLOWEST)
        drive, brake = values["drive_torque"], values["brake_torque"]
        pushed = ~(jnp.isnan(drive) | jnp.isnan(brake))
        drive, brake = jnp.where(pushed, drive, 0.0), jnp.where(pushed, brake, 0.0)
        spoke, said = heard["speed_spoke"], values["speed"]
        satellites = ~jnp.isnan(said)
        steer = self.wheelbase * heard["yaw_rate"] / away_from_zero(v_x)
        turning = heard["a_y"] * self.rear_axle_to_cg / self.wheelbase * steer

        def balance(x):
            force = self.drive_force(drive - brake, v_x, self._speeds_up(x, heard))
            pull = force * jnp.exp(-x.log_mass) / self.mass
            return self._felt(x, heard) - (pull - GRAVITY * self.rolling_resistance + x.rolling_bias - turning)

        def satellite(x):
            ago = x.v_x - self.delay * self._speeds_up(x, heard)
            return jnp.where(satellites, said, 0.0) - ago

        climbs = ~jnp.isnan(values["climb_rate"])
        # The speed over ground of a car that slides laterally exceeds its v_x.
        drifts = jnp.square(jnp.square(slides.across) / (2.0 * fast))

        def climb(x):
            passes = jnp.where(satellites, said, x.v_x - self.delay * self._speeds_up(x, heard))
            rises = passes * numerics.sin(x.grade - self.delay * x.grade_rate)
            return jnp.where(climbs, values["climb_rate"], 0.0) - rises

        slowing = brake / (self.wheel_radius * self.mass)
        # All wheels brake; in a car that drives both axles, the wheels that give the speed are driven, too.
        pushing = drive * 2.0 * driven_share(self.motion.front_share) / (self.wheel_radius * self.mass)
        noise = jnp.where(heard["speed_told"], self.told_noise, self.wheel_noise)
        slips = jnp.square(noise) + jnp.square(0.002 * v_x * (slowing + pushing))
        slips = slips + 2.0 * self.sliding.staying / dt * jnp.square(slides.along)
        doubt = jnp.square(self.brake_doubt * slowing) + jnp.square(0.3 * turning)
        # Wheels that spin or lock transmit less than their torque.
        lost = (
            (slowing + jnp.abs(drive) / (self.wheel_radius * self.mass)) * slides.along / (slides.along + 0.01 * fast)
        )
        lasting = 2.0 * self.force_time / dt * (jnp.square(self.force_noise) + doubt + jnp.square(lost))

        def wheels(x):
            ago = x.v_x - self.wheel_delay * self._speeds_up(x, heard)
            return heard["v_x"] - ago * (1.0 + x.wheel_scale + x.slip * (pushing - slowing))

        there = (heard["pull_silence"] < SILENCE) & (v_x > SLOWEST)
        by_satellite = jnp.square(self.satellite_noise) + drifts
        measured = (
            Measurement(wheels, slips, spoke, 3.0),
            Measurement(satellite, by_satellite, satellites & (v_x > 1.0), 3.0),
            Measurement(climb, jnp.square(self.climb_noise), climbs, 3.0),
            Measurement(balance, lasting + heard["rough"], pushed & there, 3.0),
        )
        return correct_by_each(belief, measured, misfit, heard["dt"], State)

    def say(self, memory):
        motion, belief = memory.motion, memory.belief
        x = State(*belief.mean)
        wide = {name: spread_of(belief, {name: 1.0}, State) for name in State._fields}
        mass = self.mass * jnp.exp(x.log_mass)
        relative = numerics.hypot(wide["log_mass"], OF_THE_CAR)
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
        **numbers_in(car, "wheel_inertia", "drag", "rolling_resistance", "pitch_gradient"),
        **options,
    )


class Held(AbstractCleaning):
    """Prepares a row for the filter of `mass_and_grade`: the last measured torques; the speed and the accelerometer without the
    body's pitch, both NaN where not measured."""

    motion: BodyMotion
    pitch_gradient: jax.Array = parameter("rad/(m/s^2)", scale=0.005)

    @property
    def channels(self):
        return tuple(need.channel for need in JOINT)

    def first(self, t, values):
        motion, heard = self.motion.first(t, values)
        return self._next(motion, heard, values, jnp.zeros_like(t), jnp.zeros_like(t))

    def next(self, memory, t, values):
        motion, heard = self.motion.next(memory[0], t, values)
        return self._next(motion, heard, values, *memory[1:])

    def _next(self, motion, heard, values, drive, brake):
        drive, brake = hold(values["drive_torque"], drive), hold(values["brake_torque"], brake)
        silent = jnp.isnan(values["a_x"])
        felt = jnp.where(silent, 0.0, values["a_x"]) / (1.0 + GRAVITY * self.pitch_gradient)
        made = {
            "drive_torque": drive,
            "brake_torque": brake,
            "v_x": jnp.where(heard["speed_spoke"], heard["v_x"], jnp.nan),
            "a_x": jnp.where(silent, jnp.nan, felt),
        }
        return (motion, drive, brake), heard | made


def joint_filter(car: CarSpecification, shown: tuple[str, ...]) -> Filtered:
    """The filter of `mass_and_grade` with accelerometer and offset, as a method. **Raises** as `mass_and_grade.model` does.

    The prior speed is 20 m/s with a standard deviation of 20. Bends, slip, and grades that change with distance are not in its
    model. `known` where the standard deviation of the mass is below `WIDEST_MASS` of it, and that of the grade below `WIDEST`;
    where the pedals move too seldom to determine the mass, as the model's docstring explains, both are large.
    """
    model = mass_and_grade.model(car, v_x=0.1, a_x=0.5, a_x_bias=0.06, mass_spread=0.15, grade_rate_walk=0.02)
    cleaning = Held(motion_of(car), car.pitch_gradient or 0.0)
    return Filtered(model, Extended(), JOINT, cleaning, _joint_told, shown)


def _joint_told(model, belief, row):
    mean, std = belief.moments(model)
    return {"grade": std.grade < WIDEST, "mass": std.mass < WIDEST_MASS * mean.mass}

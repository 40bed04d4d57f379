"""Bank and roll in one filter: lateral kinematics, a body on its springs, and a road whose bank changes slowly."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.names import record_type
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.body_motion import LATERAL, SILENCE, BodyMotion, away_from_zero, passing_speed
from jaxveh.estimators.car_file import number_of, numbers_in
from jaxveh.estimators.contract import Need
from jaxveh.estimators.delays import satellite_lag, unit_delay
from jaxveh.estimators.lateral import motion_of
from jaxveh.estimators.method import AbstractSmoothable, answer
from jaxveh.estimators.misfit import Misfit, Roughness, learn_roughness, no_misfit, no_roughness
from jaxveh.estimators.rear_steer import rolls_across
from jaxveh.estimators.sequential import Belief, Measurement, belief_of, correct_by_each, move, spread_of
from jaxveh.estimators.steer_agreement import AgreementMemory, SteerAgreement, agreement_of
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY

NEEDS = (*LATERAL, Need("roll_rate", "rad/s", optional=True), Need("course", "rad", optional=True))
"""The channels of a stability control; a gyroscope about the x axis and satellite navigation where available. With a
`SteerAgreement` also those of the steer."""

STATES = (
    "v_y", "yaw", "bank", "bank_rate", "body_roll", "body_roll_rate", "a_y_bias", "yaw_rate_bias", "roll_rate_bias",
    "slope_bias", "rear_scale", "roll_scale",
)  # fmt: skip

State = record_type("LeaningState", STATES)

WIDEST = math.radians(1.0)
"""rad: with a larger standard deviation, bank and roll count as unknown."""


LINEAR = 4.0
"""m/s^2: from about here a tyre's slip angle grows faster than its force, on a dry road."""

ROLL_TIME = 0.02
"""s: time constant of the low-pass of the roll acceleration, which is taken from the estimated roll rate: that of the springs'
equation has the wrong phase near the body's own frequency."""

LATENESS = 1.0
"""-: standard deviation of what a delay of the inertial unit changes, over this change."""

FALL = 4.0
"""How fast the weight of a slip angle falls beyond the gate: with 1 or 2 a sliding axle still turns into a bank."""

MORE = ("v_y", "rear_scale", "roll_scale", "a_y_bias", "yaw_rate_bias", "roll_rate_bias")
"""States that are reported in addition to bank and roll."""


class Memory(NamedTuple):
    """The last measurements, the belief, the body's low-passed `roll_acceleration` (rad/s^2), and how far the car lately was from
    a steady turn (None: not checked); how noisy the log is: the `misfit` of slip angle, course and roll rate, and the `roughness`
    of a_y and yaw rate."""

    motion: Any
    belief: Belief
    roll_acceleration: Any
    agreement: AgreementMemory | None
    misfit: Misfit
    roughness: tuple[Roughness, Roughness]


class Leaning(AbstractSmoothable):
    """Bank, roll and the offsets of the sensors that measure them, by an extended Kalman filter (small angles):

        d v_y = f_y - g bank - v_x r,    f_y = a_y - a_y_bias - g body_roll,    r = yaw_rate - yaw_rate_bias
        body_roll'' = w^2 (gradient f_y - body_roll) - 2 D w body_roll'
        bank' = bank_rate - v_x / bank_length bank,    bank_rate' = -v_x / bank_edge bank_rate + noise

    `f_y` is the lateral acceleration in the road's plane. The measurements are: the rear axle's slip angle, compared with
    that of its force, with a correlated error; `course` of satellites, which is the heading plus the sideslip angle `delay`
    ago and does not depend on tyres; `roll_rate`, the rate of roll and bank plus a part of the yaw rate when the car points
    uphill. None of them can distinguish a constant bank from the accelerometer's offset. The two are separated only because
    roads bank to either side about level, while the offset stays. So the standard deviation of the bank falls slowly, and an
    offset from earlier drives helps (`a_y_offset`). The spreads of bank and offset are wider than those of the drives on which
    they were chosen: otherwise an offset that is larger than expected is a bank that counts as known. An axle that slides has
    a slip angle that its force does not give, on ice at any acceleration: the further off it is, the less it counts
    (`slip_gate`), also where steer and yaw rate do not agree (`steering`, None: not checked), and then the kinematics hold
    alone. They take a slide that grows slowly for a bank. How noisy the log is, beyond the noises below, is learned: of the
    measurements as their `Misfit`, of a_y and yaw rate, which are inputs, as their `Roughness`.

    **Parameters**: `rear_axle_to_cg` (m); `rear_compliance` (rad/(m/s^2)): the rear axle's slip angle per lateral
    acceleration, `m l_f / (l C_r)`; `roll_gradient` (rad/(m/s^2)), `roll_frequency` (Hz), `roll_damping` (-) of the body over
    the road; `bank_spread` (rad): the standard deviation of banks; `bank_length`, `bank_edge` (m): the distances over which a
    bank is forgotten and over which it begins to change; `slip_error` (rad), whose correlation time is `slip_error_time` (s);
    `slip_gate` (-): a slip angle that is off by more than this many of its predicted standard deviations counts less;
    `roll_rate_noise` (rad/s): the noise of the gyroscope about x; `across` (m/s): the noise of the satellites' lateral
    velocity; `delay` (s) of the satellites; `a_y_offset` (m/s^2): the accelerometer's offset as known beforehand;
    `a_y_offset_spread` (m/s^2), `gyro_offset_spread` (rad/s): standard deviations of the offsets at the start; `scale_spread`
    (-): the standard deviation of compliance and roll gradient about the car's file.
    """

    motion: BodyMotion
    rear_axle_to_cg: jax.Array = positive("m")
    rear_compliance: jax.Array = positive("rad/(m/s^2)")
    roll_gradient: jax.Array = positive("rad/(m/s^2)")
    roll_frequency: jax.Array = positive("Hz", default=1.5)
    roll_damping: jax.Array = positive("-", default=0.3)
    bank_spread: jax.Array = positive("rad", default=0.03)
    bank_length: jax.Array = positive("m", default=200.0)
    bank_edge: jax.Array = positive("m", default=6.0)
    slip_error: jax.Array = positive("rad", default=0.0008)
    slip_error_time: jax.Array = positive("s", default=0.1)
    slip_gate: jax.Array = positive("-", default=1.0)
    roll_rate_noise: jax.Array = positive("rad/s", default=0.006)
    across: jax.Array = positive("m/s", default=0.06)
    delay: jax.Array = parameter("s", scale=0.1, default=0.14)
    unit_delay: jax.Array = parameter("s", scale=0.1, default=0.0)
    a_y_offset: jax.Array = parameter("m/s^2", scale=0.1, default=0.0)
    a_y_offset_spread: jax.Array = positive("m/s^2", default=0.09)
    gyro_offset_spread: jax.Array = positive("rad/s", default=math.radians(0.12))
    scale_spread: jax.Array = positive("-", default=0.12)
    steering: SteerAgreement | None = None

    @property
    def needs(self):
        return NEEDS if self.steering is None else (*NEEDS, *self.steering.needs)

    def first(self, t, values):
        motion, heard = self.motion.first(t, values)
        gyro, scale = self.gyro_offset_spread, self.scale_spread
        stds = {
            "v_y": 0.5, "yaw": 3.0, "bank": self.bank_spread, "bank_rate": 0.01, "body_roll": 0.02, "body_roll_rate": 0.05,
            "a_y_bias": self.a_y_offset_spread, "yaw_rate_bias": gyro, "roll_rate_bias": gyro, "slope_bias": 0.008,
            "rear_scale": scale, "roll_scale": scale,
        }  # fmt: skip
        belief = belief_of(State, {"a_y_bias": self.a_y_offset}, stds, t)
        agreement = None if self.steering is None else self.steering.start(t)
        belief, misfit = self._measured(belief, heard, agreement, no_misfit(3, t))
        rough = no_roughness(values["a_y"]), no_roughness(values["yaw_rate"])
        memory = Memory(motion, belief, jnp.zeros_like(t), agreement, misfit, rough)
        return memory, self.say(memory)

    def next(self, memory, t, values):
        motion, heard = self.motion.next(memory.motion, t, values)
        agreement = None if self.steering is None else self.steering.next(memory.agreement, values, heard)
        belief = self._ahead(memory.belief, heard, memory.roughness)
        belief, misfit = self._measured(belief, heard, agreement, memory.misfit)
        said = zip(memory.roughness, (values["a_y"], values["yaw_rate"]), strict=True)
        rough = tuple(learn_roughness(one, value, heard["dt"]) for one, value in said)
        change = State(*belief.mean).body_roll_rate - State(*memory.belief.mean).body_roll_rate
        acceleration = (ROLL_TIME * memory.roll_acceleration + change) / (ROLL_TIME + heard["dt"])
        memory = Memory(motion, belief, acceleration, agreement, misfit, rough)
        return memory, self.say(memory)

    def ahead(self, memory, t, values):
        return self._ahead(memory.belief, self.motion.next(memory.motion, t, values)[1], memory.roughness)

    def _ahead(self, belief: Belief, heard, roughness) -> Belief:
        dt = heard["dt"]
        force, turn = (one.variance for one in roughness)
        fast = passing_speed(heard["v_x"])
        # The law of the bank by distance: a chain of two first-order lags, with this variance.
        slow, quick = fast / self.bank_length, fast / self.bank_edge
        bank_walk = 2.0 * jnp.square(self.bank_spread) * slow * quick * (slow + quick)
        per_second = {
            "v_y": 4e-5 + dt * (force + jnp.square(heard["v_x"]) * turn), "yaw": 1e-7 + dt * turn,
            "bank_rate": bank_walk, "body_roll_rate": 2e-3, "a_y_bias": 4e-6, "yaw_rate_bias": 3e-8,
            "roll_rate_bias": 3e-8, "slope_bias": 1e-7, "rear_scale": 1e-5, "roll_scale": 1e-6,
        }  # fmt: skip
        step = lambda x: self._step(x, heard, slow, quick)
        return move(belief, step, {name: value * dt for name, value in per_second.items()}, State)

    def _plane_force(self, x, heard):
        return heard["a_y"] - x.a_y_bias - GRAVITY * x.body_roll

    def _step(self, x, heard, slow, quick):
        dt = heard["dt"]
        f_y, turn = self._plane_force(x, heard), heard["yaw_rate"] - x.yaw_rate_bias
        v_y = x.v_y + dt * (f_y - GRAVITY * x.bank - heard["v_x"] * turn)
        # Trapezoidal: the body on its springs stays stable however long a step is.
        w, half = 2.0 * math.pi * self.roll_frequency, 0.5 * dt
        damping = 2.0 * self.roll_damping * w
        gradient = self.roll_gradient * (1.0 + x.roll_scale)
        push = w * w * (gradient * f_y - x.body_roll - half * x.body_roll_rate)
        rate = x.body_roll_rate + dt * (push - damping * x.body_roll_rate) / (
            1.0 + half * damping + half * half * w * w
        )
        return x._replace(
            v_y=v_y,
            yaw=x.yaw + dt * turn,
            bank=x.bank * jnp.exp(-dt * slow) + dt * x.bank_rate,
            bank_rate=x.bank_rate * jnp.exp(-dt * quick),
            body_roll=x.body_roll + half * (x.body_roll_rate + rate),
            body_roll_rate=rate,
        )

    def _measured(self, belief: Belief, heard, agreement: AgreementMemory | None, misfit: Misfit):
        """The belief after the row's measurements, and by how much their noise exceeds the assumed one."""
        measured = (self._rear_axle(heard, agreement), self._course(heard), self._roll_rate(heard))
        return correct_by_each(belief, measured, misfit, heard["dt"], State)

    def _rear_axle(self, heard, agreement: AgreementMemory | None) -> Measurement:
        """The rear axle's slip angle, which follows from its force."""
        fast = away_from_zero(heard["v_x"])

        def residual(x):
            turn = heard["yaw_rate"] - x.yaw_rate_bias
            slip = self.rear_compliance * (1.0 + x.rear_scale) * self._plane_force(x, heard) * (heard["v_x"] / fast)
            return (rolls_across(heard, heard["v_x"]) - (x.v_y - self.rear_axle_to_cg * turn)) / fast - slip

        # A correlated error counts once per correlation time, however many rows there are; in hard turns tyres are not linear.
        repeats = 2.0 * self.slip_error_time / jnp.maximum(heard["dt"], 1e-3)
        lasting = jnp.square(self.slip_error) * repeats
        fourth = lambda x: jnp.square(jnp.square(x))
        variance = lasting * (1.0 + fourth(heard["a_y"] / LINEAR))
        if agreement is not None:
            variance = variance + lasting * fourth(agreement.doubt)
        return Measurement(residual, variance, heard["silence"] < SILENCE, self.slip_gate, FALL, repeats)

    def _course(self, heard) -> Measurement:
        """The course of the satellites, which is late."""
        v_x, there = heard["v_x"], ~jnp.isnan(heard["course"])
        fast = away_from_zero(v_x)

        def residual(x):
            turn = heard["yaw_rate"] - x.yaw_rate_bias
            drifts = (self._plane_force(x, heard) - GRAVITY * x.bank - v_x * turn) / fast
            rate = drifts + heard["late_yaw_rate"] - x.yaw_rate_bias
            said = x.yaw + numerics.arctan2(x.v_y, fast) - self.delay * rate
            return numerics.wrap_angle(jnp.where(there, heard["course"], 0.0) - said)

        return Measurement(residual, jnp.square(self.across / fast), there & (v_x > 1.0), 3.0)

    def _roll_rate(self, heard) -> Measurement:
        """The gyroscope about the car's x axis: the rates of body and bank, and a part of the yaw rate where the car pitches."""
        there, forgets = ~jnp.isnan(heard["roll_rate"]), passing_speed(heard["v_x"]) / self.bank_length

        def residual(x):
            turn = heard["yaw_rate"] - x.yaw_rate_bias
            pitched = turn * (heard["slope"] + x.slope_bias)
            said = x.body_roll_rate + x.bank_rate - forgets * x.bank + pitched + x.roll_rate_bias
            return jnp.where(there, heard["roll_rate"], 0.0) - said

        return Measurement(residual, jnp.square(self.roll_rate_noise), there)

    def say(self, memory):
        motion, belief = memory.motion, memory.belief
        x = State(*belief.mean)
        forgets = passing_speed(motion.v_x) / self.bank_length
        # The inertial unit is late: what has changed since.
        angle, rate = self.unit_delay * x.body_roll_rate, self.unit_delay * memory.roll_acceleration
        late = {"roll": angle, "body_roll": angle, "roll_rate": rate}
        said = {
            "bank": x.bank,
            "roll": x.bank + x.body_roll + angle,
            "roll_rate": x.bank_rate - forgets * x.bank + x.body_roll_rate + rate,
            "body_roll": x.body_roll + angle,
            **{name: getattr(x, name) for name in MORE},
        }
        sums = {"roll": ("bank", "body_roll"), "roll_rate": ("bank_rate", "body_roll_rate")}
        of_states = lambda name: spread_of(belief, dict.fromkeys(sums.get(name, (name,)), 1.0), State)
        more = lambda name: jnp.square(LATENESS * late.get(name, 0.0))
        stds = {name: numerics.sqrt(jnp.square(of_states(name)) + more(name)) for name in said}
        there = jnp.maximum(motion.silence, motion.speed_silence) < SILENCE
        widest = {"bank": WIDEST, "roll": WIDEST, "body_roll": WIDEST, "roll_rate": 6.0 * WIDEST}
        known = {name: there & (stds[name] < widest.get(name, jnp.inf)) for name in said}
        return answer(said, stds, known)


def leaning_filter(car: CarSpecification, who: str, **options: Any) -> Leaning:
    """The filter for a car's file. **Raises** `InputError` for a file without `roll_gradient`, which separates roll from
    bank."""
    stiffness = number_of(car, "rear_cornering_stiffness", who, "N/rad")
    return Leaning(
        motion_of(car),
        rear_axle_to_cg=car.rear_axle_to_cg,
        rear_compliance=car.mass * car.front_axle_to_cg / (car.wheelbase * stiffness),
        roll_gradient=number_of(car, "roll_gradient", who, "rad/(m/s^2)"),
        delay=satellite_lag(car),
        **numbers_in(car, "roll_frequency", "roll_damping"),
        **{"steering": agreement_of(car, who), "unit_delay": unit_delay(car), **options},
    )

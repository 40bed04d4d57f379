"""The learner of slowly changing parameters: two least-squares fits, which only rows with excitation change."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.names import record_type
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.body_motion import SILENCE, STEERING, away_from_zero, hold
from jaxveh.estimators.car_file import number_of
from jaxveh.estimators.delays import unit_delay
from jaxveh.estimators.leaning import Leaning, leaning_filter
from jaxveh.estimators.method import AbstractMethod, answer
from jaxveh.estimators.rear_steer import rear_angle
from jaxveh.estimators.sequential import Belief, Measurement, belief_of, correct
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY

UNITS = {"yaw_inertia": "kg m^2", "front_axle_to_cg": "m", "steer_offset": "rad", "steering_ratio": "-"}
"""The learned parameters and their units."""

RATES = {"yaw_inertia": 10.0, "front_axle_to_cg": 0.005, "steer_offset": 2e-4, "steering_ratio": 0.05}
"""Largest rates of the reported values, in units per second."""

NARROW = {"yaw_inertia": 0.1, "front_axle_to_cg": 0.05, "steer_offset": 6e-4, "steering_ratio": 0.025}
"""Standard deviations below which a number is known: relative to the start for those of `RELATIVE`, otherwise in its unit."""

RELATIVE = ("yaw_inertia", "steering_ratio")
"""The parameters whose standard deviation counts relative to their start."""

Steering = record_type("SteeringFit", ("ratio", "offset", "understeer"))
"""Relative error of the ratio, offset at the road wheels (rad), understeer gradient less that of the start (rad/(m/s^2))."""

Turning = record_type("TurningFit", ("stiffness", "inertia"))
"""Relative errors of the front axle's cornering stiffness and of the yaw inertia."""

LONG = 60.0
"""s: time constant of the averaged square of the steer."""

START = 2.0
"""s: time until the low-pass filters have forgotten their initial values."""

SLOWEST = 3.0
"""m/s: nothing is learned below this speed."""

QUICK = 5.0
"""m/s: little is learned below this speed."""

LINEAR = 2.0
"""m/s^2: above this acceleration the tyres are not linear, and little is learned."""

CALM = 0.15
"""rad/s^2: above this yaw acceleration little is learned about the steering."""

STAYS = 10.0
"""s: correlation time that is assumed for a constant error."""

OF_THE_SPEED = 0.01
"""Relative standard deviation of a ratio by errors of the wheels' radius and of the wheelbase, which no drive shows."""


class LearnerMemory(NamedTuple):
    """The memory of the filter of roll and bank, `leaning`; the steering `wheel` angle (rad); the steer with the delay of the yaw
    rate, `late` (rad); the mean `square` of the steer without slip (rad^2); low-passed steer and angle of the rear wheels, `rear`
    (rad), yaw rate (rad/s), lateral force over mass (m/s^2) and lateral velocity (m/s); the two fits; the reported values,
    `shown`; the time since the first row, `age` (s)."""

    leaning: Any
    wheel: Any
    late: Any
    square: Any
    steer: Any
    rear: Any
    turn: Any
    force: Any
    v_y: Any
    steering: Belief
    turning: Belief
    shown: Any
    age: Any


class Learner(AbstractMethod):
    """Steering ratio and offset, the centre of gravity and the yaw inertia, learned while a car drives.

    In turns of little lateral acceleration, with yaw rate and roll corrected by the filter `leaning`,

        steering_wheel / ratio = offset + steer_rear + l r / v_x + understeer f_y + J_z (1 / C_f + 1 / C_r) / l dr/dt

    gives ratio, offset and understeer. With known cornering stiffnesses understeer gives the position of the centre of gravity
    (eq 17 of the review, corrected: `l r / v - delta`): `l_f = l (m / C_f - understeer) / (m (1 / C_f + 1 / C_r))`.

        m l_r f_y = C_f l alpha_f - J_z dr/dt,    alpha_f = steer - (v_y + l_f r) / v_x

    gives yaw inertia and front stiffness. The standard deviation of l_f includes the errors of the file's stiffnesses
    (`stiffness_spread`). The reported values change no faster than `RATES`, and are known where their standard deviations are
    within `NARROW`.

    **Parameters**: the car's `mass` (kg), `yaw_inertia` (kg m^2), `front_axle_to_cg`, `wheelbase` (m), `front_stiffness`,
    `rear_stiffness` (N/rad), `steering_ratio` (-), `steer_offset` (rad, at the road wheels); prior standard deviations:
    `ratio_spread`, `stiffness_spread`, `inertia_spread` (-), `offset_spread` (rad), `place_spread` (m); `steer_error` (rad at the
    road wheels) and `moment_error` (of m g l), with the correlation time `lasting` (s); `play` (rad at the road wheels): half the
    sensor's play, of which half always remains in the offset's standard deviation, and its share of the steer in the ratio's;
    `time` (s): low-pass filter of both sides; `late` (s): delay of the inertial unit against the steering sensor.
    """

    leaning: Leaning
    mass: jax.Array = positive("kg")
    yaw_inertia: jax.Array = positive("kg m^2")
    front_axle_to_cg: jax.Array = positive("m")
    wheelbase: jax.Array = positive("m")
    front_stiffness: jax.Array = positive("N/rad")
    rear_stiffness: jax.Array = positive("N/rad")
    steering_ratio: jax.Array = positive("-")
    steer_offset: jax.Array = parameter("rad", scale=1e-3)
    ratio_spread: jax.Array = positive("-", default=0.1)
    offset_spread: jax.Array = positive("rad", default=6e-4)
    stiffness_spread: jax.Array = positive("-", default=0.2)
    place_spread: jax.Array = positive("m", default=0.15)
    inertia_spread: jax.Array = positive("-", default=0.3)
    steer_error: jax.Array = positive("rad", default=1.2e-3)
    moment_error: jax.Array = positive("-", default=0.015)
    lasting: jax.Array = positive("s", default=0.4)
    play: jax.Array = positive("rad", default=5e-4)
    late: jax.Array = positive("s", default=0.025)
    time: jax.Array = positive("s", default=0.15)

    @property
    def needs(self):
        return (*self.leaning.needs, STEERING)

    def first(self, t, values):
        leaning, said = self.leaning.first(t, values)
        zero = jnp.zeros_like(t)
        stds = {"ratio": self.ratio_spread, "offset": self.offset_spread, "understeer": self._understeer_spread()}
        steering = belief_of(Steering, {"offset": self.steer_offset}, stds, t)
        turning = belief_of(Turning, {}, {"stiffness": self.stiffness_spread, "inertia": self.inertia_spread}, t)
        start = {name: getattr(self, name) + zero for name in UNITS}
        memory = LearnerMemory(
            leaning, zero, zero, zero, zero, zero, zero, zero, zero, steering, turning, start, zero,
        )  # fmt: skip
        return self._next(memory, leaning, said, zero, values)

    def next(self, memory, t, values):
        before = memory.leaning.motion.t
        leaning, said = self.leaning.next(memory.leaning, t, values)
        return self._next(memory, leaning, said, t - before, values)

    def _next(self, memory, leaning, said, dt, values):
        motion = leaning.motion
        silent = jnp.maximum(motion.silence, motion.speed_silence) > 0.5 * SILENCE
        there = ~silent & ~jnp.isnan(values["steering_wheel"]) & (memory.age > START) & (motion.v_x > SLOWEST)
        fast = away_from_zero(motion.v_x)
        wheel = hold(values["steering_wheel"], memory.wheel)
        heard = memory._replace(leaning=leaning, wheel=wheel)
        memory, rate = self._low_passed(heard, rear_angle(values), said.mean, fast, dt)
        # Rows count gradually less in hard turns and at low speed.
        doubt = 1.0 + jnp.square(jnp.square(memory.force / LINEAR)) + jnp.square(jnp.square(QUICK / fast))
        lasting = doubt * 2.0 * self.lasting / jnp.maximum(dt, 1e-3)
        steering = self._fit_steering(memory, rate, fast, said.std.yaw_rate_bias, lasting, there)
        turning = self._fit_turning(memory, steering, rate, fast, lasting, there)
        heading = said.std.yaw_rate_bias / jnp.maximum(fast, QUICK)
        # Share of the steering amplitude that is lost in the play.
        swing = self.play / numerics.sqrt(memory.square + jnp.square(0.1 * self.play))
        means, stds = self._numbers(steering, turning, heading, jnp.minimum(swing, self.ratio_spread))
        most = {name: RATES[name] * jnp.where(there, dt, 0.0) for name in UNITS}
        shown = {name: memory.shown[name] + _within(means[name] - memory.shown[name], most[name]) for name in UNITS}
        narrow = NARROW | {name: NARROW[name] * getattr(self, name) for name in RELATIVE}
        known = {
            name: (stds[name] < narrow[name]) & (jnp.abs(means[name] - shown[name]) < narrow[name]) for name in UNITS
        }
        memory = memory._replace(steering=steering, turning=turning, shown=shown, age=memory.age + dt)
        return memory, answer(shown, stds, known)

    def _low_passed(
        self, memory: LearnerMemory, rear: Any, believed: Any, fast: Any, dt: Any
    ) -> tuple[LearnerMemory, Any]:
        """The memory with the low-passed signals of this row, and the yaw acceleration (rad/s^2). `rear`: the angle of the rear
        wheels (rad); `believed`: the means of the filter of roll and bank; `fast`: the speed away from zero (m/s)."""
        motion, share = memory.leaning.motion, dt / (self.time + dt)
        slow = lambda before, now: before + share * (now - before)
        turn_now = motion.yaw_rate - believed.yaw_rate_bias
        force_now = motion.a_y - believed.a_y_bias - GRAVITY * believed.body_roll
        late = memory.late + dt / (self.late + dt) * (memory.wheel / self.steering_ratio - memory.late)
        turn = slow(memory.turn, turn_now)
        rear = slow(memory.rear, rear)
        curve = self.wheelbase * turn / fast + rear
        after = memory._replace(
            late=late,
            steer=slow(memory.steer, late),
            rear=rear,
            turn=turn,
            force=slow(memory.force, force_now),
            v_y=slow(memory.v_y, believed.v_y),
            square=memory.square + dt / (LONG + dt) * (jnp.square(curve) - memory.square),
        )
        return after, (turn_now - turn) / self.time

    def _fit_steering(
        self, now: LearnerMemory, rate: Any, fast: Any, bias_std: Any, lasting: Any, there: Any
    ) -> Belief:
        """The fit of ratio, offset and understeer after a row with these low-passed signals. `bias_std`: standard deviation of
        the yaw rate's offset (rad/s), in a steady turn an error of the ratio; `lasting`: the factor on a row's variance, since
        errors of neighbouring rows are alike (-); `there`: whether the row counts."""
        curve = self.wheelbase * now.turn / fast + now.rear
        start = self._understeer() * now.force - self.yaw_inertia * self._place_slope() / self.mass * rate
        off = lambda x: now.steer - x.offset - (1.0 + x.ratio) * (curve + start + x.understeer * now.force)
        calm = 1.0 + jnp.square(jnp.square(rate / CALM))
        stays = jnp.square(self.wheelbase * bias_std / fast) * (STAYS / self.lasting)
        seen = Measurement(off, (jnp.square(self.steer_error) + stays) * lasting * calm, there)
        return correct(now.steering, seen, Steering)

    def _fit_turning(
        self, now: LearnerMemory, steering: Belief, rate: Any, fast: Any, lasting: Any, there: Any
    ) -> Belief:
        """The fit of front stiffness and yaw inertia after a row, given the fit of the `steering`."""
        fit = Steering(*steering.mean)
        front = (now.steer - fit.offset) / (1.0 + fit.ratio) - (now.v_y + self.front_axle_to_cg * now.turn) / fast
        scale = self.mass * GRAVITY * self.wheelbase
        rear = self.wheelbase - self.front_axle_to_cg

        def moment(x):
            tyres = self.front_stiffness * (1.0 + x.stiffness) * self.wheelbase * front
            return (self.mass * rear * now.force - tyres + self.yaw_inertia * (1.0 + x.inertia) * rate) / scale

        # Errors of ratio and position are constant: no number of rows averages them out.
        wrong = numerics.hypot(
            now.steer * numerics.sqrt(steering.covariance[0, 0]),
            numerics.hypot(self.place_spread * now.turn / fast, 1e-4),
        )
        stays = jnp.square(self.front_stiffness * self.wheelbase / scale * wrong) * (STAYS / self.lasting)
        seen = Measurement(moment, (jnp.square(self.moment_error) + stays) * lasting, there)
        return correct(now.turning, seen, Turning)

    def _understeer(self):
        rear = self.wheelbase - self.front_axle_to_cg
        return self.mass * (rear / self.front_stiffness - self.front_axle_to_cg / self.rear_stiffness) / self.wheelbase

    def _place_slope(self):
        """The derivative of the understeer gradient by `front_axle_to_cg`, rad/(m/s^2) per m."""
        return -self.mass * (1.0 / self.front_stiffness + 1.0 / self.rear_stiffness) / self.wheelbase

    def _understeer_spread(self):
        rear = self.wheelbase - self.front_axle_to_cg
        axles = numerics.hypot(rear / self.front_stiffness, self.front_axle_to_cg / self.rear_stiffness)
        of_tyres = self.mass * self.stiffness_spread * axles / self.wheelbase
        return numerics.hypot(of_tyres, self._place_slope() * self.place_spread)

    def _numbers(self, steering: Belief, turning: Belief, heading: Any, swing: Any) -> tuple[dict, dict]:
        """The numbers from the fits and their standard deviations. `heading`: standard deviation of the yaw rate's offset over
        the speed; `swing`: share of the steer that is play."""
        fit, turn = Steering(*steering.mean), Turning(*turning.mean)
        std = Steering(*numerics.sqrt(jnp.diagonal(steering.covariance)))
        # The tyres' part of the understeer's standard deviation always remains in that of the position.
        prior = self._understeer_spread()
        gain = self._place_slope() * jnp.square(self.place_spread / prior)
        place = self.front_axle_to_cg + gain * fit.understeer
        seen = jnp.maximum(jnp.square(prior) - jnp.square(std.understeer), 0.0)
        left = jnp.square(self.place_spread) - jnp.square(gain) * seen
        inertia = numerics.sqrt(turning.covariance[1, 1])
        means = {
            "yaw_inertia": self.yaw_inertia * (1.0 + turn.inertia),
            "front_axle_to_cg": place,
            "steer_offset": fit.offset,
            "steering_ratio": self.steering_ratio * (1.0 + fit.ratio),
        }
        stds = {
            "yaw_inertia": self.yaw_inertia * inertia,
            "front_axle_to_cg": numerics.sqrt(jnp.maximum(left, 1e-8)),
            "steer_offset": numerics.hypot(numerics.hypot(std.offset, 0.5 * self.play), self.wheelbase * heading),
            "steering_ratio": self.steering_ratio * numerics.hypot(numerics.hypot(std.ratio, swing), OF_THE_SPEED),
        }
        return means, stds


def _within(change: Any, most: Any) -> Any:
    """A change, smoothly limited to `most`; small changes are hardly affected."""
    bound = jnp.where(most > 0, most, 1.0)
    return jnp.where(most > 0, bound * jnp.tanh(change / bound), 0.0)


def learner_of(car: CarSpecification, who: str) -> Learner:
    """Makes `Learner` from a car's file. **Raises** `InputError` for a file without stiffnesses, `steering_ratio` or
    `roll_gradient`."""
    return Learner(
        # What the steer says is learned here, and not yet known; the roll is compared with a_y, which is as late.
        leaning_filter(car, who, steering=None, unit_delay=0.0),
        car.mass,
        car.yaw_inertia,
        car.front_axle_to_cg,
        car.wheelbase,
        number_of(car, "front_cornering_stiffness", who, "N/rad"),
        number_of(car, "rear_cornering_stiffness", who, "N/rad"),
        number_of(car, "steering_ratio", who, "-"),
        car.steer_offset or 0.0,
        late=unit_delay(car),
    )

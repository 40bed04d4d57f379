"""The recommended speed method: an error-state filter with slip, radii and slopes, which trusts each wheel separately."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.method import AbstractMethod, answer
from jaxveh.estimators.misfit import learn_misfit, no_misfit
from jaxveh.estimators.rear_steer import rolls_across
from jaxveh.estimators.sequential import (
    Belief,
    Innovation,
    innovation,
    innovations,
    predict,
    update,
    update_by_each,
)
from jaxveh.estimators.speed.car_numbers import SpeedCar, forces_of_axles
from jaxveh.estimators.speed.slip_state import (
    HELD,
    LEFT,
    MAY_HELP,
    PATIENCE,
    RADII,
    WRONG,
    Memory,
    Said,
    SpeedState,
    Spreads,
    beyond,
    bound_by_two,
    front_rear,
    heard_in,
    missed_in_turn,
    own_radii,
    roughness_of_wheels,
    trust_of_wheels,
)
from jaxveh.estimators.speed.wheels import WHEEL_SPEEDS, wheel_values
from jaxveh.estimators.two_axles import slip_stiffness
from jaxveh.numerics import smooth_step
from jaxveh.vehicles import GRAVITY
from jaxveh.vehicles import kit as vehicles

SLOWEST = 0.3
"""m/s: a slower wheel says zero."""


class SlipAware(AbstractMethod):
    """An error-state filter of rolling speed, force, slope, the accelerometer's offset and gain, radii, softness and sinking.

        dv_x/dt = force + v_y yaw_rate - slope,        a_x = (1 + gain) force + offset
        wheel   = (1 + radius) (1 + sink) (1 + slip) (speed at the wheel's position, along the wheel's plane)
        slip    = exp(softness) F / (K F_z) - f_r / K,      F from the torques if the log has them, else from `force`

    `gain` models that an accelerometer on the body pitches with it: g times the file's `pitch_gradient`, or that of usual cars.
    A wheel with more load rolls with a smaller radius: `sink = sinking (F_z / F_z at rest - 1)`. It is a state, whose prior has
    the mean `sinking` (-), because tyres differ: 0.017 for a belt whose radius decreases by a third of the tyre's compression,
    0.003 to 0.005 for a radial tyre by Pacejka's curve of the effective rolling radius. With a wrong number, wheels that differ
    in a turn would be taken for the slip of a larger force, and the accelerometer for one with an offset. Lateral velocities
    are those of a steady turn with the file's cornering stiffnesses.

    **Trust**: a wheel is weighted by `(gate / |e|)^8` where its normalised innovation e is beyond `gate`, and likewise where its
    acceleration differs from the car's by more than `rate_gate` (m/s^2; four times that without an accelerometer). Trust is lost
    at once and returns within `memory` (s). Where wheels agree and have small forces (`calm`, -, over load), the belief is more
    likely wrong than the wheels, and the gate is five times as wide. A slipping wheel is left out, all four if necessary: then
    the filter integrates the accelerometer with the offset, gain and slope estimated before. While most wheels are at their limit
    and the force is beyond `bound_force` (m/s^2), two wheels that are faster than a braking car, or slower than a driven one,
    bound its speed. Several fixes of satellites in turn that are beyond `gate` are right (`slip_state.missed_in_turn`). A car
    that turns near its limit may slide, and lose speed without feeling it (`Spreads.slides`). If wheels agree with the
    accelerometer's rate for `patience` (s) and are still not trusted, the speed's process noise is increased until they are.
    How noisy accelerometer, satellites and wheels are is learned, as their `Misfit`.

    **Delays** (s, of the production car): `a_x_delay` of the accelerometer and its low-pass filter, `wheel_delay` of wheel
    speeds, half a period included, and the time of a slow wheel from tooth to tooth (`tooth`, m), `satellite_delay`. The answer
    is for the present time: the belief, extrapolated by its acceleration.

    `v_x` is known where its standard deviation is below `known_share` (-) of it plus `known_speed` (m/s). Reported: `v_x` (m/s);
    `grade` (rad), positive uphill, and `a_x_offset` (m/s^2), which are only distinguished by how fast they change.

    Chen, Gao, Xu 2013, section 2.1, refs 88 to 92, and sections 2.2, 2.3 for the forces; the trust is our choice.
    """

    car: SpeedCar
    spreads: Spreads = eqx.field(default_factory=Spreads)
    gain: jax.Array = parameter("-", scale=0.03, default=0.048)
    sinking: jax.Array = parameter("-", scale=0.01, default=0.01)
    gate: jax.Array = positive("-", default=3.0)
    rate_gate: jax.Array = positive("m/s^2", default=2.0)
    calm: jax.Array = positive("-", default=0.1)
    bound_force: jax.Array = positive("m/s^2", default=1.5)
    memory: jax.Array = positive("s", default=0.3)
    patience: jax.Array = positive("s", default=3.0)
    a_x_delay: jax.Array = positive("s", default=0.025)
    wheel_delay: jax.Array = positive("s", default=0.03)
    satellite_delay: jax.Array = positive("s", default=0.15)
    tooth: jax.Array = positive("m", default=0.04)
    smoothing: jax.Array = positive("s", default=0.06)
    known_share: jax.Array = positive("-", default=0.02)
    known_speed: jax.Array = positive("m/s", default=0.15)

    @property
    def needs(self):
        return (*WHEEL_SPEEDS, *MAY_HELP)

    def first(self, t, values):
        wheels = wheel_values(values)
        there = ~jnp.isnan(wheels)
        count = jnp.sum(there.astype(t.dtype))
        v_x = jnp.sum(jnp.where(there, wheels, 0.0)) / jnp.maximum(count, 1.0)
        s, zero = self.spreads, jnp.zeros_like(t)
        mean = SpeedState(v_x, zero, zero, zero, zero + self.gain, *[zero] * 7, sinking=zero + self.sinking)
        std = SpeedState(
            jnp.where(count > 0, 0.3 + 0.03 * jnp.abs(v_x), 30.0), 3.0, s.slope, s.offset, s.gain,
            s.common_radius, *[0.0] * 4, *[s.softness] * 2, sinking=s.sinking,
        )  # fmt: skip
        stack = lambda state: jnp.stack([jnp.asarray(one, t.dtype) for one in state])
        belief = Belief(stack(mean), jnp.diag(jnp.square(stack(std))) + own_radii(s.radius))
        never = jnp.full_like(t, -jnp.inf)
        ones = jnp.ones_like(wheels)
        memory = Memory(
            belief, t, dict.fromkeys(HELD, zero), dict.fromkeys(HELD, never), jnp.where(there, wheels, v_x), t * ones, ones,
            jnp.zeros_like(ones), zero, t, no_misfit(3, t), (jnp.where(there, wheels, v_x),) * 2, zero,
        )  # fmt: skip
        return memory, self._answer(memory)

    def next(self, memory: Memory, t, values):
        heard, at = heard_in(self.car, memory, t, values)
        memory = memory._replace(heard=heard, at=at)
        step = jnp.maximum(t - memory.t, 0.0)
        belief = self._move(memory, step)
        wheels = wheel_values(values)
        told = innovation(belief, self._felt, values["a_x"], memory.misfit.times[0] * jnp.square(self.spreads.a_x))
        belief = update(belief, told, self._gate(told, 2.0 * self.gate))
        memory = memory._replace(rate=self._smooth_rate(memory, belief, step))
        fix = self._satellite(memory, belief, values["speed"])
        missed = missed_in_turn(memory.missed, values["speed"], self._gate(fix, self.gate))
        belief = update(belief, fix, self._gate(fix, self.gate * 2.0**memory.missed))
        misfit, lately = self._learn(memory, step, (told, values["a_x"]), (fix, values["speed"]), wheels)
        belief, memory = self._use_wheels(memory, belief, t, step, wheels)
        memory = memory._replace(belief=belief, t=t, misfit=misfit, lately=lately, missed=missed)
        return memory, self._answer(memory)

    def _speaks(self, memory: Memory, name: str):
        return memory.t - memory.at[name] <= PATIENCE

    def _lateral(self, memory: Memory, x: SpeedState):
        """Yaw rate (rad/s), lateral acceleration (m/s^2), and the lateral speed (m/s) of a steady turn."""
        car, rear = self.car, memory.smooth
        of_wheels = (rear[3] - rear[2]) / car.track_rear
        yaw_rate = jnp.where(self._speaks(memory, "yaw_rate"), memory.heard["yaw_rate"], of_wheels)
        a_y = jnp.where(self._speaks(memory, "a_y"), memory.heard["a_y"], x.rolled * yaw_rate)
        slip = car.mass * car.front_axle_to_cg / car.wheelbase * a_y / car.rear_cornering_stiffness
        v_y = car.rear_axle_to_cg * yaw_rate + rolls_across(memory.heard, x.rolled) - x.rolled * slip
        return yaw_rate, a_y, v_y

    def _acceleration(self, memory: Memory, x: SpeedState):
        yaw_rate, _, v_y = self._lateral(memory, x)
        return x.force + v_y * yaw_rate - x.slope

    def _move(self, memory: Memory, step) -> Belief:
        s = self.spreads
        # Without an accelerometer slope and force cannot be distinguished.
        felt = self._speaks(memory, "a_x")
        falls, back = jnp.where(felt, jnp.exp(-step / s.slope_time), 0.0), jnp.exp(-step / s.softness_time)

        def move(mean):
            x = SpeedState(*mean)
            # With a wrong radius the wheels' rate is slightly different, too; the accelerometer's gain contains that.
            rolled = x.rolled + step * self._acceleration(memory, x)
            soft = [back * x.softness_front, back * x.softness_rear]
            return jnp.stack([rolled, x.force, falls * x.slope, *x[3:10], *soft, x.sinking])

        lost = (memory.t - memory.lost > self.patience) | (memory.missed >= WRONG)
        yaw_rate, a_y, _ = self._lateral(memory, SpeedState(*memory.belief.mean))
        slides = s.slides * jnp.square(jnp.square(a_y / GRAVITY)) * yaw_rate * memory.belief.mean[0]
        wander = numerics.hypot(s.speed_walk + jnp.where(lost, 1.0, 0.0), slides)
        soft = s.softness * numerics.sqrt(2.0 / s.softness_time)
        slope_walk = jnp.where(felt, s.slope_walk, 0.0)
        # The walk of each wheel's own radius is added below.
        walks = [
            wander, s.force_walk, slope_walk, s.offset_walk, 0.0, 0.5 * s.radius_walk, *[0.0] * 4, soft, soft, 0.0,
        ]  # fmt: skip
        noise = jnp.diag(jnp.square(jnp.stack(walks))) + own_radii(s.radius_walk)
        return predict(memory.belief, move, step * noise)

    def _smooth_rate(self, memory: Memory, belief: Belief, step):
        now = self._acceleration(memory, SpeedState(*belief.mean))
        return memory.rate + (1.0 - jnp.exp(-step / self.smoothing)) * (now - memory.rate)

    def _felt(self, mean):
        x = SpeedState(*mean)
        return (1.0 + x.gain) * x.force + x.offset

    def _satellite(self, memory: Memory, belief: Belief, value) -> Innovation:
        lag = self.satellite_delay - self.a_x_delay

        def over_ground(mean):
            x = SpeedState(*mean)
            v_y = self._lateral(memory, x)[2]
            return numerics.hypot(x.v_x - lag * memory.rate, v_y)

        spread = self.spreads.satellite + 0.3 * jnp.abs(lag * memory.rate)
        return innovation(belief, over_ground, value, memory.misfit.times[1] * jnp.square(spread))

    def _learn(self, memory: Memory, step, felt, fix, wheels):
        """The misfit after the innovations of accelerometer and satellites, each with its measurement, and after the wheels,
        whose innovations are slip, too; and the wheels' last two speeds."""
        squares = [
            jnp.where(jnp.isnan(value), jnp.nan, jnp.square(one.residual) / one.variance) for one, value in (felt, fix)
        ]
        white = memory.misfit.times[2] * self._white(memory.belief)
        rough, lately = roughness_of_wheels(wheels, memory.lately, white)
        return learn_misfit(memory.misfit, jnp.stack([*squares, rough]), step), lately

    def _gate(self, found, most):
        """The weight of an innovation: 1 within `most` standard deviations, beyond them falling with the eighth power."""
        far = numerics.sqrt(jnp.square(found.residual) / found.variance)
        return beyond(far / most)

    def _wheels(self, memory: Memory, mean) -> Said:
        """The predicted wheels for a mean (n,)."""
        x, car = SpeedState(*mean), self.car
        lag = self.wheel_delay - self.a_x_delay + self.tooth / jnp.maximum(jnp.abs(x.rolled), SLOWEST)
        v_x = x.rolled - lag * self._acceleration(memory, x)
        yaw_rate, a_y, _ = self._lateral(memory, x)
        along = v_x - LEFT.astype(v_x.dtype) * 0.5 * front_rear(car.track_front, car.track_rear) * yaw_rate
        steer = front_rear(memory.heard["steer"], memory.heard["steer_rear"])
        arms, share = (car.rear_axle_to_cg, car.front_axle_to_cg), car.mass / car.wheelbase * a_y
        slips = front_rear(*(share * arm / c for arm, c in zip(arms, car.cornering_stiffnesses, strict=True)))
        along = along * numerics.cos(steer) + v_x * (steer - slips) * numerics.sin(steer)
        share, load = self._shares_of_load(memory, x)
        front, rear = (slip_stiffness(c, n) for c, n in zip(car.cornering_stiffnesses, car.loads, strict=True))
        softness = front_rear(x.softness_front, x.softness_rear)
        slip = jnp.exp(softness) * share / front_rear(front, rear)
        sink = x.sinking * (load / front_rear(*car.loads) - 1.0)
        rolling = along * (1.0 + mean[RADII] + sink)
        return Said(rolling + along * slip, rolling, slip, share)

    def _shares_of_load(self, memory: Memory, x: SpeedState):
        """Each wheel's longitudinal force over its load (-), and its load (N), (4,)."""
        car = self.car
        at_rest = front_rear(*car.loads)
        pitched = 0.5 * car.mass * x.force * car.cg_height / car.wheelbase
        a_y = self._lateral(memory, x)[1]
        rolled = 2.0 * a_y / GRAVITY * car.cg_height / (0.5 * (car.track_front + car.track_rear))
        load = jnp.maximum(
            at_rest * (1.0 - LEFT.astype(rolled.dtype) * rolled) + front_rear(-pitched, pitched), 0.1 * at_rest
        )
        rolling = car.rolling_resistance * car.mass * GRAVITY
        push = car.mass * x.force + car.drag * x.rolled * jnp.abs(x.rolled) + rolling
        force = front_rear(*forces_of_axles(car, push))
        brakes = [f"brake_torque_{place}" for place in vehicles.CORNERS]
        drive = 0.5 * front_rear(car.front_drive, 1.0 - car.front_drive) * memory.heard["drive_torque"]
        by_torque = (drive - jnp.stack([memory.heard[name] for name in brakes])) / car.wheel_radius
        known = jnp.stack([self._speaks(memory, name) for name in brakes]) & self._speaks(memory, "drive_torque")
        return jnp.where(known, by_torque, force) / load - car.rolling_resistance, load

    def _smooth_wheels(self, memory: Memory, t, wheels, there):
        """The low-passed speeds of the wheels (m/s), and by how much each is trusted because its rate is the car's, (4,) each."""
        waited = jnp.where(there, t - memory.smooth_at, 0.0)
        mixed = 1.0 - jnp.exp(-waited / self.smoothing)
        # A wheel that said zero turned at an unknown rate.
        last = jnp.where(there & (memory.smooth == 0.0), wheels, memory.smooth)
        smooth = last + mixed * (jnp.where(there, wheels, last) - last)
        rates = (jnp.where(there, wheels, smooth) - smooth) / self.smoothing
        # Without an accelerometer the car's rate is that of the wheels.
        gate = self.rate_gate * jnp.where(self._speaks(memory, "a_x"), 1.0, 4.0)
        return smooth, beyond((rates - memory.rate) / (gate * numerics.sqrt(memory.misfit.times[2])))

    def _use_wheels(self, memory: Memory, belief: Belief, t, step, wheels):
        there = ~jnp.isnan(wheels)
        smooth, steady = self._smooth_wheels(memory, t, wheels, there)
        said, rolled = self._wheels(memory, belief.mean), SpeedState(*belief.mean).rolled
        suspicion = memory.suspicion * jnp.exp(-step / self.spreads.suspicion_time)
        most = jnp.sort(suspicion)[1]
        limit = jnp.maximum(suspicion, most)
        # A wheel at its limit slips in the direction of its force.
        at_limit = self.spreads.limit_slip * limit * rolled
        at_limit = at_limit * said.share / (jnp.abs(said.share) + 0.02)

        def expect(mean):
            one = self._wheels(memory, mean)
            return jnp.concatenate([one.speed + at_limit, one.rolling])

        white, slow = self._wheel_variances(memory, belief, said, wheels)
        slow = slow + jnp.square(at_limit)
        # Where one wheel locks or spins, the forces of the others are unknown.
        slow = slow + jnp.square(self.spreads.other_slip * numerics.largest(suspicion) * rolled)
        variances = jnp.concatenate([white + slow, numerics.as_wide_as(white, slow)])
        both = innovations(belief, expect, jnp.tile(wheels, 2), variances)
        found, rolling = (Innovation(*[part[rows] for part in both]) for rows in (slice(0, 4), slice(4, 8)))
        now = trust_of_wheels(found, said, white + slow, there, self.gate, self.calm) * steady
        trusted = jnp.minimum(memory.trust + step / self.memory * (1.0 - memory.trust), 1.0)
        trust = jnp.where(there, jnp.minimum(now, trusted), trusted)
        # Errors that last for a while are not reduced by repeated measurements.
        lasts = found.variance / (found.variance + self.spreads.repeats * slow)
        before = belief.mean
        belief = update_by_each(belief, found, jnp.where(there, trust * lasts, 0.0))
        rolling = rolling._replace(residual=rolling.residual - rolling.slope @ (belief.mean - before))
        # A one-sided bound turns noise into a bias: only where most wheels are at their limit.
        sure = most * smooth_step(jnp.abs(SpeedState(*belief.mean).force) - self.bound_force)
        belief = bound_by_two(belief, rolling, there, white, sure)
        locked = jnp.all(jnp.where(there, wheels == 0.0, memory.smooth == 0.0))
        strange = jnp.any(there & (steady < 0.5)) | locked
        return belief, memory._replace(
            smooth=jnp.where(there & (wheels == 0.0), 0.0, smooth),
            smooth_at=jnp.where(there, t, memory.smooth_at),
            trust=trust,
            suspicion=jnp.where(there, jnp.maximum(suspicion, 1.0 - now), suspicion),
            lost=jnp.where(jnp.any(there & (trust > 0.5)) | strange, t, memory.lost),
        )

    def _white(self, belief: Belief):
        """The variance of a wheel's white noise that is assumed, (m/s)^2."""
        return jnp.square(self.spreads.wheel) + jnp.square(self.spreads.wheel_share * SpeedState(*belief.mean).rolled)

    def _wheel_variances(self, memory: Memory, belief: Belief, said: Said, wheels):
        s, x = self.spreads, SpeedState(*belief.mean)
        v_x, (yaw_rate, _, _) = jnp.abs(x.rolled), self._lateral(memory, x)
        near_limit = s.peak_slip * jnp.square(jnp.square(said.share))
        white = memory.misfit.times[2] * self._white(belief)
        still = jnp.where(wheels == 0.0, s.still, 0.0)
        # Half of the time from tooth to tooth.
        waits = 0.5 * self.tooth / jnp.maximum(v_x, SLOWEST) * memory.rate
        parts = [s.turn * yaw_rate, s.slip_share * said.slip * v_x, near_limit * v_x, still, waits]
        return white, sum(jnp.square(one) for one in parts)

    def _answer(self, memory: Memory):
        mean, covariance = memory.belief
        x = SpeedState(*mean)
        now = lambda mean: SpeedState(*mean).v_x + self.a_x_delay * self._acceleration(memory, SpeedState(*mean))
        v_x, slope = jax.value_and_grad(now)(mean)
        variance = lambda a: jnp.maximum(a @ covariance @ a, 0.0)
        std = numerics.sqrt(variance(slope) + jnp.square(0.5 * self.a_x_delay))
        known = std < self.known_share * jnp.abs(v_x) + self.known_speed
        stds = numerics.sqrt(jnp.maximum(jnp.diagonal(covariance), 0.0))
        return answer(
            {"v_x": v_x, "grade": numerics.arctan(x.slope / GRAVITY), "a_x_offset": x.offset},
            {"v_x": std, "grade": stds[2] / GRAVITY, "a_x_offset": stds[3]},
            known,
        )

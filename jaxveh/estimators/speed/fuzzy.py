"""Speed by fuzzy rules, which choose between the wheels' mean, the fastest, the slowest, and the accelerometer alone."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh._core.parameter import positive
from jaxveh.estimators.contract import Need
from jaxveh.estimators.memberships import large
from jaxveh.estimators.speed.accelerometer import A_X, Felt, never_felt
from jaxveh.estimators.speed.wheels import WHEEL_SPEEDS, AbstractWheelMethod, Wheels

LATERAL = (Need("a_y", "m/s^2", optional=True), Need("yaw_rate", "rad/s", optional=True))


class Situations(NamedTuple):
    """The truth of each situation (-), between 0 and 1: the wheels roll without slip, `stable`; they slip in braking, `brake`, or
    in driving, `drive`; the car slips sideways, `swerve`."""

    stable: Any
    brake: Any
    drive: Any
    swerve: Any


class FuzzyMemory(NamedTuple):
    """Speed `v_x` (m/s), `offset` of the accelerometer (m/s^2), last longitudinal and lateral acceleration, `along` and `across`
    (m/s^2), last yaw rate, `turns` (rad/s), and the time since the car was last stable, `alone` (s)."""

    v_x: Any
    offset: Any
    along: Felt
    across: Felt
    turns: Felt
    alone: Any


class Fuzzy(AbstractWheelMethod):
    """Rules on four situations decide between the integral of the accelerometer and the wheels.

    The membership "large" is linear between two bounds each: for the wheels' disagreement over their mean (`spread_low`,
    `spread_high`, -), for the difference of the wheels' mean rate and the acceleration (`rate_low`, `rate_high`, m/s^2), and for
    the rate of lateral slip `a_y - v_x yaw_rate` (`swerve_low`, `swerve_high`, m/s^2; 0 if one of the two channels is missing).
    The rules, with the product as "and":

        swerve:  lateral slip large                                              -> integrate
        brake:   not swerve, disagreement or rate difference large, a_x < 0      -> integrate, no slower than the fastest wheel
        drive:   not swerve, disagreement or rate difference large, a_x > 0      -> integrate, no faster than the slowest wheel
        stable:  none of these                                                   -> the wheels' mean

    The consequents are weighted by the truth of their rules (Sugeno's form). The speed follows the wheels' mean with `wheel_time`
    (s). The offset of the accelerometer is learned with `offset_time` (s), in proportion to the truth of stable. The speed is
    known if that truth was above one half within the last `patience` (s).

    Chen, Gao, Xu 2013, section 2.1, ref 93, which names the signals and four situations; bounds and rules are ours, and have to
    be fitted to a car's drives, as the review says.
    """

    spread_low: jax.Array = positive("-", default=0.01)
    spread_high: jax.Array = positive("-", default=0.03)
    rate_low: jax.Array = positive("m/s^2", default=1.0)
    rate_high: jax.Array = positive("m/s^2", default=3.0)
    swerve_low: jax.Array = positive("m/s^2", default=1.5)
    swerve_high: jax.Array = positive("m/s^2", default=4.0)
    wheel_time: jax.Array = positive("s", default=0.05)
    offset_time: jax.Array = positive("s", default=3.0)
    patience: jax.Array = positive("s", default=2.0)

    @property
    def needs(self):
        return (*WHEEL_SPEEDS, A_X, *LATERAL)

    def begin(self, wheels, values):
        del values
        zero, none = jnp.zeros_like(wheels.t), never_felt(wheels.t)
        return FuzzyMemory(wheels.mean, zero, none, none, none, jnp.where(wheels.spoke, 0.0, jnp.inf))

    def situations(self, own: FuzzyMemory, wheels: Wheels, rate: Any) -> Situations:
        """The truth of each situation; `rate`: the measured acceleration less its offset (m/s^2)."""
        t = wheels.t
        both = own.across.speaks(t) & own.turns.speaks(t)
        aside = jnp.where(both, own.across.value - own.v_x * own.turns.value, 0.0)
        swerve = large(aside, self.swerve_low, self.swerve_high)
        spread = (wheels.fastest - wheels.slowest) / (jnp.abs(wheels.mean) + 1.0)
        apart = large(spread, self.spread_low, self.spread_high)
        strange = large(wheels.mean_rate - rate, self.rate_low, self.rate_high)
        slips = 1.0 - (1.0 - apart) * (1.0 - strange)
        brakes = jax.nn.sigmoid(-4.0 * rate)
        rest = 1.0 - swerve
        return Situations(rest * (1.0 - slips), rest * slips * brakes, rest * slips * (1.0 - brakes), swerve)

    def follow(self, own: FuzzyMemory, wheels: Wheels, step, values):
        t = wheels.t
        heard = {n: f.hear(t, values[c]) for n, f, c in (("along", own.along, "a_x"), ("across", own.across, "a_y"))}
        own = own._replace(**heard, turns=own.turns.hear(t, values["yaw_rate"]))
        felt = own.along.speaks(t)
        rate = jnp.where(felt, own.along.value - own.offset, wheels.mean_rate)
        how = self.situations(own, wheels, rate)
        integral = own.v_x + step * rate
        mixed = 1.0 - jnp.exp(-step / self.wheel_time)
        mean = integral + mixed * (wheels.mean - integral)
        braked = jnp.maximum(integral, jnp.where(wheels.spoke, wheels.fastest, -jnp.inf))
        driven = jnp.minimum(integral, jnp.where(wheels.spoke, wheels.slowest, jnp.inf))
        v_x = how.stable * mean + how.brake * braked + how.drive * driven + how.swerve * integral
        v_x = jnp.where(wheels.spoke, v_x, integral)
        learns = how.stable * jnp.where(felt & wheels.spoke, 1.0 - jnp.exp(-step / self.offset_time), 0.0)
        offset = own.offset + learns * (rate - wheels.mean_rate)
        alone = jnp.where((how.stable > 0.5) & wheels.spoke, 0.0, own.alone + step)
        return own._replace(v_x=v_x, offset=offset, alone=alone), v_x, (wheels.spoke | felt) & (alone <= self.patience)

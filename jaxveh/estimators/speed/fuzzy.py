"""Speed by fuzzy rules: when to believe the wheels' mean, the fastest, the slowest, or the accelerometer alone."""

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
    """How true each is (-), between 0 and 1: wheels roll `stable`; all `brake` or all `drive` with slip; the car swerves,
    `swerve`."""

    stable: Any
    brake: Any
    drive: Any
    swerve: Any


class FuzzyMemory(NamedTuple):
    """Speed (m/s), offset (m/s^2), what is felt along and across (m/s^2) and turned (rad/s); for how long unstable (s)."""

    v_x: Any
    offset: Any
    along: Felt
    across: Felt
    turns: Felt
    alone: Any


class Fuzzy(AbstractWheelMethod):
    """Rules on four situations decide between the integral of the accelerometer and the wheels.

    The memberships of large are linear between two bounds each: of the wheels' disagreement over their mean (`spread_low`,
    `spread_high`), of the difference of the wheels' mean rate and the acceleration (`rate_low`, `rate_high`, m/s^2), and of the
    lateral slip's rate `a_y - v_x yaw_rate` (`swerve_low`, `swerve_high`, m/s^2; small where the log has neither). Rules, with
    the product as their "and":

        swerve:  lateral slip large                                              -> integrate
        brake:   not so, wheels' spread or rate difference large, a_x < 0        -> integrate, no slower than the fastest wheel
        drive:   not so, wheels' spread or rate difference large, a_x > 0        -> integrate, no faster than the slowest wheel
        stable:  none of these                                                  -> the wheels' mean

    The consequents are weighed by how true they are (Sugeno's form). The wheels' mean comes in with `wheel_time` (s); the offset
    of the accelerometer learns with `offset_time` (s), as far as stable is true. Known where stable has been half true within
    `patience` (s).

    Chen, Gao, Xu 2013, section 2.1, ref 93, which names the signals and four situations; bounds and rules are ours, to be fitted
    to a car's drives as the review says they have to be.
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
        """How true each situation is; `rate`: the acceleration that is felt, less its offset (m/s^2)."""
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

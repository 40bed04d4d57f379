"""How far a car may slide across, and its wheels along, of what its control unit hears: what kinematics are then worth."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.parameter import positive
from jaxveh.estimators.body_motion import AT, away_from_zero
from jaxveh.vehicles import GRAVITY


class Doubt(NamedTuple):
    """What may be wrong: the lateral speed `across` and the wheels' speed `along`, both m/s; in ordinary driving zero, nearly."""

    across: Any
    along: Any


class SlidingMemory(NamedTuple):
    """Of the lateral speed what was gathered beyond the tyres' (m/s), and the tyres' own in the last row (m/s); how much faster
    front wheels usually are, left and right (shares); the doubt of the last row."""

    gathered: Any
    ordinary: Any
    usual: Any
    doubt: Doubt


class Sliding(eqx.Module):
    """Two signs that a car slides, neither of which needs the road's friction.

    - `across`: what accelerometer and yaw rate say of the lateral speed's rate, `a_y / (1 + g roll_gradient) - v_x r`, less the
    rate of the lateral speed that the tyres' linear range makes, gathered over `gathering` (s). A bank and an offset gather, too:
    up to `usual_across` (m/s) counts for nearly nothing.
    - `along`: how much faster or slower front wheels are than the rear ones of their side, beside what the bend makes and what
    they are within `learning` (s) of ordinary driving, less `usual_along` (a share of the speed). Wheels that all slip alike do
    not show it.

    Both stay for `staying` (s): wheels that grip again need a moment to be what they say.
    """

    roll_gradient: jax.Array = positive("rad/(m/s^2)", default=0.006)
    gathering: jax.Array = positive("s", default=1.0)
    usual_across: jax.Array = positive("m/s", default=1.0)
    learning: jax.Array = positive("s", default=10.0)
    usual_along: jax.Array = positive("-", default=0.02)
    staying: jax.Array = positive("s", default=0.5)

    def start(self, t: Any) -> SlidingMemory:
        """Before the first row: a car that does not slide."""
        zero = jnp.zeros_like(t)
        return SlidingMemory(zero, zero, jnp.zeros((2,), zero.dtype), Doubt(zero, zero))

    def next(self, last: SlidingMemory, heard: dict[str, Any], v_x: Any, ordinary: Any, wheelbase: Any) -> SlidingMemory:
        """After a row. `v_x` (m/s) as believed, `ordinary`: the lateral speed (m/s) of tyres that do not slide."""
        dt = heard["dt"]
        rate = heard["a_y"] / (1.0 + GRAVITY * self.roll_gradient) - v_x * heard["yaw_rate"]
        gathered = last.gathered * jnp.exp(-dt / self.gathering) + dt * rate - (ordinary - last.ordinary)
        square = jnp.square(gathered)
        across = jnp.abs(gathered) * square / (square + jnp.square(self.usual_across))
        along, usual = self._along(last.usual, heard, v_x, wheelbase)
        stays = jnp.exp(-dt / self.staying)
        doubt = Doubt(jnp.maximum(across, stays * last.doubt.across), jnp.maximum(along, stays * last.doubt.along))
        return SlidingMemory(gathered, ordinary, usual, doubt)

    def _along(self, usual, heard, v_x, wheelbase):
        speed = dict(zip(AT, (heard[f"wheel_speed_{at}"] for at in AT), strict=True))
        fast = jnp.abs(away_from_zero(v_x))
        # A front wheel goes round a wider circle than the rear one.
        wider = 0.5 * jnp.square(wheelbase * heard["yaw_rate"] / fast)
        shares = jnp.stack([speed["fl"] - speed["rl"], speed["fr"] - speed["rr"]]) / fast - wider
        there = ~jnp.isnan(shares)
        beyond = jnp.where(there, shares, usual) - usual
        calm = there & (jnp.abs(beyond) < 2.0 * self.usual_along)
        usual = usual + jnp.where(calm, heard["dt"] / (self.learning + heard["dt"]), 0.0) * beyond
        return fast * jnp.max(jnp.maximum(jnp.abs(beyond) - self.usual_along, 0.0)), usual

"""How far a car may slide laterally and its wheels longitudinally, from the control unit's channels: when kinematics are
reliable."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.parameter import parameter, positive
from jaxveh.estimators.body_motion import away_from_zero
from jaxveh.estimators.car_file import USUAL_ROLL_GRADIENT, numbers_in
from jaxveh.estimators.rear_steer import rolls_across
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY
from jaxveh.vehicles import kit as vehicles


class Doubt(NamedTuple):
    """Possible errors: of the lateral speed, `across`, and of the wheels' speed, `along`, both in m/s; nearly zero in ordinary
    driving."""

    across: Any
    along: Any


class SlidingMemory(NamedTuple):
    """The lateral speed accumulated beyond that of the tyres (m/s), and the tyres' own in the last row (m/s); the usual
    excess of each wheel over the mean of all (4,), as a share; the doubt of the last row."""

    gathered: Any
    ordinary: Any
    usual: Any
    doubt: Doubt


class Sliding(eqx.Module):
    """Two indications that a car slides, neither of which needs the road's friction.

    - `across`: the rate of the lateral speed from accelerometer and yaw rate, `a_y / (1 + g roll_gradient) - v_x r`, less that
    of the tyres' linear range, accumulated over `gathering` (s). A bank and an offset accumulate, too: up to `usual_across`
    (m/s) the result counts for nearly nothing.
    - `along`: how much one wheel is faster or slower than the mean of all, beyond the effect of the bend (`half_track`, m)
    and its usual excess (learned in ordinary driving over `learning` (s)), less `usual_along` (a share of the speed).
    Wheels that all slip alike are not detected.

    Both persist for `staying` (s): wheels that grip again need a moment until their speeds are right.
    """

    roll_gradient: jax.Array = parameter("rad/(m/s^2)", scale=0.006, default=USUAL_ROLL_GRADIENT)
    gathering: jax.Array = positive("s", default=1.0)
    usual_across: jax.Array = positive("m/s", default=1.0)
    learning: jax.Array = positive("s", default=10.0)
    usual_along: jax.Array = positive("-", default=0.015)
    half_track: jax.Array = positive("m", default=0.75)
    staying: jax.Array = positive("s", default=0.5)

    def start(self, t: Any) -> SlidingMemory:
        """The memory before the first row: a car that does not slide."""
        zero = jnp.zeros_like(t)
        return SlidingMemory(zero, zero, jnp.zeros((4,), zero.dtype), Doubt(zero, zero))

    def next(
        self, last: SlidingMemory, heard: dict[str, Any], v_x: Any, ordinary: Any, wheelbase: Any
    ) -> SlidingMemory:
        """The memory after a row. `v_x` (m/s): the estimated speed; `ordinary`: the lateral speed (m/s) if the tyres do not
        slide."""
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
        speeds = jnp.stack([heard[f"wheel_speed_{at}"] for at in vehicles.CORNERS])
        there = ~jnp.isnan(speeds)
        fast, turn = jnp.abs(away_from_zero(v_x)), heard["yaw_rate"]
        # Outer wheels run on wider circles than inner ones, front wheels on wider circles than straight rear ones.
        across = rolls_across(heard, v_x)
        wider, behind = (0.5 * jnp.square(aside) / fast for aside in (wheelbase * turn + across, across))
        beside = self.half_track * turn
        bend = jnp.stack([wider - beside, wider + beside, behind - beside, behind + beside])
        shares = jnp.where(there, speeds - bend, 0.0) / fast
        mean = jnp.sum(shares) / jnp.maximum(jnp.sum(there.astype(shares.dtype)), 1.0)
        beyond = jnp.where(there, shares - mean - usual, 0.0)
        calm = jnp.max(jnp.abs(beyond)) < 2.0 * self.usual_along
        usual = usual + jnp.where(calm, heard["dt"] / (self.learning + heard["dt"]), 0.0) * beyond
        return fast * jnp.maximum(numerics.largest(jnp.abs(beyond)) - self.usual_along, 0.0), usual


def indications_of_sliding(car: CarSpecification) -> Sliding:
    """The indications for a car's file."""
    tracks = [track for track in (car.track_front, car.track_rear) if track is not None]
    half = {"half_track": 0.5 * sum(tracks) / len(tracks)} if tracks else {}
    return Sliding(**half, **numbers_in(car, "roll_gradient"))

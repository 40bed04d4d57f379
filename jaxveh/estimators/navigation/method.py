"""Navigation as a method: it starts with the first fix, integrates without fixes, and restarts after a gap of the inertial
unit."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp

from jaxveh._core.errors import check_kind
from jaxveh.estimators.contract import Need
from jaxveh.estimators.live import row_of
from jaxveh.estimators.method import AbstractMethod, answer
from jaxveh.estimators.misfit import Misfit, learn_misfit, no_misfit
from jaxveh.estimators.navigation.cleaning import Cleaning, Felt
from jaxveh.estimators.navigation.observed import ANGLES, noise, observation, report
from jaxveh.estimators.navigation.system import (
    Navigator,
    channels_of,
    inputs_of,
    misfit_of,
    state_type,
    states_of,
    transition,
)
from jaxveh.filters import Extended, kit
from jaxveh.statespace import Continuous, Gaussian, Prior, Row, StateDependent, StateSpace

LEAST_SPEED = 2.0
"""m/s: a fix at a lower speed does not start a navigation, and sideslip is not known at a lower speed."""

ENOUGH = {"v_x": 1.0, "v_y": 0.5, "yaw": 0.05, "sideslip": 0.02}
"""m/s, rad: with a larger standard deviation a quantity is not known. Quantities that are not listed are known from the first
fix on."""

FORGOTTEN = ("v_x", "v_y", "yaw", "lane_offset", "lane_heading")
"""States that are lost in a gap of the inertial unit; others, such as biases and the axle's stiffness, are kept."""


def navigation_model(system: Navigator) -> StateSpace:
    """The state space for any Gaussian filter, with rows from `Cleaning`."""
    check_kind(
        "navigation_model: system", system, Navigator, "navigation_of makes one of a car's file: its field system."
    )
    states = states_of(system.parts)
    kind = state_type(system.parts)
    return StateSpace(
        system=system,
        transition=transition,
        observation=observation,
        report=report,
        process_noise=Continuous(Gaussian({name: walk for name, (_, _, walk) in states.items()})),
        measurement_noise=StateDependent(noise, channels_of(system.parts)),
        prior=Prior(kind(*(mean for mean, _, _ in states.values())), {n: std for n, (_, std, _) in states.items()}),
        inputs=inputs_of(system.parts),
        angles=tuple(name for name in channels_of(system.parts) if name in ANGLES),
        input_path="linear",
    )


class Known(NamedTuple):
    """The memory of `Navigation`: the filter's belief, the cleaning's memory `felt`, whether a fix has started it, and the
    `misfit` of its channels."""

    belief: Any
    felt: Felt
    begun: Any
    misfit: Misfit


class Navigation(AbstractMethod):
    """A Gaussian `filter` on `navigation_model`, which starts with the first fix whose speed is more than `LEAST_SPEED`. The yaw
    starts at the course, with the standard deviation of the sideslip, and the speed at that of the fix. The car is then taken to
    go forwards.

    During an outage of the satellites the filter integrates the inertial unit; what is `known` follows from the standard
    deviations (`ENOUGH`). If the inertial unit has no measurement for longer than `at_centre.LONGEST_SILENCE`, velocity and yaw
    are lost, and the next fix restarts them. By how much the variances of the channels exceed those of the model is learned from
    `info.innovation`, their `Misfit`.
    """

    model: StateSpace
    filter: kit.AbstractRuleFilter = Extended()

    knows_places: ClassVar[bool] = True

    @property
    def _cleaning(self) -> Cleaning:
        """The cleaning of each row before the filter."""
        return Cleaning(self.model.system)

    @property
    def needs(self):
        parts = self.model.system.parts
        speeds = tuple(Need(f"wheel_speed_{at}", "m/s", optional=True) for at in ("rl", "rr"))
        more = (Need("a_z", "m/s^2"), Need("roll_rate", "rad/s"), Need("pitch_rate", "rad/s"))
        return (
            Need("a_x", "m/s^2"),
            Need("a_y", "m/s^2"),
            Need("yaw_rate", "rad/s"),
            Need("speed", "m/s"),
            Need("course", "rad"),
            *(more if parts.three_more else ()),
            *((Need("heading", "rad"),) if parts.heading else ()),
            *(speeds if parts.wheels else ()),
            *((Need("lane_offset", "m"), Need("lane_heading", "rad")) if parts.camera else ()),
        )

    def first(self, t, values):
        felt, cleaned = self._cleaning.first(t, values)
        row = row_of(self.model, t, cleaned)
        belief = self.filter.prior(self.model, row)
        known, said = self._said(belief, felt, jnp.zeros_like(t, bool), row, cleaned, jnp.int32(0))
        return Known(*known, no_misfit(len(self.model.channels), t)), said

    def next(self, memory: Known, t, values):
        felt, cleaned = self._cleaning.next(memory.felt, t, values)
        cleaned |= {misfit_of(name): memory.misfit.times[k] for k, name in enumerate(self.model.channels)}
        row = row_of(self.model, t, cleaned)
        after, info = self.filter.step(self.model, memory.belief, row)
        goes_on = memory.begun & cleaned["felt"]
        held = dataclasses.replace(memory.belief, t=row.t, u=row.u)
        belief = _choose(goes_on, after, held)
        squares = [jnp.square(error / std) for error, std in zip(info.innovation, info.innovation_std, strict=True)]
        learnt = learn_misfit(memory.misfit, jnp.stack(squares), t - memory.felt.t)
        known, said = self._said(belief, felt, goes_on, row, cleaned, jnp.where(goes_on, info.result, 0))
        return Known(*known, _choose(goes_on, learnt, memory.misfit)), said

    def _said(self, belief, felt, begun, row, cleaned, result):
        """The memory without the misfit, and the answer; a fix starts a navigation that has not started."""
        fix = jnp.isfinite(row.y.speed) & jnp.isfinite(row.y.course) & (row.y.speed > LEAST_SPEED)
        begins = ~begun & fix & cleaned["felt"]
        belief = _choose(begins, self._begun(belief, row), belief)
        begun = begun | begins
        mean, std = belief.moments(self.model)
        told = {name: begun & (getattr(std, name) < most) for name, most in ENOUGH.items()}
        told["sideslip"] = told["sideslip"] & (jnp.abs(mean.v_x) > LEAST_SPEED)
        known = {name: told.get(name, begun) for name in mean._fields}
        said = answer(mean._asdict(), std._asdict(), known)
        well = result == 0
        said = said._replace(
            known=type(said.known)(*[one & well for one in said.known]), result=jnp.where(well, said.result, result)
        )
        return (belief, felt, begun), said

    def _begun(self, belief, row: Row):
        """The belief with velocity and yaw from a fix, and with their prior standard deviations."""
        prior, system = self.model.prior, self.model.system
        speed = jnp.where(row.y.speed > LEAST_SPEED, row.y.speed, LEAST_SPEED)
        yaw = jnp.where(jnp.isfinite(row.y.course), row.y.course, 0.0) + row.u.sky_turned
        slip = self.model.states.index("v_y")
        started = dict(prior.mean._asdict(), v_x=speed + row.u.sky_gained_x, yaw=yaw)
        anew = jnp.asarray([name in FORGOTTEN for name in self.model.states])
        mean = jnp.where(anew, jnp.stack([started[name] for name in self.model.states]), belief.vector)
        kept = ~anew[:, None] & ~anew[None, :]
        covariance = jnp.where(kept, belief.covariance, 0.0) + jnp.where(anew, 1.0, 0.0) * prior.covariance()
        # The errors of yaw and lateral velocity are correlated: yaw plus sideslip is the course.
        both = covariance[slip, slip]
        place = self.model.states.index("yaw")
        fixed = jnp.square(system.across / speed)
        covariance = covariance.at[place, place].set(both / jnp.square(speed) + fixed)
        covariance = covariance.at[place, slip].set(-both / speed).at[slip, place].set(-both / speed)
        return kit.with_spread(belief, mean, self.filter.form.start(covariance), t=row.t, u=row.u)


def _choose(condition, one, other):
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), one, other)

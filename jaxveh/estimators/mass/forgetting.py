"""Mass and grade by recursive least squares with one forgetting factor each."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from jaxveh._core.names import record_type
from jaxveh._core.parameter import positive
from jaxveh.estimators.body_motion import SILENCE, SLOWEST, BodyMotion, hold
from jaxveh.estimators.joint import JOINT
from jaxveh.estimators.lateral import motion_of
from jaxveh.estimators.live import AbstractCleaning
from jaxveh.estimators.mass.ratios import START, Pull, beyond, pull_of
from jaxveh.estimators.method import Filtered
from jaxveh.io import CarSpecification
from jaxveh.observers import RecursiveLeastSquares
from jaxveh.statespace import Prior, StateSpace
from jaxveh.vehicles import GRAVITY

State = record_type("ForgettingState", ("mass", "sine"))

EXCITED = 0.4
"""m/s^2: with a smaller acceleration mass and grade cannot be distinguished, and the row does not count."""


class Pulled(AbstractCleaning):
    """Force over the file's mass and the speed's rate (m/s^2) through the same low-pass filter; the force is NaN in rows without
    torques, and 0 without excitation."""

    motion: BodyMotion
    pull: Pull
    mass: jax.Array = positive("kg")

    @property
    def channels(self):
        return tuple(need.channel for need in JOINT)

    def first(self, t, values):
        motion, heard = self.motion.first(t, values)
        zero = jnp.zeros_like(t)
        return self._next(motion, heard, values, zero, zero, zero, zero)

    def next(self, memory, t, values):
        motion, heard = self.motion.next(memory[0], t, values)
        return self._next(motion, heard, values, *memory[1:])

    def _next(self, motion, heard, values, drive, brake, force, age):
        dt = heard["dt"]
        drive, brake = hold(values["drive_torque"], drive), hold(values["brake_torque"], brake)
        force = force + dt / (self.motion.slope_time + dt) * (self.pull.force(drive, brake, heard) - force)
        spoke = ~(jnp.isnan(values["drive_torque"]) | jnp.isnan(values["brake_torque"]))
        there = spoke & (heard["pull_silence"] < SILENCE) & (heard["v_x"] > SLOWEST)
        there = there & (age > START)
        counts = beyond(heard["v_x_rate"], EXCITED)
        rolls = GRAVITY * self.pull.rolling_resistance
        made = {"force": jnp.where(there, counts * force / self.mass, jnp.nan), "rate": heard["v_x_rate"] + rolls}
        return (motion, drive, brake, force, age + dt), heard | made | {"pushed": jnp.where(there, counts, 0.0)}


def forgetting_factors(car: CarSpecification) -> Filtered:
    """Makes `F = m (d v_x/dt + g f_r) + m g sin(grade)` from a car's file, with one forgetting factor for the mass and one for
    the grade (A. Vahidi et al. 2005), and separate variances (`observers.RecursiveLeastSquares`). An observer gives no standard
    deviation: the answer is `known` in rows with excitation by the pedals.

    **Raises** `InputError` for a file without `wheel_radius`.
    """
    start = State(1.0, 0.0)
    model = StateSpace(
        system=jnp.asarray(car.mass, float), transition=_stays, observation=_force, process_noise=None,
        measurement_noise={"force": 0.3}, prior=Prior(start, {"mass": 0.15, "sine": 0.03}), inputs=("rate", "pushed"),
        report=_report,
    )  # fmt: skip
    least_squares = RecursiveLeastSquares([0.9998, 0.99], ceiling=1.0, separate=True)
    cleaning = Pulled(motion_of(car), pull_of(car, "mass"), car.mass)
    return Filtered(model, least_squares, JOINT, cleaning, _told)


def _told(model: Any, belief: Any, row: Any):
    return {"mass": row.u.pushed > 0.5, "grade": row.u.pushed > 0.5}


def _stays(system: Any, t0, t1, x, u):
    return x


def _force(system: Any, t, x, u):
    return record_type("ForgettingOutputs", ("force",))(u.pushed * (x.mass * u.rate + GRAVITY * x.sine))


def _report(system: Any, t, x, u):
    return record_type("ForgettingReport", ("mass", "grade"))(system * x.mass, x.sine / jnp.maximum(x.mass, 0.1))

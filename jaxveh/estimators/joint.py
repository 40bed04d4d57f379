"""The filter of `mass_and_grade` as a method of mass and of grade, with the accelerometer's offset."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxveh._core.parameter import parameter
from jaxveh.estimators import mass_and_grade
from jaxveh.estimators.body_motion import BodyMotion, hold
from jaxveh.estimators.lateral import motion_of
from jaxveh.estimators.live import AbstractCleaning
from jaxveh.estimators.method import Filtered
from jaxveh.estimators.pulling import ALONG, TORQUES, WIDEST, WIDEST_MASS
from jaxveh.filters import Extended
from jaxveh.io import CarSpecification
from jaxveh.vehicles import GRAVITY

JOINT = (*ALONG, *[need._replace(optional=False) for need in TORQUES])
"""The channels of the filter of `mass_and_grade`."""


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

"""What a drive can tell about the mass at all, whoever estimates it."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.names import record_type
from jaxveh.diagnostics import Observability
from jaxveh.diagnostics.observability import observability
from jaxveh.experiments.mass_grade_aukf.contestants import WALK
from jaxveh.experiments.mass_grade_aukf.drives import Drive, model_car, times
from jaxveh.experiments.mass_grade_aukf.settings import Study
from jaxveh.roads import LEVEL
from jaxveh.statespace import Heun, Propagate

KNOT = 5.0
"""s between the knots of the unknown grade."""

MASS_SPREAD, GRADE_SPREAD = 0.4, 0.03
"""What the prior knows: of the mass's logarithm, and of the grade (rad)."""


def mass_observability(study: Study, drive: Drive) -> Observability:
    """Cramer-Rao bounds of mass and first grade from the speed of one drive, with a grade that walks, as three states have it.

    The grade is linear between knots, whose increments are unknown but for the walk's spread; so is the first speed.
    """
    car, rows = model_car(study), drive.v_x.shape[0]
    knots = int(np.ceil((rows - 1) * study.dt / KNOT)) + 1
    time = times(study, rows)
    move = Propagate(_rates, Heun())
    kind = car.state_type

    def predict(z):
        mass, first, speed, steps = z[0], z[1], z[2], z[3:]
        grades = first + jnp.concatenate([jnp.zeros(1), jnp.cumsum(steps)])
        grade = jnp.interp(time, KNOT * jnp.arange(float(knots)), grades)
        own = eqx.tree_at(lambda c: c.mass, car, study.mass * jnp.exp(mass))

        def step(v, given):
            t, here, torque = given
            after = move((own, here), t, t + study.dt, kind(v), torque).v_x
            return after, after

        torque = 0.5 * (drive.torque[1:] + drive.torque[:-1])
        _, v = jax.lax.scan(step, drive.true_v_x[0] + speed, (time[:-1], 0.5 * (grade[1:] + grade[:-1]), torque))
        return v / study.v_x

    at = jnp.zeros(3 + knots - 1)
    true = jnp.interp(KNOT * jnp.arange(float(knots)), time, drive.true_grade)
    at = at.at[1].set(true[0]).at[3:].set(jnp.diff(true))
    spread = np.concatenate([[MASS_SPREAD, GRADE_SPREAD, 1.0], np.full(knots - 1, WALK * KNOT**0.5)])
    return observability(predict, at, ("mass", "grade"), spread, nuisance=knots)


def _rates(system, t, x, torque):
    car, grade = system
    u = car_inputs(torque)
    return car.derivatives(t, x, u, LEVEL._replace(grade=grade))


def car_inputs(torque):
    """The longitudinal car's inputs of a torque that pulls both ways."""
    return record_type("Inputs", ("drive_torque", "brake_torque"))(torque, jnp.zeros_like(torque))

"""The information about the mass in a drive, and the effect of a prior of the grade.

The Cramer-Rao bound alone misleads here. It averages over grades that are independent of the torque; but a driver who holds
the speed answers the grade with torque. One course of torque and speed is then explained equally well by a heavier car on a
flatter road, and the prior decides: a grade that walks prefers small steps, and so the heavier car. The error is therefore
given in two parts at the drive's own grade, in the linear problem: how far the grade's prior pulls the mass, and the effect
of the noise.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.names import record_type
from jaxveh.diagnostics import Observability, observability_at
from jaxveh.experiments.mass_grade_aukf.contestants import WALK
from jaxveh.experiments.mass_grade_aukf.drives import Drive, model_car, times
from jaxveh.experiments.mass_grade_aukf.settings import Study
from jaxveh.roads import LEVEL
from jaxveh.statespace import Heun, Propagate

KNOT, WIDE_KNOT = 1.0, 5.0
"""s between the knots of the unknown grade; and in the bound by which the mass was first judged."""

MASS_SPREAD, GRADE_SPREAD = 0.4, 0.03
"""Standard deviations of the prior: of the mass's logarithm, and of the grade (rad)."""

OBSERVABLE = 0.1
"""Largest share of the prior's standard deviation at which the mass is called observable; above 1 it is unobservable."""


class Known(NamedTuple):
    """The accuracy of the mass's logarithm by least squares over a whole drive, with a model in which the grade walks, or
    its rate.

    `bound`: the Cramer-Rao bound, which averages over grades; `pull`: how far the prior of the grade pulls the mass at this
    drive's own grade; `noise`: the standard deviation due to the noise of the speed.
    """

    bound: float
    pull: float
    noise: float

    @property
    def error(self) -> float:
        """Root mean square of pull and noise."""
        return float(np.hypot(self.pull, self.noise))

    @property
    def share(self) -> float:
        """The error over the prior's standard deviation: with 1 and above, the drive contains no information."""
        return self.error / MASS_SPREAD

    @property
    def verdict(self) -> str:
        """`observable`, `weakly observable` or `unobservable`."""
        if self.share <= OBSERVABLE:
            return "observable"
        return "weakly observable" if self.share < 1.0 else "unobservable"


def known_of_mass(study: Study, drive: Drive, smooth: bool = False) -> Known:
    """The accuracy of the mass from the speed of one drive, with a grade that walks (three states), or `smooth`: with a rate
    of the grade that walks (four states).

    The grade is linear between knots. The unknowns are the mass, the first grade (and rate), the first speed, and the
    innovation at each knot: the increment of the grade, or of its rate. The mass has no prior here, so the pull is that of
    the grade alone.
    """
    walk, first = (study.grade_rate_walk, 2) if smooth else (WALK, 1)
    predict, at = predictions(study, drive, smooth)
    news = np.full(at.size - 2 - first, walk * KNOT**0.5)
    # The rate's standard deviation as in the prior of the four states: that of its walk after half a minute.
    spread = np.concatenate([[np.inf, 1.0, GRADE_SPREAD], [walk * 30.0**0.5] * (first - 1), news])
    sensitivity = np.asarray(jax.jacfwd(predict)(jnp.asarray(at)))
    prior = np.diag(1.0 / spread**2)
    information = sensitivity.T @ sensitivity
    inverse = np.linalg.inv(information + prior)
    noise = inverse[0] @ information @ inverse[0]
    # The prior's means are zero, the truth is not.
    pull = -(inverse @ prior @ at)[0]
    return Known(float(np.sqrt(inverse[0, 0])), float(pull), float(np.sqrt(noise)))


def bound_of_mass(study: Study, drive: Drive, knot: float = WIDE_KNOT) -> Observability:
    """Cramer-Rao bounds of mass and first grade from the speed of one drive, with a grade that walks, as in the three
    states.

    The report first used these bounds to judge whether the mass is observable. They average over grades that are independent
    of the torque.
    """
    predict, at = predictions(study, drive, False, knot)
    # The parameters of interest come first: mass and grade, then the first speed.
    order = np.array([0, 2, 1, *range(3, at.size)])
    spread = np.concatenate([[MASS_SPREAD, GRADE_SPREAD, 1.0], np.full(at.size - 3, WALK * knot**0.5)])
    ordered = lambda z: predict(z[order])
    return observability_at(ordered, jnp.asarray(at[order]), ("mass", "grade"), spread, nuisance=at.size - 2)


def predictions(study: Study, drive: Drive, smooth: bool, knot: float = KNOT):
    """Whitened speeds as a function of the unknowns [log mass, first speed, first grade, (first rate), innovations]; and
    their truth."""
    car, rows = model_car(study), drive.v_x.shape[0]
    knots = knot * np.arange(np.ceil((rows - 1) * study.dt / knot) + 1)
    time = times(study, rows)
    move = Propagate(_rates, Heun())
    kind = car.state_type
    torque = 0.5 * (drive.torque[1:] + drive.torque[:-1])

    def grades(z):
        steps = jnp.cumsum(z[3:]) * knot if smooth else z[3:]
        return z[2] + jnp.pad(jnp.cumsum(steps), (1, 0))

    def predict(z):
        grade = jnp.interp(time, jnp.asarray(knots), grades(z))
        own = eqx.tree_at(lambda c: c.mass, car, study.mass * jnp.exp(z[0]))

        def step(v, given):
            t, here, pull = given
            after = move((own, here), t, t + study.dt, kind(v), pull).v_x
            return after, after

        _, v = jax.lax.scan(step, drive.true_v_x[0] + z[1], (time[:-1], 0.5 * (grade[1:] + grade[:-1]), torque))
        return v / study.v_x

    true = np.interp(knots, np.asarray(time), np.asarray(drive.true_grade))
    news = np.diff(true)
    if smooth:
        rates = news / knot
        news = np.concatenate([rates[:1], np.diff(rates)])
    return predict, np.concatenate([[0.0, 0.0, true[0]], news])


def _rates(system, t, x, torque):
    car, grade = system
    return car.derivatives(t, x, car_inputs(torque), LEVEL._replace(grade=grade))


def car_inputs(torque):
    """The longitudinal car's inputs for a torque that acts in both directions."""
    return record_type("Inputs", ("drive_torque", "brake_torque"))(torque, jnp.zeros_like(torque))

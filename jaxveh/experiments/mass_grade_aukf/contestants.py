"""The estimators: what each assumes about the grade, and how it estimates the mass."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from jaxveh import filters, numerics
from jaxveh._core.bijectors import Real
from jaxveh._core.names import record_type
from jaxveh.estimators import mass_and_grade
from jaxveh.experiments.mass_grade_aukf.drives import Drive, model_car, times
from jaxveh.experiments.mass_grade_aukf.found import Contestant, Found
from jaxveh.experiments.mass_grade_aukf.least_squares import of_library, recursive_least_squares
from jaxveh.experiments.mass_grade_aukf.settings import Study
from jaxveh.filters import kit as filters_kit
from jaxveh.statespace import Row, StateSpace
from jaxveh.statespace import kit as statespace_kit

WALK = 2e-3
"""Walk of a walking grade, rad per root second: some 4 degrees over the changes of ten minutes, 0.1 degree in a second."""


def contestants(study: Study) -> dict[str, Contestant]:
    """All estimators by name, beginning with the one that does nothing; with brake touches also those that pause during a
    touch."""
    found = {
        "first guess": Contestant(
            _guess, "the mass stays at the first guess; the grade by a filter that takes this mass as certain"
        ),
        "UKF": Contestant(
            _walking_grade(spread=0.4), "three states, the grade walks, a realistic standard deviation of the mass"
        ),
        "UKF, timid": Contestant(
            _walking_grade(spread=0.05), "the same with a standard deviation of 5 % for its first guess"
        ),
        "AUKF as printed": Contestant(_adaptive(freeze=True), "eqs 22 to 25 around additive mass"),
        "AUKF": Contestant(_adaptive(freeze=False), "eqs 22 to 24: without the scaled covariance of eq 25"),
        "EKF": Contestant(_walking_grade(spread=0.4, kind=filters.Extended), "as the UKF, linearised (refs 9, 10)"),
        "RLS": Contestant(
            recursive_least_squares, "two forgetting factors on differences over a second (Vahidi et al. 2005)"
        ),
        "gated": Contestant(
            of_library("gated"), "least squares above 0.6 m/s^2 as felt (ref. 8); the grade is the remainder"
        ),
        "high-pass": Contestant(
            of_library("high_pass"), "least squares of components faster than 4 s (ref. 11); the grade is the remainder"
        ),
        "kinematic grade": Contestant(
            of_library("kinematic_grade"), "grade by accelerometer and speed, then least squares (refs 12, 13)"
        ),
        "library's filter": Contestant(
            of_library("filter"), "recommended by `jaxveh.estimators.mass`: accelerometer, offset, slip"
        ),
        "grade rate": Contestant(_smooth(), "the grade's rate walks: fast changes are due to the mass"),
        "accelerometer": Contestant(_smooth(aided=True), "grade rate and accelerometer"),
        "accelerometer with bias": Contestant(_smooth(aided=True, bias=0.02), "the same, its offset a state"),
    }
    if not study.touches:
        return found
    return found | {
        pausing_name("grade rate"): Contestant(
            _smooth(waits=True), "pauses while the brake is touched, as in the paper"
        ),
        pausing_name("accelerometer"): Contestant(_smooth(aided=True, waits=True), "the same with the accelerometer"),
    }


def pausing_name(name: str) -> str:
    """The name of the contestant that pauses during brake touches, where `name` itself treats their force as an unknown
    one."""
    return f"{name}, pausing"


TOLD = ("braking", "unknown_force")
"""Inputs of the wrappers besides the torques: whether the brake is touched (0 or 1), and the process noise of the speed."""

FORCE_OF_A_TOUCH = 2.0
"""m/s per root second: what a touched brake may do to the speed; four times the strongest touch over a second."""


def _run_filter(filter_, model: StateSpace, study: Study, drive: Drive, waits: bool = True) -> Found:
    """A filter over the drive. While the brake is touched, it pauses if it `waits`, as in the paper; otherwise it treats the
    brake's force as an unknown one: the speed is then free for a while, and the grade goes on."""
    time = times(study, drive.v_x.shape[0])
    now = drive.braking > 0.5
    # A touch begins and ends between two rows: if either end of a step is braked, its force is unknown.
    touched = now | jnp.pad(now[:-1], (1, 0))
    force = jnp.where(touched, FORCE_OF_A_TOUCH, study.speed_noise)
    values = drive._asdict()
    if study.touches and waits:
        filter_ = filters.Paused(filter_, "braking", {"v_x": 20.0, "grade": 0.01})
    elif study.touches:
        filter_ = filters.VaryingNoise(filter_, process={"v_x": "unknown_force"}, process_of="after")
        # The accelerometer measures that force, too.
        values["a_x"] = jnp.where(now, jnp.nan, drive.a_x)
    u = record_type("Inputs", model.inputs)(drive.torque, jnp.zeros_like(drive.torque), drive.braking, force)
    y = record_type("Measurements", model.channels)(*[values[name] for name in model.channels])
    estimate = filters.scan(filter_, model, Row(time, u, y))
    return Found(estimate.mean.mass, estimate.mean.grade, estimate.result)


def _model(study: Study, guess, drive: Drive, **options) -> StateSpace:
    car = eqx.tree_at(lambda c: c.mass, model_car(study), guess)
    noises = {"grade_rate_walk": study.grade_rate_walk, "speed_noise": study.speed_noise}
    return mass_and_grade.model(car, v_x=study.v_x, start_speed=drive.v_x[0], more_inputs=TOLD, **{**noises, **options})


def _guess(study: Study, guess, drive: Drive) -> Found:
    model = _model(study, guess, drive, mass_spread=1e-6, grade_walk=WALK, grade_rate_walk=None)
    return _run_filter(filters.Unscented(), model, study, drive)


def _walking_grade(spread: float, kind: Callable[[], Any] = filters.Unscented):
    def run(study, guess, drive):
        model = _model(study, guess, drive, mass_spread=spread, grade_walk=WALK, grade_rate_walk=None)
        return _run_filter(kind(), model, study, drive)

    return run


def _smooth(aided: bool = False, bias: float | None = None, waits: bool = False):
    def run(study, guess, drive):
        model = _model(study, guess, drive, a_x=study.a_x if aided else None, a_x_bias=bias)
        return _run_filter(filters.Unscented(), model, study, drive, waits)

    return run


def _adaptive(freeze: bool):
    def run(study, guess, drive):
        model = _model(study, guess, drive, mass_spread=0.4, mass_domain=Real(), grade_walk=WALK, grade_rate_walk=None)
        # Large at first, as in the paper: a fifth of the truck's mass.
        inner = filters.ShrinkingProcess(filters.Unscented(), {"mass": 0.2 * study.mass})
        return _run_filter(Frozen(inner) if freeze else inner, model, study, drive)

    return run


class Frozen(filters_kit.AbstractStateless):
    """A `ShrinkingProcess` that scales the mass's covariances by its lambda after every row, as eq 25 prints (with e = 1, 2, 3,
    the variance itself included)."""

    inner: filters.ShrinkingProcess

    def update(self, model, belief, row):
        after, info = self.inner.update(model, belief, row)
        before, now = belief.memory[0], after.memory[0]
        shrink = jnp.where(before > 0, now / numerics.or_one(before, before > 0), 1.0)
        place = model.states.index("mass")
        P = after.inside.covariance
        scales = jnp.ones_like(P).at[place, :].set(shrink).at[:, place].set(shrink)
        form = statespace_kit.innermost(self).form
        inside = filters_kit.with_spread(after.inside, after.inside.vector, form.start(P * scales))
        return filters_kit.Remembering(inside, after.memory), info

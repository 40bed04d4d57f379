"""The estimators: what each believes of the grade, and how it goes about the mass."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxveh import filters, observers
from jaxveh._core.bijectors import Real
from jaxveh._core.names import record_type
from jaxveh.estimators import mass_and_grade
from jaxveh.experiments.mass_grade_aukf.drives import Drive, model_car, times
from jaxveh.experiments.mass_grade_aukf.settings import Study
from jaxveh.filters import kit as filters_kit
from jaxveh.statespace import Gaussian, Prior, Row, StateSpace
from jaxveh.statespace import kit as statespace_kit
from jaxveh.vehicles import GRAVITY


class Found(NamedTuple):
    """Estimates over time: `mass` (kg) and `grade` (rad), (T,); `result`, the first failing code."""

    mass: Any
    grade: Any
    result: Any


class Contestant(NamedTuple):
    """`run(study, guess, drive) -> Found`, and what it is, in words."""

    run: Callable[[Study, Any, Drive], Found]
    what: str


WALK = 2e-3
"""How far a grade that walks goes, rad per root second: some 4 degrees in ten minutes' changes, 0.1 degree in a second."""


def contestants(study: Study) -> dict[str, Contestant]:
    """All of them by name, the do-nothing ones first; where the brake is touched, those that pause meanwhile, too."""
    found = {
        "first guess": Contestant(_guess, "the mass is the first guess, the grade that of a filter which believes it"),
        "UKF": Contestant(_walking_grade(spread=0.4), "three states, the grade walks, an honest spread of the mass"),
        "UKF, timid": Contestant(_walking_grade(spread=0.05), "the same, sure of its first guess by 5 %"),
        "AUKF as printed": Contestant(_adaptive(freeze=True), "eqs 22 to 25 around additive mass"),
        "AUKF": Contestant(_adaptive(freeze=False), "eqs 22 to 24: without the scaled covariance of eq 25"),
        "RLS": Contestant(_least_squares, "two forgetting factors on differences over a second (Vahidi et al. 2005)"),
        "grade rate": Contestant(_smooth(), "the grade's rate walks: what is fast is the mass's"),
        "accelerometer": Contestant(_smooth(aided=True), "grade rate and accelerometer"),
        "accelerometer with bias": Contestant(_smooth(aided=True, bias=0.02), "the same, its offset a state"),
    }
    if not study.touches:
        return found
    return found | {
        pausing_name("grade rate"): Contestant(
            _smooth(waits=True), "pauses while the brake is touched, as the paper has it"
        ),
        pausing_name("accelerometer"): Contestant(_smooth(aided=True, waits=True), "the same with the accelerometer"),
    }


def pausing_name(name: str) -> str:
    """The name of the contestant that pauses while the brake is touched, where `name` takes its force for an unknown one."""
    return f"{name}, pausing"


TOLD = ("braking", "unknown_force")
"""What wrappers are told beside the torques: whether the brake is touched (0 or 1), and the process noise of the speed."""

FORCE_OF_A_TOUCH = 2.0
"""m/s per root second: what a touched brake may do to the speed, whatever it is; four times the strongest touch over a second."""


def _run_filter(filter_, model: StateSpace, study: Study, drive: Drive, waits: bool = True) -> Found:
    """A filter over the drive. While the brake is touched it `waits`, as the paper has it, or takes the brake's force for an
    unknown one: then the speed is free for a while, and the grade goes on as it went."""
    time = times(study, drive.v_x.shape[0])
    now = drive.braking > 0.5
    # A touch begins and ends between two rows: where either end of a step is braked, its force is unknown.
    touched = now | jnp.pad(now[:-1], (1, 0))
    force = jnp.where(touched, FORCE_OF_A_TOUCH, study.speed_noise)
    values = drive._asdict()
    if study.touches and waits:
        filter_ = filters.Paused(filter_, "braking", {"v_x": 20.0, "grade": 0.01})
    elif study.touches:
        filter_ = filters.VaryingNoise(filter_, process={"v_x": "unknown_force"}, process_of="after")
        # The accelerometer feels that force, too.
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


def _walking_grade(spread: float):
    def run(study, guess, drive):
        model = _model(study, guess, drive, mass_spread=spread, grade_walk=WALK, grade_rate_walk=None)
        return _run_filter(filters.Unscented(), model, study, drive)

    return run


def _smooth(aided: bool = False, bias: float | None = None, waits: bool = False):
    def run(study, guess, drive):
        model = _model(study, guess, drive, a_x=study.a_x if aided else None, a_x_bias=bias)
        return _run_filter(filters.Unscented(), model, study, drive, waits)

    return run


def _adaptive(freeze: bool):
    def run(study, guess, drive):
        model = _model(study, guess, drive, mass_spread=0.4, mass_domain=Real(), grade_walk=WALK, grade_rate_walk=None)
        # Large at first, as the paper has it: a fifth of the truck's mass.
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
        shrink = jnp.where(before > 0, now / jnp.where(before > 0, before, 1.0), 1.0)
        place = model.states.index("mass")
        P = after.inside.covariance
        scales = jnp.ones_like(P).at[place, :].set(shrink).at[:, place].set(shrink)
        form = statespace_kit.innermost(self).form
        inside = filters_kit.with_spread(after.inside, after.inside.vector, form.start(P * scales))
        return filters_kit.Remembering(inside, after.memory), info


OVER = 1.0
"""s over which speeds are differenced and torques averaged for the least squares."""


def _least_squares(study: Study, guess, drive: Drive) -> Found:
    """(dv/dt + air / m0) = F / m - g (sin grade + f_r): linear in 1 / m and the sum of grade and rolling resistance.

    The air's drag and the turning wheels count with the first guess' mass; they are a few per cent.
    """
    car = model_car(study)
    n = round(OVER / study.dt)
    # Trapezia between the rows whose speeds are differenced.
    running = lambda x: jnp.concatenate([jnp.zeros(1), jnp.cumsum(0.5 * (x[1:] + x[:-1]))])
    mean = lambda x: (running(x)[n:] - running(x)[:-n]) / n
    rate = (drive.v_x[n:] - drive.v_x[:-n]) / OVER
    force = mean(drive.torque / car.wheel_radius - car.drag * drive.v_x**2)
    braked = mean(drive.braking) > 1e-9
    wheels = 4.0 * car.wheel_inertia / car.wheel_radius**2
    fields = record_type("LeastSquaresState", ("per_tonne", "pull"))
    model = StateSpace(
        transition=_stay, observation=_acceleration, process_noise=None,
        measurement_noise=Gaussian({"rate": study.v_x * 2**0.5 / OVER}),
        prior=Prior(fields(1000.0 / (guess + wheels), 0.0), {"per_tonne": 0.4 * 1000.0 / 5758.0 * 2, "pull": 0.5}),
        inputs=("kilonewton",),
    )  # fmt: skip
    time = times(study, rate.shape[0] + n)[n:]
    u = record_type("Inputs", ("kilonewton",))(force / 1000.0)
    # Averages overlap: every n-th row alone is new.
    fresh = (jnp.arange(rate.shape[0]) % n == 0) & ~braked
    y = record_type("Measurements", ("rate",))(jnp.where(fresh, rate, jnp.nan))
    method = observers.RecursiveLeastSquares(np.array([1.0, 0.8]), separate=True)
    estimate = filters.scan(method, model, Row(time, u, y))
    # Never negative, which the reciprocal would make of a wild first row.
    mass = 1000.0 / jnp.maximum(estimate.mean.per_tonne, 0.02) - wheels
    grade = estimate.mean.pull / GRAVITY - car.rolling_resistance
    first = lambda x, value: jnp.where(jnp.arange(n + x.shape[0]) < n, value, jnp.pad(x, (n, 0), mode="edge"))
    return Found(first(mass, guess), first(grade, 0.0), estimate.result)


def _stay(system, t0, t1, x, u):
    return x


def _acceleration(system, t, x, u):
    return record_type("Outputs", ("rate",))(x.per_tonne * u.kilonewton - x.pull)


def metrics(study: Study, found: Found, drive: Drive) -> dict[str, Any]:
    """Final mass error (share), when it settled within 3 % (s; infinite: never), grade RMSE (degrees) over the whole drive and
    after its first minute (brake touches left out), the errors over time, and the result."""
    error = jnp.abs(found.mass / study.mass - 1.0)
    time = times(study, error.shape[0])
    # The last row outside ends the wait.
    outside = (error > 0.03) | ~jnp.isfinite(error)
    last = jnp.max(jnp.where(outside, time, -study.dt))
    settled = jnp.where(outside[-1], jnp.inf, last + study.dt)
    wrong = jnp.rad2deg(found.grade - drive.true_grade)
    rms = lambda rows: jnp.sqrt(jnp.sum(jnp.where(rows, wrong**2, 0.0)) / jnp.sum(rows.astype(wrong.dtype)))
    free = drive.braking < 0.5
    every = round(1.0 / study.dt)
    return {
        "mass_error": error[-1],
        "settled": settled,
        "grade_rmse": rms(free),
        "grade_rmse_later": rms(free & (time >= min(60.0, 0.5 * study.duration))),
        "mass": found.mass[::every],
        "grade": found.grade[::every],
        "result": found.result,
    }


def of_a_point(study: Study, contestant: Contestant) -> Callable[[Any, Drive], dict[str, Any]]:
    """The contestant's run of a design's point: `run(point, drive)`, as `sweeps.sweep` calls it."""

    def run(point, drive):
        return metrics(study, contestant.run(study, point.guess, drive), drive)

    return run

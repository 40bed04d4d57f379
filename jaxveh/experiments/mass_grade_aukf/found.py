"""The estimates of an estimator on a drive, and their metrics."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.experiments.mass_grade_aukf.drives import Drive, times
from jaxveh.experiments.mass_grade_aukf.settings import Study


class Found(NamedTuple):
    """Estimates over time: `mass` (kg) and `grade` (rad), (T,); `result`: the first code that is not a success."""

    mass: Any
    grade: Any
    result: Any


class Contestant(NamedTuple):
    """`run(study, guess, drive) -> Found`, and a description, `what`."""

    run: Callable[[Study, Any, Drive], Found]
    what: str


def metrics(study: Study, found: Found, drive: Drive) -> dict[str, Any]:
    """Final mass error (share), the time from which it stays within 3 % (s; infinite: never), RMSE of mass (share) and grade
    (degrees) over the whole drive and after its first minute (grades: without brake touches), mass and grade each second,
    whether either changes in a row (with brake touches), and the result."""
    error = jnp.abs(found.mass / study.mass - 1.0)
    time = times(study, error.shape[0])
    # It settles after the last row outside.
    outside = (error > 0.03) | ~jnp.isfinite(error)
    last = numerics.largest(jnp.where(outside, time, -study.dt))
    settled = jnp.where(outside[-1], jnp.inf, last + study.dt)
    wrong = jnp.rad2deg(found.grade - drive.true_grade)
    rms = lambda x, rows: jnp.sqrt(jnp.sum(jnp.where(rows, x**2, 0.0)) / jnp.sum(rows.astype(x.dtype)))
    free, later = drive.braking < 0.5, time >= min(60.0, 0.5 * study.duration)
    every = round(1.0 / study.dt)
    new = lambda x: jnp.concatenate([jnp.ones(1, bool), x[1:] != x[:-1]])
    moves = {"moves": (new(found.mass) | new(found.grade)).astype(error.dtype)} if study.touches else {}
    return {
        "mass_error": error[-1],
        "settled": settled,
        "mass_rmse": rms(error, jnp.ones_like(later)),
        "mass_rmse_later": rms(error, later),
        "grade_rmse": rms(wrong, free),
        "grade_rmse_later": rms(wrong, free & later),
        "mass": found.mass[::every],
        "grade": found.grade[::every],
        "result": found.result,
        **moves,
    }


def of_a_point(study: Study, contestant: Contestant) -> Callable[[Any, Drive], dict[str, Any]]:
    """The contestant's run at a design's point: `run(point, drive)`, as `sweeps.sweep` calls it."""

    def run(point, drive):
        return metrics(study, contestant.run(study, point.guess, drive), drive)

    return run

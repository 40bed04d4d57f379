"""The paper's references without a filter of the car: least squares of force and acceleration, with the grade as remainder."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import filters, observers, vehicles
from jaxveh._core.names import record_type
from jaxveh.estimators import grade, kit, mass
from jaxveh.experiments.mass_grade_aukf.drives import Drive, model_car, numbers_of, times
from jaxveh.experiments.mass_grade_aukf.found import Found
from jaxveh.experiments.mass_grade_aukf.settings import Study
from jaxveh.statespace import Gaussian, Prior, Row, StateSpace
from jaxveh.vehicles import GRAVITY

OVER = 1.0
"""s over which speeds are differenced and torques averaged for the least squares."""

SPREAD = 0.4
"""Prior's standard deviation of the mass in the library's methods, a share of it: as large as in the paper's filters."""

FORGOTTEN = 2.0
"""s after a brake touch in which torques still count as unknown: the memory of the library's low-passes."""


class Averages(NamedTuple):
    """From row to row over the last `OVER` seconds, (T - OVER / dt,): rate of the speed (m/s^2), force at the wheels less
    the air drag (N), and whether the brake was touched."""

    rate: Any
    force: Any
    braked: Any


def averages_of(study: Study, drive: Drive) -> Averages:
    """The averages of a drive, from the first row with `OVER` seconds before it."""
    car, n = model_car(study), round(OVER / study.dt)
    # Trapezoidal rule between the rows whose speeds are differenced.
    running = lambda x: jnp.concatenate([jnp.zeros(1), jnp.cumsum(0.5 * (x[1:] + x[:-1]))])
    mean = lambda x: (running(x)[n:] - running(x)[:-n]) / n
    force = mean(drive.torque / car.wheel_radius - car.drag * drive.v_x**2)
    return Averages((drive.v_x[n:] - drive.v_x[:-n]) / OVER, force, mean(drive.braking) > 1e-9)


def recursive_least_squares(study: Study, guess, drive: Drive) -> Found:
    """(dv/dt + air / m0) = F / m - g (sin grade + f_r): linear in 1 / m and the sum of grade and rolling resistance.

    Air drag and the inertia of the wheels are computed with the first guess of the mass; they are a few per cent.
    """
    car, (rate, force, braked) = model_car(study), averages_of(study, drive)
    n = round(OVER / study.dt)
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
    # Averages overlap: only every n-th row is new.
    fresh = (jnp.arange(rate.shape[0]) % n == 0) & ~braked
    y = record_type("Measurements", ("rate",))(jnp.where(fresh, rate, jnp.nan))
    method = observers.RecursiveLeastSquares(np.array([1.0, 0.8]), separate=True)
    estimate = filters.scan(method, model, Row(time, u, y))
    # Never negative: the reciprocal would otherwise turn a wild first row into a negative mass.
    found = 1000.0 / jnp.maximum(estimate.mean.per_tonne, 0.02) - wheels
    slope = estimate.mean.pull / GRAVITY - car.rolling_resistance
    rows = drive.v_x.shape[0]
    return Found(_from_the_start(found, rows, guess), _from_the_start(slope, rows, 0.0), estimate.result)


def of_library(name: str) -> Callable[[Study, Any, Drive], Found]:
    """The mass by a method of `jaxveh.estimators.mass` with its defaults, from each first guess.

    The grade is that of the method of the same name in `jaxveh.estimators.grade`, if there is one, otherwise the remainder
    of the force on that mass (`grade_of_force`). While the brake is touched, and `FORGOTTEN` after it, the torque is given
    as unknown: the library's methods leave such rows out.
    """

    def run(study, guess, drive):
        spread = "mass_spread" if name == "filter" else "prior_spread"
        method = mass.METHODS[name].make(_specification(study))
        method = eqx.tree_at(lambda m: (m.mass, getattr(m, spread)), method, (guess, jnp.asarray(SPREAD)))
        said = _follow(study, method, drive)
        found = Found(said.mean.mass, jnp.zeros(()), _first_failure(said.result))
        if name == "filter":
            return found._replace(grade=said.mean.grade)
        if name == "kinematic_grade":
            slope = _follow(study, grade.METHODS["kinematic"].make(_specification(study)), drive)
            return found._replace(grade=slope.mean.grade)
        return found._replace(grade=grade_of_force(study, found.mass, drive))

    return run


def _specification(study: Study):
    """The car's file. The truth's body does not pitch, so the file has no pitch gradient."""
    # The coefficients of its tyres must be plain numbers, also inside a program.
    with jax.ensure_compile_time_eval():
        return dataclasses.replace(vehicles.specification_of(numbers_of(study)), pitch_gradient=None)


def _follow(study: Study, method: Any, drive: Drive):
    rows = drive.v_x.shape[0]
    recently = lambda x, n: jnp.convolve(x, jnp.ones(n + 1))[:rows] > 0.5
    unknown = recently(drive.braking, round(FORGOTTEN / study.dt))
    nothing = jnp.full(rows, jnp.nan)
    told = {
        "v_x": drive.v_x,
        "a_x": drive.a_x,
        "drive_torque": jnp.where(unknown, jnp.nan, drive.torque),
        "brake_torque": jnp.where(unknown, jnp.nan, 0.0),
    }
    values = {need.channel: told.get(need.channel, nothing) for need in method.needs}
    return kit.follow_rows(method, times(study, rows), values)


def _first_failure(result):
    return result[jnp.argmax(result != 0)]


def grade_of_force(study: Study, mass, drive: Drive):
    """The grade (rad), (T,), at which a mass (kg), (T,), moves as it did over the last `OVER` seconds: `sin(grade) = (F - (m
    + 4 J_w / r^2) dv/dt) / (m g) - f_r`. It is held while the brake is touched."""
    car, (rate, force, braked) = model_car(study), averages_of(study, drive)
    own = mass[mass.shape[0] - rate.shape[0] :]
    wheels = 4.0 * car.wheel_inertia / car.wheel_radius**2
    sine = (force - (own + wheels) * rate) / (own * GRAVITY) - car.rolling_resistance
    rows = jnp.arange(rate.shape[0])
    last = jax.lax.cummax(jnp.where(braked, 0, rows))
    return _from_the_start(jnp.arcsin(jnp.clip(sine, -1.0, 1.0))[last], mass.shape[0], 0.0)


def _from_the_start(values, rows: int, first):
    """Values of the last rows, with `first` in the rows before them, (rows,)."""
    n = rows - values.shape[0]
    # With `jnp.concatenate` here, XLA 0.10's program for many drives on a CPU reads outside its memory and crashes.
    return jnp.where(jnp.arange(rows) < n, first, jnp.pad(values, (n, 0), mode="edge"))


def _stay(system, t0, t1, x, u):
    return x


def _acceleration(system, t, x, u):
    return record_type("Outputs", ("rate",))(x.per_tonne * u.kilonewton - x.pull)

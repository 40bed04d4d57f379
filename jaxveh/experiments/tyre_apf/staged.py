"""The same study, one estimator after the other: for interactive use, with compile and run times of each."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import estimators, filters, manoeuvres, vehicles
from jaxveh._core.parameter import pick, prior_spread, resolve
from jaxveh._core.progress import Progress, silent
from jaxveh._core.recording import Recording
from jaxveh.diagnostics import Observability
from jaxveh.experiments.tyre_apf.settings import STEP_OUTPUTS, STEPS, Study, tyres
from jaxveh.experiments.tyre_apf.study import (
    ESTIMATORS,
    FIELDS,
    Outcome,
    curve_error,
    drive_once,
    filter_of,
    guess_once,
    model_of,
    open_loop,
    state_errors,
    with_tyres,
)
from jaxveh.fitting import cut, pose_shooting, solve
from jaxveh.simulation import simulate
from jaxveh.statespace import RolledRK4
from jaxveh.sweeps import IN_MEMORY, Stores

FILTERS = ("PF", "APF", "UKF")


class Seconds(NamedTuple):
    """The times of a stage: compiling, and running once compiled, s, all seeds together."""

    compile: float
    run: float


class Staged(NamedTuple):
    """The study's result and its parts. Leaves have the seeds in front.

    `outcome`: each seed's; `steps`: errors of step steers by angle, and `first_step`: the course of the first of them by name,
    the truth among them, (seeds, outputs, T). `estimates`: the filters' `Estimate` by name; `fit`: the MAP's `fitting.Fit`.
    `open_loop`: mapping from each estimator to the states that its tyres give without any measurement. `observability`: the
    information about the eight parameters in the drive, at the truth. `seconds`: by stage.
    """

    outcome: Outcome
    steps: dict
    first_step: dict
    estimates: dict
    fit: Any
    open_loop: dict
    observability: Observability
    seconds: dict[str, Seconds]


def run_staged(study: Study, seeds: int, key, *, progress: Progress = silent, stores: Stores = IN_MEMORY) -> Staged:
    """The study over `seeds` seeds, compiled and run in stages, all seeds together; with stores, in chunks of seeds."""
    clock = _Clock(seeds, progress, stores)
    parts = jax.vmap(lambda key: jax.random.split(key, 4))(jax.random.split(key, seeds))
    drive, guess = clock.one(
        "simulation", lambda a, b: (drive_once(study, a), guess_once(study, b)), parts[:, 0], parts[:, 1]
    )
    segments = _segments(study, drive, guess)
    values_like = jnp.zeros((seeds, len(ESTIMATORS), len(FIELDS)), drive.time.dtype)
    tasks = {
        "MAP": (_fit(study), guess, segments),
        "errors and step steers": (_judge(study), values_like, drive),
        "PF": (_filter(study, "PF"), guess, drive, parts[:, 2]),
        "APF": (_filter(study, "APF"), guess, drive, parts[:, 3]),
        "UKF": (_filter(study, "UKF"), guess, drive, parts[:, 2]),
    }
    seen = _first(drive)
    observed = lambda: estimators.observe(model_of(study, vehicles.passenger_car(), study.gaussian), seen)
    done = clock.many(tasks, hold=("errors and step steers",), host={"observability": observed})
    fit, estimates = done["MAP"], {name: done[name] for name in FILTERS}
    values, spread = _parameters(study, guess, estimates, fit)
    stacked = jnp.stack([values[name] for name in ESTIMATORS], axis=1)
    curves, states, loops, steps, first = clock.run("errors and step steers", stacked, drive)
    by_name = lambda array: {name: array[:, i] for i, name in enumerate(ESTIMATORS)}
    filtered = {name: jax.vmap(state_errors)(estimate.mean, drive) for name, estimate in estimates.items()}
    nothing = jnp.full((seeds,), jnp.nan)
    outcome = Outcome(
        drive=drive,
        guess=guess,
        parameters=values,
        spread=spread,
        curve_error=by_name(curves),
        states={**by_name(states), **filtered},
        log_likelihood={**{n: e.log_likelihood for n, e in estimates.items()}, "prior": nothing, "MAP": -fit.cost},
        result={**{n: e.result for n, e in estimates.items()}, "MAP": fit.result, "prior": jnp.zeros_like(fit.result)},
    )
    loops = {name: {k: v[:, i] for k, v in loops.items()} for i, name in enumerate(ESTIMATORS)}
    by_angle = {degrees: by_name(errors) for degrees, errors in steps.items()}
    first = {name: first[:, i] for i, name in enumerate(("truth", *ESTIMATORS))}
    return Staged(outcome, by_angle, first, estimates, fit, loops, done["observability"], clock.seconds)


def _filter(study: Study, name: str) -> Callable:
    kind, noise = filter_of(study, name)

    def one(guess, drive, key):
        model = model_of(study, guess, noise)
        return filters.scan(kind, model, model.rows(drive), key)

    return one


def _fit(study: Study) -> Callable:
    def one(guess, segments):
        # As fast as with RK4, and compiled in two thirds of the time.
        model = model_of(study, guess, study.gaussian, solver=RolledRK4())
        return solve(pose_shooting(model, segments), max_steps=100)

    return one


def _judge(study: Study) -> Callable:
    """Errors of all estimators' tyres: curves (5, 2), open-loop states' errors (5, 2), those states, step steers and the
    first of these."""

    def each(values, drive):
        car = with_tyres(values)
        truth = open_loop(study, car).truth
        shown = {name: truth[name] for name in ("v_y", "yaw_rate", "yaw", "sideslip")}
        return curve_error(car, drive), state_errors(truth.channels, drive), shown

    def judge(values, drive):
        curves, states, shown = jax.vmap(each, in_axes=(0, None))(values, drive)
        return curves, states, shown, *_step_steers(study, values)

    return judge


def _step_steers(study: Study, values) -> tuple[dict, jax.Array]:
    """RMSE of `STEP_OUTPUTS` with each estimator's tyres (5, outputs), by angle, and the course of the first step, with the
    truth's in front, (6, outputs, T); one simulation for all of them."""
    truth = jnp.stack(pick(vehicles.passenger_car(), resolve(vehicles.passenger_car(), tyres)))
    steers = jnp.asarray([math.radians(degrees) for degrees in STEPS], values.dtype)

    def go(one, steer):
        manoeuvre = manoeuvres.step_steer(speed=study.speed, steer=steer, ramp=0.2, duration=study.duration)
        found = simulate(with_tyres(one), manoeuvre, None, dt=1 / study.rate, throw=False).truth
        return jnp.stack([found[name] for name in STEP_OUTPUTS])

    rows = jax.vmap(lambda one: jax.vmap(lambda steer: go(one, steer))(steers))(jnp.concatenate([truth[None], values]))
    errors = jnp.sqrt(jnp.mean((rows[1:] - rows[:1]) ** 2, axis=-1))
    return {degrees: errors[:, i] for i, degrees in enumerate(STEPS)}, rows[:, 0]


def _segments(study: Study, drive, guess):
    """The fit's segments of every seed, stacked; they are cut on the host."""
    count = drive.time.shape[0]
    each = lambda i: jax.tree.map(lambda leaf: leaf[i], (guess, drive))
    parts = []
    for i in range(count):
        car, recording = each(i)
        parts.append(cut(model_of(study, car, study.gaussian), recording, study.window))
    return jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *parts)


def _parameters(study: Study, guess, estimates: dict, fit) -> tuple[dict, dict]:
    """Values and standard deviations (seeds, 8) by estimator, physical."""
    chosen = resolve(vehicles.passenger_car(), tyres)

    def prior(car):
        values = pick(car, chosen)
        spreads = prior_spread(chosen, values, study.prior)
        physical = [p.domain.slope(v) * s for p, v, s in zip(chosen, values, spreads, strict=True)]
        return jnp.stack(values), jnp.stack(physical)

    values, spread = {}, {}
    values["prior"], spread["prior"] = jax.vmap(prior)(guess)
    for name, estimate in estimates.items():
        values[name] = jnp.stack([one[:, -1] for one in estimate.parameters.values()], axis=1)
        spread[name] = jnp.stack([one[:, -1] for one in estimate.parameters_std.values()], axis=1)
    values["MAP"], spread["MAP"] = (
        jnp.stack(list(found.values()), axis=1) for found in (fit.parameters, fit.parameters_std)
    )
    return values, spread


class _Clock:
    """Compiles stages, two at a time, runs them one at a time, and keeps their times."""

    def __init__(self, count: int, progress: Progress, stores: Stores):
        self.count, self.progress, self.stores = count, progress, stores
        self.seconds: dict[str, Seconds] = {}
        self.compiled: dict[str, Any] = {}
        self.done, self.total = 0.0, 13.0

    def one(self, name: str, function: Callable, *args):
        self.progress(self.done, self.total, f"compiling: {name}")
        self._compile(name, function, *args)
        return self.run(name, *args)

    def many(self, tasks: dict[str, tuple], hold: tuple[str, ...], host: dict[str, Callable]) -> dict:
        """Compile all tasks and run those that are not held back; `host`: functions that compile by themselves."""
        # The compiler does not hold Python's lock, so a second core helps; the longest come first.
        waiting = [*tasks, *host]
        self.progress(self.done, self.total, f"compiling: {', '.join(waiting)}")

        def finish(name, result=None):
            waiting.remove(name)
            self.progress(self.done, self.total, f"compiling: {', '.join(waiting)}" if waiting else "compiled")
            return result

        with ThreadPoolExecutor(2) as pool:
            compiling = [
                pool.submit(lambda n=name, t=task: finish(n, self._compile(n, *t))) for name, task in tasks.items()
            ]
            others = {name: pool.submit(lambda n=name, f=function: finish(n, f())) for name, function in host.items()}
            for future in compiling:
                future.result()
            done = {name: future.result() for name, future in others.items()}
        self.done += len(host)
        return done | {name: self.run(name, *task[1:]) for name, task in tasks.items() if name not in hold}

    def run(self, name: str, *args):
        self.progress(self.done, self.total, f"running: {name}")
        start = time.perf_counter()
        result = jax.block_until_ready(self.compiled[name](*args))
        self.seconds[name] = self.seconds[name]._replace(run=time.perf_counter() - start)
        self.done += 1
        return result

    def _compile(self, name: str, function: Callable, *args):
        start = time.perf_counter()
        if self.stores.folder is None:
            self.compiled[name] = eqx.filter_jit(self._over_batch(function)).lower(*args).compile()
        else:
            # Compiled only if a chunk is missing.
            told = lambda done, total, stage: self.progress(self.done + done / total, self.total, f"{name}: {stage}")
            own = self.stores.under(name.replace(" ", "-"))
            self.compiled[name] = lambda *args: own.each("runs", function, *args, progress=told)
        self.seconds[name] = Seconds(time.perf_counter() - start, float("nan"))
        self.done += 1

    def _over_batch(self, function: Callable) -> Callable:
        if self.count > 1:
            return lambda *args: jax.vmap(function)(*args)
        # One seed runs like the call of a single user, without the cost of a batch.
        return lambda *args: _grow(function(*_shrink(args)))


def _first(recording: Recording) -> Recording:
    """The first seed's drive, with stamps on the host as in an ordinary recording."""
    return Recording(
        np.asarray(recording.time[0]), {n: v[0] for n, v in recording.channels.items()}, dict(recording.units)
    )


def _shrink(tree):
    return jax.tree.map(lambda leaf: leaf[0], tree)


def _grow(tree):
    return jax.tree.map(lambda leaf: jnp.asarray(leaf)[None], tree)

"""Unscented Kalman filter of three states, for one run and many."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import filters

from . import limit, ours
from .measure import Bound, Case, Contestant, Skipped
from .peers import numpy_filters
from .problems import SpeedAndMass, speed_and_mass

__all__ = ["cases"]

OURS, ALONE, LIMIT = "jaxveh", "jaxveh, log-likelihood alone", "C++ limit"

MOST = {
    ("float64", 1): 2.2,
    ("float32", 1): 2.2,
    ("float64", 64): 4,
    ("float32", 64): 4,
    ("float64", 1000): 2.5,
    ("float32", 1000): 3,
}
"""Bounds over the time of the limit, which does not keep rows either."""


def cases(smoke: bool) -> list[Case]:
    """Return the cases: one run, and 64 and 1000 at once."""
    made = []
    for dtype in ("float64", "float32"):
        for runs in (1, 3) if smoke else (1, 64, 1000):
            rows = 20 if smoke else {1: 20000, 64: 2000, 1000: 500}[runs]
            made.append(
                Case(
                    name=f"unscented/{dtype}-{runs}",
                    title=f"Unscented Kalman filter of 3 states, {runs} run{'s' if runs > 1 else ''}, {dtype}",
                    unit="ns a run-step",
                    build=functools.partial(_build, np.dtype(dtype), runs, rows),
                    base=LIMIT,
                    bounds=_bounds(dtype, runs),
                )
            )
    return made


def _bounds(dtype: str, runs: int) -> tuple[Bound, ...]:
    peers = (Bound(OURS, ("dynamax", "smcx"), 0.8),) if runs in (1, 64) else ()
    return (*peers, Bound(ALONE, (LIMIT,), MOST[dtype, runs])) if (dtype, runs) in MOST else peers


def _build(dtype: np.dtype, runs: int, rows: int) -> Sequence[Contestant | Skipped]:
    problem = speed_and_mass(rows, runs, dtype=dtype.type)
    short = speed_and_mass(min(rows, 200), runs, dtype=dtype.type)
    work, little = runs * (rows - 1), runs * (short.rows - 1)
    made: list[Contestant | Skipped] = [_ours(problem, dtype, work), _ours(problem, dtype, work, ALONE)]
    reason = limit.unavailable()
    if reason:
        made.append(Skipped(LIMIT, reason))
    else:
        run = limit.unscented(problem, dtype=dtype)
        made.append(Contestant(LIMIT, lambda index: run(), work))
    slow = numpy_filters.unscented(short)
    made.append(Contestant("NumPy", lambda index: slow(), little))
    for name, builder in (("dynamax", _dynamax), ("smcx", _smcx)):
        try:
            made.append(_jitted(name, builder(problem, dtype), problem, dtype, work))
        except ImportError as error:
            made.append(Skipped(name, f"not installed here ({error.name})"))
    if runs == 1:
        try:
            from .peers import filterpy_filters

            loop = filterpy_filters.unscented(short)
            made.append(Contestant("filterpy", lambda index: loop(), little))
        except ImportError as error:
            made.append(Skipped("filterpy", f"not installed here ({error.name})"))
    return made


def _ours(problem: SpeedAndMass, dtype: np.dtype, work: float, name: str = OURS) -> Contestant:
    keep = () if name == ALONE else ("mean", "std", "info")
    filter_ = filters.Unscented(problem.alpha, problem.beta, problem.kappa)
    with ours.precision(dtype):
        model, recording = ours.speed_model(problem, dtype), ours.speed_recording(problem)
        if problem.runs == 1:

            def call(index: int) -> object:
                with ours.precision(dtype):
                    return filters.run(filter_, model, recording, keep=keep)

            return Contestant(name, ours.blocked(call), work)
        rows = model.rows(recording)

        def one(speed: jax.Array) -> filters.Estimate:
            return filters.scan(filter_, model, rows._replace(y=rows.y._replace(v=speed)), None, keep)

        return _jitted(name, jax.jit(jax.vmap(one)), problem, dtype, work)


def _jitted(name: str, run: Callable, problem: SpeedAndMass, dtype: np.dtype, work: float) -> Contestant:
    """Return a contestant from a jitted function of the measured speeds, (rows,) for one run and (runs, rows) for many."""
    with ours.precision(dtype):
        speed = jnp.asarray(problem.speed[:, 0] if problem.runs == 1 else problem.speed.T, dtype)

    def call(index: int) -> object:
        with ours.precision(dtype):
            return run(speed)

    return Contestant(name, ours.blocked(call), work)


def _dynamax(problem: SpeedAndMass, dtype: np.dtype) -> Callable:
    from .peers import dynamax_filters

    with ours.precision(dtype):
        return dynamax_filters.unscented(problem, dtype)


def _smcx(problem: SpeedAndMass, dtype: np.dtype) -> Callable:
    from .peers import smcx_filters

    with ours.precision(dtype):
        return smcx_filters.unscented(problem, dtype)

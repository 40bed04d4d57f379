"""One simulation through diffrax: states at the rows, and the result code."""

from __future__ import annotations

import functools
import itertools
import math
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check, check_kind, check_positive
from jaxveh._core.result import Result, code
from jaxveh._core.traced import trace_once
from jaxveh.simulation.driven import Driven, dtype_of
from jaxveh.simulation.events import Event
from jaxveh.simulation.stiffness import SolverChoice
from jaxveh.statespace import kit

ADAPTIVE_STEPS_A_ROW = 64
"""Most steps of a solver with its own step size, as a multiple of the number of equal steps of the greatest length."""

TOLD_FROM = 50_000
"""Number of equal steps from which on a simulation reports its progress: fewer take at most a second, and jax caches no compiled
program that calls its host."""


class Solution(NamedTuple):
    """A simulation by row, each leaf (T,): states, inputs, outputs, noise-free measurements; and as scalars the `result` code
    (`Result`), the time `end` (s) at which it ended, whether an `event` ended it, and how many rows it `reached`. Rows after an
    event are NaN."""

    x: Any
    u: Any
    outputs: Any
    measured: Any
    result: Any
    end: Any
    event: Any
    reached: Any


class Grid(NamedTuple):
    """Instants of the rows, `rows` (s), and the ends of equal steps between them, `steps` (s); both start at 0."""

    rows: np.ndarray
    steps: np.ndarray

    @property
    def steps_a_row(self) -> int | None:
        """The number of steps between two rows; None if it varies."""
        if len(self.rows) < 2:
            return None
        each, left = divmod(len(self.steps) - 1, len(self.rows) - 1)
        even = not left and np.allclose(self.steps[::each], self.rows, rtol=0.0, atol=1e-9)
        return each if even else None


MOST_ROWS, MOST_STEPS = 10**7, 10**8
"""The most rows (a day at 100 Hz) and steps of a drive: more would not fit into the memory."""


def even_grid(duration: float, dt: float, max_step: float) -> Grid:
    """Rows at 0, dt, 2 dt, ...; steps of at most `max_step` that meet each of them."""
    check_positive("dt", dt, "s")
    check_positive("max_step", max_step, "s")
    check("dt", dt, lambda v: v <= duration, f"at most the manoeuvre's duration, {duration:g} s")
    if duration / dt > MOST_ROWS or duration / max_step > MOST_STEPS:
        raise InputError(
            f"duration = {duration:g} s, rows every {dt:g} s, steps of {max_step:g} s: must be at most {MOST_ROWS:.0e} rows and "
            f"{MOST_STEPS:.0e} steps. Shorten the drive, or lengthen rows and steps."
        )
    # A duration that is a whole number of steps except for rounding keeps its last row.
    count = math.floor(duration / dt + 1e-9)
    rows = dt * np.arange(count + 1)
    return Grid(rows, np.linspace(0.0, rows[-1], count * math.ceil(dt / max_step - 1e-9) + 1))


def grid_through(rows: np.ndarray, max_step: float) -> Grid:
    """Steps of at most `max_step` (s) that meet every one of `rows`, which start at 0 and increase."""
    check_positive("max_step", max_step, "s")
    pieces = [
        np.linspace(start, end, math.ceil((end - start) / max_step - 1e-9) + 1)[1:]
        for start, end in itertools.pairwise(rows)
    ]
    return Grid(rows, np.concatenate([rows[:1], *pieces]))


def solve(
    driven: Driven,
    start: dict,
    grid: Grid,
    choice: SolverChoice,
    until: Event | None = None,
    adjoint: diffrax.AbstractAdjoint | None = None,
    meter: diffrax.AbstractProgressMeter | None = None,
) -> Solution:
    """Simulate the driven car over the grid. It may be jitted, vmapped and differentiated.

    **Raises** `InputError` for instants that coincide in the car's dtype.
    """
    check_kind("solve: driven", driven, Driven, "simulation.driven_car returns one.")
    dtype = dtype_of(driven.car.vehicle)
    _check_distinct("rows", grid.rows, dtype)
    _check_distinct("steps", grid.steps, dtype)
    rows, steps = jnp.asarray(grid.rows, dtype), jnp.asarray(grid.steps, dtype)
    meter = diffrax.NoProgressMeter() if meter is None else meter
    plain = choice.controller is None and until is None and adjoint is None and isinstance(choice.solver, kit.EXPLICIT)
    each = grid.steps_a_row if plain else None
    if each is not None:
        meter = meter if len(steps) > TOLD_FROM else diffrax.NoProgressMeter()
        return _scan(driven, start, rows, steps, kit.in_both_modes(choice.solver), each, meter)
    adjoint = diffrax.RecursiveCheckpointAdjoint() if adjoint is None else adjoint
    return _solve(driven, start, rows, steps, choice.solver, choice.controller, until, adjoint, meter)


def _check_distinct(what: str, instants: np.ndarray, dtype) -> None:
    """Raise `InputError` if two successive instants coincide in the car's dtype."""
    rounded = instants.astype(dtype)
    same = rounded[1:] <= rounded[:-1]
    if same.any():
        first, second = instants[np.argmax(same) :][:2]
        raise InputError(
            f"simulate: the {what} at t = {first:.9g} s and {(second - first):.3g} s later coincide in {np.dtype(dtype)}: "
            "take a car in float64 (jax_enable_x64), longer steps, or rates and delays whose instants lie farther apart."
        )


def _rates(t, x, driven: Driven):
    return trace_once(Driven.derivatives, driven, t, x)


@eqx.filter_jit
def _scan(driven: Driven, start, rows, steps, solver, each: int, meter) -> Solution:
    """The same steps as in `_solve`, without the parts of `diffeqsolve` that they do not need.

    About as fast; but forward mode works, and reverse mode keeps one state per row.
    """
    term, count = diffrax.ODETerm(_rates), len(rows) - 1
    y0 = driven.start(rows[0], rows.dtype, **start)

    def one_step(carry, between):
        x, memory = carry
        x, _, _, memory, _ = solver.step(term, *between, x, driven, memory, made_jump=jnp.asarray(False))
        return (x, memory), None

    @functools.partial(jax.checkpoint, prevent_cse=False)
    def steps_of_a_row(carry, between):
        return jax.lax.scan(one_step, carry, between)[0]

    def row(carry, given):
        stepped, told = carry
        between, share = given
        stepped = steps_of_a_row(stepped, between)
        return (stepped, meter.step(told, share)), stepped[0]

    between = steps[:-1].reshape(count, each), steps[1:].reshape(count, each)
    share = jnp.arange(1, count + 1, dtype=jnp.int32) / jnp.asarray(count, jnp.int32)
    # Of a solver that keeps its last slopes for the next step; None of the others.
    memory = solver.init(term, steps[0], steps[1], y0, driven)
    (_, told), later = jax.lax.scan(row, ((y0, memory), meter.init()), (between, share))
    meter.close(told)
    x = jax.tree.map(lambda first, rest: jnp.concatenate([jnp.asarray(first)[None], rest]), y0, later)
    return _solution(driven, rows, x, rows[-1], jnp.asarray(False), jnp.ones(len(rows), bool), jnp.asarray(True))


@eqx.filter_jit
def _solve(driven: Driven, start, rows, steps, solver, controller, until, adjoint, meter) -> Solution:
    fixed = controller is None
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(_rates),
        solver,
        t0=rows[0],
        t1=rows[-1],
        dt0=None,
        y0=driven.start(rows[0], rows.dtype, **start),
        args=driven,
        saveat=diffrax.SaveAt(subs=[diffrax.SubSaveAt(ts=rows), diffrax.SubSaveAt(t1=True, fn=lambda t, y, args: t)]),
        stepsize_controller=diffrax.StepTo(ts=steps) if fixed else controller,
        adjoint=adjoint,
        event=None if until is None else until.of_solver(1e-6),
        progress_meter=meter,
        max_steps=len(steps) if fixed else ADAPTIVE_STEPS_A_ROW * len(steps),
        throw=False,
    )
    ys: Any = solution.ys
    x, (end,) = ys
    event = solution.result == diffrax.RESULTS.event_occurred
    # If nothing stopped the solver, the last row is reached, however the end is rounded.
    reached = (rows <= end) | (solution.result == diffrax.RESULTS.successful)
    if until is not None:
        x = jax.tree.map(lambda leaf: jnp.where(reached, leaf, jnp.nan), x)
    ended = (solution.result == diffrax.RESULTS.successful) | event
    return _solution(driven, rows, x, end, event, reached, ended)


def _solution(driven: Driven, rows, x, end, event, reached, ended) -> Solution:
    """The solution for given states at the rows."""
    # Row by row, not as a batch: as fast for some hundred rows, and compiled in a third of the time.
    u, outputs, measured = jax.lax.map(lambda at: driven.see(*at), (rows, x))
    result = _result(ended, x, outputs, reached)
    return Solution(x, u, outputs, measured, result, end, event, jnp.sum(reached))


def _result(ended, x, outputs, reached):
    finite = jnp.all(jnp.stack([jnp.all(jnp.isfinite(v) | ~reached) for v in jax.tree.leaves((x, outputs))]))
    failed = jnp.where(ended, code(Result.non_finite_state), code(Result.too_stiff))
    return jnp.where(finite & ended, code(Result.successful), failed)

"""The car of seven degrees of freedom through a diffrax solver: many drives, one drive, gradients, and a second core."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics, simulation, statespace, tyres, vehicles

from . import limit, ours
from .measure import Bound, Case, Contestant, Skipped
from .seven_dof_problem import Drives, drives

__all__ = ["Inputs", "car", "cases", "chosen_of", "gradient_arguments", "mean_square", "simulate"]

OURS, MAPPED, LIMIT, VALUE, GRADIENT = "jaxveh", "jaxveh, vmapped", "C++ limit", "value", "value and gradient"
BLOCK = 64
BOUNDS = {"float64": 1.3, "float32": 1.6}


class Inputs(NamedTuple):
    """The driver's inputs: steer in rad, torques of all wheels in N m."""

    steer: object
    drive_torque: object
    brake_torque: object


def car(problem: Drives, dtype: np.typing.DTypeLike) -> vehicles.SevenDOF:
    """Return the cars of all drives as one car, with arrays where they differ."""
    p = problem
    number = lambda value: jnp.asarray(value if p.runs > 1 else np.squeeze(value), dtype)
    tyre = lambda stiffness, friction: tyres.IsotropicMagicFormula(
        number(stiffness), number(p.shape), number(friction), number(p.curvature)
    )
    return vehicles.SevenDOF(
        mass=number(p.mass),
        front=tyre(p.stiffness_front, p.friction_front),
        rear=tyre(p.stiffness_rear, p.friction_rear),
        drive=vehicles.AxleDrive(front_drive=number(p.front_drive)),
        load_transfer=vehicles.QuasiStatic(),
        **{name: number(value) for name, value in p.body.items()},
    )


def simulate(
    problem: Drives,
    cars: vehicles.SevenDOF,
    speed: jax.Array,
    solver: diffrax.AbstractSolver | None = None,
    block: int | None = BLOCK,
):
    """Return the states of every row, leaves (rows + 1, runs) or (rows + 1,), for speeds (runs,) or a scalar, in m/s."""
    p = problem

    def inputs(t):
        steer = p.amplitude * numerics.sin(2 * np.pi * p.frequency * t)
        return Inputs(*numerics.fence((steer, jnp.full_like(t, p.drive_torque), jnp.zeros_like(t))))

    def rates(t, x, cars):
        return cars.derivatives(t, x, inputs(t))

    x0 = cars.start(0.0, inputs(jnp.zeros((), speed.dtype)), v_x=speed)
    x0 = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, jnp.shape(speed)), x0)
    times = {"rows": p.rows, "step": p.step, "steps_a_row": p.steps_a_row}
    return simulation.fixed_steps(rates, x0, cars, **times, solver=solver, block=block)


def mean_square(problem: Drives, chosen: tuple, cars: vehicles.SevenDOF, speed: jax.Array, truth) -> jax.Array:
    """Return the mean squared distance of yaw rate and lateral velocity from `truth`; `chosen`: mass, front and rear tyre."""
    cars = eqx.tree_at(chosen_of, cars, chosen)
    x = simulate(problem, cars, speed, statespace.RolledRK4(), block=None)
    return jnp.mean((x.yaw_rate - truth.yaw_rate) ** 2) + jnp.mean((x.v_y - truth.v_y) ** 2)


def chosen_of(cars: vehicles.SevenDOF) -> tuple:
    """Return the numbers with respect to which gradients are taken."""
    return cars.mass, cars.front, cars.rear


def cases(smoke: bool) -> list[Case]:
    """Return the cases: many drives in both precisions, one drive, the gradient of many."""
    runs, rows, one, few = (16, 2, 3, 4) if smoke else (1000, 100, 1000, 100)
    made = [
        Case(
            name=f"simulation/seven-dof-{dtype}",
            title=f"7-DOF car, {runs} drives of {10 * rows} steps, {dtype}",
            unit="ns a run-step",
            build=functools.partial(_many, np.dtype(dtype), drives(runs, rows), smoke),
            base=LIMIT,
            bounds=(Bound(OURS, (LIMIT,), BOUNDS[dtype]),),
        )
        for dtype in ("float64", "float32")
    ]
    made.append(
        Case(
            name="simulation/one-float64",
            title=f"7-DOF car, one drive of {10 * one} steps, float64",
            unit="ns a step",
            build=functools.partial(_one, drives(1, one)),
            base=LIMIT,
            bounds=(Bound(OURS, (LIMIT,), 1.5),),
        )
    )
    if not smoke:  # it compiles for a minute
        made.append(
            Case(
                name="simulation/gradient",
                title=f"Gradient: 7-DOF car, {few} drives of {10 * rows} steps, mass and tyres, float64",
                unit="ns a run-step",
                build=functools.partial(_gradient, drives(few, rows)),
                base=VALUE,
                bounds=(Bound(GRADIENT, (VALUE,), 8.0),),
            )
        )
    return made


def _arguments(problem: Drives, dtype: np.dtype) -> tuple[vehicles.SevenDOF, jax.Array]:
    return car(problem, dtype), jnp.asarray(problem.speed if problem.runs > 1 else problem.speed[0], dtype)


def _calling(dtype: np.dtype, function: Callable, arguments: Sequence) -> Callable[[int], object]:
    def call(index: int) -> object:
        with ours.precision(dtype):
            return function(*arguments)

    return ours.blocked(call)


def _many(dtype: np.dtype, problem: Drives, smoke: bool) -> Sequence[Contestant | Skipped]:
    work = problem.runs * problem.steps
    with ours.precision(dtype):
        arguments = _arguments(problem, dtype)
    whole = jax.jit(functools.partial(simulate, problem))
    made: list[Contestant | Skipped] = [Contestant(OURS, _calling(dtype, whole, arguments), work)]
    if not smoke:
        axes = jax.tree.map(lambda leaf: 0 if leaf.ndim else None, arguments[0])
        mapped = jax.jit(jax.vmap(functools.partial(simulate, problem), in_axes=(axes, 0)))
        made.append(Contestant(MAPPED, _calling(dtype, mapped, arguments), work))
    return [*made, _limit(problem, dtype)]


def _one(problem: Drives) -> Sequence[Contestant | Skipped]:
    dtype = np.dtype(np.float64)
    call = _calling(dtype, jax.jit(functools.partial(simulate, problem)), _arguments(problem, dtype))
    return [Contestant(OURS, call, problem.steps), _limit(problem, dtype)]


def _limit(problem: Drives, dtype: np.dtype) -> Contestant | Skipped:
    reason = limit.unavailable()
    if reason:
        return Skipped(LIMIT, reason)
    compiled = limit.seven_dof(problem, dtype=dtype)
    return Contestant(LIMIT, lambda index: compiled(), problem.runs * problem.steps)


def gradient_arguments(problem: Drives) -> tuple:
    """Return the arguments of `mean_square` after the problem: chosen numbers with an error of one per cent, one per run."""
    cars, speed = _arguments(problem, np.dtype(np.float64))
    truth = jax.jit(functools.partial(simulate, problem))(cars, speed)
    chosen = jax.tree.map(lambda leaf: jnp.broadcast_to(1.01 * leaf, speed.shape), chosen_of(cars))
    return chosen, cars, speed, truth


def _gradient(problem: Drives) -> Sequence[Contestant]:
    dtype, work = np.dtype(np.float64), problem.runs * problem.steps
    arguments = gradient_arguments(problem)
    loss = functools.partial(mean_square, problem)
    both = jax.jit(jax.value_and_grad(loss)).lower(*arguments).compile()
    analysis = both.memory_analysis()
    note = f"{analysis.temp_size_in_bytes / 1e6:.1f} MB" if analysis else ""
    return [
        Contestant(VALUE, _calling(dtype, jax.jit(loss), arguments), work),
        Contestant(GRADIENT, _calling(dtype, both, arguments), work, note=note),
    ]

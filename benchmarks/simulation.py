"""The car of seven degrees of freedom through a diffrax solver: many drives, one drive, gradients, and a second core."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics, simulation, tyres, vehicles

from . import limit, ours
from .measure import Bound, Case, Contestant, Skipped
from .seven_dof_problem import Drives, drives

__all__ = ["Inputs", "car", "cases", "mean_square", "simulate"]

OURS, MAPPED, LIMIT, VALUE, GRADIENT = "jaxveh", "jaxveh, vmapped", "C++ limit", "value", "value and gradient"
BOUNDS = {"float64": 1.3, "float32": 1.6}


class Inputs(NamedTuple):
    """What the driver does: steer in rad, torques of all wheels in N m."""

    steer: object
    drive_torque: object
    brake_torque: object


def car(problem: Drives, dtype: np.typing.DTypeLike) -> vehicles.SevenDOF:
    """The cars of all drives as one, with arrays where they differ."""
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


def simulate(problem: Drives, cars: vehicles.SevenDOF, speed: jax.Array):
    """States of every row, leaves (rows + 1, runs) or (rows + 1,), from drives' speeds, (runs,) or a scalar, in m/s."""
    p = problem

    def inputs(t):
        steer = p.amplitude * numerics.sin(2 * np.pi * p.frequency * t)
        return Inputs(*numerics.barrier((steer, jnp.full_like(t, p.drive_torque), jnp.zeros_like(t))))

    def rates(t, x, cars):
        return cars.derivatives(t, x, inputs(t))

    x0 = cars.start(0.0, inputs(jnp.zeros((), speed.dtype)), v_x=speed)
    x0 = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, jnp.shape(speed)), x0)
    return simulation.fixed_steps(rates, x0, cars, rows=p.rows, step=p.step, steps_a_row=p.steps_a_row)



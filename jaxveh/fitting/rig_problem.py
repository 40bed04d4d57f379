"""Residuals of rig data: rows, weights, chosen coefficients, and their normal equations."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxveh._core.bijectors import Real
from jaxveh._core.parameter import Parameter, pick, put
from jaxveh.numerics import on_cpu
from jaxveh.tyres import AbstractTyre, Contact

PULL = 0.1
"""How hard a coefficient is pulled to its start, in standard deviations a step: 1 % of what a direction is pulled that data
identify, but what they do not show stays where it was, where it would creep for hundreds of steps."""

KINK = 2.0
"""Standard deviations of a residual where a fit that is robust begins to count it little: Student's t with 2^2 = 4 degrees of
freedom."""

BLOCK = 2000
"""Rows at a time on a CPU; an accelerator takes all at once."""


class RigProblem(eqx.Module):
    """Rig data, a law and what of it is to be fitted.

    `contact` (n,) arrays; `measured` (m, n), the forces and moments `channels`, zero where there is no measurement; `weight`
    (m, n), one over the standard deviation, zero where a row does not count. `scale` (p,): the step of each coefficient that
    counts as one, on its bijector's line, from `origin` (p,); zero where it is held.
    """

    law: AbstractTyre
    contact: Contact
    measured: jax.Array
    weight: jax.Array
    origin: jax.Array
    scale: jax.Array
    parameters: tuple[Parameter, ...] = eqx.field(static=True)
    channels: tuple[str, ...] = eqx.field(static=True)
    robust: bool = eqx.field(static=True)

    def values(self, z):
        """Coefficients (p,) at the coordinates z (p,)."""
        line = self.origin + self.scale * z
        return [p.domain.forward(line[i]) for i, p in enumerate(self.parameters)]

    def filled(self, z) -> AbstractTyre:
        """The law with the coefficients at z."""
        return put(self.law, self.parameters, self.values(z))

    def forces(self, law: AbstractTyre):
        """The channels (m, n) of a law."""
        found = law.forces(self.contact)
        like = self.measured[0]
        return jnp.stack([jnp.asarray(getattr(found, name), like.dtype) + 0 * like for name in self.channels])

    def bent(self, residual):
        """Residuals in standard deviations, bent beyond `KINK` where the fit is robust, and the slope of the bend."""
        if not self.robust:
            return residual, jnp.ones_like(residual)
        # The square of the result is k^2 log(1 + (r / k)^2), what Student's t with k^2 degrees of freedom has in its exponent.
        x = (residual / KINK) ** 2
        some = jnp.where(x > 1e-8, x, 1.0)
        shrink = jnp.sqrt(jnp.where(x > 1e-8, jnp.log1p(some) / some, 1 - x / 2))
        return residual * shrink, 1 / ((1 + x) * shrink)


class Normal(NamedTuple):
    """Half the sum of squares `loss`, its `gradient` (p,) and its Gauss-Newton `matrix` (p, p) at a point."""

    loss: Any
    gradient: Any
    matrix: Any


def loss(z, problem: RigProblem):
    """Half the sum of squared residuals at the coordinates z (p,), in standard deviations, with the pull to the start."""
    difference = problem.weight * (problem.forces(problem.filled(z)) - problem.measured)
    return 0.5 * jnp.sum(problem.bent(difference)[0] ** 2) + 0.5 * PULL**2 * jnp.sum(z**2)


def normal_equations(z, problem: RigProblem) -> Normal:
    """The loss at z (p,) with its gradient and Gauss-Newton matrix.

    A row of data sees its own force alone, so that with coefficients as wide as the rows one pass backward a channel gives
    every derivative of every row: the cost does not grow with the number of coefficients, as that of passes forward does.
    The rows go in blocks that the processor's cache holds: 0.7 us a row and two channels of MF-Tyre with 68 coefficients, where
    100,000 rows at once took 1.8 us.
    """
    table, block = _in_blocks(problem)

    def add(sums: Normal, some) -> tuple[Normal, None]:
        return jax.tree.map(jnp.add, sums, _of_data(z, block(some))), None

    pull = Normal(0.5 * PULL**2 * jnp.sum(z**2), PULL**2 * z, PULL**2 * jnp.eye(z.size, dtype=z.dtype))
    return lax.scan(add, pull, table)[0]


def _of_data(z, problem: RigProblem) -> Normal:
    """The data's part of the normal equations."""
    line = problem.origin + problem.scale * z
    rows = problem.measured.shape[1]

    def channels(*lines):
        values = [p.domain.forward(one) for p, one in zip(problem.parameters, lines, strict=True)]
        return problem.forces(put(problem.law, problem.parameters, values))

    found, pull = jax.vjp(channels, *(jnp.broadcast_to(line[i], (rows,)) for i in range(line.size)))
    value, slope = problem.bent(problem.weight * (found - problem.measured))
    gradient, matrix = jnp.zeros_like(z), jnp.zeros((z.size, z.size), z.dtype)
    for k in range(len(problem.channels)):
        # A row a coefficient: a Jacobian with its rows the other way round would be copied number by number.
        slopes = jnp.stack(pull(jnp.zeros_like(found).at[k].set(problem.weight[k] * slope[k])))
        slopes = slopes * problem.scale[:, None]
        gradient, matrix = gradient + slopes @ value[k], matrix + slopes @ slopes.T
    return Normal(0.5 * jnp.sum(value**2), gradient, matrix)


def _in_blocks(problem: RigProblem) -> tuple[Any, Callable[[Any], RigProblem]]:
    """What has a number a row, cut into blocks (b, ..., size), and the problem of one block of it.

    Rows that fill the last block repeat the last one, without weight.
    """
    rows = problem.measured.shape[1]
    blocks = -(-rows // BLOCK) if on_cpu() else 1
    size = -(-rows // blocks)

    def cut(leaf, mode: str = "edge"):
        filled = jnp.pad(leaf, [(0, 0)] * (leaf.ndim - 1) + [(0, blocks * size - rows)], mode=mode)
        return jnp.moveaxis(filled.reshape(*leaf.shape[:-1], blocks, size), -2, 0)

    by_row, alike = eqx.partition(problem.contact, lambda leaf: jnp.shape(leaf) == (rows,))

    def block(some) -> RigProblem:
        contact, measured, weight = some
        return dataclasses.replace(problem, contact=eqx.combine(contact, alike), measured=measured, weight=weight)

    return (jax.tree.map(cut, by_row), cut(problem.measured), cut(problem.weight, "constant")), block


def contact_of(rig) -> Contact:
    """The contact of each row of a `RigTable`."""
    optional = lambda values: None if values is None else jnp.asarray(values)
    return Contact(
        slip_angle=jnp.asarray(rig.slip_angle),
        slip_ratio=jnp.asarray(rig.slip_ratio),
        load=jnp.asarray(rig.load),
        camber=0.0 if rig.camber is None else jnp.asarray(rig.camber),
        # Zero throughout is what rigs write that do not tell it.
        speed=None if rig.speed is None or not np.any(rig.speed) else jnp.asarray(rig.speed),
        pressure=optional(rig.pressure),
    )


def offered(law: AbstractTyre, contact: Contact) -> tuple[str, ...]:
    """The forces and moments that a law has (those that are no plain zero)."""
    one = jax.tree.map(lambda values: values[:1] if jnp.ndim(values) else values, contact)
    found = eqx.filter_eval_shape(law.forces, one)
    return tuple(name for name, value in found._asdict().items() if not isinstance(value, float))


def start_of(law: AbstractTyre, parameters: tuple[Parameter, ...]) -> tuple[jax.Array, jax.Array]:
    """Origin and scale (p,) of the coordinates: its own size or the declared scale, the larger; one on the bijector's line
    (for what is positive a factor of e) for what is positive or bounded."""
    origin, scale = [], []
    for p, value in zip(parameters, pick(law, parameters), strict=True):
        value = jnp.asarray(value)
        origin.append(p.domain.inverse(value))
        step = jnp.asarray(1.0 if p.scale is None else abs(p.scale), value.dtype)
        scale.append(jnp.where(_is_real(p), jnp.maximum(step, jnp.abs(value)), 1.0))
    return jnp.stack(origin), jnp.stack(scale)


def _is_real(p: Parameter) -> bool:
    return isinstance(p.domain, Real)

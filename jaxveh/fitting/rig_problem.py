"""Residuals of rig data: rows, weights, chosen coefficients, and their normal equations."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax import lax

from jaxveh._core.bijectors import Real
from jaxveh._core.lengths import common_length
from jaxveh._core.parameter import Parameter, pick, put
from jaxveh.fitting.levenberg_marquardt import LevenbergMarquardt, Quadratic
from jaxveh.fitting.problem import AbstractProblem, SearchEnd, in_units
from jaxveh.numerics import as_wide_as, on_cpu
from jaxveh.tyres import AbstractTyre, Contact

PULL = 0.1
"""Strength with which a coefficient is pulled to its start, in standard deviations per step: 1 % of the pull of the data
along a direction that they identify. Coefficients that they do not show stay at their start instead of creeping for hundreds
of steps."""

KINK = 2.0
"""Residual, in standard deviations, beyond which a robust fit reduces its weight: Student's t with 2^2 = 4 degrees of
freedom."""

BLOCK = 2000
"""Rows per block on a CPU; an accelerator takes all at once."""

SHARED = 10_000
"""Rows of the longest table that is filled up to a common length: to fit a longer one takes longer than to compile."""


def forces_of(law: AbstractTyre, contact: Contact, channels: tuple[str, ...], measured: jax.Array) -> jax.Array:
    """The channels (m, n) that a law gives at the rows of `contact`, in the precision of `measured` (m, n)."""
    found, like = law.forces(contact), measured[0]
    return jnp.stack([as_wide_as(jnp.asarray(getattr(found, name), like.dtype), like) for name in channels])


class RigProblem(AbstractProblem):
    """Rig data, a law and its coefficients to fit.

    `contact`: of each row, arrays (n,); `measured` (m, n): the forces and moments `channels`, zero where there is no
    measurement; `weight` (m, n): one over the standard deviation, zero where a row does not count; `emphasis` (m,): factors
    on the channels' weights from the noise. Coordinates z (p,) are steps: `scale` (p,) is the length of one step of each
    coefficient on its bijector's real line, from `origin` (p,); zero where it is held. `centre`, `spread` (p,): mean and
    standard deviation of the prior on that line; infinite for no prior. `pull`: how strongly coefficients are pulled to the
    origin, in standard deviations per step, one for all or each (p,).
    """

    law: AbstractTyre
    contact: Contact
    measured: jax.Array
    weight: jax.Array
    emphasis: jax.Array
    origin: jax.Array
    scale: jax.Array
    centre: jax.Array
    spread: jax.Array
    pull: jax.Array
    chosen: tuple[Parameter, ...] = eqx.field(static=True)
    channels: tuple[str, ...] = eqx.field(static=True)
    robust: bool = eqx.field(static=True)

    def start(self):
        return jnp.zeros_like(self.origin)

    def line(self, z):
        return self.origin + self.scale * z

    def cost(self, z):
        return loss(z, self)

    def search(self, z, max_steps, tolerance):
        return descend(self, z, max_steps, tolerance).found

    def covariance(self, z):
        spread, _ = spread_of(z, self)
        # A standard error above one step, a coefficient's own size, comes from the pull.
        return spread * self.scale * self.scale[:, None], jnp.diagonal(spread) <= 1.0

    def is_failure(self, cost):
        return jnp.asarray(False)

    def units(self):
        return self.measured.shape[1]

    def with_counts(self, counts):
        return dataclasses.replace(self, weight=self.weight * jnp.sqrt(counts))

    def values(self, z):
        """Coefficients (p,) at the coordinates z (p,)."""
        return in_units(self.chosen, self.line(z))

    def model_at(self, z) -> AbstractTyre:
        """The law with the coefficients at z."""
        return put(self.law, self.chosen, self.values(z))

    def forces(self, law: AbstractTyre):
        """The channels (m, n) that a law gives."""
        return forces_of(law, self.contact, self.channels, self.measured)

    def bend(self, residual):
        """Residuals in standard deviations, reduced beyond `KINK` if the fit is robust, and the slope of this function."""
        if not self.robust:
            return residual, jnp.ones_like(residual)
        # The square of the result is k^2 log(1 + (r / k)^2), the exponent of Student's t with k^2 degrees of freedom.
        x = (residual / KINK) ** 2
        some = jnp.where(x > 1e-8, x, 1.0)
        shrink = jnp.sqrt(jnp.where(x > 1e-8, jnp.log1p(some) / some, 1 - x / 2))
        return residual * shrink, 1 / ((1 + x) * shrink)


class Descent(NamedTuple):
    """The end of a search, and by how much it `lowered` the loss."""

    found: SearchEnd
    lowered: Any


def descend(problem: RigProblem, z, max_steps: int | None, tolerance: float, limit=None) -> Descent:
    """Least squares from the coordinates z (p,), by `LevenbergMarquardt`; `limit`: the most steps as an array."""
    solver = LevenbergMarquardt(rtol=tolerance, atol=tolerance, quadratic=normal_equations)
    options = {} if limit is None else {"limit": limit}
    found = optx.minimise(loss, solver, z, problem, options=options, max_steps=max_steps, throw=False)
    cost = found.state.at.cost
    return Descent(SearchEnd(found.value, found.stats["num_steps"], found.state.done, cost), loss(z, problem) - cost)


def loss(z, problem: RigProblem):
    """Half the sum of squared residuals at the coordinates z (p,), in standard deviations, with the prior and the pull."""
    difference = problem.weight * (problem.forces(problem.model_at(z)) - problem.measured)
    squares = jnp.sum(problem.bend(difference)[0] ** 2, axis=1)
    return 0.5 * jnp.sum(problem.emphasis * squares) + _prior_loss(z, problem).cost


def _prior_loss(z, problem: RigProblem) -> Quadratic:
    """The part of the prior and the pull in the loss."""
    off, rate = (problem.line(z) - problem.centre) / problem.spread, problem.scale / problem.spread
    cost = 0.5 * jnp.sum(off**2) + 0.5 * jnp.sum((problem.pull * z) ** 2)
    return Quadratic(cost, off * rate + problem.pull**2 * z, jnp.diag(rate**2 + problem.pull**2))


def normal_equations(z, problem: RigProblem) -> Quadratic:
    """The loss at z (p,) with its gradient and Gauss-Newton matrix.

    Each row depends only on its own coefficients when these are broadcast to all rows. So one reverse pass per channel gives
    every derivative of every row, and the cost does not grow with the number of coefficients as it does for forward passes.
    The rows go in blocks that fit the processor's cache: 0.7 us per row and two channels of MF-Tyre with 68 coefficients,
    where 100,000 rows at once took 1.8 us.
    """
    table, block = _in_blocks(problem)

    def add(sums: Quadratic, some) -> tuple[Quadratic, None]:
        return jax.tree.map(jnp.add, sums, _of_data(z, block(some))), None

    return lax.scan(add, _prior_loss(z, problem), table)[0]


def _of_data(z, problem: RigProblem) -> Quadratic:
    """The data's part of the normal equations."""
    line = problem.line(z)
    rows = problem.measured.shape[1]

    def channels(*lines):
        values = [p.domain.forward(one) for p, one in zip(problem.chosen, lines, strict=True)]
        return problem.forces(put(problem.law, problem.chosen, values))

    found, pull = jax.vjp(channels, *(jnp.broadcast_to(line[i], (rows,)) for i in range(line.size)))
    value, slope = problem.bend(problem.weight * (found - problem.measured))
    gradient, matrix = jnp.zeros_like(z), jnp.zeros((z.size, z.size), z.dtype)
    for k in range(len(problem.channels)):
        # One row per coefficient: a Jacobian with the axes swapped would be copied number by number.
        slopes = jnp.stack(pull(jnp.zeros_like(found).at[k].set(problem.weight[k] * slope[k])))
        slopes = slopes * problem.scale[:, None]
        gradient = gradient + problem.emphasis[k] * (slopes @ value[k])
        matrix = matrix + problem.emphasis[k] * (slopes @ slopes.T)
    return Quadratic(0.5 * jnp.sum(problem.emphasis * jnp.sum(value**2, axis=1)), gradient, matrix)


def spread_of(z, problem: RigProblem) -> tuple[jax.Array, jax.Array]:
    """The covariance (p, p) of the coordinates at an optimum z (p,), and how many directions the data identify.

    The emphasis changes the minimum, not the information: hence the sandwich, and the number of directions without emphasis.
    The pull counts in the middle of the sandwich as at its ends: coefficients that data do not show stay unknown.
    """
    e, pull = problem.emphasis, jnp.broadcast_to(problem.pull, z.shape)
    matrix = lambda e: normal_equations(z, dataclasses.replace(problem, emphasis=e)).matrix
    found, middle, plain = jax.vmap(matrix)(jnp.stack([e, e**2, jnp.ones_like(e)]))
    spread, _ = inverse_of(found - jnp.diag(pull**2), pull)
    return spread @ middle @ spread, inverse_of(plain - jnp.diag(pull**2), pull)[1]


@eqx.filter_jit
def spread_at_start(problem: RigProblem) -> jax.Array:
    """The covariance (p, p) of the coordinates where the problem starts; for held ones, that of the pull."""
    pull = jnp.broadcast_to(problem.pull, problem.origin.shape)
    return inverse_of(normal_equations(problem.start(), problem).matrix - jnp.diag(pull**2), pull)[0]


def inverse_of(information, pull) -> tuple[jax.Array, jax.Array]:
    """The inverse (p, p) of an information matrix with the pull (p,), and how many directions it identifies.

    A direction is identified if its standard error is below one step, a coefficient's own size: above, it comes from the pull.
    """
    known = jnp.sum(jnp.linalg.eigvalsh(information) > 1.0)
    # On scales on which the pull is one, so that no eigenvalue is lost in the rounding of the largest.
    values, vectors = jnp.linalg.eigh(information / pull / pull[:, None])
    inverse = (vectors / (jnp.maximum(values, 0.0) + 1.0)) @ vectors.T
    return inverse / pull / pull[:, None], known


def _in_blocks(problem: RigProblem) -> tuple[Any, Callable[[Any], RigProblem]]:
    """The arrays with one number per row, cut into blocks (b, ..., size), and a function that gives the problem of one block.

    The last block is filled up with copies of the last row, without weight.
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


def of_common_length(problem: RigProblem) -> RigProblem:
    """The problem filled up with copies of its last row, without weight, so that tables of similar length share a program; not
    traced."""
    contact, measured = rows_of_common_length(problem.contact, problem.measured)
    weight = fill_up(problem.weight, measured.shape[1], "constant")
    return dataclasses.replace(problem, contact=contact, measured=measured, weight=weight)


def rows_of_common_length(contact: Contact, measured: Any) -> tuple[Contact, Any]:
    """The contact and the measurements (m, n), with copies of the last row up to a common length."""
    rows = measured.shape[1]
    length = common_length(rows) if rows <= SHARED else rows
    longer = lambda leaf: fill_up(leaf, length, "edge") if jnp.shape(leaf) == (rows,) else leaf
    return jax.tree.map(longer, contact), fill_up(measured, length, "edge")


def fill_up(leaf: Any, length: int, mode: Any) -> Any:
    """Numbers by row (..., n) up to a length: by the last row's ("edge"), or by zeros ("constant")."""
    values = np.asarray(leaf)
    more = length - values.shape[-1]
    return jax.device_put(np.pad(values, [(0, 0)] * (values.ndim - 1) + [(0, more)], mode=mode))


def contact_of(rig) -> Contact:
    """The contact of each row of a `RigTable`."""
    array = lambda values: None if values is None else jax.device_put(np.asarray(values))
    return Contact(
        slip_angle=array(rig.slip_angle),
        slip_ratio=array(rig.slip_ratio),
        load=array(rig.load),
        camber=0.0 if rig.camber is None else array(rig.camber),
        # Rigs that do not record the speed write zero throughout.
        speed=None if rig.speed is None or not np.any(rig.speed) else array(rig.speed),
        pressure=array(rig.pressure),
    )


def offered_forces(law: AbstractTyre, contact: Contact) -> tuple[str, ...]:
    """The forces and moments that a law computes (those that are not a plain zero)."""
    one = jax.tree.map(lambda values: np.asarray(values)[:1] if jnp.ndim(values) else values, contact)
    found = eqx.filter_eval_shape(law.forces, one)
    return tuple(name for name, value in found._asdict().items() if not isinstance(value, float))


def start_of(law: AbstractTyre, parameters: tuple[Parameter, ...]) -> tuple[jax.Array, jax.Array]:
    """Origin and scale (p,) of the coordinates. The scale of a real coefficient is its own size or the declared scale, the
    larger; of a positive or bounded one it is one on the bijector's real line (for a positive one a factor of e)."""
    origin, scale = [], []
    for p, value in zip(parameters, pick(law, parameters), strict=True):
        value = jnp.asarray(value)
        origin.append(p.domain.inverse(value))
        step = jnp.asarray(1.0 if p.scale is None else abs(p.scale), value.dtype)
        scale.append(jnp.where(_is_real(p), jnp.maximum(step, jnp.abs(value)), 1.0))
    return jnp.stack(origin), jnp.stack(scale)


def _is_real(p: Parameter) -> bool:
    return isinstance(p.domain, Real)

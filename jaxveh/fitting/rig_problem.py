"""Residuals of rig data: rows, weights, chosen coefficients, and their Jacobian row by row."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.parameter import Parameter, pick, put
from jaxveh.tyres import AbstractTyre, Contact

PULL = 0.01
"""How hard a coefficient is pulled to its start, in standard deviations a step: nothing against what data show, but what they do
not show stays where it was."""

KINK = 2.0
"""Residuals above this many standard deviations count by their size, not by their square, where a fit is robust."""


class RigProblem(eqx.Module):
    """Rig data, a law and what of it is to be fitted.

    `contact` (n,) arrays; `measured` (m, n), the forces and moments `channels`, zero where there is no measurement; `weight`
    (m, n), one over the standard deviation, zero where a row does not count. `scale` (p,): the step of each coefficient that
    counts as one, on its bijector's line, from `origin` (p,).
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
        # The square of the result is the pseudo-Huber loss 2 k^2 (sqrt(1 + (r / k)^2) - 1): smooth, linear far out.
        root = jnp.sqrt(1 + (residual / KINK) ** 2)
        shrink = jnp.sqrt(2 / (root + 1))
        return residual * shrink, shrink * (1 - 0.5 * (root - 1) / root)


@eqx.filter_custom_jvp
def residuals(z, problem: RigProblem):
    """Residuals (m n + p,) at the coordinates z; the last ones are the pull to the start."""
    difference = problem.weight * (problem.forces(problem.filled(z)) - problem.measured)
    return jnp.concatenate([problem.bent(difference)[0].reshape(-1), PULL * z])


@residuals.def_jvp
def _residuals_jvp(primals, tangents):
    z, problem = primals
    value, jacobian = with_jacobian(z, problem)
    move = tangents[0]
    return jnp.concatenate([value, PULL * z]), jnp.concatenate([jacobian @ move, PULL * move])


def with_jacobian(z, problem: RigProblem) -> tuple[Any, Any]:
    """Residuals (m n,) and their Jacobian (m n, p).

    A row of data sees its own force alone, so that with coefficients as wide as the rows one pass backward a channel gives
    every derivative of every row: the cost does not grow with the number of coefficients, as that of passes forward does.
    """
    line = problem.origin + problem.scale * z
    rows = problem.measured.shape[1]

    def channels(*lines):
        values = [p.domain.forward(one) for p, one in zip(problem.parameters, lines, strict=True)]
        return problem.forces(put(problem.law, problem.parameters, values))

    found, pull = jax.vjp(channels, *(jnp.broadcast_to(line[i], (rows,)) for i in range(line.size)))
    value, slope = problem.bent(problem.weight * (found - problem.measured))
    blocks = []
    for k in range(len(problem.channels)):
        seed = jnp.zeros_like(found).at[k].set(problem.weight[k] * slope[k])
        blocks.append(jnp.stack(pull(seed), axis=1))
    return value.reshape(-1), jnp.concatenate(blocks) * problem.scale


def contact_of(rig) -> Contact:
    """The contact of each row of a `RigTable`."""
    optional = lambda values: None if values is None else jnp.asarray(values)
    return Contact(
        slip_angle=jnp.asarray(rig.slip_angle),
        slip_ratio=jnp.asarray(rig.slip_ratio),
        load=jnp.asarray(rig.load),
        camber=0.0 if rig.camber is None else jnp.asarray(rig.camber),
        speed=optional(rig.speed),
        pressure=optional(rig.pressure),
    )


def offered(law: AbstractTyre, contact: Contact) -> tuple[str, ...]:
    """The forces and moments that a law has (those that are no plain zero)."""
    one = jax.tree.map(lambda values: values[:1] if jnp.ndim(values) else values, contact)
    found = eqx.filter_eval_shape(law.forces, one)
    return tuple(name for name, value in found._asdict().items() if not isinstance(value, float))


def start_of(law: AbstractTyre, parameters: tuple[Parameter, ...]) -> tuple[jax.Array, jax.Array]:
    """Origin and scale (p,) of the coordinates: a declared scale, or a tenth of itself for what is positive or bounded."""
    origin, scale = [], []
    for p, value in zip(parameters, pick(law, parameters), strict=True):
        value = jnp.asarray(value)
        origin.append(p.domain.inverse(value))
        step = jnp.asarray(1.0 if p.scale is None else abs(p.scale), value.dtype)
        scale.append(jnp.where(_is_real(p), jnp.maximum(step, jnp.abs(value)), 1.0))
    return jnp.stack(origin), jnp.stack(scale)


def _is_real(p: Parameter) -> bool:
    from jaxveh._core.bijectors import Real

    return isinstance(p.domain, Real)

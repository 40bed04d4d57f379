"""RK4 with the four stages written out, as a diffrax solver; and the step from one row to the next."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.statespace.model import LinearInput


class RK4(diffrax.AbstractSolver):
    """The classical Runge-Kutta method of fourth order (Kutta 1901), fixed step, no error estimate.

    The stages are written out: a Butcher tableau keeps a stage buffer that costs 1.3 times in a batch and 2 to 4 times
    under `vmap`. A barrier after each stage keeps XLA from computing a stage anew in every consumer.

    `rolled`: the four stages as a loop over one, for a single run of a car of many equations: half the time to compile
    (SevenDOF: 5.3 instead of 9.7 s), and a fifth faster there; a batch is faster written out.
    """

    rolled: bool = eqx.field(static=True, default=False)

    term_structure: ClassVar = diffrax.AbstractTerm
    interpolation_cls: ClassVar[Callable] = diffrax.LocalLinearInterpolation

    def order(self, terms):
        return 4

    def init(self, terms, t0, t1, y0, args):
        return None

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        del solver_state, made_jump
        y1 = self._in_a_loop(terms, t0, t1, y0, args) if self.rolled else self._written_out(terms, t0, t1, y0, args)
        return y1, None, dict(y0=y0, y1=y1), None, diffrax.RESULTS.successful

    def func(self, terms, t0, y0, args):
        return terms.vf(t0, y0, args)

    def _written_out(self, terms, t0, t1, y0, args):
        dt = terms.contr(t0, t1)
        half = t0 + (t1 - t0) / 2

        def stage(t, y):
            return numerics.barrier(terms.vf_prod(t, y, args, dt))

        def ahead(share, k):
            return jax.tree.map(lambda y, d: y + share * d, y0, k)

        k1 = stage(t0, y0)
        k2 = stage(half, ahead(0.5, k1))
        k3 = stage(half, ahead(0.5, k2))
        k4 = stage(t1, ahead(1.0, k3))
        y1 = jax.tree.map(lambda y, a, b, c, d: y + (a + 2 * b + 2 * c + d) / 6, y0, k1, k2, k3, k4)
        return numerics.barrier(y1)

    def _in_a_loop(self, terms, t0, t1, y0, args):
        dt = terms.contr(t0, t1)

        def stage(carry, coefficients):
            k, total = carry
            ahead, weight = coefficients
            k = terms.vf_prod(t0 + ahead * (t1 - t0), jax.tree.map(lambda y, d: y + ahead * d, y0, k), args, dt)
            return (k, jax.tree.map(lambda so_far, d: so_far + weight * d, total, k)), None

        none = jax.tree.map(jnp.zeros_like, y0)
        table = jnp.asarray([[0.0, 1 / 6], [0.5, 1 / 3], [0.5, 1 / 3], [1.0, 1 / 6]], jnp.result_type(t0))
        (_, total), _ = jax.lax.scan(stage, (none, none), (table[:, 0], table[:, 1]))
        return jax.tree.map(jnp.add, y0, total)


class Heun(diffrax.AbstractSolver):
    """Heun's method of second order (1900), fixed step, no error estimate: half the work of `RK4`.

    For models whose poles are slow against the step, such as handling at 100 Hz. Written out as `RK4` is.
    """

    term_structure: ClassVar = diffrax.AbstractTerm
    interpolation_cls: ClassVar[Callable] = diffrax.LocalLinearInterpolation

    def order(self, terms):
        return 2

    def init(self, terms, t0, t1, y0, args):
        return None

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        del solver_state, made_jump
        dt = terms.contr(t0, t1)
        k1 = numerics.barrier(terms.vf_prod(t0, y0, args, dt))
        k2 = numerics.barrier(terms.vf_prod(t1, jax.tree.map(jnp.add, y0, k1), args, dt))
        y1 = numerics.barrier(jax.tree.map(lambda y, a, b: y + 0.5 * (a + b), y0, k1, k2))
        return y1, None, dict(y0=y0, y1=y1), None, diffrax.RESULTS.successful

    def func(self, terms, t0, y0, args):
        return terms.vf(t0, y0, args)


class Propagate(eqx.Module):
    """A continuous model as a filter's `transition(system, t0, t1, x, u)`: explicit fixed steps of a diffrax solver.

    `derivatives(system, t, x, u) -> dx/dt` is elementwise in a batch of states, so that a whole batch is one call. `steps`
    divides the interval between two rows. The solver's `step` is called directly, never `diffeqsolve` per particle.
    """

    derivatives: Callable = eqx.field(static=True)
    solver: diffrax.AbstractSolver = eqx.field(static=True, default=RK4())
    steps: int = eqx.field(static=True, default=1)

    def __call__(self, system, t0, t1, x, u):
        term = diffrax.ODETerm(lambda t, y, args: self.derivatives(system, t, y, _at(args, t)))
        dt = (t1 - t0) / self.steps
        state = None
        for i in range(self.steps):
            start, end = t0 + i * dt, (t1 if i == self.steps - 1 else t0 + (i + 1) * dt)
            state = self.solver.init(term, start, end, x, u) if i == 0 else state
            x, _, _, state, _ = self.solver.step(term, start, end, x, u, state, made_jump=jnp.array(False))
        return x


def _at(u, t):
    return u.at(t) if isinstance(u, LinearInput) else u

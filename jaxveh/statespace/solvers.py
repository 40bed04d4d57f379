"""RK4 with the four stages written out, as a diffrax solver; and the step from one row to the next."""

from __future__ import annotations

import abc
import functools
from collections.abc import Callable, Sequence
from typing import ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_kind, check_takes, check_whole, word_for
from jaxveh._core.traced import trace_once
from jaxveh.statespace.model import LinearInput


class AbstractOneStep(diffrax.AbstractSolver):
    """An explicit method that uses only the state at the step's start, without an error estimate."""

    term_structure: ClassVar = diffrax.AbstractTerm
    interpolation_cls: ClassVar[Callable] = diffrax.LocalLinearInterpolation
    step_order: eqx.AbstractClassVar[int]

    @abc.abstractmethod
    def end(self, terms, t0, t1, y0, args):
        """The state at t1."""

    def order(self, terms):
        return self.step_order

    def init(self, terms, t0, t1, y0, args):
        return None

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        del solver_state, made_jump
        y1 = self.end(terms, t0, t1, y0, args)
        return y1, None, dict(y0=y0, y1=y1), None, diffrax.RESULTS.successful

    def func(self, terms, t0, y0, args):
        return terms.vf(t0, y0, args)


class RK4(AbstractOneStep):
    """The classical Runge-Kutta method of fourth order (Kutta 1901), fixed step, no error estimate.

    The stages are written out: the stage buffer of a Butcher tableau would take 1.3 times as long in a batch and 2 to 4 times
    under `vmap`. A fence after each stage keeps XLA from recomputing a stage wherever it is used.
    """

    step_order: ClassVar[int] = 4

    def end(self, terms, t0, t1, y0, args):
        dt = terms.contr(t0, t1)
        half = t0 + (t1 - t0) / 2

        def stage(t, y):
            return numerics.fence(terms.vf_prod(t, y, args, dt), firm=True)

        def ahead(share, k):
            return jax.tree.map(lambda y, d: y + share * d, y0, k)

        k1 = stage(t0, y0)
        k2 = stage(half, ahead(0.5, k1))
        k3 = stage(half, ahead(0.5, k2))
        k4 = stage(t1, ahead(1.0, k3))
        y1 = jax.tree.map(lambda y, a, b, c, d: y + (a + 2 * b + 2 * c + d) / 6, y0, k1, k2, k3, k4)
        return numerics.fence(y1)


def stages_in_a_loop(stage: Callable, carry: tuple, *columns: Sequence[float]) -> tuple:
    """`carry = stage(carry, *numbers)` for each stage of a method, whose numbers are the columns' rows: one stage's program, and
    for reverse mode only the carries are kept."""
    dtype = jnp.result_type(*jax.tree.leaves(carry))

    @functools.partial(jax.checkpoint, prevent_cse=False)
    def one(carry, numbers):
        return stage(carry, *numbers), None

    return jax.lax.scan(one, carry, tuple(jnp.asarray(column, dtype) for column in columns))[0]


class RolledRK4(AbstractOneStep):
    """The same method as `RK4` with its four stages in a loop: a quarter of the program's size.

    For gradients through rates of hundreds of operations: reverse mode keeps only the states of the stages and recomputes each
    stage for its slopes. Value and gradient of 100 7-DOF cars over 1000 steps of 1 ms take 6.0 times as long as the value and
    1.1 MB (8.8 times and 6.3 MB with `RK4`), and compile in 7 instead of 60 s. Without gradients it takes 1.05 times as long as
    `RK4`.
    """

    step_order: ClassVar[int] = 4

    def end(self, terms, t0, t1, y0, args):
        dt = terms.contr(t0, t1)

        def stage(carry, reach, weight):
            k, y1 = carry
            y = jax.tree.map(lambda y, d: y + reach * d, y0, k)
            k = numerics.fence(terms.vf_prod(t0 + reach * (t1 - t0), y, args, dt), firm=True)
            return k, jax.tree.map(lambda y, d: y + weight * d, y1, k)

        none = jax.tree.map(jnp.zeros_like, y0)
        return stages_in_a_loop(stage, (none, y0), (0, 0.5, 0.5, 1), (1 / 6, 1 / 3, 1 / 3, 1 / 6))[1]


class Heun(AbstractOneStep):
    """Heun's method of second order (1900), fixed step, no error estimate: half the work of `RK4`.

    For models whose poles are slow compared with the step, such as handling at 100 Hz. Written out like `RK4`.
    """

    step_order: ClassVar[int] = 2

    def end(self, terms, t0, t1, y0, args):
        dt = terms.contr(t0, t1)
        k1 = numerics.fence(terms.vf_prod(t0, y0, args, dt))
        k2 = numerics.fence(terms.vf_prod(t1, jax.tree.map(jnp.add, y0, k1), args, dt))
        return numerics.fence(jax.tree.map(lambda y, a, b: y + 0.5 * (a + b), y0, k1, k2))


EXPLICIT = (AbstractOneStep, diffrax.AbstractERK, diffrax.Euler)
"""Explicit solvers, the package's own and those of diffrax."""


def in_both_modes(solver: diffrax.AbstractSolver) -> diffrax.AbstractSolver:
    """The solver, whose steps can be differentiated in forward and in reverse mode.

    The stages of diffrax's Runge-Kutta methods are a loop of one of three kinds (`scan_kind`); unless the solver was made with
    another, it is one for reverse mode alone.
    """
    if not isinstance(solver, diffrax.AbstractRungeKutta) or solver.scan_kind is not None:
        return solver
    return eqx.tree_at(lambda one: one.scan_kind, solver, "bounded", is_leaf=lambda leaf: leaf is None)


class Propagate(eqx.Module):
    """A continuous model as a filter's `transition(system, t0, t1, x, u)`: explicit fixed steps of a diffrax solver.

    `derivatives(system, t, x, u) -> dx/dt` is elementwise in a batch of states, so that a whole batch is one call. `steps`:
    the number of steps between two rows. The solver's `step` is called directly, never `diffeqsolve` per particle.
    """

    derivatives: Callable = eqx.field(static=True)
    solver: diffrax.AbstractSolver = eqx.field(static=True, default=RK4())
    steps: int = eqx.field(static=True, default=1)

    def __check_init__(self):
        check_takes("Propagate: derivatives", self.derivatives, "system", "t", "x", "u")
        check_kind("solver", self.solver, diffrax.AbstractSolver, "Take one such as statespace.RK4() (called).")
        check_whole("Propagate: steps", self.steps)

    def __call__(self, system, t0, t1, x, u):
        term = diffrax.ODETerm(lambda t, y, args: trace_once(_rates, self.derivatives, system, t, y, args))
        dt, solver = (t1 - t0) / self.steps, in_both_modes(self.solver)
        state = None
        for i in range(self.steps):
            start, end = t0 + i * dt, (t1 if i == self.steps - 1 else t0 + (i + 1) * dt)
            state = solver.init(term, start, end, x, u) if i == 0 else state
            x, _, _, state, _ = solver.step(term, start, end, x, u, state, made_jump=jnp.array(False))
        return x


def _rates(derivatives, system, t, x, u):
    rates = derivatives(system, t, x, u.at(t) if isinstance(u, LinearInput) else u)
    if getattr(rates, "_fields", None) != getattr(x, "_fields", None):
        raise InputError(f"Propagate: derivatives returned {word_for(rates)}: must return the rates, {word_for(x)}.")
    return rates if type(rates) is type(x) else type(x)(*rates)

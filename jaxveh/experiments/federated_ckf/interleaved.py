"""Several estimators that take turns on the same rows, each believing what the others said last."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh.experiments.federated_ckf.model import MOVE, Planar, State, sensor_outputs
from jaxveh.statespace import AbstractFilter, LinearInput, Row, StateSpace


class Told(NamedTuple):
    """What the estimators know of each other after a row: its time (s) and inputs, the car with the latest parameters, and the
    latest state."""

    t: Any
    u: Any
    car: Planar
    state: Any


class Member(NamedTuple):
    """One estimator: its filter and model, the system that its model gets from what is told, and what it then tells:
    `tell(mean, told) -> told`."""

    filter: AbstractFilter
    model: StateSpace
    system: Callable[[Told], Any]
    tell: Callable[[Any, Told], Told]


def take_turns(members: tuple[Member, ...], told: Told, rows: Row) -> tuple[Any, Any, Any]:
    """Means and covariances of every member and row, tuples of (T, n) and (T, n, n), and what was told, leaves (T, ...).

    All see what was told after the row before, as the paper has it: means alone, as if they were certain.
    """

    def after(told, beliefs, row):
        later = told._replace(t=row.t, u=row.u)
        for member, belief in zip(members, beliefs, strict=True):
            later = member.tell(belief.mean, later)
        kept = tuple((jnp.stack(belief.mean), belief.covariance) for belief in beliefs)
        return later, kept

    def model(member: Member, told: Told) -> StateSpace:
        return eqx.tree_at(lambda m: m.system, member.model, member.system(told), is_leaf=lambda v: v is None)

    first, rest = jax.tree.map(lambda leaf: leaf[0], rows), jax.tree.map(lambda leaf: leaf[1:], rows)
    beliefs = tuple(member.filter.init(model(member, told), first)[0] for member in members)
    told, start = after(told, beliefs, first)

    def step(carry, row):
        told, beliefs = carry
        beliefs = tuple(
            member.filter.step(model(member, told), belief, row)[0]
            for member, belief in zip(members, beliefs, strict=True)
        )
        told, kept = after(told, beliefs, row)
        return (told, beliefs), (kept, told)

    _, (later, tolds) = jax.lax.scan(step, (told, beliefs), rest)
    join = lambda one, many: jnp.concatenate([jnp.asarray(one)[None], many])
    kept = jax.tree.map(join, start, later)
    return tuple(k[0] for k in kept), tuple(k[1] for k in kept), jax.tree.map(join, told, tolds)


def propagate(told: Told, car: Planar, t, u) -> State:
    """Where the car is at `t` with these parameters, from where it was told to be."""
    path = LinearInput(told.t, jnp.where(t > told.t, t, told.t + 1.0), told.u, u)
    return MOVE(car, told.t, t, told.state, path)


def stays(system, t0, t1, x, u):
    """Parameters stay."""
    del system, t0, t1, u
    return x


class SeenThrough(eqx.Module):
    """What the sensors say of a car with the estimated parameters, `put(car, x)`, from where it was a row ago."""

    put: Callable = eqx.field(static=True)

    def __call__(self, told: Told, t, x, u):
        car, shape = self.put(told.car, x), jnp.shape(x[0])
        here = told._replace(state=jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, shape), told.state))
        return sensor_outputs(car, t, propagate(here, car, t, u), u)

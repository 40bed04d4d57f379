"""MF-Tyre 6.1 in combined slip: forces and moments of many contacts, and the gradient with respect to all inputs."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics, tyres
from jaxveh.tyres import mf_tyre

from . import limit, ours
from .measure import Bound, Case, Contestant, Skipped
from .mf_tyre_problem import COEFFICIENTS, Contacts, contacts
from .peers import numpy_mf_tyre

__all__ = ["cases", "contact", "tyre", "weighted_sum", "weighted_sum_in_blocks"]

OURS, LIMIT, VALUE, GRADIENT, PLAIN = "jaxveh", "C++ limit", "value", "value and gradient", "the same, not in blocks"


def cases(smoke: bool) -> list[Case]:
    """Return the cases: forces and moments in both precisions; the gradient in reverse mode, in blocks and plain."""
    count = 50 if smoke else 100_000
    made = []
    for dtype in ("float64", "float32"):
        made.append(
            Case(
                name=f"tyres/mf-{dtype}",
                title=f"MF-Tyre 6.1, combined slip, forces and moments of {count} contacts, {dtype}",
                unit="ns a contact",
                build=functools.partial(_build, np.dtype(dtype), count),
                base=LIMIT,
                bounds=(Bound(OURS, (LIMIT,), 2.0),) if dtype == "float64" else (),
            )
        )
    # A gradient compiles for ten seconds: one is enough to show that it runs.
    for dtype in ("float64",) if smoke else ("float64", "float32"):
        made.append(
            Case(
                name=f"tyres/gradient-{dtype}",
                title=f"Gradient: MF-Tyre 6.1 with respect to coefficients and {count} contacts, {dtype}",
                unit="ns a contact",
                build=functools.partial(_pair, np.dtype(dtype), count, not smoke),
                base=VALUE,
                bounds=(Bound(GRADIENT, (VALUE,), 6.0),) if dtype == "float64" else (),
            )
        )
    return made


def tyre(dtype: np.typing.DTypeLike, coefficients: Mapping[str, float] = COEFFICIENTS) -> mf_tyre.MFTyre:
    """Return the tyre with these coefficients, as from a property file."""
    sections = (
        mf_tyre.Structure,
        mf_tyre.LongitudinalCoefficients,
        mf_tyre.LateralCoefficients,
        mf_tyre.AligningCoefficients,
        mf_tyre.OverturningCoefficients,
        mf_tyre.RollingCoefficients,
        mf_tyre.Scaling,
        mf_tyre.Ranges,
    )
    made = mf_tyre.MFTyre(*[section(**_coefficients(section, coefficients)) for section in sections])
    return jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype), made)


def _coefficients(section: type, given: Mapping[str, float]) -> dict[str, float]:
    names = [field.name for field in dataclasses.fields(section)]
    return {name: given[name] for name in names if name in given}


def contact(given: Contacts) -> tyres.Contact:
    """Return the contacts in the library's form."""
    return tyres.Contact(**{name: jnp.asarray(array) for name, array in given._asdict().items()})


def _build(dtype: np.dtype, count: int) -> Sequence[Contestant | Skipped]:
    given = contacts(count, dtype=dtype.type)
    with ours.precision(dtype):
        arguments = tyre(dtype), contact(given)
    run = jax.jit(lambda tyre, contact: tyre.forces(contact))

    def call(index: int) -> object:
        with ours.precision(dtype):
            return run(*arguments)

    made: list[Contestant | Skipped] = [Contestant(OURS, ours.blocked(call), count)]
    reason = limit.unavailable()
    if reason:
        made.append(Skipped(LIMIT, reason))
    else:
        compiled = limit.mf_tyre(given, dtype=dtype)
        made.append(Contestant(LIMIT, lambda index: compiled(), count))
    made.append(Contestant("NumPy", lambda index: numpy_mf_tyre.forces(COEFFICIENTS, given), count))
    return made


def weighted_sum(tyre: mf_tyre.MFTyre, contact: tyres.Contact, weights: Sequence[jax.Array]) -> jax.Array:
    """Return all forces and moments, randomly weighted, as one number, whose gradient involves every output."""
    return jnp.sum(_weighted(tyre, (contact, weights)))


def weighted_sum_in_blocks(tyre: mf_tyre.MFTyre, contact: tyres.Contact, weights: Sequence[jax.Array]) -> jax.Array:
    """Return the same number; its gradient is computed block by block."""
    return numerics.sum_in_blocks(_weighted, tyre, (contact, weights))


def _weighted(tyre: mf_tyre.MFTyre, rows: tuple[tyres.Contact, Sequence[jax.Array]]) -> jax.Array:
    contact, weights = rows
    products = [weight * force for weight, force in zip(weights, tyre.forces(contact), strict=True)]
    return functools.reduce(jnp.add, products)


def _pair(dtype: np.dtype, count: int, with_plain: bool) -> Sequence[Contestant]:
    with ours.precision(dtype):
        weights = [jnp.asarray(w, dtype) for w in np.random.default_rng(1).standard_normal((5, count))]
        arguments = tyre(dtype), contact(contacts(count, dtype=dtype.type)), weights
    value = jax.jit(lambda tyre, contact, weights: tyre.forces(contact))
    gradient = jax.jit(jax.value_and_grad(weighted_sum_in_blocks, argnums=(0, 1)))
    plain = jax.jit(jax.value_and_grad(weighted_sum, argnums=(0, 1)))

    def calling(function: Callable) -> Callable[[int], object]:
        def call(index: int) -> object:
            with ours.precision(dtype):
                return function(*arguments)

        return ours.blocked(call)

    made = [Contestant(VALUE, calling(value), count), Contestant(GRADIENT, calling(gradient), count)]
    return [*made, Contestant(PLAIN, calling(plain), count)] if with_plain else made

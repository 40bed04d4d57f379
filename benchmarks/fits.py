"""MF-Tyre's slip forces fitted to rig data: jaxveh, already compiled, and scipy's least squares on the NumPy formula."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxveh._core.parameter import resolve
from jaxveh.fitting import RigProblem, rig_problem, rig_stages
from jaxveh.fitting.problem import SearchEnd
from jaxveh.fitting.rig_data import leaf_of
from jaxveh.tyres import mf_tyre

from . import ours
from .measure import Bound, Case, Contestant, Skipped
from .mf_tyre_problem import COEFFICIENTS, Contacts, contacts
from .peers import numpy_mf_tyre
from .tyres import contact, tyre

__all__ = ["Rig", "by_scipy", "cases", "make_rig", "ours_compiled"]

OURS, SCIPY = "jaxveh", "scipy"
METHODS = ("lm", "trf")
NOISE = 30.0
"""Standard deviation of a measured force, N."""
TOLERANCE, STEPS = 1e-7, 200
FORCES = ("F_x", "F_y")


def cases(smoke: bool) -> list[Case]:
    """Return the case: one fit to pure and combined slip."""
    count = 200 if smoke else 2000
    return [
        Case(
            name="fits/mf-slip",
            title=f"Fit of MF-Tyre 6.1, F_x and F_y, {len(_names())} coefficients, {count} rows, float64",
            unit="ms a fit",
            build=functools.partial(_build, count, METHODS[:1] if smoke else METHODS),
            base=OURS,
            bounds=(Bound(OURS, tuple(f"{SCIPY}, {method}" for method in METHODS), 1 / 20),),
        )
    ]


class Rig(NamedTuple):
    """A problem: contacts, forces measured at them (2, n) in N, and the start values of the coefficients by name."""

    contacts: Contacts
    measured: np.ndarray
    start: dict[str, float]


def make_rig(count: int, seed: int = 0) -> Rig:
    """Return forces of `COEFFICIENTS` with noise, and a start with an error of up to a tenth in each coefficient."""
    rng = np.random.default_rng(seed)
    given = contacts(count, seed)
    c = numpy_mf_tyre.of_type(np.dtype(float), COEFFICIENTS)
    forces = np.stack(numpy_mf_tyre.slip_forces(c, numpy_mf_tyre.operating(c, given)))
    start = {name: COEFFICIENTS[name] * (1 + 0.1 * rng.uniform(-1, 1)) for name in map(_short, _names())}
    return Rig(given, forces + NOISE * rng.standard_normal(forces.shape), start)


def ours_compiled(rig: Rig) -> tuple[RigProblem, Callable[[], SearchEnd]]:
    """Return the problem of the joint stage of `fit_rig`, and its fit."""
    law = _started(rig.start)
    parameters = resolve(law, lambda law: [leaf_of(law, name) for name in _names()])
    origin, scale = rig_problem.start_of(law, parameters)
    weight = jnp.full(rig.measured.shape, 1 / NOISE)
    once, none = jnp.ones(len(FORCES)), jnp.full_like(origin, jnp.inf)
    problem = RigProblem(
        law=law, contact=contact(rig.contacts), measured=jnp.asarray(rig.measured), weight=weight, emphasis=once, origin=origin,
        scale=scale, centre=origin, spread=none, pull=jnp.asarray(rig_problem.PULL), chosen=parameters, channels=FORCES,
        robust=False,
    )  # fmt: skip
    search = eqx.filter_jit(lambda problem: problem.search(problem.start(), STEPS, TOLERANCE))
    return problem, lambda: search(problem)


def by_scipy(rig: Rig, problem: RigProblem, method: str) -> Callable[[], Any]:
    """Return the same fit by `scipy.optimize.least_squares`: same coordinates, start and tolerance, forward differences."""
    from scipy.optimize import least_squares

    names = [_short(p.name) for p in problem.chosen]
    origin, scale = np.asarray(problem.origin), np.asarray(problem.scale)
    c = numpy_mf_tyre.of_type(np.dtype(float), {**COEFFICIENTS, **rig.start})
    at = numpy_mf_tyre.operating(c, rig.contacts)

    def residuals(z: np.ndarray) -> np.ndarray:
        vars(c).update(zip(names, origin + scale * z, strict=True))
        F_x, F_y = numpy_mf_tyre.slip_forces(c, at)
        return np.concatenate([(F_x - rig.measured[0]) / NOISE, (F_y - rig.measured[1]) / NOISE, rig_problem.PULL * z])

    # It stops at the first of its tests that holds, as jaxveh does; the test of the gradient is disabled.
    settings = {"ftol": TOLERANCE, "xtol": TOLERANCE, "gtol": 1e-15, "x_scale": 1.0, "method": method}
    return lambda: least_squares(residuals, np.zeros(origin.size), "2-point", **settings)


def _build(count: int, methods: Sequence[str]) -> Sequence[Contestant | Skipped]:
    rig = make_rig(count)
    problem, fit = ours_compiled(rig)
    made: list[Contestant | Skipped] = [Contestant(OURS, ours.blocked(lambda index: fit()), 1)]
    for method in methods:
        name = f"{SCIPY}, {method}"
        try:
            run = by_scipy(rig, problem, method)
        except ImportError as error:
            made.append(Skipped(name, f"not installed here ({error.name})"))
            continue
        made.append(Contestant(name, lambda index, run=run: run(), 1))
    return made


def _names() -> list[str]:
    """Return the coefficients of F_x and F_y that are identifiable from data with varying load, camber and pressure."""
    groups = rig_stages.ALONG, rig_stages.ALONG_COMBINED, rig_stages.ACROSS, rig_stages.ACROSS_COMBINED
    return [name for group in groups for name in group.identifiable({"load", "camber", "pressure"})]


def _started(start: dict[str, float]) -> mf_tyre.MFTyre:
    return tyre(np.float64, {**COEFFICIENTS, **start})


def _short(name: str) -> str:
    """Return the name in a property file."""
    return name.rpartition(".")[2]

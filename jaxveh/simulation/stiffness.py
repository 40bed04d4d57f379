"""The fastest motion of a simulated car, and the solver that it requires."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from jaxveh import numerics
from jaxveh._core.errors import check_kind
from jaxveh.sensors import Instrumented
from jaxveh.simulation.driven import Driven, DrivenState, dtype_of
from jaxveh.statespace import Heun, RolledRK4, StabilisedRK4
from jaxveh.vehicles import kit

STABLE = 2.5
"""Step times fastest pole up to which RK4 decays with it; its limit is 2.79 on the real and 2.83 on the imaginary axis."""

LIMIT = 2.75
"""Step times fastest pole beyond which RK4 grows or rings."""

STABILISED, STABILISED_LIMIT = 16.5, 17.8
"""The same two for `StabilisedRK4`, whose limit is 18.2 on the real axis, for the real poles of spins."""

LEAST_STEP = 2.5e-4
"""s: for shorter steps an implicit solver is cheaper."""

SQUARINGS = 10
"""Of the Jacobian, whose power 1024 shows its largest eigenvalue."""

LEAST_SIZE = 1e-30

LOOKS = 16
"""Number of rows of a simulation that are checked."""


SLOW_POLE = 1000.0
"""1/s: of slow states, several hundred at walking speed, with a margin."""

FAST_POLE = 8000.0
"""1/s: the same of the other states. Spins of the package's cars have at most 5500 at standstill, 7100 when they brake fully."""


def limits(solver: Any) -> tuple[float, float]:
    """The largest product of pole and step for which equal steps of a solver are stable, and one well inside; both are infinite
    for an implicit solver.

    Explicit methods of one or two stages allow 2, those with more stages at least as much as RK4 (E. Hairer and G. Wanner,
    Solving Ordinary Differential Equations II, sec. IV.2).
    """
    if isinstance(solver, diffrax.AbstractImplicitSolver):
        return math.inf, math.inf
    if isinstance(solver, StabilisedRK4):
        return STABILISED_LIMIT, STABILISED
    few = isinstance(solver, Heun | diffrax.Euler | diffrax.Heun | diffrax.Midpoint | diffrax.Ralston)
    return (2.0, 1.8) if few else (LIMIT, STABLE)


class SolverChoice(NamedTuple):
    """How `solve` integrates: `solver` (one of diffrax) takes equal steps of at most `max_step` (s), unless a diffrax
    `controller` chooses the steps (None: equal steps)."""

    solver: diffrax.AbstractSolver
    controller: diffrax.AbstractStepSizeController | None
    max_step: float


def fastest_pole(driven: Driven, t: Any, x: Any) -> jax.Array:
    """The spectral radius of the Jacobian of car, driver and sensors at one instant, 1/s, within a few per cent.

    The sensors' low-pass does not act on the car, so its poles are taken separately.
    """
    check_kind("fastest_pole: driven", driven, Driven, "simulation.driven_car returns one.")
    bare = Driven(Instrumented(driven.car.vehicle), driven.driver)
    flat, shaped = ravel_pytree(DrivenState(driven.car.split(x.car)[0], x.driver))
    found = spectral_radius(differences(lambda y: ravel_pytree(bare.derivatives(t, shaped(y)))[0], flat))
    return jnp.maximum(found, jnp.asarray(sensors_pole(driven), found.dtype))


def differences(rates: Callable, x: jax.Array) -> jax.Array:
    """The Jacobian (n, n) of `rates` at x (n,), by central differences.

    The rates of a car are hundreds of operations: this program has them once. With the rules of differentiation it takes four
    times as long to compile (the most detailed car: 45 instead of 10 s).
    """
    reach = jnp.finfo(x.dtype).eps ** 0.4 * jnp.maximum(jnp.abs(x), 1.0)
    # In turn, not as a batch: fast for a few rows, and quicker to compile.
    above, below = jnp.split(jax.lax.map(rates, jnp.concatenate([x + jnp.diag(reach), x - jnp.diag(reach)])), 2)
    return ((above - below) / (2.0 * reach[:, None])).T


def spectral_radius(matrix: jax.Array) -> jax.Array:
    """The size of the largest eigenvalue of a matrix (n, n), real or a complex pair, within a few per cent.

    It is the limit of |A^n|^(1/n) for high powers n (I. Gelfand, 1941), here by squaring, with the size taken out each time.
    """

    def squared(power, _):
        power = power @ power
        size = jnp.maximum(numerics.largest(jnp.abs(power)), LEAST_SIZE)
        return power / size, jnp.log(size)

    size = jnp.maximum(numerics.largest(jnp.abs(matrix)), LEAST_SIZE)
    _, sizes = jax.lax.scan(squared, matrix / size, None, length=SQUARINGS)
    # The i-th size is part of every later power, twice of each in turn.
    return size * jnp.exp(jnp.sum(sizes * 2.0 ** -jnp.arange(1, SQUARINGS + 1, dtype=matrix.dtype)))


def sensors_pole(driven: Driven) -> Any:
    """The poles of the sensors' low-pass, all of one size, 1/s; 0 without a low-pass."""
    sensors = driven.car.sensors
    return 0.0 if sensors is None or sensors.low_pass is None else sensors.low_pass.omega


def may_be_stiff(driven: Driven, max_step: float) -> bool:
    """Whether steps of `max_step` (s) may be too long for RK4: the car has fast states, or its sensors or its driver are fast."""
    rate = driven.driver.fastest_rate
    if rate is None or kit.has_fast_states(driven.car.vehicle):
        return True
    # The driver's rate is approximate, and includes the response of the car.
    known = max(SLOW_POLE, float(np.max(sensors_pole(driven))), 2.0 * float(np.max(rate)))
    return known * max_step > LIMIT


def at_start(driven: Driven, values: dict, times: np.ndarray) -> float:
    """The fastest pole at the start, 1/s."""
    dtype = dtype_of(driven.car.vehicle)
    x = driven.start(jnp.asarray(times[0], dtype), dtype, **values)
    # As many rows as are checked later: one compilation serves both.
    many = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (LOOKS + 1,)), x)
    return float(fastest_poles(driven, jnp.full(LOOKS + 1, times[0], dtype), many)[0])


@eqx.filter_jit
def fastest_poles(driven: Driven, t: Any, x: Any) -> jax.Array:
    """The fastest pole at each row: t (n,), the leaves of x (n,).

    Also at straight rolling with the row's speed (the driver's speed for a car whose speed is an input): there the tyres are
    stiffest. Where equal steps were too long, the wheels ring until the tyres slide, and a check of the sliding state alone would
    find nothing.
    """
    # In turn, not as a batch: fast for a few rows, and compiled in half the time.
    pole = lambda t, x: jax.lax.map(lambda at: fastest_pole(driven, *at), (t, x))
    dtype = x.car[0].dtype
    if "v_x" in x.car._fields:
        rolling = jax.lax.map(lambda at: driven.start(at[0], dtype, v_x=at[1]), (t, x.car.v_x))
    else:
        rolling = jax.lax.map(lambda at: driven.start(at, dtype), t)
    both = pole(jnp.concatenate([t, t]), jax.tree.map(lambda a, b: jnp.concatenate([a, b]), x, rolling))
    return jnp.maximum(both[: len(t)], both[len(t) :])


def sample_rows(x: Any, u: Any) -> np.ndarray:
    """The rows of a simulation that are checked: evenly from first to last, and the slowest."""
    speed = np.abs(np.asarray(getattr(x.car, "v_x", getattr(u, "v_x", x.car[0]))))
    even = np.linspace(0, len(speed) - 1, LOOKS).round().astype(int)
    return np.append(even, np.argmin(np.where(np.isfinite(speed), speed, np.inf)))


def worst(driven: Driven, times: np.ndarray, x: Any, u: Any) -> tuple[float, float]:
    """The fastest pole (1/s) over the checked rows of a simulation, and its time (s); rows that are not finite are skipped."""
    some = sample_rows(x, u)
    at = jax.tree.map(lambda leaf: leaf[some], x)
    found = np.asarray(fastest_poles(driven, jnp.asarray(times[some], dtype_of(driven.car.vehicle)), at))
    finite = np.all([np.isfinite(np.asarray(leaf)) for leaf in jax.tree.leaves(at)], axis=0) & np.isfinite(found)
    if not finite.any():
        return float("nan"), float(times[0])
    row = int(np.argmax(np.where(finite, found, -np.inf)))
    return float(found[row]), float(times[some][row])


def explicit(max_step: float) -> SolverChoice:
    """RK4 with equal steps."""
    return SolverChoice(RolledRK4(), None, max_step)


def blind_choice(driven: Driven, max_step: float) -> SolverChoice:
    """The choice where no number is known, as under jit, vmap or grad: it holds the fastest motion that this kind of car can
    have, with steps of at most `max_step` (s)."""
    sensors = driven.car.sensors
    filtered = sensors is not None and sensors.low_pass is not None
    if kit.has_fast_states(driven.car.vehicle) or filtered or driven.driver.fastest_rate is None:
        return SolverChoice(StabilisedRK4(), None, min(max_step, STABILISED / FAST_POLE))
    return explicit(min(max_step, STABLE / SLOW_POLE))


def implicit(max_step: float, rtol: float = 1e-6, atol: float = 1e-7) -> SolverChoice:
    """Kvaerno's stiff method of fifth order (2004) with adaptive steps."""
    return SolverChoice(diffrax.Kvaerno5(), diffrax.PIDController(rtol=rtol, atol=atol, dtmax=0.05), max_step)


def first_choice(driven: Driven, values: dict, times: np.ndarray, max_step: float) -> SolverChoice:
    """The choice for known numbers. For a car whose wheels turn it is the blind one: a drive to standstill then needs one
    program, where RK4, chosen by the start, would need another with shorter steps. For every other car the start decides."""
    if kit.has_fast_states(driven.car.vehicle) and not float(np.max(sensors_pole(driven))) * max_step > LIMIT:
        return blind_choice(driven, max_step)
    return choose(at_start(driven, values, times), max_step)


def next_choice(choice: SolverChoice, pole: float, max_step: float) -> SolverChoice:
    """The choice after one whose steps were too long for the fastest pole (1/s) of its result."""
    if isinstance(choice.solver, StabilisedRK4) and (step := STABILISED / pole) >= 2.0 * LEAST_STEP:
        return SolverChoice(choice.solver, None, min(max_step, step))
    return choose(pole, max_step)


def choose(pole: float, max_step: float) -> SolverChoice:
    """RK4 with steps short enough for the fastest pole; if they were shorter than `LEAST_STEP`, the implicit method."""
    step = min(max_step, STABLE / pole) if np.isfinite(pole) and pole > 0 else max_step
    return explicit(step) if step >= LEAST_STEP else implicit(max_step)

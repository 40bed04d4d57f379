"""Observer gains from poles."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check, check_positive, word_for
from jaxveh._core.host import on_host
from jaxveh._core.names import as_names, as_pairs, check_names, record
from jaxveh.observers.base import observe
from jaxveh.observers.chains import chained_gain
from jaxveh.statespace import Row, StateSpace, cast, kit


@on_host
def place_poles(
    model: StateSpace, poles: Any, *, dt: float, x: Any = None, u: Any = None, leave: tuple[str, ...] = ()
) -> np.ndarray:
    """The gain (n, m) of a `Luenberger` observer whose error decays with these `poles`, 1/s, on the linearised model.

    **Arguments**: `poles`, continuous, one per state that is not left out, real negative numbers or conjugate pairs. None
    may be repeated more often than there are channels, unless all are equal or there is one channel; `dt` (s), the step; `x`,
    the state about which the model is linearised (default: the prior's mean), a NamedTuple; `u`, its inputs by name (default:
    zeros); `leave`, states that nothing else depends on, such as a car's yaw: they get no correction. The poles of a step are
    exp(pole dt). By SciPy's `place_poles` (A. Tits & Y. Yang 1996), repeated ones in chains (`chained_gain`).

    **Raises** `InputError` for poles that are not stable, for a state that cannot be left out, and for a model that is not
    observable, naming the mode that does not reach the channels.
    """
    F, H, kept = slopes_without(model, dt, x, u, leave)
    names = tuple(model.states[i] for i in kept)
    poles = _as_poles(poles)
    if poles.shape != (len(kept),):
        raise InputError(f"poles have shape {poles.shape}: must be ({len(kept)},), one for each of {', '.join(names)}.")
    if not (poles.real < 0).all():
        raise InputError(f"poles = {poles}: must have negative real parts (1/s).")
    if not np.allclose(np.sort_complex(poles), np.sort_complex(poles.conj()), rtol=1e-12):
        raise InputError(f"poles = {poles}: complex ones must be conjugate pairs.")
    _check_observable(F, H, dt, names)
    gain = np.zeros((len(model.states), len(model.channels)))
    gain[kept] = _place_poles(F.astype(float), H.astype(float), np.exp(poles * dt))
    return gain


def _as_poles(poles: Any) -> np.ndarray:
    """The poles as an array of numbers, which may be complex."""
    try:
        return np.asarray(poles, complex) if np.iscomplexobj(np.asarray(poles)) else np.asarray(poles, float)
    except (TypeError, ValueError):
        raise InputError(f"poles = {poles!r}: must be numbers (1/s), one for each state.") from None


def _place_poles(F: np.ndarray, H: np.ndarray, poles: np.ndarray) -> np.ndarray:
    # SciPy comes with JAX; importing this part of it takes a third as long as importing all of the package.
    from scipy import signal

    # The error after a correction obeys (I - L H) F: the poles of F - L (H F) are placed.
    C = H @ F
    distinct, counts = np.unique(poles, return_counts=True)
    if counts.max() <= np.linalg.matrix_rank(C):
        return signal.place_poles(F.T, C.T, poles).gain_matrix.T
    if len(distinct) > 1 and len(C) > 1:
        raise InputError(
            f"a pole is repeated {counts.max()} times with {len(C)} channels: must be at most once per channel, or all "
            "poles equal."
        )
    return chained_gain(F, C, poles)


@on_host
def linearised_step(model: StateSpace, dt: float, x: Any = None, u: Any = None) -> tuple[np.ndarray, np.ndarray]:
    """Slopes of a step of `dt` seconds (n, n) and of the observation (m, n), at the state `x` and the inputs `u` of
    `place_poles`.

    In the default precision, whatever the model's: gains are computed in float64 if it is enabled.
    """
    kit.check_model("linearised_step", model)
    check_positive("dt", dt, "s")
    dtype = jax.dtypes.canonicalize_dtype(float)
    model = cast(model, dtype)
    x = model.prior.mean if x is None else x
    if getattr(x, "_fields", None) != model.states:
        raise InputError(f"x = {word_for(x)}: must have the fields {', '.join(model.states)}, as model.prior.mean has.")
    given = dict(as_pairs({} if u is None else u, "u"))
    for name, value in (*x._asdict().items(), *given.items()):
        check(name, value, np.isfinite, "finite")
    check_names("u", given, model.inputs)
    inputs = record("Inputs", {name: jnp.asarray(given.get(name, 0.0), dtype) for name in model.inputs})
    vector = jnp.stack([jnp.asarray(value, dtype) for value in x])
    F, H = _slopes(model, jnp.asarray(dt, dtype), vector, inputs)
    return np.asarray(F), np.asarray(H)


@eqx.filter_jit
def _slopes(model: StateSpace, end: Any, vector: Any, inputs: Any):
    zero, kind = jnp.zeros_like(end), type(model.prior.mean)

    def move(vector):
        moved = model.transition(zero, end, kind(*vector), model.step_inputs(zero, end, inputs, inputs))
        return jnp.stack([jnp.asarray(value, vector.dtype) for value in moved])

    see = lambda vector: observe(model, Row(zero, inputs, None), vector)
    return jax.jacfwd(move)(vector), jax.jacfwd(see)(vector)


def slopes_without(model: StateSpace, dt: float, x: Any, u: Any, leave: tuple[str, ...]):
    """The slopes of the states not in `leave`, (k, k) and (m, k), and their indices in the state (k,).

    **Raises** `InputError` if another state or a channel depends on a state in `leave`.
    """
    kit.check_model("slopes", model)
    leave = as_names(leave, "leave") or ()
    check_names("leave", leave, model.states)
    F, H = linearised_step(model, dt, x, u)
    left = [i for i, name in enumerate(model.states) if name in leave]
    kept = [i for i, name in enumerate(model.states) if name not in leave]
    for i in left:
        moved = [model.states[k] for k in kept if F[k, i] != 0]
        seen = [name for name, slope in zip(model.channels, H[:, i], strict=True) if slope != 0]
        if moved or seen:
            raise InputError(
                f"leave: {', '.join(moved + seen)} depends on {model.states[i]}, which cannot be left out."
            )
    return F[np.ix_(kept, kept)], H[:, kept], kept


def _check_observable(F: np.ndarray, H: np.ndarray, dt: float, names: tuple[str, ...]) -> None:
    """Kalman's rank condition on rates, which do not lose digits to the step; the mode by Popov, Belevitch and Hautus."""
    n, eps = len(F), np.finfo(F.dtype).eps
    rates = (F.astype(float) - np.eye(n)) / dt
    size = np.linalg.norm(rates) or 1.0
    H = H / np.maximum(np.linalg.norm(H, axis=1, keepdims=True), np.finfo(float).tiny)
    singular = np.linalg.svd(np.vstack([H @ np.linalg.matrix_power(rates / size, k) for k in range(n)]))[1]
    # In the rates, the rounding of the step's slopes is larger by 1 / dt.
    seen = int(np.sum(singular > singular[0] * n * eps * max(1.0, 1.0 / (dt * size))))
    if seen == n and singular[0] > 0:
        return
    modes = [(s, np.linalg.svd(np.vstack([rates - s * np.eye(n), H]))) for s in np.linalg.eigvals(rates)]
    mode, (_, sizes, directions) = min(modes, key=lambda pair: pair[1][1][-1])
    silent = directions[sizes <= max(10 * sizes[-1], 1e-9 * sizes[0])]
    share = np.linalg.norm(silent, axis=0)
    who = ", ".join(name for name, value in zip(names, share, strict=True) if value > 0.1 * share.max())
    speed = f"{mode.real:.3g}" + (f" +- {abs(mode.imag):.3g} i" if abs(mode.imag) > 1e-6 * size else "")
    raise InputError(
        f"the model is not observable there: {seen} of {n} directions of the state reach the channels; the mode of "
        f"{speed} 1/s in {who} does not. Leave out a state that nothing depends on (`leave`), or measure more."
    )

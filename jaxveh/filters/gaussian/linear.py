"""A check that a model is linear, as the exact Kalman filter needs."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, is_concrete
from jaxveh._core.names import record
from jaxveh.filters.gaussian.belief import rows_of
from jaxveh.filters.gaussian.known_numbers import look_inside_jit
from jaxveh.statespace import StateDependent, StateSpace


def check_linear(who: str, model: StateSpace) -> None:
    """Raise `InputError` with the name of the first state or channel that is not a linear function of the state.

    Each function is compared with its tangent at ten times the prior's standard deviations, for inputs of 0 and of 1;
    values that are not finite are not compared. In a linear model the noise may depend on the inputs, but not on the
    state. Tracers pass.
    """
    for nonlinear in look_inside_jit(_nonlinear_parts, model) or ():
        for (what, names), values in zip(
            (("state", model.states), ("channel", model.channels)), nonlinear, strict=True
        ):
            if np.any(values):
                name = names[int(np.argmax(values))]
                raise InputError(
                    f"{who}: {what} {name} is not a linear function of the state. Use Extended or Unscented."
                )
    depends = isinstance(model.measurement_noise, StateDependent) and is_concrete(model.measurement_noise)
    if depends and look_inside_jit(_noise_varies, model):
        raise InputError(
            f"{who}: the measurement noise depends on the state. Use Extended, Unscented or a particle filter."
        )


# Compiled: without jit it would take longer than filtering a short recording.
@eqx.filter_jit
def _nonlinear_parts(model: StateSpace):
    """Which states and which channels are nonlinear, (n,) and (m,), for inputs of 0 and for inputs of 1."""
    return [[_is_nonlinear(f, model) for f in _functions(model, value)] for value in (0.0, 1.0)]


@eqx.filter_jit
def _noise_varies(model: StateSpace):
    """Whether the covariance of the measurement noise changes with the state, for inputs of 0 or of 1."""
    start, step = _start_and_step(model)
    kind, t = type(model.prior.mean), jnp.zeros((), start.dtype)
    changed = []
    for value in (0.0, 1.0):
        u = record("Inputs", {name: jnp.asarray(value, start.dtype) for name in model.inputs})
        at = lambda rows, u=u: model.measurement_law(t, kind(*rows), u).covariance()
        changed.append(jnp.any(at(start) != at(start + step)))
    return jnp.any(jnp.stack(changed))


def _functions(model: StateSpace, value: float):
    dtype = model.dtype
    t0, t1 = jnp.zeros((), dtype), jnp.asarray(0.01, dtype)
    u = record("Inputs", {name: jnp.asarray(value, dtype) for name in model.inputs})
    kind = type(model.prior.mean)
    move = lambda rows: rows_of(model.transition(t0, t1, kind(*rows), model.step_inputs(t0, t1, u, u)), rows)

    def see(rows):
        observed = model.observation(t0, kind(*rows), u)
        return rows_of([getattr(observed, name) for name in model.channels], rows)

    return move, see


def _is_nonlinear(f, model: StateSpace):
    start, step = _start_and_step(model)
    here, slope = jax.jvp(f, (start,), (step,))
    there = f(start + step)
    size = jnp.abs(here) + jnp.abs(slope) + jnp.abs(there)
    return (jnp.abs(there - here - slope) > 1e3 * jnp.finfo(start.dtype).eps * size) & jnp.isfinite(size)


def _start_and_step(model: StateSpace):
    """The prior's mean, and a step of ten of its standard deviations."""
    start = jnp.stack(model.prior.mean)
    reach = 10.0 * jnp.sqrt(jnp.diagonal(model.prior.covariance()))
    # One direction of mixed signs, along which a sum of squares or products does not look linear by chance.
    return start, reach * jnp.asarray(np.cos(1.0 + 2.0 * np.arange(len(start))), start.dtype)

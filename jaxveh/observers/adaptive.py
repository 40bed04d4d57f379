"""An observer that adapts parameters in addition to the states."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check, check_at_least, check_finite, check_positive
from jaxveh._core.names import as_pairs, check_names
from jaxveh.observers.base import AbstractObserver, advance, check_gain, observe
from jaxveh.observers.luenberger import array
from jaxveh.statespace import StateSpace, kit


def _gains(given: Mapping[str, Any]) -> dict[str, jax.Array]:
    return {name: array(value) for name, value in as_pairs(given, "Adaptive.rate")}


def _bounds(given: Mapping[str, tuple[float, float]]) -> tuple[tuple[str, float, float], ...]:
    return tuple(_bound(name, ends) for name, ends in as_pairs(given, "Adaptive.bounds"))


def _bound(name: str, ends: tuple[float, float]) -> tuple[str, float, float]:
    try:
        low, high = map(float, ends)
    except (TypeError, ValueError):
        raise InputError(f"Adaptive.bounds of {name} = {ends!r}: must be (low, high), two numbers.") from None
    return name, low, high


class Adaptive(AbstractObserver):
    """A Luenberger observer of the states with a gradient law for parameters theta, combined so that both errors decay.

    (Q. Zhang, IEEE Trans. Autom. Control 47, 2002; A. Guyader & Q. Zhang, SYSID 2003; the law, projection, leakage and dead
    zone: P. Ioannou & J. Sun, Robust Adaptive Control, 1996, ch. 4 and 8; with `a_y` measured and friction adapted it
    represents H. Grip et al., Automatica 44, 2008.)

        Y- = dx-/dtheta,    phi = dh/dx Y- + dh/dtheta,    e = y - h(x-, theta)
        dtheta = G phi^T (R + phi G phi^T)^-1 e,    G = rate dt
        x = x- + gain e + Y dtheta,    Y = Y- - gain phi,    theta += dtheta

    Y (n, p), the estimate's slope with respect to the parameters, is filtered along; R is the measurement noise's covariance,
    which weights the channels; slopes are those of the model at the estimate.

    - `gain` (states that are not adapted, channels): computed by `place_poles` for the model without the parameters.
    - `rate`: by state's name, for the states that are adapted. They are constant in the transition, as with
      `statespace.with_parameters`, and on their own real line (a positive one as its logarithm). In unit squared per second,
      like the variance per second of a random walk in a Kalman filter, but no covariance accumulates. Theta follows with
      about `phi^T phi rate / R` (1/s): best near the placed poles. Far larger rates fit each row exactly and are slow again,
      since similar rows determine only one direction.
    - `bounds` by name, (low, high) in physical units: an estimate outside is projected onto them. `leakage` (1/s): pulls
      towards the prior's mean, sigma-modification, which leaves a bias. `dead_zone`: errors within this many standard
      deviations of a channel adapt nothing; of larger ones only the excess counts.

    **Stability**, on a model linear in x and theta, possibly varying in time, without noise: x's error less Y times theta's
    obeys `(I - gain H) F` alone; once it has decayed, `V = (theta - truth)^T rate^-1 (theta - truth)` never rises, whatever
    the excitation and however large the rate, and projection onto bounds that contain the truth lowers it. **Both errors
    decay exponentially only under persistent excitation**: the sum of `phi^T phi` over every window of some length is
    positive definite. Otherwise theta stays where it is, or drifts along directions without excitation under noise or a wrong
    model; then use bounds, leakage or a dead zone of the size of the unmodelled effects. On a nonlinear model this holds near
    the truth, where slopes represent differences, and nothing is proven far from it.

    **Raises** `InputError` for names that are no states, a gain of another shape, rates that are not positive, bounds that are
    empty or outside the parameter's domain, and a measurement noise without a covariance.
    """

    gain: jax.Array = eqx.field(converter=array)
    rate: dict[str, jax.Array] = eqx.field(converter=_gains)
    bounds: tuple[tuple[str, float, float], ...] = eqx.field(static=True, converter=_bounds, default=())
    leakage: jax.Array = eqx.field(converter=array, default=0.0)
    dead_zone: jax.Array = eqx.field(converter=array, default=0.0)

    def __check_init__(self):
        check_finite("Adaptive.gain", self.gain)
        if not self.rate:
            raise InputError("Adaptive.rate is empty: name at least one parameter, or use a Luenberger observer.")
        for name, value in self.rate.items():
            check_positive(f"Adaptive.rate of {name}", value, "unit squared per second")
        check_names("Adaptive.bounds", [name for name, *_ in self.bounds], self.rate)
        for name, low, high in self.bounds:
            check(f"Adaptive.bounds of {name}", np.array([low, high]), lambda b: b[0] < b[1], "low below high")
        check_at_least("Adaptive.leakage", self.leakage, 0)
        check_at_least("Adaptive.dead_zone", self.dead_zone, 0)

    def check(self, model):
        check_names("Adaptive.rate", self.rate, model.states)
        check_gain("Adaptive.gain", self.gain, model, tuple(name for name in model.states if name not in self.rate))
        kit.check_fixed("Adaptive", model.measurement_noise, "Take a filter.")
        if not model.measurement_noise.has_covariance:
            raise InputError("Adaptive: the measurement noise has no covariance, which weights the channels.")
        for name, low, high in self.bounds:
            for value in (low, high):
                try:
                    _to_real_line(model, name, value)
                except InputError as error:
                    raise InputError(f"Adaptive.bounds of {name}: {error}") from None

    def start(self, model):
        own, adapted = self._places(model)
        return jnp.zeros((len(own), len(adapted)), model.dtype)

    def _places(self, model: StateSpace) -> tuple[np.ndarray, np.ndarray]:
        """Indices of the states (n,) and of the parameters (p,) in the state."""
        adapts = np.array([name in self.rate for name in model.states])
        return np.flatnonzero(~adapts), np.flatnonzero(adapts)

    def predict(self, model, belief, row):
        own, adapted = self._places(model)

        def moved(change):
            start = belief.vector.at[own].add(belief.memory @ change).at[adapted].add(change)
            vector = advance(model, belief, row, start)
            return vector, vector

        slope, vector = jax.jacfwd(moved, has_aux=True)(jnp.zeros(len(adapted), belief.vector.dtype))
        return vector, slope[own]

    def correct(self, model, belief, row, error, here):
        own, adapted = self._places(model)
        slope = jax.jacfwd(lambda vector: observe(model, row, vector))(belief.vector)
        slope = jnp.where(here[:, None], slope, 0)
        phi = slope[:, own] @ belief.memory + slope[:, adapted]
        gain = self.gain.astype(error.dtype)
        change = self._parameter_change(model, belief, row, error, here, phi)
        sensitivity = belief.memory - gain @ phi
        correction = jnp.zeros_like(belief.vector).at[own].set(gain @ error + sensitivity @ change)
        return correction.at[adapted].set(change), sensitivity

    def _parameter_change(self, model, belief, row, error, here, phi):
        """The change of the parameters (p,) by the row."""
        dtype, dt = error.dtype, row.t - belief.t
        _, adapted = self._places(model)
        names = [model.states[i] for i in adapted]
        theta, start = belief.vector[adapted], jnp.stack([getattr(model.prior.mean, name) for name in names])
        noise = model.measurement_noise.covariance()
        zone = self.dead_zone.astype(dtype) * jnp.sqrt(jnp.diagonal(noise))
        error = error - jnp.clip(error, -zone, zone)
        noise = jnp.where(here[:, None] & here[None, :], noise, jnp.eye(len(here), dtype=noise.dtype))
        weighed = jnp.stack([self.rate[name].astype(dtype) for name in names])[:, None] * dt * phi.T
        change = weighed @ jnp.linalg.solve(noise + phi @ weighed, error)
        change = change + jnp.expm1(-self.leakage.astype(dtype) * dt) * (theta - start)
        limits = {name: (low, high) for name, low, high in self.bounds}
        for i, name in enumerate(names):
            if name in limits:
                low, high = (_to_real_line(model, name, jnp.asarray(value, dtype)) for value in limits[name])
                change = change.at[i].set(jnp.clip(theta[i] + change[i], low, high) - theta[i])
        return change


def _to_real_line(model: StateSpace, name: str, value: Any) -> Any:
    """A physical value of a state on its own real line."""
    chosen = () if model.chosen is None else model.chosen.parameters
    domain = {p.field: p.domain for p in chosen}.get(name)
    return value if domain is None else domain.inverse(value)

"""Recursive least squares, with one or several forgetting factors and resets."""

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check
from jaxveh.observers.base import AbstractObserver, advance, check_one_or_each, observe
from jaxveh.observers.luenberger import array
from jaxveh.statespace import kit


class RecursiveLeastSquares(AbstractObserver):
    """Least squares for a measurement that is linear in constant states: `y = phi^T theta` (L. Ljung & T. Soderstrom 1983).

        K = P phi / (R + phi^T P phi),    theta += K e,    P <- (P - K phi^T P) / forgetting

    `forgetting`: one factor, or one per state, then `P <- Lambda^-1/2 (P - K phi^T P) Lambda^-1/2` (S. Saelid & B. Foss
    1983). `separate`: each state has its own variance, P stays diagonal, updated as if the others were known (A. Vahidi, A.
    Stefanopoulou & H. Peng, Vehicle System Dynamics 43, 2005: mass slowly, grade fast), which prevents a slow state from
    absorbing the changes of a fast one. R: the measurement noise's variances, weights of the channels. P starts as the
    prior's covariance. `ceiling`: the limit of each state's variance as a multiple of its prior's, since variances without
    excitation wind up under forgetting. `reset`: if a channel's innovation exceeds this many of its predicted standard
    deviations, P starts anew, since the parameters have jumped (None: never). The phi of each row is the observation's slope
    at the estimate; for a nonlinear observation this is the recursive prediction error method.
    """

    forgetting: jax.Array = eqx.field(converter=array, default=0.99)
    ceiling: float = eqx.field(static=True, default=100.0)
    reset: float | None = eqx.field(static=True, default=None)
    separate: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        check(
            "RecursiveLeastSquares.forgetting", self.forgetting, lambda f: (f > 0) & (f <= 1), "above 0 and at most 1"
        )
        check("RecursiveLeastSquares.ceiling", self.ceiling, lambda c: c >= 1, "at least 1")
        if self.reset is not None:
            check("RecursiveLeastSquares.reset", self.reset, lambda r: r > 0, "positive")

    def check(self, model):
        check_one_or_each("RecursiveLeastSquares.forgetting", self.forgetting, model.states)
        kit.check_fixed("RecursiveLeastSquares", model.measurement_noise, "Take a filter.")
        if not model.measurement_noise.has_covariance:
            raise InputError(
                "RecursiveLeastSquares: the measurement noise has no variances, which weight the channels."
            )

    def start(self, model):
        P = model.prior.covariance()
        return jnp.diag(jnp.diagonal(P)) if self.separate else P

    def predict(self, model, belief, row):
        return advance(model, belief, row, belief.vector), belief.memory

    def correct(self, model, belief, row, error, here):
        P, start = belief.memory, self.start(model)
        slope = jax.jacfwd(lambda vector: observe(model, row, vector))(belief.vector)
        slope = jnp.where(here[:, None], slope, 0)
        noise = model.measurement_noise.covariance()
        noise = jnp.where(here[:, None] & here[None, :], noise, jnp.eye(len(here), dtype=noise.dtype))
        if self.reset is not None:
            spread = jnp.diagonal(slope @ P @ slope.T + noise)
            jumped = jnp.any(here & (jnp.square(error) > self.reset**2 * spread))
            P = jnp.where(jumped, start, P)
        gain = _gain(P, slope, noise)
        after = self._alone(P, slope, noise) if self.separate else _joseph_update(P, gain, slope, noise)
        root = jnp.sqrt(1 / jnp.broadcast_to(self.forgetting.astype(P.dtype), P.shape[:1]))
        after = jnp.where(jnp.any(here), after * root[:, None] * root[None, :], P)
        # Scaled back where a variance exceeds its ceiling; correlations stay.
        limit = jnp.sqrt(self.ceiling * jnp.diagonal(start) / jnp.diagonal(after))
        shrink = jnp.minimum(limit, 1)
        return gain @ error, after * shrink[:, None] * shrink[None, :]

    def _alone(self, P, slope, noise):
        """Each state's variance after the row as if the others were known."""
        columns = slope.T[:, :, None]
        single = jnp.diagonal(P)[:, None, None]
        return jnp.diag(jax.vmap(lambda p, s: _joseph_update(p, _gain(p, s, noise), s, noise)[0, 0])(single, columns))


def _gain(P, slope, noise):
    return jnp.linalg.solve(slope @ P @ slope.T + noise, slope @ P).T


def _joseph_update(P, gain, slope, noise):
    """P - K phi^T P in Joseph's form, which stays symmetric and positive definite in float32."""
    left = jnp.eye(len(P), dtype=P.dtype) - gain @ slope
    return left @ P @ left.T + gain @ noise @ gain.T

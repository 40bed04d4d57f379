"""Recursive least squares, with one or several forgetting factors and resets."""

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh._core.errors import InputError, check
from jaxveh.observers.base import AbstractObserver, observed
from jaxveh.observers.luenberger import array


class RecursiveLeastSquares(AbstractObserver):
    """Least squares of a measurement that is linear in the states, which stay: `y = phi^T theta` (L. Ljung & T. Soderstrom 1983).

        K = P phi / (R + phi^T P phi),    theta += K e,    P <- (P - K phi^T P) / forgetting

    `forgetting`: one factor, or one a state (A. Vahidi, A. Stefanopoulou & H. Peng 2005: mass slowly, grade fast), then
    `P <- Lambda^-1/2 (P - K phi^T P) Lambda^-1/2`. R: the measurement noise's variances, weights of the channels. P starts as the
    prior's covariance. `ceiling`: no state's variance grows beyond this multiple of its prior's, for what is not excited winds up
    under forgetting. `reset`: where a channel's innovation exceeds this many of its predicted spreads, P starts anew: what is
    estimated has jumped (None: never). The phi of each row is the observation's slope at the estimate; with one that is not
    linear this is the recursive prediction error method.
    """

    forgetting: jax.Array = eqx.field(converter=array, default=0.99)
    ceiling: float = eqx.field(static=True, default=100.0)
    reset: float | None = eqx.field(static=True, default=None)

    def __check_init__(self):
        check(
            "RecursiveLeastSquares.forgetting", self.forgetting, lambda f: (f > 0) & (f <= 1), "above 0 and at most 1"
        )
        check("RecursiveLeastSquares.ceiling", self.ceiling, lambda c: c >= 1, "at least 1")
        check("RecursiveLeastSquares.reset", self.reset, lambda r: r > 0, "positive")

    def check(self, model):
        if self.forgetting.ndim > 1 or (self.forgetting.ndim == 1 and len(self.forgetting) != len(model.states)):
            raise InputError(
                f"RecursiveLeastSquares.forgetting has shape {self.forgetting.shape}: must be one, or one for each of "
                f"{', '.join(model.states)}."
            )
        if not model.measurement_noise.has_covariance:
            raise InputError("RecursiveLeastSquares: the measurement noise has no variances, which weigh the channels.")

    def start(self, model):
        return model.prior.covariance()

    def correct(self, model, belief, row, error, here):
        P, start = belief.memory, model.prior.covariance()
        slope = jax.jacfwd(lambda vector: observed(model, row, vector))(belief.vector)
        slope = jnp.where(here[:, None], slope, 0)
        noise = model.measurement_noise.covariance()
        noise = jnp.where(here[:, None] & here[None, :], noise, jnp.eye(len(here), dtype=noise.dtype))
        spread = slope @ P @ slope.T + noise
        if self.reset is not None:
            jumped = jnp.any(here & (jnp.square(error) > self.reset**2 * jnp.diagonal(spread)))
            P = jnp.where(jumped, start, P)
            spread = slope @ P @ slope.T + noise
        gain = jnp.linalg.solve(spread, slope @ P).T
        after = P - gain @ slope @ P
        root = jnp.sqrt(1.0 / jnp.broadcast_to(self.forgetting.astype(P.dtype), P.shape[:1]))
        after = jnp.where(jnp.any(here), after * root[:, None] * root[None, :], P)
        # Scaled back where a variance has grown beyond its ceiling; correlations stay.
        limit = jnp.sqrt(self.ceiling * jnp.diagonal(start) / jnp.diagonal(after))
        shrink = jnp.minimum(limit, 1.0)
        return gain @ error, 0.5 * (after + after.T) * shrink[:, None] * shrink[None, :]

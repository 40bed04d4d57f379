"""The ensemble Kalman filter: a Gaussian update of samples."""

from __future__ import annotations

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import check_whole
from jaxveh._core.result import Result, with_reason
from jaxveh.filters.gaussian.filter import (
    check_covariances,
    innovation_info,
    measurements_of,
    unwrap,
    wrapped_innovation,
)
from jaxveh.filters.gaussian.forms import masked_factor
from jaxveh.filters.gaussian.noises import law_at
from jaxveh.filters.gaussian.rules import times
from jaxveh.filters.particle import add_noise
from jaxveh.statespace import AbstractBelief, AbstractTwoPartFilter, Gradient, Info, Row, StateSpace, kit


class EnsembleBelief(AbstractBelief):
    """Members of equal weight: the state's NamedTuple with (N,) in each field."""

    members: Any
    key: Any
    t: Any
    u: Any
    count: Any

    @property
    def mean(self):
        """The mean of each field over the members."""
        return jax.tree.map(jnp.mean, self.members)

    @property
    def std(self):
        """The standard deviation of each field over the members (divided by N - 1)."""
        return jax.tree.map(_std, self.members)

    @property
    def covariance(self):
        """The covariance (n, n) (divided by N - 1), in the order of the state's fields."""
        deviations = _deviations(jnp.stack(self.members))
        return times(deviations, deviations.T)

    def sample(self, key, draws):
        chosen = jax.random.randint(key, (draws,), 0, self.members[0].shape[0])
        return jax.tree.map(lambda field: field[chosen], self.members)

    def moments(self, model):
        shown = model.report(self.t, self.members, self.u)
        shown = jax.tree.map(lambda field: jnp.broadcast_to(field, self.members[0].shape), shown)
        return jax.tree.map(jnp.mean, shown), jax.tree.map(_std, shown)


class Ensemble(AbstractTwoPartFilter):
    """The ensemble Kalman filter of `members` samples (G. Evensen 1994; G. Burgers, P. van Leeuwen & G. Evensen 1998).

    Every member is propagated with a draw of the process noise and then moved towards the measurement by the gain of
    the ensemble's own covariances. `perturbed=True`: each member moves towards the measurement plus a draw of its
    noise. Otherwise the update is deterministic (J. Whitaker & T. Hamill 2002): the mean moves by the gain and the
    deviations by a smaller one, without that sampling error. With M channels the gain has errors of about
    sqrt(M / members), so that it is exact only in the limit.

    Noises must have covariances; a measurement noise that depends on the state is taken at the members' mean. The
    gradients are exact, as no member is drawn by weights.
    """

    whitens: ClassVar[bool] = True
    has_covariance: ClassVar[bool] = True
    noise_by_row: ClassVar[bool] = True
    rows_between: ClassVar[bool] = True
    members: int = eqx.field(static=True)
    perturbed: bool = eqx.field(static=True, default=False)

    @property
    def gradients(self):
        return Gradient.exact

    def __check_init__(self):
        check_whole("members", self.members, 2)

    def check(self, model):
        check_covariances(type(self).__name__, model)

    @property
    def needs_key(self):
        return True

    def _start(self, model, row, key):
        draw, key = jax.random.split(key)
        return EnsembleBelief(model.prior.sample(draw, (self.members,)), key, row.t, row.u, jnp.int32(0))

    def predict(self, model: StateSpace, belief: EnsembleBelief, t) -> EnsembleBelief:
        """The belief at time `t`, propagated with the inputs that the belief carries (held)."""
        return self._propagate(model, belief, t, belief.u)

    def _predict(self, model, belief, row):
        return self._propagate(model, belief, row.t, row.u)

    def _update(self, model, ahead, row):
        return self.update(model, ahead, row)

    def _propagate(self, model, belief, t, u_next):
        u = model.step_inputs(belief.t, t, belief.u, u_next)
        moved = model.transition(belief.t, t, belief.members, u)
        # A new key for each prediction: there may be several between two rows.
        draw, key = jax.random.split(jax.random.fold_in(belief.key, belief.count))
        moved = numerics.fence(add_noise(model, draw, moved, t - belief.t))
        return EnsembleBelief(moved, key, t, belief.u, belief.count)

    def update(self, model: StateSpace, belief: EnsembleBelief, row: Row) -> tuple[EnsembleBelief, Info]:
        """The belief after the row's measurement, at the belief's own time."""
        given, here = measurements_of(model, row)
        observed = model.observation(row.t, belief.members, row.u)
        rows = [jnp.broadcast_to(getattr(observed, name), belief.members[0].shape) for name in model.channels]
        rows = [unwrap(model, name, values) for name, values in zip(model.channels, rows, strict=True)]
        predicted = jnp.where(here[:, None], jnp.stack(rows), 0)
        states = jnp.stack(belief.members)
        X, E = _deviations(states), _deviations(predicted)
        law = law_at(model, row, lambda: belief.mean)
        noise = masked_factor(law, model.channels, here, states.dtype)
        factor = numerics.cholesky(times(E, E.T) + times(noise, noise.T))
        # P H^T S^-1, as the transpose of S^-1 (E X^T).
        gain = numerics.solve_psd(factor, times(E, X.T)).T
        innovation = wrapped_innovation(model, given - jnp.mean(predicted, axis=1), here)
        if self.perturbed:
            _, draw = jax.random.split(jax.random.fold_in(belief.key, belief.count))
            jitter = times(noise, numerics.normal(draw, (len(here), self.members), states.dtype))
            errors = wrapped_innovation(model, (given[:, None] + jitter) - predicted, here[:, None])
            moved = states + times(gain, errors)
        else:
            # K~ = P H^T S^-T/2 (S^1/2 + R^1/2)^-1, so that the deviations' covariance becomes the Kalman filter's.
            lesser = numerics.solve_lower_transposed(factor + noise, numerics.solve_lower(factor, times(E, X.T))).T
            mean = jnp.mean(states, axis=1) + times(gain, innovation)
            moved = mean[:, None] + (self.members - 1) ** 0.5 * (X - times(lesser, E))
        white = numerics.solve_lower(factor, innovation)
        after = EnsembleBelief(type(belief.members)(*moved), belief.key, row.t, row.u, belief.count + 1)
        lost = ~(jnp.all(jnp.isfinite(moved)) & jnp.all(jnp.isfinite(factor)))
        result = with_reason(kit.input_result(model, row), lost, Result.non_finite_state)
        return after, innovation_info(model, row, innovation, white, factor, result)


def _deviations(values):
    """Deviations from the mean over sqrt(N - 1): their products are covariances."""
    count = values.shape[-1]
    return (values - jnp.mean(values, axis=-1, keepdims=True)) * (1.0 / (count - 1) ** 0.5)


def _std(field):
    return numerics.sqrt(jnp.sum(jnp.square(_deviations(field))))

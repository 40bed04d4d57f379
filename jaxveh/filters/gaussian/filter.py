"""The steps of every Gaussian filter: prediction, update, and both together."""

import abc
import dataclasses
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.contracts import contract
from jaxveh._core.errors import InputError, check, kind_of_inner, warn, word_for
from jaxveh._core.names import record
from jaxveh._core.own_results import belief_and_info, instance_of, not_none, of_kind
from jaxveh._core.result import Result, with_reason
from jaxveh.filters.gaussian.belief import GaussianBelief, rows_of
from jaxveh.filters.gaussian.forms import AbstractForm, Spread
from jaxveh.filters.gaussian.noises import law_at
from jaxveh.filters.gaussian.rules import AbstractRule, Image
from jaxveh.statespace import (
    AbstractBelief,
    AbstractNoise,
    AbstractTwoPartFilter,
    Gradient,
    Info,
    Row,
    StateDependent,
    StateSpace,
    kit,
)


class AbstractGaussianFilter(AbstractTwoPartFilter):
    """A filter whose belief is a Gaussian, with additive noises that have covariances (S. Sarkka, 2013, ch. 5 and 6).

    A step is `predict_between`, then `update`. Both are public, for sensors of different rates, and so is `observe`, the
    predicted measurement. Wrappers wrap these three. The filter is differentiable with respect to every array leaf of the model.
    """

    whitens: ClassVar[bool] = True
    has_covariance: ClassVar[bool] = True
    _contract = contract(
        prior=not_none,
        predict_between=not_none,
        observe=of_kind(Image, numbers=False),
        update=belief_and_info,
        adapted_model=instance_of(StateSpace, "a StateSpace"),
    )

    @property
    def gradients(self):
        return Gradient.exact

    @abc.abstractmethod
    def prior(self, model: StateSpace, row: Row) -> AbstractBelief:
        """The model's prior as a belief at the row's time, before its measurement."""

    @abc.abstractmethod
    def predict_between(self, model: StateSpace, belief: Any, t, u_next) -> Any:
        """The belief at time `t`, where the inputs are `u_next` (used where the model's inputs run linearly over a step)."""

    @abc.abstractmethod
    def observe(self, model: StateSpace, belief: Any, row: Row) -> Image:
        """The image of the belief under the observation, without noise, as rows in the order of the channels."""

    @abc.abstractmethod
    def update(self, model: StateSpace, belief: Any, row: Row) -> tuple[Any, Info]:
        """The belief after the row's measurement, at the belief's own time (it takes over row.t without propagating to it)."""

    @abc.abstractmethod
    def adapted_model(self, model: StateSpace, belief: Any) -> StateSpace:
        """The model with the noises that this filter estimates from the rows so far."""

    @property
    def linearisations(self) -> int | None:
        """How many times the update linearises the observation (0: a filter of linear models), for a filter that can
        run over all rows at once (`smooth_parallel`); None if it runs row by row only."""
        return None

    def predict(self, model: StateSpace, belief: Any, t) -> Any:
        """The belief at time `t`, propagated with the inputs that the belief carries (held)."""
        return self.predict_between(model, belief, t, belief.u)

    def _start(self, model, row, key):
        return self.prior(model, row)

    def _predict(self, model, belief, row):
        return self.predict_between(model, belief, row.t, row.u)

    def _update(self, model, ahead, row):
        return self.update(model, ahead, row)


class AbstractRuleFilter(AbstractGaussianFilter):
    """A Gaussian filter with a `rule(n)` that approximates functions and a `form` that stores its covariance.

    Measurement noise that depends on the state (`StateDependent`) is taken with its covariance at the prediction's mean.

    Points are drawn anew after the prediction, so that the update sees the process noise (on linear models this is the exact
    Kalman filter).
    """

    # No postponed annotations in this file: they would turn this into a field.
    noise_by_row: ClassVar[bool] = True
    rows_between: ClassVar[bool] = True
    written_out: ClassVar[bool] = True
    form: eqx.AbstractVar[AbstractForm]
    _contract = contract(rule=instance_of(AbstractRule, "a rule, such as filters.kit.Slopes()"))

    def __check_init__(self):
        for entry in dataclasses.fields(self):
            value = getattr(self, entry.name)
            if entry.name != "form" and isinstance(value, AbstractForm):
                kind, form = type(self).__name__, type(value).__name__
                raise InputError(
                    f"{kind}.{entry.name} = {form}(): is a form; pass it by keyword, {kind}(form={form}())."
                )
            if isinstance(entry.default, int | float) and not isinstance(entry.default, bool):
                check(f"{type(self).__name__}.{entry.name}", value, lambda _: True, f"such as {entry.default}")
        if not isinstance(self.form, AbstractForm):
            name, form = type(self).__name__, word_for(self.form)
            raise InputError(f"{name}.form = {form}: must be a form, Covariance(), SquareRoot() or SingularValues().")

    @property
    def gradients(self):
        return Gradient.exact if self.form.differentiable else Gradient.none

    @abc.abstractmethod
    def rule(self, n: int) -> AbstractRule:
        """The rule for n states."""

    def check(self, model):
        check_covariances(type(self).__name__, model)
        check_weights(self, model)

    def prior(self, model, row):
        spread = self.form.start(model.prior.covariance())
        mean = jnp.stack(model.prior.mean)
        rule = self.rule(len(model.states))
        return GaussianBelief(mean, *spread, row.t, row.u, jnp.int32(0), type(model.prior.mean), rule)

    def predict_between(self, model, belief, t, u_next):
        image = transition_image(model, belief, t, u_next)
        law = None if model.process_noise is None else model.process_noise.over(t - belief.t)
        return with_spread(belief, image.mean, self.form.add(image, law, model.states), t=t)

    def observe(self, model, belief, row):
        return observation_image(model, belief, row, kit.presence(model, row)[1])

    def update(self, model, belief, row):
        return correct(self.form, model, belief, row, self.observe(model, belief, row))

    def adapted_model(self, model, belief):
        return model


MOST_LOST = 1e-3
"""The largest share of an average over points that rounding may take without a warning."""


def check_weights(filter: AbstractRuleFilter, model: StateSpace) -> None:
    """Raise `InputError` where the form needs positive weights and the rule has negative ones; warn where rounding
    ruins the averages."""
    form = type(filter.form)
    if not form.negative_weights and not filter.rule(len(model.states)).positive:
        raise InputError(
            f"{type(filter).__name__}: a weight is negative for {len(model.states)} states, which {form.__name__} cannot take. "
            "Use positive weights (alpha = 1, kappa >= 0), or Covariance()."
        )
    rule, dtype = filter.rule(len(model.states)), model.dtype
    lost = rule.amplification * float(jnp.finfo(dtype).eps)
    if lost > MOST_LOST:
        # Python shows a warning once if its words do not change with the numbers.
        warn(
            f"{type(filter).__name__}: its weights cancel each other, so that in {dtype} means are rounded to {lost:.1g} of "
            "their size, and estimates and likelihoods have larger errors. Take points further out (alpha = 1, the default), "
            "or float64."
        )


def correct(
    form: AbstractForm, model: StateSpace, belief: GaussianBelief, row: Row, image: Image
) -> tuple[GaussianBelief, Info]:
    """The belief after a row and its info, where `image` is that of the belief under the observation."""
    given, here = measurements_of(model, row)
    innovation = wrapped_innovation(model, given - image.mean, here)
    before = Spread(belief.factor, belief.matrix)
    law = law_at(model, row, lambda: belief.mean)
    found = form.condition(image, law, model.channels, here, innovation, before)
    after = with_spread(belief, belief.vector + found.shift, found.spread, t=row.t, u=row.u, count=belief.count + 1)
    result = _result(model, row, (belief, after), image, found.innovation_factor)
    return after, innovation_info(model, row, innovation, found.white, found.innovation_factor, result)


def check_covariances(name: str, model: StateSpace) -> None:
    """Raise `InputError` where a noise or the prior of the model has no covariance."""
    laws = {"measurement noise": kind_of_law(model), "prior": model.prior.law}
    if model.process_noise is not None:
        laws["process noise"] = model.process_noise.law
    for what, law in laws.items():
        if not law.has_covariance:
            raise InputError(
                f"{name}: the {what} {type(law).__name__} has no covariance, which a Kalman filter needs. "
                "Use a particle filter, or a Gaussian or Student-t law."
            )


def kind_of_law(model: StateSpace) -> AbstractNoise:
    """The law of the measurement noise; where it depends on the state, the law at the prior's mean, without numbers."""
    if not isinstance(model.measurement_noise, StateDependent):
        return model.measurement_noise
    number = jax.ShapeDtypeStruct((), model.dtype)
    u = record("Inputs", dict.fromkeys(model.inputs, number))
    laws = []
    eqx.filter_eval_shape(lambda t, u: laws.append(model.measurement_law(t, model.prior.mean, u)), number, u)
    return laws[0]


def check_kind(who: str, filter: Any, kind: type) -> None:
    """Raise `InputError` unless the filter is of the kind that a wrapper can wrap."""
    if not isinstance(filter, kind):
        what = "an unwrapped Gaussian filter" if kind is AbstractRuleFilter else "a Gaussian filter"
        raise InputError(
            f"{who}: {kind_of_inner(filter)} inside: must be {what} (Kalman(), Extended(), Unscented(), ...)."
        )


def check_gaussian(who: str, what: str, law: AbstractNoise, advice: str = "Use ParticleFilter.") -> None:
    """Raise `InputError` unless the law, or each part of it, is Gaussian."""
    for part in law.parts:
        if not part.is_gaussian:
            raise InputError(f"{who}: the {what} {type(part).__name__} is not Gaussian. {advice}")


def with_spread(belief: GaussianBelief, vector: Any, spread: Spread, t=None, u=None, count=None) -> GaussianBelief:
    """The belief with another Gaussian, and with another time, inputs and count where these are given."""
    return GaussianBelief(
        vector,
        *spread,
        belief.t if t is None else t,
        belief.u if u is None else u,
        belief.count if count is None else count,
        belief.state_type,
        belief.rule,
    )


def transition_image(model: StateSpace, belief: GaussianBelief, t, u_next) -> Image:
    """The belief's image under the transition to time `t`."""
    u = model.step_inputs(belief.t, t, belief.u, u_next)
    move = lambda rows: rows_of(model.transition(belief.t, t, belief.state_type(*rows), u), rows)
    return belief.rule.image(move, belief.vector, belief.factor)


def observation_image(model: StateSpace, belief: GaussianBelief, row: Row, present: dict) -> Image:
    """The belief's image under the observation; zero where a channel is missing, angles unwrapped about the first point."""

    def see(rows):
        observed = model.observation(row.t, belief.state_type(*rows), row.u)
        found = []
        for name in model.channels:
            values = jnp.broadcast_to(getattr(observed, name), rows.shape[1:])
            found.append(jnp.where(present[name], unwrap(model, name, values), 0))
        return jnp.stack(found)

    return belief.rule.image(see, belief.vector, belief.factor)


def unwrap(model: StateSpace, name: str, values: Any) -> Any:
    """A channel's values (k, ...); angles lie within half a turn of the first. A single value is unchanged."""
    if name not in model.angles or not values.ndim:
        return values
    return values[0] + numerics.wrap_angle(values - values[0])


def measurements_of(model: StateSpace, row: Row) -> tuple[Any, Any]:
    """The measurements (m,) of a row, zero where missing, and which of them are there (m,)."""
    values, present = kit.presence(model, row)
    stacked = lambda by_name: jnp.stack([by_name[name] for name in model.channels])
    return stacked(values), stacked(present)


def wrapped_innovation(model: StateSpace, innovation: Any, here: Any) -> Any:
    """Innovations (m, ...), angles in [-pi, pi), zero where a channel is not `here` (m, ...)."""
    if model.angles:
        wraps = jnp.asarray([name in model.angles for name in model.channels])
        wraps = wraps.reshape(-1, *[1] * (innovation.ndim - 1))
        innovation = jnp.where(wraps, numerics.wrap_angle(innovation), innovation)
    return jnp.where(here, innovation, 0)


def innovation_info(model: StateSpace, row: Row, innovation: Any, white: Any, factor: Any, result: Any) -> Info:
    """The info of innovations (m,) whose covariance has the lower factor `factor` (m, m); `white` (m,) are the
    innovations whitened by it."""
    _, present = kit.presence(model, row)
    dtype = innovation.dtype
    count = jnp.sum(jnp.stack([present[name] for name in model.channels]).astype(dtype))
    nis, variances = jnp.sum(white**2), jnp.sum(jnp.square(factor), axis=-1)
    named = lambda values: record("Measurements", dict(zip(model.channels, values, strict=True)))
    log_likelihood = -0.5 * (nis + numerics.log_det(factor) + count * kit.LOG_2PI)
    return Info(
        log_likelihood=log_likelihood,
        innovation=kit.by_channel(model, innovation, present),
        innovation_std=kit.by_channel(model, jnp.sqrt(variances), present),
        nis=nis,
        ess=jnp.full((), jnp.nan, dtype),
        whitened=named(white),
        log_scale=named(jnp.log(jnp.diagonal(factor))),
        result=kit.likelihood_result(result, log_likelihood),
    )


def _result(model, row, beliefs, image: Image, factor):
    """The code of the first failure in the order of the computation: after it nothing is finite."""
    before, after = beliefs
    diverged, indefinite = Result.non_finite_state, Result.not_positive_definite
    result = kit.input_result(model, row)
    matrix = before.vector if before.matrix is None else before.matrix
    for values, reason in (
        (before.vector, diverged),
        (matrix, diverged),
        (before.factor, indefinite),
        (image.mean, diverged),
        (image.deviations, diverged),
        (factor, indefinite),
        (after.factor, indefinite),
    ):
        result = with_reason(result, ~jnp.all(jnp.isfinite(values)), reason)
    return result

"""The bootstrap particle filter, and the base of all particle filters."""

import abc
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.contracts import contract
from jaxveh._core.errors import InputError, check, check_whole, kind_of_inner, word_for
from jaxveh._core.result import Result, code
from jaxveh.filters.choosing import AbstractResampling, Scheme, as_resampling, log_of
from jaxveh.filters.particle_belief import ParticleBelief
from jaxveh.statespace import (
    AbstractBelief,
    AbstractTwoPartFilter,
    Gradient,
    Info,
    Row,
    Smoothing,
    StateDependent,
    StateSpace,
    kit,
)

SHORTEST = 1e-9
"""The time (s) for which the process noise between two rows at the same time is taken, so that its covariance has a factor."""


class AbstractParticleFilter(AbstractTwoPartFilter):
    """The base of particle filters: `particles` (at least 2), `resampling` scheme, `threshold` of the ESS, `gradient`.

    `resampling(key, weights, n) -> ancestors` (see `numerics.systematic`, `stratified`, `multinomial`, `residual`), or an
    `AbstractResampling`: `Soft(...)` around one of these, or, for `ParticleFilter`, `Transport(...)`.
    `threshold`: resample where the ESS falls below this share of the particles; 1 (the default) resamples every step.
    `gradient`: `"score"` (the default) includes the derivative of the choice of ancestors, so that the gradient of the
    log-likelihood is right in the limit of many particles; its scatter grows with the length of the recording. `"held"`
    leaves that derivative out: the gradient is smooth, but has a **bias** that more particles do not reduce, for
    parameters and noise levels alike.
    """

    # No postponed annotations in this file: they would turn these into fields.
    has_covariance: ClassVar[bool] = True
    noise_by_row: ClassVar[bool] = True
    rows_between: ClassVar[bool] = True
    particles: eqx.AbstractVar[int]
    resampling: eqx.AbstractVar[Scheme]
    threshold: eqx.AbstractVar[float]
    gradient: eqx.AbstractVar[str]

    @property
    def scheme(self) -> AbstractResampling:
        """`resampling` as an `AbstractResampling`; a plain function draws ancestors, with equal weights after it."""
        return as_resampling(self.resampling)

    @property
    def gradients(self):
        return Gradient.on_average if self.gradient == "score" else Gradient.none

    @property
    def needs_key(self):
        return True

    def check(self, model):
        del model

    def _update(self, model, ahead, row):
        return ahead.update(self, model, row)


def check_all_particles(who: str, filter: Any) -> None:
    """Raise `InputError` unless the filter's belief consists of weighted particles only."""
    if not isinstance(filter, AbstractParticleFilter) or kit.smoothing_of(filter) is not Smoothing.particles:
        raise InputError(
            f"{who}: {kind_of_inner(filter)} inside: must be a filter whose belief is particles only (ParticleFilter, "
            "AuxiliaryParticleFilter, Guided)."
        )


def check_particle_settings(
    particles: int, threshold: float, gradient: str = "score", resampling: Scheme = numerics.systematic
) -> None:
    """Raise `InputError` for fewer than two particles, a threshold outside [0, 1], another gradient, or no resampling scheme."""
    if gradient not in ("score", "held"):
        raise InputError(f"gradient = {gradient!r}: must be 'score' or 'held'.")
    check_whole("particles", particles, 2)
    check("threshold", threshold, lambda v: (v >= 0) & (v <= 1), "from 0 (never resample) to 1 (every step)")
    as_resampling(resampling)


def log_prob(model: StateSpace, row, particles):
    """log p(y | x) of each particle over the channels present, (N,), and by channel the measurement less the particle's
    prediction."""
    measured, present = kit.presence(model, row)
    n = particles[0].shape[0]
    observed = model.observation(row.t, particles, row.u)
    predicted = {name: jnp.broadcast_to(getattr(observed, name), (n,)) for name in model.channels}
    residual = {name: measured[name] - predicted[name] for name in model.channels}
    for name in model.angles:
        residual[name] = numerics.wrap_angle(residual[name])
    if isinstance(model.measurement_noise, StateDependent):
        of = lambda x, r: model.measurement_law(row.t, x, row.u).log_prob(r, present)
        logs = jax.vmap(of)(particles, residual)
    else:
        logs = model.measurement_noise.log_prob(residual, present)
    return numerics.fence(jnp.broadcast_to(logs, (n,))), residual


def add_noise(model: StateSpace, key, particles, dt):
    """The particles with a draw of the process noise over `dt` added to the fields that have it."""
    if model.process_noise is None:
        return particles
    noise = model.process_noise.over(dt).sample(key, particles[0].shape)
    return particles._replace(**{name: getattr(particles, name) + value for name, value in noise.items()})


def replace_lost(moved, before):
    """The particles, where lost ones, with a field that is not finite, are replaced by those `before` the step; and which are
    lost, (N,). Lost particles must get zero weight, and particles of zero weight must be finite for a mean."""
    n = moved[0].shape[-1]
    lost = ~jnp.isfinite(sum((jnp.broadcast_to(field, (n,)) for field in moved[1:]), start=moved[0]))
    return jax.tree.map(lambda new, old: jnp.where(lost, old, new), moved, before), lost


def without(lost, logs):
    """The log weights (N,) with minus infinity for the particles `lost`."""
    return jnp.where(lost, -jnp.inf, logs)


def fate(alive, lost):
    """The result code of a step: successful if any particle is `alive`; `lost` (N,) are the particles that are not finite."""
    reason = jnp.where(jnp.all(lost), code(Result.non_finite_state), code(Result.all_particles_dead))
    return jnp.where(alive, code(Result.successful), reason)


def start_particles(filter_, model, row, key):
    """Draws of the prior, and the key into which later steps fold their count."""
    prior_key, key = jax.random.split(key)
    particles = model.prior.sample(prior_key, (filter_.particles,))
    return particles, key


def noise_variances(model, row, particles, weights):
    """Variances (m,) of the measurement noise in the order of the channels, NaN if the law has none; if the noise
    depends on the state, the weighted mean of its variances over the particles."""
    if not isinstance(model.measurement_noise, StateDependent):
        return _variances(model.measurement_noise, weights.dtype)

    def at(x):
        law = model.measurement_law(row.t, x, row.u)
        found = dict(zip(law.names, _variances(law, weights.dtype), strict=True))
        return jnp.stack([found[name] for name in model.channels])

    return weights @ jax.vmap(at)(particles)


def _variances(law, dtype):
    return jnp.diagonal(law.covariance()) if law.has_covariance else jnp.full((len(law.names),), jnp.nan, dtype)


def make_info(model, row, log_likelihood, residual, weights, became, within=None, particles=None, remark=None):
    """The info of one step; `weights`: those of the prediction, to which the `residual` belongs, and those after the
    row; `became`: the result code if the input is valid; `within`: by channel, the variance that the residuals do not
    contain, without R; `particles`: those of the prediction, for noise that depends on the state."""
    before, after = weights
    # Particles whose observation is not finite are left out.
    known = jnp.isfinite(sum(residual[name] for name in model.channels))
    before = jnp.where(known, before, 0)
    residual = {name: jnp.where(known, residual[name], 0) for name in model.channels}
    whole = 1.0 / numerics.total(before)
    mean = {name: numerics.total(before * residual[name]) * whole for name in model.channels}
    spread = {name: numerics.total(before * (residual[name] - mean[name]) ** 2) * whole for name in model.channels}
    if within is not None:
        spread = {name: spread[name] + within[name] for name in model.channels}
    noise = noise_variances(model, row, particles, before * whole)
    std = [numerics.sqrt(spread[name] + noise[i]) for i, name in enumerate(model.channels)]
    result = kit.input_result(model, row)
    dtype = after.dtype
    _, present = kit.presence(model, row)
    return Info(
        log_likelihood=log_likelihood,
        innovation=kit.by_channel(model, [mean[name] for name in model.channels], present),
        innovation_std=kit.by_channel(model, std, present),
        nis=jnp.full((), jnp.nan, dtype),
        ess=numerics.ess(after),
        result=jnp.where(result == 0, became, result),
        remark=code(Result.successful) if remark is None else remark,
    )


def mean_variances(model, weights, variances):
    """By channel, the weighted mean of the particles' own variances (N, m); variances that are not finite count as zero."""
    return dict(zip(model.channels, weights @ jnp.where(jnp.isfinite(variances), variances, 0), strict=True))


class DrawnParticles(NamedTuple):
    """Particles before their measurement: their `ancestors`, their weights and the logarithms of these, with
    derivatives; `remark`: a code of how they were chosen."""

    ancestors: Any
    weights: Any
    log_weights: Any
    remark: Any


class AbstractAhead(eqx.Module):
    """A particle filter's prediction for a row, with its `update` by the measurement: `_start` and `_predict` return it."""

    @abc.abstractmethod
    def update(self, filter_: Any, model: StateSpace, row: Row) -> tuple[AbstractBelief, Info]:
        """The belief after the row's measurement, and its info."""


class Expected(AbstractAhead):
    """Particles before their measurement: their draw (`drawn`), which are `lost` (N,), the filter's `key`, and the
    `count` of rows before."""

    particles: Any
    drawn: DrawnParticles
    lost: Any
    key: Any
    count: Any

    def update(self, filter_: Any, model, row):
        logs, residual = log_prob(model, row, self.particles)
        weights, log_mean, alive = numerics.normalise(without(self.lost, logs + self.drawn.log_weights))
        belief = ParticleBelief(self.particles, weights, self.drawn.ancestors, self.key, row.t, row.u, self.count + 1)
        # normalise gives the log of the mean over N; the likelihood is the sum.
        log_likelihood = log_mean + jnp.log(jnp.asarray(filter_.particles, weights.dtype))
        became = fate(alive, self.lost)
        both, remark = (self.drawn.weights, weights), self.drawn.remark
        info = make_info(model, row, log_likelihood, residual, both, became, particles=self.particles, remark=remark)
        return belief, info


def _proposal(who: str, filter_: Any, given: tuple, result: Any) -> None:
    """Raise `InputError` unless there are particles with noise, with the fields and shapes of those given, and a log ratio."""
    if type(result) is not tuple or len(result) != 2:
        raise InputError(f"{who}: returned {word_for(result)}: must return two, (particles, log ratio or None).")
    (moved, ratio), before = result, given[1]
    if getattr(moved, "_fields", None) != before._fields:
        raise InputError(f"{who}: its first result is {word_for(moved)}: must be the particles, {word_for(before)}.")
    for name, value in [*zip(moved._fields, moved, strict=True), *([] if ratio is None else [("log ratio", ratio)])]:
        if np.shape(value) != np.shape(before[0]):
            raise InputError(
                f"{who}: {name} has shape {np.shape(value)}: must have a number for each particle, {np.shape(before[0])}."
            )


class AbstractProposalFilter(AbstractParticleFilter):
    """A particle filter whose noise is drawn by `propose` and weighted accordingly. Everything else is as in the
    bootstrap filter: first particles from the prior, resampling before each step (Sarkka 2013, algorithm 7.4)."""

    particles: int = eqx.field(static=True)
    resampling: Scheme = eqx.field(static=True, default=numerics.systematic)
    threshold: float = eqx.field(static=True, default=1.0)
    gradient: str = eqx.field(static=True, default="score")
    _contract = contract(propose=_proposal)

    def __check_init__(self):
        check_particle_settings(self.particles, self.threshold, self.gradient, self.resampling)

    @abc.abstractmethod
    def propose(self, model: StateSpace, particles: Any, row: Row, dt: Any, key: Any) -> tuple[Any, Any]:
        """The particles with noise added, given the particles after the transition over `dt` (s); and the logarithm (N,) of each
        noise's density under the model over the density of its draw, None if it was drawn from the model."""

    def _start(self, model, row, key):
        particles, key = start_particles(self, model, row, key)
        uniform = jnp.full((self.particles,), 1 / self.particles, particles[0].dtype)
        ancestors = jnp.arange(self.particles, dtype=jnp.int32)
        drawn = DrawnParticles(ancestors, uniform, log_of(uniform), code(Result.successful))
        none = jnp.zeros(self.particles, bool)
        return Expected(particles, drawn, none, key, jnp.int32(0))

    def _predict(self, model, belief, row):
        draw, noise = jax.random.split(jax.random.fold_in(belief.key, belief.count))
        particles, drawn = self._draw_particles(draw, belief)
        u = model.step_inputs(belief.t, row.t, belief.u, row.u)
        moved, lost = replace_lost(model.transition(belief.t, row.t, particles, u), particles)
        moved, ratio = self.propose(model, moved, row, row.t - belief.t, noise)
        if ratio is not None:
            logs = drawn.log_weights + ratio
            drawn = drawn._replace(weights=numerics.normalise(logs)[0], log_weights=logs)
        moved, lost = numerics.fence((moved, lost))
        return Expected(moved, drawn, lost, belief.key, belief.count)

    def _draw_particles(self, key, belief):
        """The next particles before they move."""
        n, logs = self.particles, log_of(belief.weights)
        uniform = jnp.full((n,), 1 / n, belief.weights.dtype)
        found = self.scheme.resample(key, belief.particles, belief.weights, logs, n, self.gradient)
        ancestors, remark = found.ancestors.astype(jnp.int32), jnp.asarray(found.remark, jnp.int32)
        chosen = log_of(uniform) + found.log_weights.astype(uniform.dtype)
        weights = numerics.normalise(chosen)[0] if self.scheme.reweights else uniform
        drawn = DrawnParticles(ancestors, weights, chosen, remark)
        if self.threshold >= 1:
            return found.particles, drawn
        resampled = numerics.ess(belief.weights) < self.threshold * n
        themselves = jnp.arange(n, dtype=jnp.int32)
        kept = belief.particles, DrawnParticles(themselves, belief.weights, logs, code(Result.successful))
        return jax.tree.map(lambda new, old: jnp.where(resampled, new, old), (found.particles, drawn), kept)


class ParticleFilter(AbstractProposalFilter):
    """The bootstrap particle filter (Gordon, Salmond & Smith 1993; Sarkka 2013, algorithm 7.4, the transition as proposal)."""

    smooths: ClassVar[Smoothing] = Smoothing.particles

    def propose(self, model, particles, row, dt, key):
        return add_noise(model, key, particles, dt), None

"""The guided particle filter: particles are drawn where the measurement is likely."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, check_one_of
from jaxveh.filters.auxiliary import FirstStage
from jaxveh.filters.choosing import DRAW_INSTEAD, Scheme, check_ancestors, choose_ancestors, gather, log_chosen, log_of
from jaxveh.filters.gaussian.filter import check_covariances, check_gaussian, unwrap, wrapped_innovation
from jaxveh.filters.gaussian.forms import Covariance, Spread
from jaxveh.filters.gaussian.noises import law_at
from jaxveh.filters.gaussian.rules import AbstractRule, Points, Slopes, product, times
from jaxveh.filters.particle import (
    SHORTEST,
    AbstractAhead,
    AbstractParticleFilter,
    ParticleBelief,
    ParticleFilter,
    check_particle_settings,
    fate,
    log_prob,
    make_info,
    mean_variances,
    replace_lost,
    without,
)
from jaxveh.numerics import sigma_points
from jaxveh.statespace import Smoothing, StateSpace, kit

RULES = ("extended", "unscented")

UNGUIDED = 0.1
"""The share of the first particles that are drawn from the prior alone, so that no weight exceeds ten times the likelihood."""


class Proposal(NamedTuple):
    """The distribution from which a particle's noise is drawn, N(mean, F F^T), with `mean` (q,) and `factor` F (q, q);
    `log_ahead`: the log-likelihood of the measurement given the particle; `variances` (m,): those of the channels that
    the noise causes."""

    mean: Any
    factor: Any
    log_ahead: Any
    variances: Any


class FirstGuided(AbstractAhead):
    """The first particles, some of them `astray` (N,); `log_drawn` (N,): the log-density of their draw less that of the
    prior; `unmeasured`: the particles that the prior alone gives; and the filter's `key`."""

    particles: Any
    astray: Any
    log_drawn: Any
    unmeasured: Any
    key: Any

    def update(self, filter_: Any, model, row):
        n = filter_.particles
        logs, _ = log_prob(model, row, self.particles)
        _, residual = log_prob(model, row, self.unmeasured)
        weights, log_likelihood, alive = numerics.normalise(without(self.astray, logs - self.log_drawn))
        ancestors = jnp.arange(n, dtype=jnp.int32)
        belief = ParticleBelief(self.particles, weights, ancestors, self.key, row.t, row.u, jnp.int32(1))
        uniform = jnp.full((n,), 1 / n, logs.dtype)
        about = (uniform, weights)
        became = fate(alive, self.astray)
        return belief, make_info(model, row, log_likelihood, residual, about, became, particles=self.unmeasured)


class Proposed(AbstractAhead):
    """Particles before their weights: drawn from their proposals, some of them `astray` (N,), with log p(e) / q(e) in
    `ratio` (N,); the belief `before`, its particles after the transition (`moved`), which of these are `lost`, the
    `variances` (N, m) of their proposals, and the first `stage`."""

    particles: Any
    astray: Any
    ratio: Any
    before: ParticleBelief
    moved: Any
    lost: Any
    variances: Any
    stage: FirstStage

    def update(self, filter_: Any, model, row):
        before, stage = self.before, self.stage
        after, _ = log_prob(model, row, self.particles)
        _, residual = log_prob(model, row, self.moved)
        kept = log_chosen(filter_, log_of(stage.weights), stage.ancestors)
        log_n = jnp.log(jnp.asarray(before.weights.shape[0], after.dtype))
        judged = stage.ahead[stage.ancestors] if filter_.auxiliary else None
        drawn = after + self.ratio + kept - (0.0 if judged is None else judged)
        plain = lambda: after + self.ratio + without(self.lost, log_of(before.weights)) + log_n
        weights, total, alive, remark = stage.weigh(log_n, drawn, plain, judged, self.astray)
        found = ParticleBelief(self.particles, weights, stage.ancestors, before.key, row.t, row.u, before.count + 1)
        within = mean_variances(model, before.weights, self.variances)
        about, became = (before.weights, weights), fate(alive, self.lost)
        info = make_info(model, row, total, residual, about, became, within, self.moved, remark)
        return found, info


class Guided(AbstractParticleFilter):
    """Particles whose noise is drawn given the measurement, by a Kalman update of each (Sarkka 2013, sec. 7.4).

    `rule`: `"extended"` (A. Doucet, S. Godsill & C. Andrieu 2000) or `"unscented"`, the unscented particle filter (R. van der
    Merwe, A. Doucet, N. de Freitas & E. Wan 2001). With e the process noise of a step, Gaussian on the fields that carry it,
    x = f(x_{k-1}) + e, the measurement's image under N(0, Q) gives a proposal q(e), and the weight is

        w_{k-1} p(y | x) p(e) / q(e)

    If the prior is Gaussian, nine tenths of the first particles are drawn given the first measurement in the same way,
    and a tenth from the prior itself.

    `auxiliary`: ancestors are chosen by their weights and by how well each predicts the measurement. With a linear observation
    this is the fully adapted filter (M. Pitt & N. Shephard 1999), whose weights are all equal. (For the proposal, measurement
    noise that depends on the state is taken at the particle without process noise.) It pays where the measurement is sharper
    than the process noise; each particle costs a small Kalman update. **Where the observation is nonlinear over the process
    noise, do not use it**: with `"extended"` it loses particles that the linearisation does not foresee, and the effective
    sample size does not show this, as it rises (one recording of the growth model, 40 rows, 1000 particles: log-likelihood 1.5
    too low, standard deviation 1.9, ESS 700; without `auxiliary` 0.6, 0.8 and 550). Rows whose weights show it have
    `info.remark = Result.lookahead_misled`. The process noise must be Gaussian, and the measurement noise must have a
    covariance.
    """

    smooths: ClassVar[Smoothing] = Smoothing.particles
    particles: int = eqx.field(static=True)
    rule: str = eqx.field(static=True, default="extended")
    auxiliary: bool = eqx.field(static=True, default=False)
    resampling: Scheme = eqx.field(static=True, default=numerics.systematic)
    threshold: float = eqx.field(static=True, default=1.0)
    gradient: str = eqx.field(static=True, default="score")

    def __check_init__(self):
        check_particle_settings(self.particles, self.threshold, self.gradient, self.resampling)
        check_ancestors("Guided", self.resampling, DRAW_INSTEAD)
        check_one_of("rule", self.rule, RULES)

    def check(self, model):
        if model.process_noise is None:
            raise InputError("Guided: the model has no process noise, which this filter guides. Use ParticleFilter.")
        check_covariances("Guided", model)
        check_gaussian("Guided", "process noise", model.process_noise.law)

    def _start(self, model, row, key):
        if not model.prior.law.is_gaussian:
            plain = ParticleFilter(self.particles, self.resampling, self.threshold, self.gradient)
            return plain._start(model, row, key)
        draw, key = jax.random.split(key)
        covariance = model.prior.covariance()
        prior = Spread(numerics.cholesky(covariance), covariance)
        names, start = model.states, model.prior.mean
        proposal = _proposal(model, _rule_of(self.rule, len(names)), row, start, names, prior)
        white = numerics.normal(draw, (len(names), self.particles), covariance.dtype)
        unguided = max(1, round(UNGUIDED * self.particles))
        blind = times(prior.factor, white)
        e = proposal.mean[:, None] + times(proposal.factor, white)
        e = jnp.where(jnp.arange(self.particles) < unguided, blind, e)
        wide = jax.tree.map(lambda m: jnp.full(self.particles, m), start)
        moved = lambda e: _add_to_states(wide, names, e)
        x, astray = replace_lost(moved(e), wide)
        oftener = _log_normal(numerics.solve_lower(proposal.factor, e - proposal.mean[:, None]), proposal.factor)
        oftener = oftener - _log_normal(numerics.solve_lower(prior.factor, e), prior.factor)
        share = jnp.asarray(unguided / self.particles, covariance.dtype)
        mixed = jnp.logaddexp(jnp.log(share), jnp.log1p(-share) + oftener)
        return FirstGuided(x, astray, mixed, moved(blind), key)

    def _predict(self, model, belief, row):
        draw, noise = jax.random.split(jax.random.fold_in(belief.key, belief.count))
        u = model.step_inputs(belief.t, row.t, belief.u, row.u)
        moved = model.transition(belief.t, row.t, belief.particles, u)
        moved, lost = replace_lost(moved, belief.particles)
        assert model.process_noise is not None  # `check` ensures it
        law = model.process_noise.over(jnp.maximum(row.t - belief.t, SHORTEST))
        covariance = law.covariance()
        prior = Spread(numerics.cholesky(covariance), covariance)
        rule = _rule_of(self.rule, len(law.names))
        propose = jax.vmap(lambda x: _proposal(model, rule, row, x, law.names, prior))
        proposals = numerics.fence(propose(moved))
        logs = without(lost, log_of(belief.weights))
        first, log_first, alive = numerics.normalise(logs + proposals.log_ahead if self.auxiliary else logs)
        ancestors, resampled = choose_ancestors(self, draw, first)
        taken = lambda tree: jax.tree.map(lambda leaf: leaf[ancestors], tree)
        chosen, start = taken(proposals), gather(moved, ancestors)
        white = numerics.normal(noise, (len(law.names), self.particles), logs.dtype)
        e = chosen.mean.T + jnp.einsum("iqr,ri->qi", chosen.factor, white)
        x = _add_to_states(start, law.names, e)
        # A draw from a proposal, too, can give a particle that is not finite.
        x, astray = replace_lost(x, start)
        ratio = _log_normal(numerics.solve_lower(prior.factor, e), prior.factor) - _log_normal(white, chosen.factor)
        stage = FirstStage(proposals.log_ahead, first, log_first, ancestors, resampled, alive)
        return Proposed(x, astray, ratio, belief, moved, lost, proposals.variances, stage)


def _add_to_states(particles, names, e):
    """The particles with rows e (q, N) added to the states `names`."""
    return particles._replace(**{name: getattr(particles, name) + e[i] for i, name in enumerate(names)})


def _rule_of(name: str, count: int) -> AbstractRule:
    return Slopes() if name == "extended" else Points(sigma_points.unscented(count))


def _proposal(model: StateSpace, rule: AbstractRule, row, moved, names, prior: Spread) -> Proposal:
    """The proposal for the noise on `names` of one particle, which is `moved` after the transition."""
    measured, present = kit.presence(model, row)
    here = jnp.stack([present[name] for name in model.channels])

    def see(e):
        x = moved._replace(**{name: getattr(moved, name) + e[i] for i, name in enumerate(names)})
        observed = model.observation(row.t, x, row.u)
        rows = [jnp.broadcast_to(getattr(observed, name), e.shape[1:]) for name in model.channels]
        rows = [unwrap(model, name, r) for name, r in zip(model.channels, rows, strict=True)]
        return jnp.stack([jnp.where(present[name], r, 0) for name, r in zip(model.channels, rows, strict=True)])

    image = rule.image(see, jnp.zeros(len(names), prior.matrix.dtype), prior.factor)
    given = jnp.stack([measured[name] for name in model.channels])
    innovation = wrapped_innovation(model, given - image.mean, here)
    law = law_at(model, row, lambda: moved)
    found = Covariance().condition(image, law, model.channels, here, innovation, prior)
    count = jnp.sum(here.astype(innovation.dtype))
    distance = jnp.sum(jnp.square(found.white)) + numerics.log_det(found.innovation_factor)
    variances = jnp.diagonal(product(image.deviations, image.deviations, image.signs))
    return Proposal(found.shift, found.spread.factor, -0.5 * (distance + count * kit.LOG_2PI), variances)


def _log_normal(white, factor):
    """Log-density (N,) of draws whose whitened values are `white` (q, N), without the constant -q log(2 pi) / 2."""
    return -0.5 * (jnp.sum(jnp.square(white), axis=0) + numerics.log_det(factor))

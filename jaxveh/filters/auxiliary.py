"""The auxiliary particle filter: particles are chosen by how well they will explain the next measurement."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError, word_for
from jaxveh._core.result import Result, code
from jaxveh.filters.choosing import DRAW_INSTEAD, Scheme, check_ancestors, choose_ancestors, gather, log_chosen, log_of
from jaxveh.filters.looking_ahead import AbstractLookahead, lookahead_for, remark_of, soften
from jaxveh.filters.particle import (
    AbstractAhead,
    AbstractParticleFilter,
    ParticleBelief,
    ParticleFilter,
    add_noise,
    check_particle_settings,
    fate,
    log_prob,
    make_info,
    replace_lost,
    without,
)
from jaxveh.statespace import Smoothing


class FirstStage(NamedTuple):
    """The choice of ancestors: the log look-ahead `ahead` (N,), the first-stage `weights` (N,), the logarithm
    `log_mean` of their mean before they were normalised, the `ancestors` (N,), whether these were drawn (`resampled`;
    None: always), and whether any particle was `alive`."""

    ahead: Any
    weights: Any
    log_mean: Any
    ancestors: Any
    resampled: Any
    alive: Any

    def weigh(self, log_n, drawn, plain, judged, lost) -> SecondStage:
        """The second stage. `log_n`: the logarithm of the number of particles before the step, which with an adaptive number may
        differ from that of this step; log weights (N,): `drawn` after a draw of ancestors, `plain()` without one (an ordinary
        importance step from the weights before, which has their number: not called where ancestors are always drawn);
        `judged` (N,): the log look-ahead of each particle's ancestor, None where ancestors are drawn by their weights alone;
        which particles are `lost`."""
        log_first = self.log_mean
        # By how much more often than by its weight each ancestor was drawn, as a logarithm.
        oftener = jnp.zeros_like(drawn) if judged is None else judged - (log_first + log_n)
        if self.resampled is not None:
            drawn = jnp.where(self.resampled, drawn, plain())
            log_first = jnp.where(self.resampled, log_first, -log_n)
            oftener = jnp.where(self.resampled, oftener, 0.0)
        weights, log_second, alive = numerics.normalise(without(lost, drawn))
        alive = alive & self.alive
        remark = jnp.where(alive, remark_of(weights, oftener), code(Result.successful))
        return SecondStage(weights, log_first + log_n + log_second, alive, remark)


class SecondStage(NamedTuple):
    """The normalised `weights` (N,) after a measurement, the step's `log_likelihood`, whether any particle is `alive`, and the
    `remark` on what the first stage foresaw."""

    weights: Any
    log_likelihood: Any
    alive: Any
    remark: Any


class LookedAhead(AbstractAhead):
    """Particles before their second-stage weights: moved from the belief `before`, some of them `lost` (N,).
    `characteristic`: the point at which the look-ahead judged each particle of the belief; `residual`: its residual
    there by channel; `stage`: the first stage."""

    particles: Any
    lost: Any
    before: ParticleBelief
    characteristic: Any
    residual: Any
    stage: FirstStage

    def update(self, filter_: Any, model, row):
        before, stage = self.before, self.stage
        logs, after = log_prob(model, row, self.particles)
        chosen_ahead = gather((stage.ahead,), stage.ancestors)[0]
        log_n = jnp.log(jnp.asarray(before.weights.shape[0], logs.dtype))
        drawn = logs - chosen_ahead + log_chosen(filter_, log_of(stage.weights), stage.ancestors)
        plain = lambda: logs + log_of(before.weights) + log_n
        weights, total, alive, remark = stage.weigh(log_n, drawn, plain, chosen_ahead, self.lost)
        found = ParticleBelief(self.particles, weights, stage.ancestors, before.key, row.t, row.u, before.count + 1)
        within = _scatter(model, after, gather(self.residual, stage.ancestors))
        both, became = (before.weights, weights), fate(alive, self.lost)
        info = make_info(model, row, total, self.residual, both, became, within, self.characteristic, remark)
        return found, info


class AuxiliaryParticleFilter(AbstractParticleFilter):
    """The auxiliary particle filter (Pitt & Shephard 1999; Bao et al. 2015, eqs 8 to 11).

    A step has first-stage weights `w_{k-1} p(y_k | x_{k-1})`, which `lookahead` approximates, a draw of ancestors,
    propagation, and second-stage weights `p(y_k | x_k) / p(y_k | x_{k-1} of the ancestor)` (erratum: the paper prints
    eq 11 otherwise, and its steps omit the ancestor draw). The likelihood is unbiased for any look-ahead. The scatter
    of the log-likelihood, and with it its downward bias, depends on the look-ahead.

    `lookahead`: `PredictiveLikelihood()`, which includes the process noise, is the default where process and
    measurement noise are Gaussian; `PointLookahead()` is the paper's, p(y_k | mu_k), as sharp as the sensor. For other
    noises the default is `PointLookahead` with a share of ancestors that are drawn without looking ahead. Rows in which
    the first and the second stage disagree have `info.remark = Result.lookahead_misled`, of which `run` warns. Where
    the ESS of the first-stage weights stays above `threshold`, no ancestors are drawn and the step is a bootstrap step.
    """

    smooths: ClassVar[Smoothing] = Smoothing.particles
    particles: int = eqx.field(static=True)
    resampling: Scheme = eqx.field(static=True, default=numerics.systematic)
    threshold: float = eqx.field(static=True, default=1.0)
    lookahead: AbstractLookahead | None = eqx.field(static=True, default=None)
    gradient: str = eqx.field(static=True, default="score")

    def __check_init__(self):
        check_particle_settings(self.particles, self.threshold, self.gradient, self.resampling)
        check_ancestors("AuxiliaryParticleFilter", self.resampling, DRAW_INSTEAD)
        if not isinstance(self.lookahead, AbstractLookahead | None):
            raise InputError(
                f"lookahead = {word_for(self.lookahead)}: must be PredictiveLikelihood(), PointLookahead() or None (what the "
                "model allows). Give a function as PointLookahead(function)."
            )

    def check(self, model):
        if self.lookahead is not None:
            self.lookahead.check(model)

    def _start(self, model, row, key):
        # Before the first row there are no particles to choose from.
        return ParticleFilter(self.particles, self.resampling, self.threshold, self.gradient)._start(model, row, key)

    def _predict(self, model, belief, row):
        draw, noise = jax.random.split(jax.random.fold_in(belief.key, belief.count))
        u = model.step_inputs(belief.t, row.t, belief.u, row.u)
        lookahead = lookahead_for(model) if self.lookahead is None else self.lookahead
        to = (belief.t, row.t)
        characteristic, lost = numerics.fence(
            replace_lost(lookahead.propagate(model, *to, belief.particles, u), belief.particles)
        )
        ahead, residual = lookahead.log_prob(model, row, characteristic, row.t - belief.t)
        log_weights = log_of(belief.weights)
        ahead = soften(ahead, log_weights, ~lost, lookahead.defensive)
        if self.gradient == "score":
            # Its derivative adds nothing to the likelihood's: the choice and the weights cancel.
            ahead = jax.lax.stop_gradient(ahead)
        first, log_first, alive = numerics.normalise(without(lost, ahead + log_weights))
        ancestors, resampled = choose_ancestors(self, draw, first)
        if lookahead.moves_by_transition:
            moved, lost = gather((characteristic, lost), ancestors)
        else:
            chosen = gather(belief.particles, ancestors)
            moved, lost = replace_lost(model.transition(*to, chosen, u), chosen)
        moved, lost = numerics.fence((add_noise(model, noise, moved, row.t - belief.t), lost))
        stage = FirstStage(ahead, first, log_first, ancestors, resampled, alive)
        return LookedAhead(moved, lost, belief, characteristic, residual, stage)


def _scatter(model, residual, ahead):
    """By channel, the variance that the step's noise causes: the mean square distance of particles from the points at
    which their ancestors were judged."""
    gone = {name: residual[name] - ahead[name] for name in model.channels}
    return {
        name: jnp.mean(jnp.square(numerics.wrap_angle(d) if name in model.angles else d)) for name, d in gone.items()
    }

"""The auxiliary particle filter: particles are chosen by how well they will explain the next measurement."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh._core.errors import InputError
from jaxveh._core.result import Result, code
from jaxveh.filters.choosing import log_of
from jaxveh.filters.looking_ahead import AbstractLookahead, lookahead_for, remark_of, softened
from jaxveh.filters.particle import (
    AbstractParticleFilter,
    ParticleBelief,
    ParticleFilter,
    add_noise,
    check_particle_settings,
    check_scheme,
    choose_ancestors,
    fate,
    found_again,
    gather,
    log_chosen,
    log_prob,
    make_info,
    need_key,
    without,
)
from jaxveh.statespace.contract import Smoothing, apart, presence, wrap_angle


class AuxiliaryParticleFilter(AbstractParticleFilter):
    """The auxiliary particle filter (Pitt & Shephard 1999; Bao et al. 2015, eqs 8 to 11).

    First-stage weights `w_{k-1} p(y_k | x_{k-1})` as far as `lookahead` knows it, ancestor draw, propagation, second-stage
    weights `p(y_k | x_k) / p(y_k | x_{k-1} of the ancestor)` (erratum: the paper prints eq 11 otherwise, and its steps omit the
    ancestor draw). The log-likelihood is right for any look-ahead, but its scatter is not, and with it its bias, which is low.

    `lookahead`: `PredictiveLikelihood()`, which counts in the process noise, is the default where process and measurement noise
    are Gaussian; `PointLookahead()` is the paper's, p(y_k | mu_k), sharp as the sensor is. For other noises the default is the
    point with a share of ancestors that are drawn without looking ahead. Rows in which first and second stage disagree have
    `info.remark = Result.lookahead_misled`, and `run` tells of them. Where the ESS of the first-stage weights stays above
    `threshold`, no ancestors are drawn and the step is a bootstrap step.
    """

    smooths: ClassVar[Smoothing] = Smoothing.particles
    particles: int = eqx.field(static=True)
    resampling: Callable = eqx.field(static=True, default=numerics.systematic)
    threshold: float = eqx.field(static=True, default=1.0)
    lookahead: AbstractLookahead | None = eqx.field(static=True, default=None)
    gradient: str = eqx.field(static=True, default="score")

    def __check_init__(self):
        check_particle_settings(self.particles, self.threshold, self.gradient)
        check_scheme(self)
        if not isinstance(self.lookahead, AbstractLookahead | None):
            raise InputError(
                f"lookahead = {self.lookahead!r}: must be PredictiveLikelihood(), PointLookahead() or None (what the model "
                "allows). A function is given as PointLookahead(function)."
            )

    def check(self, model):
        if self.lookahead is not None:
            self.lookahead.check(model)

    def init(self, model, row, key=None):
        return ParticleFilter(self.particles, self.resampling, self.threshold, self.gradient).init(
            model, row, need_key(self, key)
        )

    def step(self, model, belief, row):
        return apart(self._step, belief.count >= 0, model, belief, row)

    def _step(self, model, belief, row):
        draw, noise = jax.random.split(jax.random.fold_in(belief.key, belief.count))
        u = model.step_inputs(belief.t, row.t, belief.u, row.u)
        measured, present = presence(model, row)
        lookahead = lookahead_for(model) if self.lookahead is None else self.lookahead
        to = (belief.t, row.t)
        characteristic, lost = numerics.barrier(
            found_again(lookahead.moved(model, *to, belief.particles, u), belief.particles)
        )
        ahead, residual = lookahead.log_prob(model, row, characteristic, measured, present, row.t - belief.t)
        log_weights = log_of(belief.weights)
        ahead = softened(ahead, log_weights, ~lost, lookahead.defensive)
        if self.gradient == "score":
            # Its derivative is none of the likelihood's: what is gained in the choice is lost in the weights.
            ahead = jax.lax.stop_gradient(ahead)
        first, log_first, alive_first = numerics.normalise(without(lost, ahead + log_weights))
        ancestors, resampled = choose_ancestors(self, draw, first)
        if lookahead.moves_by_transition:
            moved, lost = gather((characteristic, lost), ancestors)
        else:
            chosen = gather(belief.particles, ancestors)
            moved, lost = found_again(model.transition(*to, chosen, u), chosen)
        moved, lost = numerics.barrier((add_noise(model, noise, moved, row.t - belief.t), lost))
        logs, after = log_prob(model, row, moved, measured, present)
        chosen_ahead = gather((ahead,), ancestors)[0]
        # Of the particles before, of which a number that adapts may have left others than it takes.
        n = jnp.asarray(belief.weights.shape[0], logs.dtype)
        drawn = logs - chosen_ahead + log_chosen(self, log_of(first), ancestors)
        oftener = chosen_ahead - (log_first + jnp.log(n))
        if resampled is not None:
            # Without a draw: an ordinary importance step from the weights that were there.
            drawn = jnp.where(resampled, drawn, logs + log_weights + jnp.log(n))
            log_first = jnp.where(resampled, log_first, -jnp.log(n))
            oftener = jnp.where(resampled, oftener, 0.0)
        weights, log_second, alive_second = numerics.normalise(without(lost, drawn))
        log_likelihood = log_first + jnp.log(n) + log_second
        found = ParticleBelief(moved, weights, ancestors, belief.key, row.t, row.u, belief.count + 1)
        alive = alive_first & alive_second
        within = _scatter(model, after, gather(residual, ancestors))
        remark = jnp.where(alive, remark_of(weights, oftener), code(Result.successful))
        both = (belief.weights, weights)
        info = make_info(model, row, log_likelihood, residual, both, fate(alive, lost), within, characteristic, remark)
        return found, info


def _scatter(model, residual, ahead):
    """By channel, the variance that the step's noise makes: how far particles came from where their ancestors were to be."""
    gone = {name: residual[name] - ahead[name] for name in model.channels}
    return {name: jnp.mean(jnp.square(wrap_angle(d) if name in model.angles else d)) for name, d in gone.items()}

"""The auxiliary particle filter: particles are chosen by how well they will explain the next measurement."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxveh import numerics
from jaxveh.filters.choosing import log_of
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

    First-stage weights `w_{k-1} p(y_k | mu_k)`, ancestor draw, propagation, second-stage weights
    `p(y_k | x_k) / p(y_k | mu_k of the ancestor)` (erratum: the paper prints eq 11 otherwise, and its steps omit the
    ancestor draw). `lookahead(model, t0, t1, x, u) -> mu` is the characteristic of the transition, elementwise; by
    default its mean, the propagated state without noise, which then is not computed twice. Where the ESS of the
    first-stage weights stays above `threshold`, no ancestors are drawn and the step is a bootstrap step.
    """

    smooths: ClassVar[Smoothing] = Smoothing.particles
    particles: int = eqx.field(static=True)
    resampling: Callable = eqx.field(static=True, default=numerics.systematic)
    threshold: float = eqx.field(static=True, default=1.0)
    lookahead: Callable | None = eqx.field(static=True, default=None)
    gradient: str = eqx.field(static=True, default="score")

    def __check_init__(self):
        check_particle_settings(self.particles, self.threshold, self.gradient)
        check_scheme(self)

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
        characteristic, lost = self._look(model, belief, row, u)
        ahead, residual = log_prob(model, row, characteristic, measured, present)
        first, log_first, alive_first = numerics.normalise(without(lost, ahead + log_of(belief.weights)))
        ancestors, resampled = choose_ancestors(self, draw, first)
        if self.lookahead is None:
            moved, lost = gather((characteristic, lost), ancestors)
        else:
            chosen = gather(belief.particles, ancestors)
            moved, lost = found_again(model.transition(belief.t, row.t, chosen, u), chosen)
        moved, lost = numerics.barrier((add_noise(model, noise, moved, row.t - belief.t), lost))
        logs, after = log_prob(model, row, moved, measured, present)
        chosen_ahead = gather((ahead,), ancestors)[0]
        # Of the particles before, of which a number that adapts may have left others than it takes.
        n = jnp.asarray(belief.weights.shape[0], logs.dtype)
        drawn = logs - chosen_ahead + log_chosen(self, log_of(first), ancestors)
        if resampled is not None:
            # Without a draw: an ordinary importance step from the weights that were there.
            drawn = jnp.where(resampled, drawn, logs + log_of(belief.weights) + jnp.log(n))
            log_first = jnp.where(resampled, log_first, -jnp.log(n))
        weights, log_second, alive_second = numerics.normalise(without(lost, drawn))
        log_likelihood = log_first + jnp.log(n) + log_second
        found = ParticleBelief(moved, weights, ancestors, belief.key, row.t, row.u, belief.count + 1)
        became = fate(alive_first & alive_second, lost)
        within = _scatter(model, after, gather(residual, ancestors))
        info = make_info(
            model, row, log_likelihood, residual, (belief.weights, weights), became, within, characteristic
        )
        return found, info

    def _look(self, model, belief, row, u):
        if self.lookahead is None:
            moved = model.transition(belief.t, row.t, belief.particles, u)
        else:
            moved = self.lookahead(model, belief.t, row.t, belief.particles, u)
        return numerics.barrier(found_again(moved, belief.particles))


def _scatter(model, residual, ahead):
    """By channel, the variance that the step's noise makes: how far particles came from where their ancestors were to be."""
    gone = {name: residual[name] - ahead[name] for name in model.channels}
    return {name: jnp.mean(jnp.square(wrap_angle(d) if name in model.angles else d)) for name, d in gone.items()}

"""The Rao-Blackwellised particle filter: states that are linear given the others are estimated by one Kalman filter per
particle."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh import numerics
from jaxveh._core.errors import InputError
from jaxveh._core.names import as_names, check_names, record
from jaxveh.filters.choosing import DRAW_INSTEAD, Scheme, check_ancestors, choose_ancestors, log_chosen, log_of
from jaxveh.filters.gaussian.filter import check_covariances, check_gaussian, measurements_of, wrapped_innovation
from jaxveh.filters.gaussian.forms import Covariance, Spread
from jaxveh.filters.gaussian.known_numbers import look_inside_jit
from jaxveh.filters.gaussian.noises import covariance_in
from jaxveh.filters.gaussian.rules import Image, product, times
from jaxveh.filters.particle import (
    SHORTEST,
    AbstractAhead,
    AbstractParticleFilter,
    check_particle_settings,
    fate,
    make_info,
    mean_variances,
    replace_lost,
    without,
)
from jaxveh.statespace import AbstractBelief, StateSpace, kit


class MarginalisedBelief(AbstractBelief):
    """Weighted particles, each with a Gaussian over the linear states.

    `particles`: the state's NamedTuple with (N,) in each field, the conditional means for the linear states; `covariances`
    (N, l, l) of the linear states given each particle, in the order of the filter's `linear`; `weights` (N,), `ancestors` (N,).
    """

    particles: Any
    covariances: jax.Array
    weights: jax.Array
    ancestors: jax.Array
    key: Any
    t: Any
    u: Any
    count: Any
    linear: tuple[str, ...] = eqx.field(static=True)

    @property
    def mean(self):
        """The state's mean."""
        return jax.tree.map(lambda field: numerics.total(self.weights * field), self.particles)

    @property
    def covariance(self):
        """The covariance (n, n) in the order of the state's fields: between particles plus within them."""
        names = self.particles._fields
        centred = jnp.stack([field - m for field, m in zip(self.particles, self.mean, strict=True)])
        place = np.array([names.index(name) for name in self.linear])
        within = jnp.sum(self.weights[:, None, None] * self.covariances, axis=0)
        between = times(centred * self.weights, centred.T)
        return between.at[np.ix_(place, place)].add(within)

    @property
    def std(self):
        """The state's standard deviations."""
        return type(self.particles)(*numerics.sqrt(jnp.diagonal(self.covariance)))

    def sample(self, key, draws):
        which, inside = jax.random.split(key)
        chosen = jax.random.categorical(which, log_of(self.weights), shape=(draws,))
        points, P = jax.tree.map(lambda leaf: leaf[chosen], (self.particles, self.covariances))
        white = numerics.normal(inside, (draws, len(self.linear)), self.weights.dtype)
        moved = jax.vmap(lambda P, w: times(numerics.cholesky(P), w), out_axes=1)(P, white)
        return points._replace(**{n: getattr(points, n) + moved[i] for i, n in enumerate(self.linear)})

    def moments(self, model):
        kinds = []

        def shown(values, point):
            x = point._replace(**dict(zip(self.linear, values, strict=True)))
            report = model.report(self.t, x, self.u)
            kinds.append(type(report))
            return jnp.stack([jnp.asarray(value, values.dtype) for value in report])

        def of(point, covariance):
            values = jnp.stack([getattr(point, name) for name in self.linear])
            seen, slope = jax.linearize(lambda v: shown(v, point), values)
            J = jax.vmap(slope, out_axes=1)(jnp.eye(len(values), dtype=values.dtype))
            return seen, jnp.sum(times(J, covariance) * J, axis=1)

        seen, within = jax.vmap(of)(self.particles, self.covariances)
        weights = self.weights[:, None]
        mean = jnp.sum(weights * seen, axis=0)
        variance = jnp.sum(weights * (within + jnp.square(seen - mean)), axis=0)
        return kinds[0](*mean), kinds[0](*numerics.sqrt(variance))


class CloudWeights(NamedTuple):
    """Ancestors, weights, and the weights' logarithms with the derivative of the choice, before a measurement."""

    ancestors: Any
    weights: Any
    log_weights: Any


class Cloud(AbstractAhead):
    """Particles before their measurement: the state's NamedTuple with (N,) fields, `covariances` (N, l, l), their
    weights in `prior`, the filter's `key`, and the `count` of rows before."""

    particles: Any
    covariances: Any
    prior: Any
    key: Any
    count: Any

    def update(self, filter_: Any, model, row):
        linear, prior = filter_.linear, self.prior
        given, here = measurements_of(model, row)

        def see(point, P):
            observe = lambda x: [getattr(model.observation(row.t, x, row.u), name) for name in model.channels]
            mean, H = _slopes(linear, point, observe)
            root = numerics.cholesky(P)
            image = Image(mean, jnp.where(here[:, None], times(H, root), 0), root, None)
            innovation = wrapped_innovation(model, given - mean, here)
            found = Covariance().condition(
                image, model.measurement_noise, model.channels, here, innovation, Spread(root, P)
            )
            present_ = jnp.sum(here.astype(innovation.dtype))
            distance = jnp.sum(jnp.square(found.white)) + numerics.log_det(found.innovation_factor)
            variances = jnp.diagonal(product(image.deviations, image.deviations, None))
            return -0.5 * (distance + present_ * kit.LOG_2PI), innovation, variances, found.shift, found.spread.matrix

        logs, residual, variances, shift, P = jax.vmap(see)(self.particles, self.covariances)
        given_y = {name: getattr(self.particles, name) + shift[:, i] for i, name in enumerate(linear)}
        particles, astray = replace_lost(self.particles._replace(**given_y), self.particles)
        P = jnp.where(astray[:, None, None], self.covariances, P)
        weights, log_mean, alive = numerics.normalise(without(astray, logs + prior.log_weights))
        log_likelihood = log_mean + jnp.log(jnp.asarray(filter_.particles, weights.dtype))
        belief = MarginalisedBelief(
            particles, P, weights, prior.ancestors, self.key, row.t, row.u, self.count + 1, linear
        )
        by_name = dict(zip(model.channels, residual.T, strict=True))
        within = mean_variances(model, prior.weights, variances)
        became = fate(alive, jnp.isneginf(prior.log_weights))
        info = make_info(model, row, log_likelihood, by_name, (prior.weights, weights), became, within)
        return belief, info


class Marginalised(AbstractParticleFilter):
    """The Rao-Blackwellised, or marginalised, particle filter (T. Schon, F. Gustafsson & P.-J. Nordlund 2005).

    Given the path of the other states, transition and observation must be linear in the states `linear`, and noises
    Gaussian: each particle carries the exact Gaussian of its linear states. With z the other states, x the linear
    states, and J the slopes of the transition with respect to x:

        (z, x)_{k+1} ~ N(f, J P J^T + Q),   z is drawn, and x conditioned on the drawn z
        weights: N(y; h, H P H^T + R),      and x is conditioned on y

    It needs fewer particles than a filter that draws all states; the more the linear states vary, the fewer. Every other state
    must have process noise, and all noises must have covariances. A model that is not linear in `linear` raises `InputError`.
    """

    particles: int = eqx.field(static=True)
    linear: tuple[str, ...] = eqx.field(static=True, converter=as_names)
    resampling: Scheme = eqx.field(static=True, default=numerics.systematic)
    threshold: float = eqx.field(static=True, default=1.0)
    gradient: str = eqx.field(static=True, default="score")

    def __check_init__(self):
        check_particle_settings(self.particles, self.threshold, self.gradient, self.resampling)
        check_ancestors("Marginalised", self.resampling, DRAW_INSTEAD)
        if not self.linear:
            raise InputError("Marginalised.linear is empty: name the states that are linear given the others.")

    def check(self, model):
        check_names("Marginalised.linear", self.linear, model.states)
        check_covariances("Marginalised", model)
        kit.check_fixed("Marginalised", model.measurement_noise, "Take Guided or ParticleFilter.")
        check_gaussian("Marginalised", "measurement noise", model.measurement_noise)
        check_gaussian("Marginalised", "prior", model.prior.law)
        if model.process_noise is None:
            raise InputError("Marginalised: the model has no process noise, which its drawn states need. Use Kalman.")
        check_gaussian("Marginalised", "process noise", model.process_noise.law)
        noisy = model.process_noise.law.names
        still = [name for name in _others(self, model) if name not in noisy]
        if still:
            raise InputError(
                f"Marginalised: the drawn states {', '.join(still)} have no process noise, which the conditional Gaussians "
                "need. Make them linear states, or use ParticleFilter."
            )
        _check_linear_in(self.linear, model)

    def _start(self, model, row, key):
        draw, key = jax.random.split(key)
        dtype = model.dtype
        n, others = self.particles, _others(self, model)
        order = np.array([model.states.index(name) for name in (*others, *self.linear)])
        joint = model.prior.covariance()[order][:, order]
        mean = jnp.stack(model.prior.mean)[order]
        white = numerics.normal(draw, (len(others), n), dtype)
        drawn = jax.vmap(lambda w: _condition_on_first(mean, joint, w), in_axes=1)(white)
        weights = jnp.full((n,), 1 / n, dtype)
        start = _as_state(self, model, drawn.z.T, drawn.x.T), drawn.P
        ancestors = jnp.arange(n, dtype=jnp.int32)
        return Cloud(*start, CloudWeights(ancestors, weights, log_of(weights)), key, jnp.int32(0))

    def _predict(self, model, belief, row):
        draw, noise = jax.random.split(jax.random.fold_in(belief.key, belief.count))
        ancestors, resampled = choose_ancestors(self, draw, belief.weights)
        uniform = jnp.full((self.particles,), 1 / self.particles, belief.weights.dtype)
        logs = log_of(belief.weights)
        chosen = log_of(uniform) + log_chosen(self, logs, ancestors)
        weights = numerics.normalise(chosen)[0] if self.scheme.reweights else uniform
        if resampled is not None:
            weights = jnp.where(resampled, weights, belief.weights)
            chosen = jnp.where(resampled, chosen, logs)
        points, covariances = (
            jax.tree.map(lambda leaf: leaf[ancestors], t) for t in (belief.particles, belief.covariances)
        )
        u = model.step_inputs(belief.t, row.t, belief.u, row.u)
        assert model.process_noise is not None  # `check` ensures it
        law = model.process_noise.over(jnp.maximum(row.t - belief.t, SHORTEST))
        others = _others(self, model)
        Q = covariance_in(law, (*others, *self.linear), weights.dtype)
        white = numerics.normal(noise, (len(others), self.particles), weights.dtype)

        def move(point, P, white):
            f = lambda x: model.transition(belief.t, row.t, x, u)
            mean, J = _slopes(self.linear, point, lambda x: [getattr(f(x), n) for n in (*others, *self.linear)])
            return _condition_on_first(mean, times(times(J, P), J.T) + Q, white)

        moved = jax.vmap(move, in_axes=(0, 0, 1))(points, covariances, white)
        moved = numerics.fence(moved)
        particles, lost = replace_lost(_as_state(self, model, moved.z.T, moved.x.T), points)
        lost = lost | ~jnp.all(jnp.isfinite(moved.P), axis=(1, 2))
        P = jnp.where(lost[:, None, None], covariances, moved.P)
        return Cloud(particles, P, CloudWeights(ancestors, weights, without(lost, chosen)), belief.key, belief.count)


class GivenDraw(NamedTuple):
    """Drawn states z (q,), and the Gaussian (x, P) of the linear states given them."""

    z: Any
    x: Any
    P: Any


def _condition_on_first(mean, covariance, white) -> GivenDraw:
    """The first q = len(white) of jointly Gaussian numbers, drawn by means of `white` (q,), and the others given them."""
    q = white.shape[0]
    if q == 0:
        return GivenDraw(white, mean, covariance)
    factor = numerics.cholesky(covariance[:q, :q])
    gain = numerics.solve_lower(factor, covariance[:q, q:])
    P = covariance[q:, q:] - times(gain.T, gain)
    return GivenDraw(mean[:q] + times(factor, white), mean[q:] + times(gain.T, white), P)


def _slopes(linear: tuple[str, ...], point, function) -> tuple[Any, Any]:
    """Values (m,) of a function of the state at `point`, and their slopes (m, l) with respect to the linear states."""
    values = jnp.stack([getattr(point, name) for name in linear])

    def rows(values):
        x = point._replace(**dict(zip(linear, values, strict=True)))
        return jnp.stack([jnp.asarray(value, values.dtype) for value in function(x)])

    seen, slope = jax.linearize(rows, values)
    return seen, jax.vmap(slope, out_axes=1)(jnp.eye(len(linear), dtype=values.dtype))


def _others(filter_: Marginalised, model: StateSpace) -> tuple[str, ...]:
    return tuple(name for name in model.states if name not in filter_.linear)


def _as_state(filter_: Marginalised, model: StateSpace, z, x) -> Any:
    """The state's NamedTuple, made of rows z (q, N) and x (l, N)."""
    values = dict(zip((*_others(filter_, model), *filter_.linear), (*z, *x), strict=True))
    return type(model.prior.mean)(**values)


def _check_linear_in(linear: tuple[str, ...], model: StateSpace) -> None:
    """Raise `InputError` with the name of the first state or channel that is not linear in the states `linear`. Tracers pass."""
    found = look_inside_jit(lambda model: _nonlinear_in(linear, model), model)
    if found is None:
        return
    for what, names, nonlinear in zip(("state", "channel"), (model.states, model.channels), found, strict=True):
        if nonlinear.any():
            raise InputError(
                f"Marginalised: {what} {names[int(np.argmax(nonlinear))]} is not linear in {', '.join(linear)}. "
                "Name fewer states in `linear`, or use Guided."
            )


# Compiled: without jit it would take longer than filtering a short recording.
@eqx.filter_jit
def _nonlinear_in(linear: tuple[str, ...], model: StateSpace) -> list[Any]:
    """Whether each state (n,) and each channel (m,) is nonlinear in the states `linear`."""
    dtype = model.dtype
    t0, t1 = jnp.zeros((), dtype), jnp.asarray(0.01, dtype)
    u = record("Inputs", {name: jnp.asarray(1.0, dtype) for name in model.inputs})
    spread = dict(zip(model.states, 10.0 * jnp.sqrt(jnp.diagonal(model.prior.covariance())), strict=True))
    # Not at the means of the other states: where one of them is zero, a product with it would seem linear.
    point = type(model.prior.mean)(**{n: m + 0.1 * spread[n] for n, m in model.prior.mean._asdict().items()})
    move = lambda x: model.transition(t0, t1, x, model.step_inputs(t0, t1, u, u))
    see = lambda x: model.observation(t0, x, u)
    found = []
    for names, f in ((model.states, move), (model.channels, see)):
        seen, slopes = _slopes(linear, point, lambda x, f=f, names=names: [getattr(f(x), n) for n in names])
        step = jnp.stack([spread[name] * math.cos(1.0 + 2.0 * i) for i, name in enumerate(linear)])
        moved = point._replace(**{n: getattr(point, n) + step[i] for i, n in enumerate(linear)})
        there = jnp.stack([jnp.asarray(getattr(f(moved), n), dtype) for n in names])
        slope = times(slopes, step)
        size = jnp.abs(seen) + jnp.abs(slope) + jnp.abs(there)
        found.append(jnp.abs(there - seen - slope) > 1e3 * jnp.finfo(dtype).eps * size)
    return found

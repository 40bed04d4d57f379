"""Particle filters against exact answers: Kalman on linear models, a dense grid on a nonlinear one, scipy's densities."""

import functools
from collections import namedtuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.special
import scipy.stats
from filter_systems import kalman, linear_model, linear_recording, nile_model

from jaxveh import Recording, filters, numerics
from jaxveh import statespace as ss

pytestmark = pytest.mark.product

RUNS = 300


def _halfway(model, t0, t1, x, u):
    """A poor look-ahead on purpose: the filter must stay unbiased whatever it is."""
    moved = model.transition(t0, t1, x, u)
    return type(x)(*[0.5 * (a + b) for a, b in zip(x, moved, strict=True)])


def _spread(kind, scheme, threshold, **kwargs):
    name = f"{kind.__name__.removesuffix('ParticleFilter')}-{scheme}-{threshold}{'-lookahead' if kwargs else ''}"
    return pytest.param(kind(200, getattr(numerics, scheme), threshold, **kwargs), id=name)


FILTERS = [
    _spread(filters.ParticleFilter, "residual", 1.0),
    _spread(filters.ParticleFilter, "multinomial", 1.0),
    _spread(filters.ParticleFilter, "stratified", 0.5),
    _spread(filters.AuxiliaryParticleFilter, "systematic", 0.5),
    _spread(filters.AuxiliaryParticleFilter, "multinomial", 0.5, lookahead=filters.PointLookahead(_halfway)),
    _spread(filters.AuxiliaryParticleFilter, "stratified", 1.0),
]


def _many(filter_, model, rows, runs=RUNS, seed=0):
    """Log-likelihoods, last means and info of independent runs."""

    @jax.jit
    def one(key):
        estimate = filters.scan(filter_, model, rows, key)
        return estimate.log_likelihood, jnp.stack(jax.tree.map(lambda m: m[-1], estimate.mean)), estimate.info.ess

    keys = jax.random.split(jax.random.key(seed), runs)
    return [np.asarray(value) for value in jax.vmap(one)(keys)]


def _assert_unbiased(log_likelihoods, exact):
    """E[exp(ll)] is the exact likelihood: the mean within three standard errors, which must be small themselves."""
    ratio = np.exp(log_likelihoods - exact)
    error = ratio.std() / np.sqrt(len(ratio))
    assert error < 0.06
    assert abs(ratio.mean() - 1) < 3 * error


@pytest.mark.parametrize("filter_", FILTERS)
def test_likelihood_is_unbiased_and_means_are_consistent(filter_):
    model = linear_model(2, 2, seed=7)
    model = eqx.tree_at(lambda m: m.measurement_noise, model, model.measurement_noise.times(3.0))
    recording = linear_recording(model, rows=12)
    exact = kalman(model, recording)
    log_likelihoods, means, ess = _many(filter_, model, model.rows(recording))
    _assert_unbiased(log_likelihoods, exact["log_likelihood"].sum())
    # Runs weighted by their likelihood together are one large importance sample of the posterior.
    weights = np.exp(log_likelihoods - log_likelihoods.max())[:, None]
    weights /= weights.sum()
    mean = (weights * means).sum(axis=0)
    error = np.sqrt((weights**2 * (means - mean) ** 2).sum(axis=0))
    assert (np.abs(mean - exact["mean"][-1]) < 3.5 * error).all()
    assert (error < 0.1 * np.sqrt(np.diagonal(exact["covariance"][-1]))).all()
    assert (ess >= 1).all()
    assert (ess <= 200 + 1e-9).all()


State = namedtuple("State", "x")
Square = namedtuple("Square", "y")


def _growth(system, t0, t1, x, u):
    """The growth model of Gordon, Salmond & Smith (1993), eq. 29."""
    return State(x.x / 2 + 25 * x.x / (1 + x.x**2) + 8 * jnp.cos(1.2 * t1))


def _grid_filter(measured, std, points=1001):
    """Log-likelihood and means of the growth model by Bayes' rule on a dense grid."""
    grid = np.linspace(-60, 60, points)
    width = grid[1] - grid[0]
    density, total, means = scipy.stats.norm.pdf(grid, 0.0, 2.0), 0.0, []
    for k, y in enumerate(measured):
        if k:
            moved = grid / 2 + 25 * grid / (1 + grid**2) + 8 * np.cos(1.2 * k)
            density = scipy.stats.norm.pdf(grid[:, None], moved[None, :], np.sqrt(10.0)) @ density * width
        density = density * (1.0 if np.isnan(y) else scipy.stats.norm.pdf(y, grid**2 / 20, std))
        mass = density.sum() * width
        total, density = total + np.log(mass), density / mass
        means.append((grid * density).sum() * width)
    return total, np.array(means)


@pytest.mark.parametrize(("kind", "std"), [(filters.ParticleFilter, 1.0), (filters.AuxiliaryParticleFilter, 1.0)])
def test_growth_model_equals_a_dense_grid(kind, std):
    model = ss.StateSpace(
        transition=_growth,
        observation=lambda s, t, x, u: Square(x.x**2 / 20),
        process_noise=ss.Discrete(ss.Gaussian({"x": 10.0**0.5})),
        measurement_noise=ss.Gaussian({"y": std}),
        prior=ss.Prior(State(0.0), {"x": 2.0}),
    )
    rng = np.random.default_rng(2)
    x, measured = 1.0, []
    for k in range(12):
        x = x / 2 + 25 * x / (1 + x**2) + 8 * np.cos(1.2 * k) + rng.normal() * 10**0.5 if k else x
        measured.append(np.nan if k == 4 else x**2 / 20 + std * rng.normal())
    exact, means = _grid_filter(measured, std)
    rows = model.rows(Recording(np.arange(12.0), {"y": measured}))
    log_likelihoods, last, _ = _many(kind(500), model, rows, runs=100)
    _assert_unbiased(log_likelihoods, exact)
    error = last[:, 0].std() / np.sqrt(100)
    assert abs(last[:, 0].mean() - means[-1]) < 4 * error + 0.02
    assert error < 0.1


@pytest.mark.parametrize(
    ("law", "density"),
    [
        (ss.StudentT(2.5, {"flow": 80.0}), lambda r: scipy.stats.t.pdf(r, 2.5, scale=80.0)),
        (
            ss.CauchyGaussianMixture(0.3, {"flow": 90.0}, {"flow": 120.0}),
            lambda r: 0.3 * scipy.stats.cauchy.pdf(r, scale=90.0) + 0.7 * scipy.stats.norm.pdf(r, scale=120.0),
        ),
    ],
    ids=["StudentT", "CauchyGaussianMixture"],
)
def test_heavy_tails_weigh_by_scipy_s_densities(law, density):
    model = eqx.tree_at(lambda m: m.measurement_noise, nile_model(1000.0, 300.0), law)
    init = eqx.filter_jit(filters.ParticleFilter(500).init)
    belief, info = init(model, model.row(0.0, {}, {"flow": 3000.0}), jax.random.key(1))
    likelihoods = density(3000.0 - np.asarray(belief.particles.level))
    np.testing.assert_allclose(info.log_likelihood, np.log(likelihoods.mean()), rtol=1e-12)
    np.testing.assert_allclose(belief.weights, likelihoods / likelihoods.sum(), rtol=1e-10)
    np.testing.assert_allclose(info.ess, likelihoods.sum() ** 2 / (likelihoods**2).sum(), rtol=1e-9)


@functools.cache
def restless():
    """A model, a drive drawn from it, and the exact answer."""
    model = linear_model(2, 2, seed=7)
    model = eqx.tree_at(lambda m: m.measurement_noise, model, ss.Gaussian({"y0": 0.6, "y1": 0.5}))
    recording = ss.draw(model, linear_recording(model, rows=12), jax.random.key(0)).recording
    R = ss.MultivariateGaussian(("y0", "y1"), np.diag([0.36, 0.25]))
    return model, recording, kalman(eqx.tree_at(lambda m: m.measurement_noise, model, R), recording)


@pytest.mark.parametrize(
    "filter_",
    [
        filters.ParticleFilter(4000),
        filters.AuxiliaryParticleFilter(4000),
        filters.AuxiliaryParticleFilter(4000, threshold=0.5),
        filters.Guided(4000),
        filters.Guided(4000, "unscented", auxiliary=True),
        filters.Marginalised(4000, ("x1",)),
    ],
    ids=["bootstrap", "auxiliary", "auxiliary, seldom", "guided", "guided, auxiliary", "marginalised"],
)
def test_innovations_and_their_spread_are_the_kalman_filter_s(filter_):
    """Process noise is most of what a step adds, so that a spread without it would be far off."""
    model, recording, exact = restless()
    info = filters.run(filter_, model, recording, key=jax.random.key(1)).info
    std = np.stack(info.innovation_std, axis=-1)
    np.testing.assert_allclose(std, exact["innovation_std"], rtol=0.05)
    np.testing.assert_allclose(np.stack(info.innovation, axis=-1), exact["innovation"], atol=0.12)


def test_belief_s_summaries():
    rng = np.random.default_rng(0)
    particles, weights = rng.normal(3.0, 2.0, size=(2, 400)), rng.uniform(size=400)
    weights /= weights.sum()
    pair = namedtuple("Pair", "a b")(*particles)

    @jax.jit
    def summaries(pair, weights):
        belief = filters.ParticleBelief(
            pair, weights, np.arange(400), jax.random.key(0), jnp.asarray(0.0), (), jnp.int32(0)
        )
        moments = belief.mean, belief.covariance, belief.std
        return moments, (belief.quantile(0.05), belief.quantile(0.95)), belief.moments(nile_model())

    (mean, covariance, std), (low, high), (shown, spread) = summaries(pair, weights)
    np.testing.assert_allclose(mean, particles @ weights, rtol=1e-12)
    expected = np.cov(particles, aweights=weights, ddof=0)
    np.testing.assert_allclose(covariance, expected, rtol=1e-12)
    np.testing.assert_allclose(std, np.sqrt(np.diag(expected)), rtol=1e-12)
    for field, row in zip("ab", particles, strict=True):
        at_most = weights[row <= getattr(low, field)].sum()
        assert 0.05 <= at_most < 0.05 + weights.max() + 1e-12
        assert weights[row <= getattr(high, field)].sum() >= 0.95
    np.testing.assert_allclose(shown, mean, rtol=1e-12)
    np.testing.assert_allclose(spread, std, rtol=1e-10)


def test_a_report_is_averaged_over_the_particles():
    shown = namedtuple("Shown", "square constant")
    base = nile_model(10.0, 3.0)
    model = ss.StateSpace(
        transition=base.transition_function,
        observation=base.observation_function,
        process_noise=base.process_noise,
        measurement_noise=base.measurement_noise,
        prior=base.prior,
        report=lambda s, t, x, u: shown(x.level**2, t),
    )

    @eqx.filter_jit
    def after_a_row(filter_):
        belief, _ = filter_.init(model, model.row(7.0, {}, {}), jax.random.key(1))
        return belief, *belief.moments(model)

    belief, mean, std = after_a_row(filters.ParticleFilter(200))
    levels = np.asarray(belief.particles.level)
    np.testing.assert_allclose(mean, (np.mean(levels**2), 7.0), rtol=1e-12)
    np.testing.assert_allclose(std, (np.std(levels**2), 0.0), rtol=1e-9)
    _, mean, std = after_a_row(filters.Unscented())
    # The unscented transform is exact to second order: E[x^2] = 10^2 + 3^2; its beta is 2.
    np.testing.assert_allclose(mean, (109.0, 7.0), rtol=1e-12)
    np.testing.assert_allclose(std, (np.sqrt(2 * 9.0**2 + (60.0**2)), 0.0), rtol=1e-9)


def _blind(key, weights, n):
    """Ancestors that depend on the key alone, so that no difference of parameters can move them."""
    return jnp.sort(jax.random.randint(key, (n,), 0, n))


@pytest.mark.parametrize(
    "filter_",
    [
        pytest.param(filters.ParticleFilter(25, _blind, gradient="held"), id="PF-blind"),
        pytest.param(filters.AuxiliaryParticleFilter(25, threshold=0.7, gradient="held"), id="APF-systematic"),
    ],
)
def test_gradient_equals_differences_with_frozen_ancestors(filter_):
    model = linear_model(2, 2, seed=4)
    model = eqx.tree_at(lambda m: m.prior.law, model, ss.Gaussian({"x0": 0.7, "x1": 1.2}))
    rows, key = model.rows(linear_recording(model, rows=10)), jax.random.key(5)
    both = jax.jit(jax.value_and_grad(lambda m: filters.scan(filter_, m, rows, key).log_likelihood))
    leaves, treedef = jax.tree.flatten(model)
    slopes = jax.tree.leaves(both(model)[1])
    # Of systematic resampling a step this small moves no ancestor here.
    rng, step = np.random.default_rng(0), 1e-6
    for i, leaf in enumerate(leaves):
        direction = rng.normal(size=leaf.shape)
        direction = direction + direction.T if leaf.ndim == 2 and leaf.shape[0] == leaf.shape[1] else direction
        ends = [
            float(both(jax.tree.unflatten(treedef, [*leaves[:i], leaf + s * step * direction, *leaves[i + 1 :]]))[0])
            for s in (1, -1)
        ]
        difference = (ends[0] - ends[1]) / (2 * step)
        assert abs(difference) > 1e-3
        np.testing.assert_allclose(np.sum(slopes[i] * direction), difference, rtol=1e-6, atol=1e-6)

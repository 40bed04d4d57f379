"""The algebra that filters share beside its equations in NumPy, un-jitted: forms of a covariance, look-aheads, weights.

Each form gives the same Gaussian: S = E W E^T + R, K = X W E^T S^-1, m + K r, P - K S K^T, and backwards
m + G (m_s - m'), P + G (P_s - P') G^T with G = X W E^T P'^-1.
"""

from collections import namedtuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import spd
from test_every_filter import FILTERS

from jaxveh import InputError, Result, filters, numerics
from jaxveh import statespace as ss
from jaxveh.filters.auxiliary import FirstStage
from jaxveh.filters.choosing import choose_ancestors, log_of
from jaxveh.filters.gaussian.filter import AbstractRuleFilter
from jaxveh.filters.gaussian.forms import Later, Spread, masked_factor
from jaxveh.filters.gaussian.rules import Image, spread_of
from jaxveh.filters.looking_ahead import lookahead_for, remark_of, soften
from jaxveh.statespace import Row

FORMS = {"covariance": filters.Covariance, "square root": filters.SquareRoot, "singular values": filters.SingularValues}
FIELDS = ("a", "b")
NOISES = {
    "of all": ss.MultivariateGaussian(FIELDS, [[0.5, 0.2], [0.2, 0.4]]),
    "in another order": ss.MultivariateGaussian(("b", "a"), [[0.4, 0.2], [0.2, 0.5]]),
    "of one": ss.Gaussian({"b": 0.7}),
}
COVARIANCES = {"of all": [[0.5, 0.2], [0.2, 0.4]], "of one": [[0.0, 0.0], [0.0, 0.49]]}
COVARIANCES["in another order"] = COVARIANCES["of all"]


def image(signs=None):
    """Deviations (2, 5) of a function of three states, and their own (3, 5)."""
    rng = np.random.default_rng(4)
    both = rng.normal(size=(5, 5))
    return Image(jnp.zeros(2), jnp.asarray(both[:2]), jnp.asarray(both[2:]), signs)


def moments(image):
    """E W E^T, X W E^T and X W X^T."""
    E, X = np.asarray(image.deviations), np.asarray(image.spread)
    W = np.eye(5) if image.signs is None else np.diag(image.signs)
    return E @ W @ E.T, X @ W @ E.T, X @ W @ X.T


def covariance_of(spread):
    """F F^T, which is the matrix where the form keeps one."""
    P = np.asarray(spread.factor) @ np.asarray(spread.factor).T
    if spread.matrix is not None:
        np.testing.assert_allclose(spread.matrix, P, rtol=1e-9, atol=1e-12)
    return P


def spread_in(form, P):
    """A covariance in a form."""
    return form.start(jnp.asarray(P))


def signs_of(form):
    """Weights of both signs where a form takes them; the sums stay positive."""
    return [None, np.array([1.0, 1.0, 1.0, 1.0, -1e-3])] if form.negative_weights else [None]


@pytest.mark.parametrize("kind", FORMS)
@pytest.mark.parametrize("noise", NOISES)
def test_every_form_adds_noise_and_conditions_as_the_equations_say(kind, noise):
    form, law = FORMS[kind](), NOISES[noise]
    for signs in signs_of(form):
        given = image(signs)
        EE, XE, P = moments(given)
        np.testing.assert_allclose(spread_of(given), np.diag(EE), rtol=1e-12)
        np.testing.assert_allclose(covariance_of(form.add(given, law, FIELDS)), EE + COVARIANCES[noise], rtol=1e-9)
        np.testing.assert_allclose(covariance_of(form.add(given, None, FIELDS)), EE, rtol=1e-9)
        S = EE + COVARIANCES["of all"]
        K, r = XE @ np.linalg.inv(S), np.array([0.3, -0.8])
        told = form.condition(
            given, NOISES["of all"], FIELDS, np.array([True, True]), jnp.asarray(r), spread_in(form, P)
        )
        np.testing.assert_allclose(told.innovation_factor @ told.innovation_factor.T, S, rtol=1e-9)
        np.testing.assert_allclose(np.sum(np.square(told.white)), r @ np.linalg.solve(S, r), rtol=1e-9)
        np.testing.assert_allclose(told.shift, K @ r, rtol=1e-9)
        np.testing.assert_allclose(covariance_of(told.spread), P - K @ S @ K.T, rtol=1e-8, atol=1e-10)
        if form.triangular:
            np.testing.assert_array_equal(np.triu(told.spread.factor, 1), 0.0)


@pytest.mark.parametrize("kind", FORMS)
def test_a_missing_channel_has_an_error_of_its_own_of_unit_variance(kind):
    """With its deviations and its innovation zero it changes nothing."""
    form, given = FORMS[kind](), image()
    EE, XE, P = moments(given)
    masked = given._replace(deviations=given.deviations.at[0].set(0.0))
    law, here = NOISES["of all"], np.array([False, True])
    np.testing.assert_allclose(masked_factor(law, FIELDS, here, jnp.float64), np.diag([1.0, 0.4**0.5]), rtol=1e-12)
    told = form.condition(masked, law, FIELDS, here, jnp.asarray([0.0, -0.8]), spread_in(form, P))
    gain = XE[:, 1] / (EE[1, 1] + 0.4)
    np.testing.assert_allclose(told.shift, -0.8 * gain, rtol=1e-9)
    np.testing.assert_allclose(covariance_of(told.spread), P - np.outer(gain, XE[:, 1]), rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("kind", FORMS)
@pytest.mark.parametrize("noise", [None, *NOISES])
def test_every_form_smooths_as_the_equations_say(kind, noise):
    """Of a square transition: as many states after it as before."""
    form, rng = FORMS[kind](), np.random.default_rng(8)
    before, slope, later = spd(rng, 2), rng.normal(size=(2, 2)), spd(rng, 2, 0.3)
    start = spread_in(form, before)
    given = Image(jnp.zeros(2), jnp.asarray(slope) @ start.factor, start.factor, None)
    law = None if noise is None else NOISES[noise]
    predicted = slope @ before @ slope.T + (0.0 if noise is None else np.array(COVARIANCES[noise]))
    shift = np.array([0.4, -1.1])
    found = form.smooth(given, law, FIELDS, start, Later(jnp.asarray(shift), spread_in(form, later)))
    G = before @ slope.T @ np.linalg.inv(predicted)
    np.testing.assert_allclose(found.gain, G, rtol=1e-8)
    np.testing.assert_allclose(found.shift, G @ shift, rtol=1e-8)
    smoothed = before + G @ (later - predicted) @ G.T
    np.testing.assert_allclose(covariance_of(found.spread), smoothed, rtol=1e-8, atol=1e-10)
    assert isinstance(found.spread, Spread)


MADE = [line.make() for line in reversed(FILTERS.values())]
RULED = {filter_.rule(2): filter_ for filter_ in MADE if isinstance(filter_, AbstractRuleFilter)}
"""One filter of each rule: forms make no difference to what it sees."""

X = namedtuple("X", "x angle")
Y = namedtuple("Y", "far angle")


def curved(process_noise, measurement_noise):
    """Two states, of which one is an angle, seen by two channels that are not linear in them."""
    return ss.StateSpace(
        transition=lambda s, t0, t1, x, u: X(x.x + (t1 - t0) * x.angle, x.angle),
        observation=lambda s, t, x, u: Y(x.x**2 + 0.3 * x.angle, x.angle + 0.1 * x.x),
        process_noise=process_noise,
        measurement_noise=measurement_noise,
        prior=ss.Prior(X(0.0, 0.0), {"x": 1.0, "angle": 1.0}),
        angles=("angle",),
    )


STD = {"far": 0.5, "angle": 0.5}
AHEAD = X(jnp.asarray([0.5, -1.0, 2.0]), jnp.asarray([3.0, -0.2, 0.1]))
R = np.array([[0.3, 0.05], [0.05, 0.2]])
PROCESS = {
    "independent": (ss.Continuous(ss.Gaussian({"x": 0.4, "angle": 0.2})), np.diag([0.16, 0.04])),
    "of one state": (ss.Continuous(ss.Gaussian({"angle": 0.2})), np.diag([0.0, 0.04])),
    "full": (
        ss.Continuous(ss.MultivariateGaussian(X._fields, [[0.16, 0.03], [0.03, 0.04]])),
        [[0.16, 0.03], [0.03, 0.04]],
    ),
}


@pytest.mark.parametrize("filter_", RULED.values(), ids=lambda filter_: type(filter_).__name__)
def test_the_image_of_a_missing_channel_is_zero(filter_):
    """By whatever rule, and exactly: what rounding leaves there would count beside its error's unit variance."""
    model = curved(PROCESS["full"][0], ss.MultivariateGaussian(Y._fields, R))
    row = Row(jnp.asarray(0.0), None, Y(jnp.asarray(0.9), jnp.asarray(np.nan)))
    found = filter_.observe(model, filter_.prior(model, row), row)
    assert found.mean[1] == 0.0 and not np.any(found.deviations[1]) and np.ptp(found.deviations[0]) > 0.1


def log_normal(z, S):
    return -0.5 * (z @ np.linalg.solve(S, z) + np.linalg.slogdet(2.0 * np.pi * S)[1])


@pytest.mark.parametrize("noise", PROCESS)
@pytest.mark.parametrize("measured", [(0.9, -3.0), (0.9, np.nan), (np.nan, 0.4), (np.nan, np.nan)])
def test_a_look_ahead_is_the_density_of_what_is_measured(noise, measured):
    """N(y; h, H Q dt H^T + R) of the channels present, the angle in the nearest turn; without the process noise at a point."""
    dt, (process, Q) = 0.5, PROCESS[noise]
    model = curved(process, ss.MultivariateGaussian(Y._fields, R))
    row = Row(jnp.asarray(0.0), None, Y(*map(jnp.asarray, measured)))
    found, residual = filters.PredictiveLikelihood().log_prob(model, row, AHEAD, dt)
    sharp, point = filters.PointLookahead().log_prob(model, row, AHEAD, dt)
    here = np.isfinite(measured)
    for k, (x, angle) in enumerate(zip(*map(np.asarray, AHEAD), strict=True)):
        z = np.array(measured) - np.array([x**2 + 0.3 * angle, angle + 0.1 * x])
        z[1] = (z[1] + np.pi) % (2.0 * np.pi) - np.pi
        H = np.array([[2.0 * x, 0.3], [0.1, 1.0]])
        S = (H @ np.asarray(Q) @ H.T * dt + R)[np.ix_(here, here)]
        expected = log_normal(z[here], S) if here.any() else 0.0
        np.testing.assert_allclose(found[k], expected, rtol=1e-9, atol=1e-12)
        expected = log_normal(z[here], R[np.ix_(here, here)]) if here.any() else 0.0
        np.testing.assert_allclose(sharp[k], expected, rtol=1e-9, atol=1e-12)
        for channel in np.flatnonzero(here):
            np.testing.assert_allclose([residual[Y._fields[channel]][k], point[Y._fields[channel]][k]], z[channel])


def test_a_look_ahead_takes_the_measurement_noise_at_each_particle():
    """And in the order of the channels, whatever the order of the law."""
    law = lambda s, t, x, u: ss.Gaussian({"angle": 0.3 + 0.0 * x.x, "far": 0.5 + 0.1 * x.x**2})
    process, Q = PROCESS["full"]
    row = Row(jnp.asarray(0.0), None, Y(jnp.asarray(0.9), jnp.asarray(0.4)))
    model = curved(process, ss.StateDependent(law, Y._fields))
    found, residual = filters.PredictiveLikelihood().log_prob(model, row, AHEAD, 0.5)
    sharp, _ = filters.PointLookahead().log_prob(model, row, AHEAD, 0.5)
    for k, x in enumerate(np.asarray(AHEAD.x)):
        H, noise = np.array([[2.0 * x, 0.3], [0.1, 1.0]]), np.diag([(0.5 + 0.1 * x**2) ** 2, 0.09])
        z = np.array([residual[name][k] for name in Y._fields])
        np.testing.assert_allclose(found[k], log_normal(z, H @ np.asarray(Q) @ H.T * 0.5 + noise), rtol=1e-9)
        np.testing.assert_allclose(sharp[k], log_normal(z, noise), rtol=1e-9)


def test_the_default_look_ahead_and_what_each_needs():
    gaussian, heavy = ss.Gaussian(STD), ss.StudentT(3.0, STD)
    process = PROCESS["independent"][0]
    assert lookahead_for(curved(process, gaussian)) == filters.PredictiveLikelihood(0.3)
    for model in (curved(process, heavy), curved(None, gaussian)):
        assert lookahead_for(model) == filters.PointLookahead(defensive=0.5)
        filters.PointLookahead().check(model)
        with pytest.raises(InputError, match="Use PointLookahead"):
            filters.PredictiveLikelihood().check(model)
        with pytest.raises(InputError, match="Use PointLookahead"):
            filters.AuxiliaryParticleFilter(10, lookahead=filters.PredictiveLikelihood()).check(model)
    filters.PredictiveLikelihood().check(curved(process, gaussian))


def test_a_look_ahead_judges_at_the_transition_or_at_the_point_that_is_given():
    model = curved(None, ss.Gaussian(STD))
    at = (0.0, 0.5, AHEAD, None)
    plain, own = filters.PointLookahead(), filters.PointLookahead(lambda model, t0, t1, x, u: X(x.x + t1, x.angle))
    for lookahead in (plain, filters.PredictiveLikelihood()):
        assert lookahead.moves_by_transition
        np.testing.assert_allclose(lookahead.propagate(model, *at).x, AHEAD.x + 0.5 * AHEAD.angle)
    assert not own.moves_by_transition
    np.testing.assert_allclose(own.propagate(model, *at).x, AHEAD.x + 0.5)


WEIGHTS = np.array([0.1, 0.2, 0.3, 0.4])


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_a_softened_look_ahead_is_a_mixture_with_none(share):
    """log(share + (1 - share) ahead / mean ahead), the mean by the weights, of those alive."""
    ahead, alive = np.log([0.5, 2.0, 1.0, 7.0]), np.array([True, True, True, False])
    found = soften(jnp.asarray(ahead), log_of(jnp.asarray(WEIGHTS)), jnp.asarray(alive), share)
    mean = np.sum(WEIGHTS * np.exp(ahead) * alive)
    expected = ahead if share == 0 else np.log(share + (1 - share) * np.exp(ahead) / mean)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_a_look_ahead_misled_where_few_particles_are_left_that_it_had_judged_likely():
    """Effective samples over those without it: sum v^2 drawn / sum v^2, of which half is the limit."""
    v = np.array([0.5, 0.5])
    for drawn, misled in (([0.4, 0.4], True), ([0.4, 0.7], False), ([1.0, 1.0], False), ([0.1, 0.85], True)):
        told = remark_of(jnp.asarray(v), jnp.log(jnp.asarray(drawn)))
        assert int(told) == (Result.lookahead_misled if misled else Result.successful), drawn


@pytest.mark.parametrize("resampled", [None, True, False])
def test_the_second_stage_weighs_by_hand(resampled):
    """log-likelihood: of both stages where ancestors were drawn, of an importance step where none were."""
    drawn, plain = np.log([0.2, 0.1, 0.4, 0.3]), np.log([1.0, 3.0, 2.0, 2.0])
    lost, log_n, log_mean = np.array([False, False, True, False]), np.log(4.0), -1.3
    stage = FirstStage(
        None, None, jnp.asarray(log_mean), None, None if resampled is None else jnp.asarray(resampled), True
    )
    weigh = lambda stage, judged=None: stage.weigh(
        jnp.asarray(log_n), jnp.asarray(drawn), lambda: jnp.asarray(plain), judged, jnp.asarray(lost)
    )
    found = weigh(stage)
    mass = np.where(lost, 0.0, np.exp(plain if resampled is False else drawn))
    np.testing.assert_allclose(found.weights, mass / mass.sum(), rtol=1e-12)
    first = log_mean + log_n if resampled is not False else 0.0
    np.testing.assert_allclose(found.log_likelihood, first + np.log(mass.mean()), rtol=1e-12)
    assert bool(found.alive) and int(found.remark) == Result.successful
    assert not bool(weigh(stage._replace(alive=jnp.asarray(False))).alive)
    # A look-ahead misled if ancestors were drawn half as often as by their weights, by what it says over the weights' sum.
    for share in (0.49, 0.51):
        judged = jnp.full(4, np.log(share) + log_mean + log_n)
        misled = resampled is not False and share < 0.5
        assert (int(weigh(stage, judged).remark) == Result.lookahead_misled) == misled


@pytest.mark.parametrize(("threshold", "chooses"), [(0.0, False), (0.8, False), (0.9, True), (1.0, True)])
def test_ancestors_are_drawn_where_the_effective_sample_is_below_the_threshold(threshold, chooses):
    """1 / sum w^2 = 10 / 3 of four particles: five sixths."""
    filter_ = filters.ParticleFilter(4, threshold=threshold)
    chosen, resampled = choose_ancestors(filter_, jax.random.key(0), jnp.asarray(WEIGHTS))
    drawn = numerics.systematic(jax.random.key(0), jnp.asarray(WEIGHTS), 4)
    np.testing.assert_array_equal(chosen, drawn if chooses else np.arange(4))
    assert resampled is None if threshold == 1.0 else bool(resampled) == chooses

"""A filter for contaminated noise: the mixture's own answer, its density, what is wild and what is missing."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import linear_model, linear_recording
from scipy import stats
from test_learned_noise import model, walk

from jaxveh import InputError, Recording, filters, fitting
from jaxveh import statespace as ss

SHARE, FACTOR = 0.1, 8.0


def two_channels():
    """A linear model of three states, two channels of independent noise."""
    return eqx.tree_at(lambda m: m.measurement_noise, linear_model(), ss.Gaussian({"y0": 0.3, "y1": 0.5}))


def by_hand(base, recording, share, factor):
    """Log-likelihood increments, means and covariances in NumPy: all cases of each row, then one Gaussian."""
    H, D = (np.asarray(base.system[k]) for k in "HD")
    law = filters.Kalman()
    stds = np.array([float(s) for s in base.measurement_noise.std])
    belief, rows = None, base.rows(recording)
    likelihood, means, covariances = [], [], []
    prior, predict = eqx.filter_jit(law.prior), eqx.filter_jit(law.predict_between)
    rows = jax.tree.map(np.asarray, rows)
    for k in range(len(recording)):
        row = jax.tree.map(lambda leaf, k=k: leaf[k], rows)
        belief = prior(base, row) if k == 0 else predict(base, belief, row.t, row.u)
        x, P = np.asarray(belief.vector), np.asarray(belief.covariance)
        y = np.array([float(v) for v in row.y])
        here = np.isfinite(y)
        total, mean, second = 0.0, 0.0, 0.0
        for wild in itertools.product((False, True), repeat=2):
            wild = np.array(wild)
            weight = np.prod(np.where(wild, share, 1 - share))
            R = np.diag(np.where(wild, factor, 1.0) * stds) ** 2
            h, e = H[here], (y - H @ x - D * float(row.u.force))[here]
            S = h @ P @ h.T + R[np.ix_(here, here)]
            if here.any():
                weight *= stats.multivariate_normal(np.zeros(here.sum()), S).pdf(e)
            K = P @ h.T @ np.linalg.inv(S)
            after, spread = x + K @ e, P - K @ S @ K.T
            total, mean = total + weight, mean + weight * after
            second = second + weight * (spread + np.outer(after, after))
        x, second = mean / total, second / total
        P = second - np.outer(x, x)
        belief = belief.__class__(
            jnp.asarray(x), jnp.asarray(np.linalg.cholesky(P)), jnp.asarray(P), row.t, row.u, belief.count + 1,
            belief.state_type, belief.rule,
        )  # fmt: skip
        likelihood.append(np.log(total))
        means.append(x)
        covariances.append(P)
    return np.array(likelihood), np.array(means), np.array(covariances)


def test_it_is_the_mixture_of_all_cases_with_missing_channels():
    base = two_channels()
    recording = linear_recording(base, rows=25)
    likelihood, means, covariances = by_hand(base, recording, SHARE, FACTOR)
    found = filters.run(filters.Contaminated(filters.Kalman(), SHARE, FACTOR), base, recording)
    np.testing.assert_allclose(found.info.log_likelihood, likelihood, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(np.stack(found.mean, axis=1), means, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(found.belief.covariance, covariances[-1], rtol=1e-7, atol=1e-12)
    np.testing.assert_array_equal(np.isnan(found.info.innovation.y0), np.isnan(recording["y0"]))


def test_what_is_predicted_of_a_row_is_as_wide_as_the_law():
    recording = Recording(np.arange(1.0), {"flow": np.array([0.3])})
    found = filters.run(filters.Contaminated(filters.Kalman(), SHARE, FACTOR), model(2.0), recording)
    expected = np.sqrt(1.0 + 4.0 * (1 - SHARE + SHARE * FACTOR**2))
    np.testing.assert_allclose(found.info.innovation_std.flow, [expected], rtol=1e-12)
    assert np.isnan(found.info.nis).all()


def test_its_likelihood_finds_share_and_factor_and_gradients_reach_them():
    rng = np.random.default_rng(5)
    rows = 3000
    wild = rng.uniform(size=rows) < SHARE
    _, recording = walk(rows, 5, np.where(wild, FACTOR, 1.0))

    @jax.jit
    @jax.value_and_grad
    def likelihood(both):
        filter_ = filters.Contaminated(filters.Kalman(), both[0], both[1])
        return filters.scan(filter_, model(1.0), model(1.0).rows(recording)).log_likelihood

    value = lambda *both: float(likelihood(np.array(both))[0])
    found = [[value(share, factor) for factor in (3.0, 8.0, 20.0)] for share in (0.03, 0.1, 0.3)]
    assert np.unravel_index(np.argmax(found), (3, 3)) == (1, 1)
    at = np.array([0.08, 7.0])
    _, gradient = likelihood(at)
    for i, h in enumerate((1e-5, 1e-4)):
        step = h * np.eye(2)[i]
        slope = (value(*(at + step)) - value(*(at - step))) / (2 * h)
        np.testing.assert_allclose(gradient[i], slope, rtol=1e-5)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: filters.Contaminated(filters.Kalman(), 0.0), "share = 0"),
        (lambda: filters.Contaminated(filters.Kalman(), 1.0), "share = 1"),
        (lambda: filters.Contaminated(filters.Kalman(), 0.1, 1.0), "factor = 1"),
        (lambda: filters.Contaminated(filters.Gated(filters.Kalman())), "Gated inside"),
        (lambda: filters.Contaminated(filters.ParticleFilter(10)), "ParticleFilter inside"),
    ],
)
def test_bad_settings_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_too_many_channels_are_refused():
    base = linear_model(m=7)
    own = eqx.tree_at(lambda m: m.measurement_noise, base, ss.Gaussian({f"y{i}": 1.0 for i in range(7)}))
    with pytest.raises(InputError, match="7 channels .* 128 cases"):
        filters.Contaminated(filters.Kalman()).check(own)


def test_a_fit_that_needs_whitened_innovations_refuses_it_wherever_it_is():
    _, recording = walk(20, 0, np.ones(20))
    for filter_ in (filters.Contaminated(filters.Kalman()), filters.HaarNoise(filters.Contaminated(filters.Kalman()))):
        with pytest.raises(InputError, match="Contaminated has no whitened innovations"):
            fitting.prediction_error(filter_, model(1.0), recording, where=lambda m: m.measurement_noise.std)

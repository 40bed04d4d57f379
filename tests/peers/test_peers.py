"""The same model in other libraries: log-likelihoods and means agree where they do the same.

Known differences: filterpy keeps the sigma points of before the process noise, so the test regenerates them; dynamax adds
1e-9 to a covariance's diagonal before it is solved with.
"""

from collections import namedtuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import Recording, filters
from jaxveh import statespace as ss

pytestmark = pytest.mark.peers

Swing = namedtuple("Swing", "angle rate")
Seen = namedtuple("Seen", "sine")
DT, ROWS = 0.1, 40
PROCESS, MEASUREMENT = np.array([0.02, 0.1]), 0.2
MEAN, SPREAD = np.array([0.5, 0.0]), np.array([0.3, 0.4])
ALPHA, BETA, KAPPA = 0.9, 2.0, 1.0


def _moved(angle, rate, xp):
    return angle + DT * rate, rate - DT * 5.0 * xp.sin(angle)


def _model():
    return ss.StateSpace(
        transition=lambda s, t0, t1, x, u: Swing(*_moved(x.angle, x.rate, jnp)),
        observation=lambda s, t, x, u: Seen(jnp.sin(x.angle)),
        process_noise=ss.Discrete(ss.Gaussian({"angle": PROCESS[0], "rate": PROCESS[1]})),
        measurement_noise={"sine": MEASUREMENT},
        prior=ss.Prior(Swing(*MEAN), {"angle": SPREAD[0], "rate": SPREAD[1]}),
    )


@pytest.fixture(scope="module")
def measured():
    rng = np.random.default_rng(0)
    x, out = np.array([0.7, 0.2]), []
    for _ in range(ROWS):
        out.append(np.sin(x[0]) + MEASUREMENT * rng.normal())
        x = np.array(_moved(*x, np)) + PROCESS * rng.normal(size=2)
    return np.array(out)


@pytest.fixture(scope="module")
def unscented(measured):
    recording = Recording(DT * np.arange(ROWS), {"sine": measured})
    return filters.run(filters.Unscented(ALPHA, BETA, KAPPA), _model(), recording)


def _transition(x, *_):
    return jnp.stack(_moved(x[0], x[1], jnp))


def _observation(x, *_):
    return jnp.sin(x[:1])


def test_unscented_equals_dynamax(measured, unscented):
    dynamax = pytest.importorskip("dynamax.nonlinear_gaussian_ssm")
    with jax.numpy_dtype_promotion("standard"):
        parameters = dynamax.ParamsNLGSSM(
            jnp.asarray(MEAN), jnp.diag(jnp.asarray(SPREAD) ** 2), _transition, jnp.diag(jnp.asarray(PROCESS) ** 2),
            _observation, jnp.eye(1) * MEASUREMENT**2)  # fmt: skip
        scaling = dynamax.UKFHyperParams(ALPHA, BETA, KAPPA)
        theirs = dynamax.unscented_kalman_filter(parameters, jnp.asarray(measured)[:, None], scaling)
    np.testing.assert_allclose(unscented.log_likelihood, theirs.marginal_loglik, rtol=1e-6)
    np.testing.assert_allclose(np.stack(unscented.mean, axis=1), theirs.filtered_means, rtol=1e-5, atol=1e-6)
    variances = np.diagonal(theirs.filtered_covariances, axis1=1, axis2=2)
    np.testing.assert_allclose(np.stack(unscented.std, axis=1) ** 2, variances, rtol=1e-5)


def test_unscented_equals_smcx(measured, unscented):
    smcx = pytest.importorskip("smcx")
    with jax.numpy_dtype_promotion("standard"):
        theirs = smcx.unscented_kalman_filter(
            jnp.asarray(MEAN), jnp.diag(jnp.asarray(SPREAD) ** 2), _transition, jnp.diag(jnp.asarray(PROCESS) ** 2),
            _observation, jnp.eye(1) * MEASUREMENT**2, jnp.asarray(measured)[:, None],
            alpha=ALPHA, beta=BETA, kappa=KAPPA)  # fmt: skip
    np.testing.assert_allclose(unscented.log_likelihood, theirs.marginal_loglik, rtol=1e-7)
    np.testing.assert_allclose(np.stack(unscented.mean, axis=1), theirs.filtered_means, rtol=1e-6, atol=1e-7)


def test_unscented_equals_filterpy_with_regenerated_points(measured, unscented):
    filterpy = pytest.importorskip("filterpy.kalman")
    points = filterpy.MerweScaledSigmaPoints(2, ALPHA, BETA, KAPPA)
    ukf = filterpy.UnscentedKalmanFilter(
        2, 1, DT, hx=lambda x: np.sin(x[:1]), fx=lambda x, dt: np.array(_moved(*x, np)), points=points
    )
    ukf.x, ukf.P = MEAN.copy(), np.diag(SPREAD**2)
    ukf.Q, ukf.R = np.diag(PROCESS**2), np.eye(1) * MEASUREMENT**2
    total, means = 0.0, []
    for k, y in enumerate(measured):
        if k:
            ukf.predict()
        ukf.sigmas_f = points.sigma_points(ukf.x, ukf.P)
        ukf.update(np.array([y]))
        total += ukf.log_likelihood
        means.append(ukf.x.copy())
    np.testing.assert_allclose(unscented.log_likelihood, total, rtol=1e-9)
    np.testing.assert_allclose(np.stack(unscented.mean, axis=1), means, rtol=1e-8, atol=1e-10)


def test_linear_model_equals_filterpy_and_dynamax():
    filterpy = pytest.importorskip("filterpy.kalman")
    linear = pytest.importorskip("dynamax.linear_gaussian_ssm")
    F, H = np.array([[1.0, DT], [-0.4, 0.9]]), np.array([[1.0, 0.3]])
    model = ss.StateSpace(
        transition=lambda s, t0, t1, x, u: Swing(*[F[i, 0] * x.angle + F[i, 1] * x.rate for i in range(2)]),
        observation=lambda s, t, x, u: Seen(H[0, 0] * x.angle + H[0, 1] * x.rate),
        process_noise=ss.Discrete(ss.Gaussian({"angle": PROCESS[0], "rate": PROCESS[1]})),
        measurement_noise={"sine": MEASUREMENT},
        prior=ss.Prior(Swing(*MEAN), {"angle": SPREAD[0], "rate": SPREAD[1]}),
    )
    y = np.random.default_rng(1).normal(size=ROWS)
    ours = filters.run(filters.Unscented(), model, Recording(DT * np.arange(ROWS), {"sine": y}))
    kf = filterpy.KalmanFilter(2, 1)
    kf.x, kf.P, kf.F, kf.H = MEAN[:, None].copy(), np.diag(SPREAD**2), F, H
    kf.Q, kf.R = np.diag(PROCESS**2), np.eye(1) * MEASUREMENT**2
    total = 0.0
    for k, value in enumerate(y):
        if k:
            kf.predict()
        kf.update(value)
        total += kf.log_likelihood
    np.testing.assert_allclose(ours.log_likelihood, total, rtol=1e-10)
    np.testing.assert_allclose(ours.belief.vector, kf.x[:, 0], rtol=1e-9)
    with jax.numpy_dtype_promotion("standard"):
        lgssm = linear.LinearGaussianSSM(2, 1)
        parameters, _ = lgssm.initialize(
            jax.random.PRNGKey(0), initial_mean=jnp.asarray(MEAN), initial_covariance=jnp.diag(jnp.asarray(SPREAD) ** 2),
            dynamics_weights=jnp.asarray(F), dynamics_covariance=jnp.diag(jnp.asarray(PROCESS) ** 2),
            emission_weights=jnp.asarray(H), emission_covariance=jnp.eye(1) * MEASUREMENT**2)  # fmt: skip
        theirs = lgssm.filter(parameters, jnp.asarray(y)[:, None])
    np.testing.assert_allclose(ours.log_likelihood, theirs.marginal_loglik, rtol=1e-6)


N, RUNS = 1500, 60


@pytest.fixture(scope="module")
def particle_runs(measured):
    """Log-likelihoods of our bootstrap and auxiliary filters, (RUNS,) each."""
    model, keys = _model(), jax.random.split(jax.random.key(0), RUNS)
    rows = model.rows(Recording(DT * np.arange(ROWS), {"sine": measured}))
    kinds = {
        "bootstrap": filters.ParticleFilter(N),
        "auxiliary": filters.AuxiliaryParticleFilter(N, lookahead=filters.PointLookahead()),
    }
    runs = lambda filter_: jax.vmap(lambda key: filters.scan(filter_, model, rows, key).log_likelihood)(keys)
    return {name: np.asarray(runs(filter_)) for name, filter_ in kinds.items()}


def _log_mean(values):
    """Logarithm of the mean likelihood, and its standard error."""
    ratio = np.exp(values - values.max())
    return values.max() + np.log(ratio.mean()), ratio.std() / ratio.mean() / np.sqrt(len(values))


def _assert_agree(a, b):
    (first, error), (second, other) = _log_mean(a), _log_mean(b)
    assert max(error, other) < 0.1
    assert abs(first - second) < 3 * np.hypot(error, other)


def test_particle_likelihoods_agree_with_particles(measured, particle_runs):
    particles = pytest.importorskip("particles")
    distributions = pytest.importorskip("particles.distributions")
    models = pytest.importorskip("particles.state_space_models")

    class Pendulum(models.StateSpaceModel):
        def PX0(self):
            return distributions.IndepProd(*[distributions.Normal(m, s) for m, s in zip(MEAN, SPREAD, strict=True)])

        def PX(self, t, xp):
            moved = _moved(xp[:, 0], xp[:, 1], np)
            return distributions.IndepProd(*[distributions.Normal(m, s) for m, s in zip(moved, PROCESS, strict=True)])

        def PY(self, t, xp, x):
            return distributions.Normal(np.sin(x[:, 0]), MEASUREMENT)

    np.random.seed(0)  # noqa: NPY002  the library draws from the global generator
    theirs = []
    for _ in range(RUNS):
        run = particles.SMC(fk=models.Bootstrap(ssm=Pendulum(), data=measured), N=N, ESSrmin=1.0)
        run.run()
        theirs.append(run.logLt)
    for ours in particle_runs.values():
        _assert_agree(ours, np.array(theirs))


def test_particle_likelihoods_agree_with_smcx(measured, particle_runs):
    smcx = pytest.importorskip("smcx")

    def initial(key, n):
        return jnp.asarray(MEAN) + jnp.asarray(SPREAD) * jax.random.normal(key, (n, 2))

    def transition(key, x):
        return _transition(x) + jnp.asarray(PROCESS) * jax.random.normal(key, (2,))

    def observe(y, x):
        return jax.scipy.stats.norm.logpdf(y[0], jnp.sin(x[0]), MEASUREMENT)

    with jax.numpy_dtype_promotion("standard"):
        run = jax.jit(
            lambda key: (
                smcx.bootstrap_filter(
                    key, initial, transition, observe, jnp.asarray(measured)[:, None], N, resampling_threshold=1.1
                ).marginal_loglik
            )
        )
        theirs = np.array([run(key) for key in jax.random.split(jax.random.key(1), RUNS)])
    for ours in particle_runs.values():
        _assert_agree(ours, theirs)

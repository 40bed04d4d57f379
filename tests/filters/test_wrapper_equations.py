"""Wrappers row by row beside their equations in NumPy: a level that walks, measured with noise, with a row missing.

P' = P + q,   K = P / (P + R),   m' = m + K (y - m),   P'' = P - K P
"""

import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import linear_model, linear_recording, nile_model
from test_learned_noise import model

from jaxveh import JaxvehWarning, Recording, filters
from jaxveh import statespace as ss

FLOW = np.array([1.5, -0.8, np.nan, 4.0, 3.2, -2.0, 3.9])
R0, Q = 4.0, 0.5


def beliefs_of(filter_):
    """The beliefs after each row."""
    base = model(R0**0.5, Q**0.5)
    rows = jax.tree.map(np.asarray, base.rows(Recording(np.arange(float(len(FLOW))), {"flow": FLOW})))
    row = lambda k: jax.tree.map(lambda leaf: leaf[k], rows)
    init, step = eqx.filter_jit(filter_.init), eqx.filter_jit(filter_.step)
    belief, _ = init(base, row(0))
    found = [belief]
    for k in range(1, len(FLOW)):
        belief, _ = step(base, belief, row(k))
        found.append(belief)
    return found


def updated(m, P, y, R):
    K = P / (P + R)
    return m + K * (y - m), P - K * P


def check(belief, m, P):
    np.testing.assert_allclose([belief.mean.level, belief.std.level], [m, P**0.5], rtol=1e-9)


@pytest.mark.parametrize("iterations", [1, 3])
def test_variational_bayes(iterations):
    forgets, weight = 0.9, 6.0
    filter_ = filters.VariationalBayes(filters.Kalman(), forgets, weight, iterations)
    m, P, shape, scale = 0.0, 1.0, 0.5 * weight, 0.5 * weight * R0
    for k, belief in enumerate(beliefs_of(filter_)):
        P = P + Q * (k > 0)
        y = FLOW[k]
        if np.isfinite(y):
            before, shape = forgets * scale, forgets * shape + 0.5
            scale = scale / ((shape - 0.5) / forgets) * shape
            for _ in range(iterations):
                after, spread = updated(m, P, y, scale / shape)
                # The square that is expected: of the residual, and of what the state itself spreads.
                scale = before + 0.5 * ((y - after) ** 2 + spread)
            m, P = updated(m, P, y, scale / shape)
        check(belief, m, P)
        np.testing.assert_allclose([belief.memory.shape[0], belief.memory.scale[0]], [shape, scale], rtol=1e-9)


def test_student_t():
    dof, iterations = 3.0, 2
    m, P = 0.0, 1.0
    for k, belief in enumerate(beliefs_of(filters.RobustStudentT(filters.Kalman(), dof, iterations))):
        P = P + Q * (k > 0)
        y = FLOW[k]
        if np.isfinite(y):
            R = R0
            for _ in range(iterations):
                after, spread = updated(m, P, y, R)
                R = R0 * (dof + ((y - after) ** 2 + spread) / R0) / (dof + 1)
            m, P = updated(m, P, y, R)
        check(belief, m, P)


def test_huber():
    threshold = 0.8
    m, P, some = 0.0, 1.0, 0
    for k, belief in enumerate(beliefs_of(filters.Huber(filters.Kalman(), threshold))):
        P = P + Q * (k > 0)
        y = FLOW[k]
        if np.isfinite(y):
            e = abs(y - m) / (P + R0) ** 0.5
            some += e > threshold
            m, P = updated(m, P, y, R0 / min(1.0, threshold / e))
        check(belief, m, P)
    assert 0 < some < 6


def test_shrinking_process():
    m, P, extra = 0.0, 1.0, 0.6**2
    for k, belief in enumerate(beliefs_of(filters.ShrinkingProcess(filters.Kalman(), {"level": 0.6}))):
        P = P + (Q + extra) * (k > 0)
        before = m
        if np.isfinite(FLOW[k]):
            m, P = updated(m, P, FLOW[k], R0)
        d = (m - before) ** 2
        extra = extra * abs(extra - 0.5 * (d + extra)) / (extra + d)
        check(belief, m, P)
        np.testing.assert_allclose(belief.memory, [extra], rtol=1e-9)


def test_matched_process():
    forgets, most = 0.7, 0.9
    m, P, excess = 0.0, 1.0, 0.0
    for k, belief in enumerate(beliefs_of(filters.MatchedProcess(filters.Kalman(), {"level": most}, forgets))):
        P = P + (Q + np.clip(excess, 0.0, most**2)) * (k > 0)
        before = m
        if np.isfinite(FLOW[k]):
            m, P = updated(m, P, FLOW[k], R0)
        if k:
            excess = min(forgets * excess + (1 - forgets) * ((m - before) ** 2 - Q), most**2)
        check(belief, m, P)
        np.testing.assert_allclose(belief.memory[0], [excess], rtol=1e-9)


@pytest.mark.parametrize("window", [4, 6])
def test_haar_noise(window):
    forgets = 0.6
    m, P, R, seen = 0.0, 1.0, R0, []
    filter_ = filters.HaarNoise(filters.Kalman(), window, forgets, 1e-3, 1e3)
    for k, belief in enumerate(beliefs_of(filter_)):
        P = P + Q * (k > 0)
        if np.isfinite(FLOW[k]):
            seen.append(FLOW[k])
            if len(seen) >= window:
                last = np.array(seen[-window:])
                sigma = np.median(np.abs(last[1::2] - last[::2]) / 2**0.5) / 0.6744897501960817
                R = forgets * R + (1 - forgets) * sigma**2
            m, P = updated(m, P, FLOW[k], R)
        check(belief, m, P)


@pytest.mark.parametrize("start", [None, [0.8, 0.2]])
def test_interacting_models(start):
    """Blom & Bar-Shalom 1988: mix by the transition, update each mode, weigh; the likelihood is that of the mixture."""
    noises, transition = (R0, 9.0 * R0), np.array([[0.9, 0.1], [0.3, 0.7]])
    noisy = lambda m: eqx.tree_at(lambda m: m.measurement_noise.std.flow, m, jnp.asarray(noises[1] ** 0.5))
    filter_ = filters.InteractingModels(filters.Kalman(), (lambda m: m, noisy), transition, start)
    base = model(R0**0.5, Q**0.5)
    recording = Recording(np.arange(float(len(FLOW))), {"flow": FLOW})
    found = filters.run(filter_, base, recording)
    weights, ms, Ps = np.array([0.5, 0.5] if start is None else start), np.zeros(2), np.ones(2)
    for k, y in enumerate(FLOW):
        if k > 0:
            joint = transition * weights[:, None]
            weights = joint.sum(axis=0)
            share = joint / weights
            mixed = share.T @ ms
            Ps = np.array([share[:, j] @ (Ps + (ms - mixed[j]) ** 2) for j in range(2)]) + Q
            ms = mixed
        log_likelihood = 0.0
        if np.isfinite(y):
            S = Ps + np.array(noises)
            densities = weights * np.exp(-0.5 * (y - ms) ** 2 / S) / np.sqrt(2.0 * np.pi * S)
            ms, Ps = ms + Ps / S * (y - ms), Ps - Ps**2 / S
            log_likelihood, weights = np.log(densities.sum()), densities / densities.sum()
        mean = weights @ ms
        std = np.sqrt(weights @ (Ps + (ms - mean) ** 2))
        row = (found.mean.level[k], found.std.level[k], found.info.log_likelihood[k])
        np.testing.assert_allclose(row, (mean, std, log_likelihood), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.belief.probabilities, weights, rtol=1e-9)


def test_h_infinity_with_a_scale():
    """P~ = (P^-1 - bound S)^-1 with S = 1 / scale^2 of a state that is named, zero of one that is not."""
    bound, scale = 0.4, 2.0
    base = linear_model(2, 1, seed=6)
    recording = linear_recording(base, rows=9, seed=2)
    filter_ = filters.HInfinity(filters.Kalman(), bound, {"x1": scale})
    found = filters.run(filter_, base, recording)
    A, B, H, D = (np.asarray(base.system[k]) for k in "ABHD")
    law, R = np.asarray(base.process_noise.law.matrix), np.asarray(base.measurement_noise.matrix)
    t, u, y = (np.asarray(v) for v in (recording.time, recording["force"], recording["y0"]))
    x, P = np.array([float(v) for v in base.prior.mean]), np.asarray(base.prior.covariance())
    for k in range(len(t)):
        if k:
            dt = t[k] - t[k - 1]
            F = np.eye(2) + dt * A
            x, P = F @ x + dt * B * u[k - 1], F @ P @ F.T + law * dt
        P = np.linalg.inv(np.linalg.inv(P) - bound * np.diag([0.0, 1 / scale**2]))
        if np.isfinite(y[k]):
            S = H @ P @ H.T + R
            K = P @ H.T @ np.linalg.inv(S)
            x, P = x + K @ (y[k] - H @ x - D * u[k]), P - K @ S @ K.T
        np.testing.assert_allclose([leaf[k] for leaf in found.mean], x, rtol=1e-8)
        np.testing.assert_allclose([leaf[k] for leaf in found.std], np.sqrt(np.diag(P)), rtol=1e-8)


KERNELS = {
    "Liu-West": (lambda f: filters.LiuWest(f, 0.6), lambda n: 1.0),
    "regularised": (lambda f: filters.Regularised(f, 0.5), lambda n: 1.0 + 0.5**2),
    "regularised, best": (
        lambda f: filters.Regularised(f, share=1.0),
        lambda n: 1.0 + ((4 / 3) ** (1 / 5) * n ** (-1 / 5)) ** 2,
    ),
}


@pytest.mark.parametrize("name", KERNELS)
def test_kernels_leave_the_mean_and_make_the_variance_that_they_say(name):
    """Of a constant whose particles carry weights: Liu & West's shrinking makes up for their kernel, others widen."""
    n = 20000
    make, factor = KERNELS[name]
    still = eqx.tree_at(lambda m: m.process_noise, nile_model(0.0, 1.0), None)
    still = eqx.tree_at(lambda m: m.measurement_noise, still, ss.Gaussian({"flow": 1.0}))
    filter_ = make(filters.ParticleFilter(n))
    rows = still.rows(Recording(np.arange(2.0), {"flow": np.array([1.0, np.nan])}))
    row = lambda k: jax.tree.map(lambda leaf: leaf[k], rows)

    @jax.jit
    def two_rows(key):
        before, _ = filter_.init(still, row(0), key)
        after, _ = filter_.step(still, before, row(1))
        return [(belief.mean.level, belief.std.level) for belief in (before, after)]

    (mean, std), (moved, spread) = np.array(two_rows(jax.random.key(0)))
    assert std**2 == pytest.approx(0.5, rel=0.05)
    assert abs(moved - mean) < 4 * (0.5 / n) ** 0.5
    np.testing.assert_allclose((spread / std) ** 2, factor(n), rtol=5 * (2 / n) ** 0.5)


@pytest.mark.parametrize("discount", [0.4, 0.6, 0.98])
def test_liu_west_s_kernel_is_theirs(discount):
    keeps, spread = filters.LiuWest(filters.ParticleFilter(10), discount).kernel(1)
    assert keeps == pytest.approx((3 * discount - 1) / (2 * discount))
    assert spread**2 == pytest.approx(1 - keeps**2)


def test_the_warning_of_weights_that_cancel():
    """alpha = 1e-3 in float32: a nat or more off, and said; in float64, or with points further out, nothing to say."""
    base = nile_model(0.0, 1.0)
    single = ss.cast(base, jnp.float32)
    for filter_ in (filters.Unscented(alpha=1e-3), filters.Gated(filters.Unscented(alpha=1e-3))):
        with pytest.warns(
            JaxvehWarning, match="Unscented: its weights cancel each other, so that in float32.*alpha = 1"
        ):
            filter_.check(single)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        filters.Unscented(alpha=1e-3).check(base)
        for quiet in (
            filters.Unscented(),
            filters.Unscented(alpha=0.1),
            filters.Cubature(degree=5),
            filters.Extended(),
        ):
            quiet.check(single)

"""Filters around others on a linear model of two states, beside the Kalman filter's equations in NumPy; an ensemble's by hand."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn_systems import STD, drawn, exact, linear

from jaxveh import Recording, filters, numerics
from jaxveh import statespace as ss
from jaxveh.filters.ensemble import EnsembleBelief
from jaxveh.filters.particle import add_noise
from jaxveh.filters.wrappers.interacting import MixtureBelief
from jaxveh.filters.wrappers.process_noise import Extra

ROWS = 8
MODEL, RECORDING = linear(), drawn(ROWS)
A, B, H, D = (np.asarray(MODEL.system[name]) for name in "ABHD")
Q, R = np.asarray(MODEL.process_noise.law.matrix), np.square(list(STD.values()))
TIME, FORCE = np.asarray(RECORDING.time), np.asarray(RECORDING["force"])
SEEN = np.stack([np.asarray(RECORDING[name]) for name in STD], axis=1)
GROUPS = (("y0",), ("y1",))


def ahead(k, x, P, noise=1.0):
    """The prediction of row k, the process noise's covariance times a factor."""
    dt = TIME[k] - TIME[k - 1]
    F = np.eye(2) + dt * A
    return F @ x + dt * B * FORCE[k - 1], F @ P @ F.T + noise * Q * dt


def after(k, x, P, channels, variances=R):
    """The update by those of these channels that are there: mean, covariance, innovation over its spread by channel."""
    here = [c for c in channels if np.isfinite(SEEN[k, c])]
    if not here:
        return x, P
    h = H[here]
    S = h @ P @ h.T + np.diag(np.asarray(variances)[here])
    K = P @ h.T @ np.linalg.inv(S)
    return x + K @ (SEEN[k, here] - h @ x - D[here] * FORCE[k]), P - K @ S @ K.T


def start():
    return np.array([float(value) for value in MODEL.prior.mean]), np.asarray(MODEL.prior.covariance())


def compare(found, k, x, P):
    np.testing.assert_allclose([field[k] for field in found.mean], x, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose([field[k] for field in found.std], np.sqrt(np.diag(P)), rtol=1e-8)


FEDERATED = {
    "own shares": {"shares": (0.3, 0.7)},
    "by trace": {"by_trace": True},
    "common information": {"common": True},
}


@pytest.mark.parametrize("name", FEDERATED)
def test_a_federation_that_resets_is_the_filter_of_all_sensors(name):
    found = filters.run(filters.Federated(filters.Kalman(), GROUPS, **FEDERATED[name]), MODEL, RECORDING)
    expected = exact(ROWS)
    for k in range(ROWS):
        compare(found, k, expected["mean"][k], expected["covariance"][k])
    np.testing.assert_allclose(found.info.log_likelihood, expected["log_likelihood"], rtol=1e-8, atol=1e-10)
    if name == "by trace":
        scale = np.diag(start()[1])
        traces = [np.sum(np.diag(local.covariance) / scale) for local in found.belief.locals]
        np.testing.assert_allclose(
            found.belief.shares, (1 / np.array(traces)) / np.sum(1 / np.array(traces)), rtol=1e-9
        )


@pytest.mark.parametrize("isolate", [None, 1.02])
def test_locals_that_go_on_from_their_own_estimates_are_fused_by_information(isolate):
    """Each with the covariances of the prior and of the process noise over its share; the alarm is a fading mean, beyond which a
    local goes on from its prediction."""
    shares, forgets, used = (0.3, 0.7), 0.8, set()
    filter_ = filters.Federated(filters.Kalman(), GROUPS, shares, reset=False, isolate=isolate, forgetting=forgets)
    found = filters.run(filter_, MODEL, RECORDING)
    x, P = start()
    locals_ = [(x, P / share) for share in shares]
    alarm = np.ones(2)
    for k in range(ROWS):
        if k:
            locals_ = [ahead(k, *local, 1.0 / share) for local, share in zip(locals_, shares, strict=True)]
        together = np.linalg.inv(sum(np.linalg.inv(P) for _, P in locals_))
        mean = together @ sum(np.linalg.solve(P, x) for x, P in locals_)
        for c in np.flatnonzero(np.isfinite(SEEN[k])):
            nis = (SEEN[k, c] - H[c] @ mean - D[c] * FORCE[k]) ** 2 / (H[c] @ together @ H[c] + R[c])
            alarm[c] = forgets * alarm[c] + (1 - forgets) * nis
        trusted = alarm < (np.inf if isolate is None else isolate)
        used.add(tuple(trusted))
        locals_ = [after(k, *local, [c] if trusted[c] else []) for c, local in enumerate(locals_)]
        P = np.linalg.inv(sum(np.linalg.inv(P) for _, P in locals_))
        compare(found, k, P @ sum(np.linalg.solve(P, x) for x, P in locals_), P)
    np.testing.assert_allclose(found.belief.alarm, alarm, rtol=1e-8)
    np.testing.assert_allclose(found.belief.locals[1].vector, locals_[1][0], rtol=1e-8)
    assert used == ({(True, True)} if isolate is None else {(True, True), (True, False)})


def test_a_gate_leaves_out_what_is_too_far_off():
    limit, left_out = 1.0, 0
    found = filters.run(filters.Gated(filters.Kalman(), limit), MODEL, RECORDING)
    x, P = start()
    for k in range(ROWS):
        x, P = ahead(k, x, P) if k else (x, P)
        near = []
        for c in np.flatnonzero(np.isfinite(SEEN[k])):
            off = (SEEN[k, c] - H[c] @ x - D[c] * FORCE[k]) / (H[c] @ P @ H[c] + R[c]) ** 0.5
            near += [c] if abs(off) <= limit else []
            left_out += abs(off) > limit
        x, P = after(k, x, P, near)
        compare(found, k, x, P)
    assert 0 < left_out < 8


@pytest.mark.parametrize("name", ["considered", "apart"])
def test_a_state_that_is_considered_or_kept_apart(name):
    """Considered: neither its mean nor its variance is corrected. Apart: covariances between the blocks are forgotten."""
    inner = filters.Kalman()
    filter_ = filters.Consider(inner, "x1") if name == "considered" else filters.Dual(inner, (("x0",),))
    found = filters.run(filter_, MODEL, RECORDING)
    x, P = start()
    for k in range(ROWS):
        before = ahead(k, x, P) if k else (x, P)
        x, P = after(k, *before, [0, 1])
        if name == "considered":
            x, P = np.array([x[0], before[0][1]]), np.where([[0, 0], [0, 1]], before[1], P)
        else:
            P = np.diag(np.diag(P))
        compare(found, k, x, P)


@pytest.mark.parametrize("process_of", ["before", "after"])
def test_spreads_that_are_inputs_count_row_by_row(process_of):
    """The process noise over a step is that of its first row, or of its last."""
    rng = np.random.default_rng(5)
    spread, wide = rng.uniform(0.2, 1.0, ROWS), rng.uniform(0.3, 2.0, ROWS)
    model = ss.StateSpace(
        system=MODEL.system,
        transition=MODEL.transition_function,
        observation=MODEL.observation_function,
        process_noise=ss.Continuous(ss.Gaussian({"x0": 0.4, "x1": 0.6})),
        measurement_noise=MODEL.measurement_noise,
        prior=MODEL.prior,
        inputs=("force", "spread", "wide"),
    )
    filter_ = filters.VaryingNoise(filters.Kalman(), {"y1": "spread"}, {"x0": "wide"}, process_of)
    given = Recording(TIME, {**{name: RECORDING[name] for name in (*STD, "force")}, "spread": spread, "wide": wide})
    found = filters.run(filter_, model, given)
    x, P = start()
    for k in range(ROWS):
        if k:
            dt = TIME[k] - TIME[k - 1]
            F = np.eye(2) + dt * A
            level = wide[k - 1] if process_of == "before" else wide[k]
            x, P = F @ x + dt * B * FORCE[k - 1], F @ P @ F.T + np.diag([level**2, 0.36]) * dt
        x, P = after(k, x, P, [0, 1], [R[0], spread[k] ** 2])
        compare(found, k, x, P)


def test_extra_noise_is_added_to_any_law_and_to_none():
    added = ss.Gaussian({"b": 0.5, "c": 2.0})
    matrix = np.array([[0.4, 0.1], [0.1, 0.3]])
    full = Extra(ss.Continuous(ss.MultivariateGaussian(("a", "b"), matrix)), added)
    for law, time in ((full.law, 1.0), (full.over(0.5), 0.5)):
        assert law.names == ("a", "b", "c")
        expected = np.zeros((3, 3))
        expected[:2, :2] = time * matrix
        np.testing.assert_allclose(law.covariance(), expected + np.diag([0.0, 0.25, 4.0]), rtol=1e-12)
    plain = Extra(ss.Continuous(ss.Gaussian({"a": 0.3, "b": 0.4})), added)
    for law, time in ((plain.law, 1.0), (plain.over(0.5), 0.5)):
        spread = {"a": time * 0.09, "b": time * 0.16 + 0.25, "c": 4.0}
        for name, value in law.std._asdict().items():
            np.testing.assert_allclose(value**2, spread[name], rtol=1e-12)
    assert Extra(None, added).law.names == Extra(None, added).over(0.1).names == added.names


def members(n=6):
    rng = np.random.default_rng(2)
    return rng.normal(size=(2, n))


def ensemble_at(t, values):
    kind = type(MODEL.prior.mean)
    force = MODEL.rows(RECORDING.rows(slice(1, 2))).u.force[0]
    u = type(MODEL.rows(RECORDING).u)(force)
    return EnsembleBelief(kind(*map(jnp.asarray, values)), jax.random.key(7), jnp.asarray(t), u, jnp.int32(3))


def test_an_ensemble_is_moved_member_by_member_with_noise_of_its_own():
    filter_, before = filters.Ensemble(6), ensemble_at(TIME[1], members())
    found = filter_.predict(MODEL, before, jnp.asarray(TIME[2]))
    dt = TIME[2] - TIME[1]
    x = members() + dt * (A @ members() + (B * FORCE[1])[:, None])
    draw, key = jax.random.split(jax.random.fold_in(before.key, 3))
    noisy = add_noise(MODEL, draw, type(before.members)(*map(jnp.asarray, x)), jnp.asarray(dt))
    np.testing.assert_allclose(found.members, noisy, rtol=1e-12)
    assert np.abs(np.asarray(found.members) - x).min() > 1e-6
    np.testing.assert_array_equal(jax.random.key_data(found.key), jax.random.key_data(key))
    assert float(found.t) == TIME[2] and int(found.count) == 3


@pytest.mark.parametrize("perturbed", [False, True])
def test_an_ensemble_is_updated_by_the_gain_of_its_own_covariances(perturbed):
    """By a noisy measurement for each member, or without a draw: then the covariance is exactly the Kalman filter's."""
    row = jax.tree.map(lambda leaf: leaf[1], MODEL.rows(RECORDING))
    row = row._replace(y=type(row.y)(jnp.asarray(0.7), jnp.asarray(-0.4)))
    before = ensemble_at(TIME[1], members())
    found, info = filters.Ensemble(6, perturbed).update(MODEL, before, row)
    x, y = members(), np.array([0.7, -0.4])
    P, seen = np.cov(x), H @ x + (D * FORCE[1])[:, None]
    S = H @ P @ H.T + np.diag(R)
    K, off = P @ H.T @ np.linalg.inv(S), y - seen.mean(axis=1)
    np.testing.assert_allclose(info.nis, off @ np.linalg.solve(S, off), rtol=1e-9)
    if perturbed:
        _, draw = jax.random.split(jax.random.fold_in(before.key, 3))
        jitter = np.sqrt(R)[:, None] * np.asarray(numerics.normal(draw, (2, 6), jnp.float64))
        np.testing.assert_allclose(found.members, x + K @ (y[:, None] + jitter - seen), rtol=1e-9)
    else:
        np.testing.assert_allclose(np.mean(found.members, axis=1), x.mean(axis=1) + K @ off, rtol=1e-9)
        np.testing.assert_allclose(np.cov(found.members), P - K @ S @ K.T, rtol=1e-9)
    assert int(found.count) == 4 and int(info.result) == 0


def test_a_mixture_is_at_the_time_of_its_modes_and_spreads_as_they_lie_apart():
    kind = type(MODEL.prior.mean)
    rule = filters.Extended().rule(2)
    mode = lambda mean, spread: filters.GaussianBelief(
        jnp.asarray(mean), jnp.diag(jnp.asarray(spread)), None, jnp.asarray(2.5), "inputs", jnp.int32(4), kind, rule
    )
    both = MixtureBelief((mode([1.0, 2.0], [0.5, 1.0]), mode([3.0, -1.0], [0.2, 0.4])), jnp.asarray([0.25, 0.75]))
    means, spreads = np.array([[1.0, 2.0], [3.0, -1.0]]), np.array([[0.5, 1.0], [0.2, 0.4]])
    w = np.array([0.25, 0.75])
    mean = w @ means
    covariance = sum(
        p * (np.diag(s**2) + np.outer(m - mean, m - mean)) for p, s, m in zip(w, spreads, means, strict=True)
    )
    np.testing.assert_allclose(both.mean, mean, rtol=1e-12)
    np.testing.assert_allclose(both.std, np.sqrt(np.diag(covariance)), rtol=1e-12)
    np.testing.assert_allclose(both.covariance, covariance, rtol=1e-12)
    assert (float(both.t), both.u, int(both.count)) == (2.5, "inputs", 4)

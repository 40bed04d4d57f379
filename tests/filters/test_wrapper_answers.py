"""What each wrapper is for: outliers, noise and jumps that the model does not know, faults, pauses, states left alone."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn_systems import linear
from filter_systems import linear_model, linear_recording, nile_model, see_level, stay
from test_learned_noise import model, rmse, walk

from jaxveh import InputError, Recording, Result, filters
from jaxveh import statespace as ss

ROWS = 400


def last_std(filter_, recording, wrong):
    """The sensor's standard deviation that a wrapper believes in at the end."""
    belief = filters.run(filter_, model(wrong), recording).belief
    own = filter_.adapted_model(model(wrong), belief)
    return float(own.measurement_noise.std.flow)


@pytest.mark.parametrize("kind", [filters.SageHusa, filters.VariationalBayes])
@pytest.mark.parametrize("wrong", [0.7, 6.0])
def test_learners_find_the_sensor_s_noise(kind, wrong):
    found = []
    for seed in range(4):
        _, recording = walk(ROWS, seed, np.full(ROWS, 2.0))
        found.append(last_std(kind(filters.Kalman(), 0.99), recording, wrong))
    np.testing.assert_allclose(np.mean(found), 2.0, rtol=0.1)


def test_sage_husa_is_its_equation():
    _, recording = walk(30, 0, np.full(30, 2.0))
    filter_, base = filters.SageHusa(filters.Kalman(), 0.9, 1e-9, 1e9), model(1.0)
    step, rows = eqx.filter_jit(filter_.step), base.rows(recording)
    row = lambda k: jax.tree.map(lambda leaf: leaf[k], rows)
    x, P, R = 0.0, 1.0, 1.0
    belief, _ = filter_.init(base, row(0))
    for k in range(30):
        if k:
            belief, _ = step(base, belief, row(k))
            P = P + 0.01
        d = (1 - 0.9) / (1 - 0.9 ** (k + 2))
        e, gain, before = float(recording["flow"][k]) - x, P / (P + R), P
        x, P = x + gain * e, P - gain * P
        R = max((1 - d) * R + d * (e**2 - before), 1e-9)
        np.testing.assert_allclose([belief.mean.level, belief.memory[0][0]], [x, R], rtol=1e-9)


ROBUST = {
    "gated": filters.Gated(filters.Kalman(), 4.0),
    "contaminated": filters.Contaminated(filters.Kalman()),
    "Huber": filters.Huber(filters.Kalman()),
    "Student-t": filters.RobustStudentT(filters.Kalman(), 3.0),
}


@pytest.mark.parametrize("name", ROBUST)
def test_outliers_cost_the_robust_little(name):
    robust, plain, clean = [], [], []
    for seed in range(4):
        level, recording = walk(ROWS, seed, np.ones(ROWS))
        clean.append(rmse(filters.run(filters.Kalman(), model(), recording), level))
        flow = np.array(recording["flow"])
        flow[np.random.default_rng(seed).uniform(size=ROWS) < 0.05] += 25.0
        hit = Recording(recording.time, {"flow": flow})
        robust.append(rmse(filters.run(ROBUST[name], model(), hit), level))
        plain.append(rmse(filters.run(filters.Kalman(), model(), hit), level))
    assert np.mean(plain) > 2.0 * np.mean(clean)
    share = {"gated": 0.05, "contaminated": 0.05, "Huber": 0.25, "Student-t": 0.1}[name]
    assert np.mean(robust) - np.mean(clean) < share * (np.mean(plain) - np.mean(clean))


@pytest.mark.parametrize("outer", [filters.Huber, filters.RobustStudentT])
@pytest.mark.parametrize("inner", [filters.SageHusa, filters.VariationalBayes, filters.HaarNoise])
def test_robust_weights_that_would_be_lost_are_refused(outer, inner):
    with pytest.raises(InputError, match=rf"Put {outer.__name__} inside: {inner.__name__}\({outer.__name__}"):
        outer(inner(filters.Kalman())).check(model())
    inner(outer(filters.Kalman())).check(model())


def test_strong_tracking_is_its_equation():
    flow = np.array([1.0, -1.0, np.nan, 0.5, 12.0, 11.0, 12.5])
    filter_, base = filters.StrongTracking(filters.Kalman(), 0.9, 1.5, 50.0), model(2.0)
    estimate = filters.run(filter_, base, Recording(np.arange(7.0), {"flow": flow}))
    x, P, V = 0.0, 1.0, None
    for k, y in enumerate(flow):
        P = P + 0.01 * (k > 0)
        if np.isfinite(y):
            e = y - x
            V = e**2 if V is None else (0.9 * V + e**2) / 1.9
            P = P * np.clip((V - 1.5 * 4.0) / P, 1.0, 50.0)
            gain = P / (P + 4.0)
            x, P = x + gain * e, P - gain * P
        np.testing.assert_allclose([estimate.mean.level[k], estimate.std.level[k]], [x, P**0.5], rtol=1e-9)
    assert abs(x - 12.0) < 1.0


def test_matched_process_leaves_a_right_model_nearly_alone():
    """Its extra noise is what the corrections are above the model's own: nothing, but for scatter."""
    found, plain = [], []
    for seed in range(5):
        level, recording = walk(1500, seed, np.full(1500, 10.0), drift=1.0)
        filter_ = filters.MatchedProcess(filters.Kalman(), {"level": 10.0}, 0.99)
        found.append(rmse(filters.run(filter_, model(10.0, 1.0), recording), level))
        plain.append(rmse(filters.run(filters.Kalman(), model(10.0, 1.0), recording), level))
    assert np.mean(found) < 1.05 * np.mean(plain)


@functools.cache
def faulty():
    """A linear model with two sensors, of which the second lies from the middle on."""
    rows, base = 200, linear()
    schedule = linear_recording(base, rows, seed=4)
    truth, recording = ss.draw(base, schedule, jax.random.key(0))
    lies = np.array(recording["y1"])
    lies[rows // 2 :] += 8.0
    return base, np.stack(truth)[:, rows // 2 + 10 :], recording, recording.replace(y1=lies)


@pytest.mark.thorough
def test_a_faulty_local_is_isolated_and_a_sound_one_is_not():
    base, truth, sound, lying = faulty()
    error = lambda filter_, recording: np.sqrt(
        np.mean((np.stack(filters.run(filter_, base, recording).mean)[:, -truth.shape[1] :] - truth) ** 2)
    )
    groups = (("y0",), ("y1",))
    central, safe = filters.Kalman(), filters.Federated(filters.Kalman(), groups, reset=False, isolate=4.0)
    assert error(safe, lying) < 0.5 * error(central, lying)
    assert error(safe, sound) < 2.0 * error(central, sound)


def test_locals_with_a_common_prediction_leave_a_faulty_sensor_out():
    base, truth, _, lying = faulty()
    groups = (("y0",), ("y1",))
    error = lambda filter_, recording: np.sqrt(
        np.mean((np.stack(filters.run(filter_, base, recording).mean)[:, -truth.shape[1] :] - truth) ** 2)
    )
    isolating = filters.Federated(filters.Kalman(), groups, common=True, isolate=4.0)
    assert error(isolating, lying) < 0.5 * error(filters.Kalman(), lying)
    for options in (dict(reset=False), dict(by_trace=True), dict(shares=(0.5, 0.5))):
        with pytest.raises(InputError, match="common: shares and by_trace must not be given"):
            filters.Federated(filters.Kalman(), groups, common=True, **options)


def test_a_considered_state_stays_as_predicted():
    base, _, recording, _ = faulty()
    filter_ = filters.Consider(filters.Kalman(), ("x1",))
    first, row = (jax.tree.map(lambda leaf, k=k: np.asarray(leaf)[k], base.rows(recording)) for k in (0, 1))

    @jax.jit
    def around_a_row(model, first, row):
        belief, _ = filter_.init(model, first)
        before = filter_.predict_between(model, belief, row.t, row.u)
        after, _ = filter_.update(model, before, row)
        return [(belief.mean, belief.covariance) for belief in (before, after)]

    (mean_before, P), (mean, covariance) = around_a_row(base, first, row)
    P, covariance = np.asarray(P), np.asarray(covariance)
    assert float(mean.x1) == float(mean_before.x1) and float(mean.x0) != float(mean_before.x0)
    np.testing.assert_allclose(covariance[1, 1], P[1, 1], rtol=1e-12)
    # The optimal gain is that of the filter; Joseph's form with the considered row of it zero is the covariance.
    H, R = np.asarray(base.system["H"]), np.diag([0.16, 0.09])
    here = np.isfinite([row.y.y0, row.y.y1])
    H, R = H[here], R[np.ix_(here, here)]
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    K[1] = 0.0
    left = np.eye(2) - K @ H
    np.testing.assert_allclose(covariance, left @ P @ left.T + K @ R @ K.T, rtol=1e-9, atol=1e-12)


def braked(transition=stay):
    """A level without process noise, and whether the brake is on."""
    return ss.StateSpace(
        transition=transition,
        observation=see_level,
        process_noise=None,
        measurement_noise=ss.Gaussian({"flow": 1.0}),
        prior=nile_model(0.0, 1.0).prior,
        inputs=("braking",),
    )


def test_a_pause_holds_the_state_and_widens_it_after():
    base = braked()
    flow = np.array([1.0, 1.0, 50.0, 50.0, 7.0])
    recording = Recording(np.arange(5.0), {"flow": flow, "braking": np.array([0.0, 0.0, 1.0, 1.0, 0.0])})
    estimate = filters.run(filters.Paused(filters.Kalman(), "braking", {"level": 100.0}), base, recording)
    np.testing.assert_array_equal(estimate.mean.level[2:4], estimate.mean.level[1])
    np.testing.assert_array_equal(estimate.std.level[2:4], estimate.std.level[1])
    assert abs(float(estimate.mean.level[4]) - 7.0) < 0.01
    np.testing.assert_array_equal(estimate.info.log_likelihood[2:4], 0.0)


def test_the_time_before_a_pause_is_predicted_and_the_pause_is_not():
    """The level rises by one a second: from the row before the pause to its first row, and not within it."""
    base = braked(lambda system, t0, t1, x, u: type(x)(x.level + (t1 - t0)))
    nothing = np.full(6, np.nan)
    recording = Recording(np.arange(6.0), {"flow": nothing, "braking": np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0])})
    estimate = filters.run(filters.Paused(filters.Kalman(), "braking", {"level": 1.0}), base, recording)
    np.testing.assert_allclose(estimate.mean.level, [0.0, 1.0, 2.0, 2.0, 2.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(estimate.std.level, np.sqrt([1.0, 1.0, 1.0, 1.0, 2.0, 2.0]), rtol=1e-12)


@pytest.mark.parametrize("form", [filters.Covariance(), filters.SquareRoot()], ids=["covariance", "square root"])
def test_a_bound_that_cannot_be_reached_is_told_from_a_model_that_diverges(form):
    _, recording = walk(10, 0, np.full(10, 1.0))
    found = filters.run(filters.HInfinity(filters.Kalman(form), 1e6, {"level": 1.0}), model(), recording, throw=False)
    assert Result(int(found.result)) is Result.not_positive_definite and int(found.failed_at) == 0


def test_a_mode_that_cannot_be_counts_for_nothing():
    """From the first mode none leads to the second, which would explain the data better by far."""
    _, recording = walk(50, 0, np.full(50, 30.0))
    same = lambda model: model
    noisy = lambda m: eqx.tree_at(lambda m: m.measurement_noise.std.flow, m, jnp.asarray(30.0))
    fixed = filters.InteractingModels(filters.Kalman(), (same, noisy), np.eye(2), np.array([1.0, 0.0]))
    fixed.check(model())

    def of(scale):
        found = filters.scan(fixed, scaled(scale), model().rows(recording))
        return found.log_likelihood, found

    slope, found = jax.jit(jax.grad(of, has_aux=True))(1.0)
    plain = filters.run(filters.Kalman(), model(), recording)
    np.testing.assert_allclose(found.log_likelihood, plain.log_likelihood, rtol=1e-12)
    np.testing.assert_allclose(found.mean.level, plain.mean.level, rtol=1e-9)
    np.testing.assert_array_equal(found.belief.probabilities, [1.0, 0.0])
    assert np.isfinite(slope) and slope != 0


def scaled(factor):
    return eqx.tree_at(lambda m: m.measurement_noise.std.flow, model(), factor * model().measurement_noise.std.flow)


def test_smoothers_of_what_they_would_get_wrong_are_refused():
    base, _, recording, _ = faulty()
    key = jax.random.key(0)
    for what, filter_ in (
        ("Marginalised has no smoother", filters.Marginalised(20, ("x1",))),
        ("StrongTracking has no", filters.StrongTracking(filters.Kalman())),
        ("HInfinity has no", filters.HInfinity(filters.Kalman(), 0.1, {"x0": 1.0})),
        ("Consider has no", filters.Consider(filters.Kalman(), ("x1",))),
    ):
        for lag in (None, 3):
            with pytest.raises(InputError, match=what):
                filters.smooth(filter_, base, recording, key=key, lag=lag)


def test_laws_that_are_not_gaussian_are_refused_where_they_must_be():
    noise = ss.Discrete(ss.StudentT(4.0, {"x0": 0.1, "x1": 0.1, "x2": 0.1}))
    base = eqx.tree_at(lambda m: m.process_noise, linear_model(3, 2), noise)
    for filter_ in (filters.Guided(10), filters.Marginalised(10, ("x2",))):
        with pytest.raises(InputError, match="process noise StudentT is not Gaussian"):
            filter_.check(base)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: filters.Gated(filters.ParticleFilter(10)), "Gated: ParticleFilter inside: must be a Gaussian filter"),
        (
            lambda: filters.Consider(filters.Gated(filters.Kalman()), ("x0",)),
            "Consider: Gated inside: must be an unwrapped Gaussian filter",
        ),
        (lambda: filters.Iterated(filters.Gated(filters.Kalman())), "Iterated: Gated inside"),
        (lambda: filters.Federated(filters.Ensemble(5), (("y0",), ("y1",))), "Federated: Ensemble inside"),
        (
            lambda: filters.LiuWest(filters.Kalman()),
            "LiuWest: Kalman inside: must be a filter whose belief is particles only",
        ),
        (lambda: filters.Regularised(filters.Marginalised(5, ("x0",))), "Regularised: Marginalised inside"),
        (
            lambda: filters.AdaptiveNumber(filters.Marginalised(50, ("x0",)), {"x1": 1.0}),
            "AdaptiveNumber: Marginalised inside",
        ),
        (lambda: filters.LiuWest(filters.ParticleFilter(5)).check(linear_model()), "none is a parameter. Give `names`"),
    ],
)
def test_a_filter_of_the_wrong_kind_inside_is_named(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_names_may_be_lists_and_one_is_no_row_of_letters():
    assert filters.Consider(filters.Kalman(), ["x0", "x1"]).names == ("x0", "x1")
    assert filters.Marginalised(5, "x1").linear == ("x1",)
    assert filters.Federated(filters.Kalman(), ["y0", ["y1"]]).groups == (("y0",), ("y1",))


def test_what_a_wrapped_filter_remembers_stays_in_a_pause():
    """The extra noise of `ShrinkingProcess` halves with every row at least, but not while nothing is looked at."""
    base = braked()
    braking = np.array([0.0, 0.0, 1.0, 1.0, 1.0, 0.0])
    recording = Recording(np.arange(6.0), {"flow": np.linspace(0.0, 1.0, 6), "braking": braking})
    inner = filters.ShrinkingProcess(filters.Kalman(), {"level": 2.0})
    keep = lambda belief: (belief.memory, belief.mean.level, belief.t)
    _, (memory, level, time) = filters.run_and_keep(
        filters.Paused(inner, "braking", {"level": 3.0}), base, recording, keep
    )
    np.testing.assert_array_equal(time, recording.time)
    np.testing.assert_array_equal(memory[2:5], np.broadcast_to(memory[1], (3, 1)))
    np.testing.assert_array_equal(level[2:5], level[1])
    assert 0 < memory[5, 0] < memory[4, 0]

"""Multiple shooting: against scipy on the same residuals, against the truth, over several recordings, and its errors."""

from collections import namedtuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize
from fit_systems import NOISE, PRIOR_STD, START, TRUE, drive, model, plain, residuals, see

from jaxveh import FilterError, InputError, Recording, Result
from jaxveh import statespace as ss
from jaxveh.fitting import cut, multiple_shooting, pose_shooting, solve
from jaxveh.fitting.multiple_shooting import tie_spread


def numbers(tree):
    return np.asarray(jax.tree.leaves(tree))


@pytest.fixture(scope="module")
def recordings():
    return [drive(52, seed=1), drive(37, seed=2, start=[0.4, 0.5])]


@pytest.fixture(scope="module")
def both(recordings):
    return multiple_shooting(model(), recordings, window=1.0, tie=0.1, tolerance=1e-12)


def test_equals_scipy_on_the_same_residuals(recordings, both):
    fit = both
    centre, spread = np.log([3.0, 0.7]), 0.5
    start = np.concatenate([centre, np.tile(START, 10)])
    exact = scipy.optimize.least_squares(
        residuals, start, args=(recordings, 10, 0.1, centre, spread), xtol=1e-15, ftol=1e-15, gtol=1e-13
    )
    np.testing.assert_allclose(fit.unconstrained, exact.x[:2], rtol=1e-6)
    np.testing.assert_allclose(numbers(fit.parameters), np.exp(exact.x[:2]), rtol=1e-6)
    np.testing.assert_allclose(fit.cost, exact.cost, rtol=1e-9)
    covariance = np.linalg.inv(exact.jac.T @ exact.jac)[:2, :2]
    np.testing.assert_allclose(fit.covariance, covariance, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(
        numbers(fit.parameters_std), np.sqrt(np.diagonal(covariance)) * np.exp(exact.x[:2]), rtol=1e-5
    )
    assert Result(int(fit.result)) is Result.successful
    assert fit.names == ("k", "d") and fit.parameters.k == numbers(fit.parameters)[0]
    # The model carries the fit: the prior's mean, physically.
    np.testing.assert_allclose(
        fit.model.report(0.0, fit.model.prior.mean, None)[2:], numbers(fit.parameters), rtol=1e-12
    )
    assert int(fit.steps) > 1


def test_least_squares_alone_finds_the_truth_without_noise():
    clean = drive(60, noise=False)
    fit = multiple_shooting(plain(), clean, lambda m: (m.system.k, m.system.d), window=1.0, tolerance=1e-12)
    np.testing.assert_allclose(fit.parameters.array(), TRUE, rtol=1e-5)
    assert float(fit.cost) < 1e-8


def test_standard_errors_cover_the_truth():
    """A hundred drives with new noise: the parameters' errors are as large as the fit says, and centred."""
    loose = model(prior=3.0, law={"angle": 1.0, "rate": 1.0})
    segments = cut(loose, drive(60, noise=False), 1.5)
    noise = np.random.default_rng(0).normal(size=(100, 2, *segments.rows.t.shape)) * NOISE[:, None, None]

    @jax.jit
    @jax.vmap
    def fit(noise):
        y = segments.rows.y
        y = type(y)(*[value + change for value, change in zip(y, noise, strict=True)])
        rows = segments.rows._replace(y=y)
        found = solve(pose_shooting(loose, segments._replace(rows=rows), tie=0.001), max_steps=50)
        return found.unconstrained, found.covariance, found.result

    found, covariance, result = fit(jnp.asarray(noise))
    assert (np.asarray(result) == 0).mean() > 0.97
    deviation = np.asarray(found) - np.log(TRUE)
    scores = deviation / np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    np.testing.assert_allclose(scores.std(axis=0), 1.0, atol=0.25)
    assert (np.abs(scores.mean(axis=0)) < 0.35).all()
    covered = (np.abs(scores) < 1.96).mean()
    assert 0.88 < covered <= 1.0


def test_several_recordings_tell_more_than_one(recordings, both):
    one = multiple_shooting(model(), recordings[0], window=1.0, tie=0.1, tolerance=1e-12)
    for few, more, truth in zip(numbers(one.parameters_std), numbers(both.parameters_std), TRUE, strict=True):
        assert float(more) < float(few)
        assert float(more) < 0.3 * truth
    assert (np.abs(numbers(both.parameters) - TRUE) < 4 * numbers(both.parameters_std)).all()


One = namedtuple("One", "x")
Feedback = namedtuple("Feedback", "u")


def _unstable(rows=200, dt=0.05):
    """dx/dt = 8 x + u with a feedback in u: bounded as driven, exp(80) as simulated open loop with a little error."""
    rng, x, xs, us = np.random.default_rng(0), 0.3, [], []
    for k in range(rows):
        u = -10.0 * x + 2 * np.sin(3 * k * dt)
        xs.append(x)
        us.append(u)
        x = x * np.exp(8 * dt) + u * (np.exp(8 * dt) - 1) / 8
    system = ss.StateSpace(
        system={"a": jnp.asarray(5.0)},
        transition=ss.Propagate(lambda s, t, x, u: One(s["a"] * x.x + u.u), steps=4),
        observation=lambda s, t, x, u: One(x.x),
        process_noise=None,
        measurement_noise={"x": 0.01},
        prior=ss.Prior(One(0.0), {"x": 1.0}),
        inputs=("u",),
    )
    measured = np.array(xs) + 0.01 * rng.normal(size=rows)
    recording = Recording(dt * np.arange(rows), {"u": us, "x": measured})
    return ss.with_parameters(system, lambda m: m.system["a"], prior=1.0), recording


@pytest.mark.parametrize("window", [1e9, np.inf])
def test_a_window_longer_than_the_drive_is_the_drive(window):
    one = drive(20, seed=5)
    whole = len(one) * float(np.median(np.diff(one.time)))
    found, expected = (multiple_shooting(model(), one, window=seconds) for seconds in (window, whole))
    np.testing.assert_allclose(found.cost, expected.cost, rtol=1e-12)


def test_short_windows_keep_an_unstable_system_from_exploding():
    system, recording = _unstable()
    fit = multiple_shooting(system, recording, window=0.25)
    assert abs(float(fit.parameters["a"]) - 8.0) < 5 * float(fit.parameters_std["a"])
    assert float(fit.parameters_std["a"]) < 0.1


def test_a_fit_that_diverges_everywhere_is_a_code_not_a_crash():
    system, recording = _unstable()
    system = ss.start_from(system, a=1e6)
    fit = multiple_shooting(system, recording, window=0.25, throw=False)
    assert Result(int(fit.result)) in (Result.not_converged, Result.non_finite_state)


def test_correlated_noise_is_whitened(recordings, both):
    law = ss.MultivariateGaussian(("rate", "angle"), [[NOISE[1] ** 2, 0.0], [0.0, NOISE[0] ** 2]])
    same = multiple_shooting(model(noise=law), recordings, window=1.0, tie=0.1, tolerance=1e-12)
    np.testing.assert_allclose(same.unconstrained, both.unconstrained, rtol=1e-6)
    np.testing.assert_allclose(same.cost, both.cost, rtol=1e-9)
    # With a correlation the cost at the optimum of other residuals differs: it is not the diagonal that counts.
    shared = 0.9 * NOISE[0] * NOISE[1]
    law = ss.MultivariateGaussian(("rate", "angle"), [[NOISE[1] ** 2, shared], [shared, NOISE[0] ** 2]])
    other = multiple_shooting(model(noise=law), recordings, window=1.0, tie=0.1, tolerance=1e-12)
    assert float(other.cost) > 1.5 * float(both.cost)


def test_ties_gather_the_process_noise_of_a_window():
    steps = jnp.full((10, 3), 0.1)
    continuous = model(process=ss.Continuous(ss.Gaussian({"rate": 0.2})))
    spread = lambda model: tie_spread(pose_shooting(model, cut(model, drive(20), 1.0)), steps)
    angle, rate = spread(continuous)
    np.testing.assert_allclose(rate, 0.2, rtol=1e-12)
    np.testing.assert_allclose(angle, 0.01 * PRIOR_STD[0], rtol=1e-12)
    discrete = model(process=ss.Discrete(ss.Gaussian({"rate": 0.2})))
    np.testing.assert_allclose(spread(discrete)[1], 0.2 * 10**0.5, rtol=1e-12)


def test_segments_share_their_last_row_and_measure_each_row_once(recordings):
    segments = cut(model(), recordings, 1.0)
    assert segments.rows.t.shape == (11, 10)
    np.testing.assert_array_equal(segments.first, np.isin(np.arange(10), [0, 6]))
    np.testing.assert_array_equal(segments.linked, ~np.isin(np.arange(10), [5, 9]))
    np.testing.assert_allclose(segments.rows.t[-1, :5], segments.rows.t[0, 1:6])
    used = np.isfinite(segments.rows.y.rate[:-1]).sum()
    assert used == sum(np.isfinite(recording["rate"]).sum() for recording in recordings)
    assert (np.diff(segments.rows.t, axis=0) > 0).all()


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (lambda: multiple_shooting(model(), []), "recordings: empty"),
        (lambda: multiple_shooting(model(), drive(2)), "recording has 2 rows: a fit needs at least 3"),
        (lambda: multiple_shooting(model(), drive(20), window=0.1), r"window = 0\.1 s: must span at least two steps"),
        (lambda: multiple_shooting(model(), drive(20), window=-1.0), r"window = -1\.0 s"),
        (lambda: multiple_shooting(model(), drive(20), window=np.nan), "window = nan s"),
        (lambda: multiple_shooting(model(), drive(20), window="1"), r"window = '1': must be a real number"),
        (lambda: multiple_shooting(model(), drive(20), tie=0.0), r"tie = 0\.0: must be positive"),
        (
            lambda: multiple_shooting(
                ss.StateSpace(transition=lambda s, t0, t1, x, u: x, observation=lambda s, t, x, u: x,
                              process_noise=None, measurement_noise={"angle": 1.0},
                              prior=ss.Prior(One(0.0), {"x": 1.0})), drive(20)),
            "the model estimates no parameter",
        ),
        (lambda: multiple_shooting(model(), drive(20).without("rate")), r"unknown name\(s\) rate"),
    ],
)  # fmt: skip
def test_errors(act, message):
    with pytest.raises(InputError, match=message):
        act()


def test_a_fit_that_does_not_finish_raises_unless_told(recordings):
    with pytest.raises(
        FilterError, match=r"fit of k, d stopped after 2 steps: the solver stopped before its tolerance"
    ):
        multiple_shooting(model(), recordings[1], window=1.0, max_steps=2)
    fit = multiple_shooting(model(), recordings[1], window=1.0, max_steps=2, throw=False)
    assert Result(int(fit.result)) is Result.not_converged
    assert not bool(fit.converged) and fit.reason.startswith("the solver stopped before its tolerance")
    assert np.isfinite(numbers(fit.parameters)).all()


def test_one_compilation_serves_other_drives(recordings):
    traces = []

    def counted(system, t, x, u):
        traces.append(x)
        return see(system, t, x, u)

    counting = model(see=counted)
    multiple_shooting(counting, drive(30, seed=3), window=1.0)
    count = len(traces)
    assert count > 0
    multiple_shooting(ss.start_from(counting, k=3.5), drive(30, seed=4), window=1.0, tie=0.02)
    assert len(traces) == count


def test_float32_without_x64(float32):
    fit = multiple_shooting(model(), drive(40, seed=5), window=1.0)
    assert fit.parameters.k.dtype == fit.covariance.dtype == jnp.float32
    assert (np.abs(numbers(fit.parameters) - TRUE) < 4 * numbers(fit.parameters_std)).all()

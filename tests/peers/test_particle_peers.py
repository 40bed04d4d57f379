"""The further particle filters of the benchmarks say what those of every library that has the same one say.

Linear problems have exact answers, which ours and each peer must give within the errors of their draws; Liu and West's filter
is compared with ours, and so is each guided proposal, whose density is known.
"""

import importlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks import further_particle_filters as compared
from benchmarks.compared import LOOPS, PROBLEMS
from benchmarks.peers import plain_particles
from jaxveh import filters
from jaxveh.filters import guided
from jaxveh.filters.gaussian.forms import Spread

pytestmark = pytest.mark.peers
ROWS, RUNS, COUNT = 15, 24, 1000
OURS = "jaxveh"


def results(name, who, count=COUNT, rows=ROWS):
    """What `RUNS` runs over the same measurements say: means, of ours and of smoothers spreads, and log-likelihoods."""
    entry = compared.FAMILY[name].of(count)
    problem = PROBLEMS[entry.problem]
    plain = problem.plain(rows, 1)
    y = plain.measured[0]
    keys = jax.random.split(jax.random.key(3), RUNS)
    if who == OURS:
        model, recording = problem.model(plain.problem, np.float64), problem.recording(plain.problem)

        def one(key):
            done = (entry.smoother or filters.run)(entry.filter, model, recording, key=key)
            total = (done.filtered if entry.smoother else done).log_likelihood
            return jnp.stack(done.mean, axis=1), jnp.stack(done.std, axis=1), total

        found = jax.jit(jax.vmap(one))(keys)
    else:
        pytest.importorskip(who)
        module = importlib.import_module(f"benchmarks.peers.{who}_filters")
        build = getattr(module, entry.peers[who])
        if who in LOOPS:
            run = build(plain, **entry.settings)
            found = [np.array(values) for values in zip(*[run(y, seed) for seed in range(RUNS)], strict=True)]
        else:
            with jax.numpy_dtype_promotion("standard"):
                run = build(plain, np.float64, **entry.settings)
                # Not batched over runs: XLA's small factorisations of so many matrices can wait for each other for ever.
                found = [np.stack(values) for values in zip(*[run(jnp.asarray(y), key) for key in keys], strict=True)]
    return plain, [np.asarray(values) for values in found]


def exact(plain, drive):
    """Means (rows, n), spreads and log-likelihood of the Kalman filter or smoother."""
    problem = PROBLEMS["linear"]
    done = drive(filters.Kalman(), problem.model(plain.problem, np.float64), problem.recording(plain.problem))
    total = (done.filtered if drive is filters.smooth else done).log_likelihood
    return np.stack(done.mean, axis=1), np.stack(done.std, axis=1), float(total)


def log_mean(logs):
    """Logarithm of the mean likelihood, and its standard error."""
    ratio = np.exp(logs - logs.max())
    return logs.max() + np.log(ratio.mean()), ratio.std(ddof=1) / ratio.mean() / np.sqrt(len(logs))


def standard_error(values):
    return values.std(axis=0, ddof=1) / np.sqrt(len(values))


def assert_means(values, expected, scale, others_error=0.0):
    """The mean over runs is what is expected, within the errors of both and a hundredth of the scale."""
    error = standard_error(values)
    assert (np.abs(values.mean(axis=0) - expected) < 4.5 * np.hypot(error, others_error) + 0.01 * scale).all()
    assert (error < 0.05 * scale).all()


def assert_likelihood(logs, expected, others_error=0.0):
    found, error = log_mean(logs)
    assert error < 0.1
    assert abs(found - expected) < 4 * np.hypot(error, others_error)


@pytest.mark.parametrize("who", [OURS, "smcx", "cuthbert", "particles"])
def test_guided_filters_have_the_kalman_filters_answer(who):
    plain, (mean, *_, total) = results("guided", who)
    expected_mean, expected_std, expected_total = exact(plain, filters.run)
    assert_means(mean, expected_mean, expected_std)
    assert_likelihood(total, expected_total)


@pytest.mark.parametrize("name", ["guided", "guided-11"])
def test_the_peers_proposal_is_ours(name):
    problem = PROBLEMS[compared.FAMILY[name].of(COUNT).problem]
    plain = problem.plain(ROWS, 1)
    model, row = problem.model(plain.problem, np.float64), 7
    rows = model.rows(problem.recording(plain.problem))
    here = jax.tree.map(lambda leaf: leaf[row], rows)
    u, y = jnp.asarray(plain.inputs[row]), jnp.asarray(plain.measured[0, row])
    law = model.process_noise.over(0.01)
    prior = Spread(jnp.linalg.cholesky(law.covariance()), law.covariance())
    rng = np.random.default_rng(0)
    noise, spread = np.sqrt(np.diag(plain.process)), np.sqrt(np.diag(plain.covariance))
    theirs = plain_particles.guide(plain, np.float64)
    for _ in range(3):
        x = jnp.asarray(plain.mean + spread * rng.standard_normal(len(spread)))
        moved = plain.transition(x, u)
        new = moved + jnp.asarray(noise * rng.standard_normal(len(noise)))
        rule = guided._rule_of("extended", len(noise))
        ours = guided._proposal(model, rule, here, type(model.prior.mean)(*moved), law.names, prior)
        at = jnp.asarray([model.states.index(n) for n in law.names])
        covariance = ours.factor @ ours.factor.T
        expected = jax.scipy.stats.multivariate_normal.logpdf((new - moved)[at], ours.mean, covariance)
        np.testing.assert_allclose(theirs.log_density(y, new, x, u), expected, rtol=1e-8)
        draws = jax.vmap(lambda key, x=x: theirs.draw(key, x, y, u))(jax.random.split(jax.random.key(0), 4000))
        shift = (draws.mean(axis=0) - moved)[at] - ours.mean
        assert (jnp.abs(shift) < 4.5 * noise / np.sqrt(4000)).all()
        np.testing.assert_allclose(jnp.std(draws, axis=0), jnp.sqrt(jnp.diag(covariance)), rtol=0.06)


@pytest.mark.parametrize("who", ["smcx", "cuthbert"])
def test_guided_filters_of_the_eleven_states_agree(who):
    _, (mean, total) = results("guided-11", who, 300)
    _, (expected, std, logs) = results("guided-11", OURS, 300)
    assert_means(mean, expected.mean(axis=0), std.mean(axis=0), standard_error(expected))
    assert_likelihood(total, *log_mean(logs))


def test_liu_and_wests_filters_agree():
    _, (expected, std, logs) = results("liu-west", OURS)
    _, (mean, total) = results("liu-west", "smcx")
    assert_means(mean, expected.mean(axis=0), std.mean(axis=0), standard_error(expected))
    assert_likelihood(total, *log_mean(logs))


@pytest.mark.parametrize("who", [OURS, "cuthbert", "particles"])
def test_paths_drawn_backwards_have_the_smoothers_answer(who):
    plain, (mean, std, total) = results("backward-sampling", who)
    expected_mean, expected_std, expected_total = exact(plain, filters.smooth)
    assert_means(mean, expected_mean, expected_std)
    assert_means(std, expected_std, expected_std)
    assert_likelihood(total, expected_total)


def test_paths_are_drawn_by_the_same_transition_density():
    # Means and spreads of paths hardly tell a wrong density from the right one.
    particles_filters = pytest.importorskip("benchmarks.peers.particles_filters")
    problem, row = PROBLEMS["linear"], 7
    plain = problem.plain(ROWS, 1)
    model, u = problem.model(plain.problem, np.float64), plain.inputs[row]
    noise = np.sqrt(np.diag(plain.process))
    x = np.sqrt(np.diag(plain.covariance)) * np.random.default_rng(0).standard_normal((5, len(noise)))
    residual = noise * np.random.default_rng(1).standard_normal(x.shape)
    new = plain.moved(x.T, u[:, None]).T + residual
    law = model.process_noise.over(0.01)
    named = dict(zip(model.states, residual.T, strict=True))
    expected = law.log_prob({n: jnp.asarray(named[n]) for n in law.names}, dict.fromkeys(law.names, jnp.asarray(True)))
    density = plain_particles.particle_functions(plain, np.float64).log_transition
    np.testing.assert_allclose(jax.vmap(density, (0, 0, None))(new, x, jnp.asarray(u)), expected, rtol=1e-9)
    theirs = particles_filters._Linear(plain, plain.measured[0], 0).logpt(row, x, new)
    np.testing.assert_allclose(theirs, expected, rtol=1e-9)

"""Measurement noise whose law depends on state and inputs: which filters take it, and what they make of it."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn_systems import drawn
from drawn_systems import linear as of_two_states
from filter_systems import linear_model, linear_recording, spd
from test_every_filter import FILTERS, KEYS, batch, batch_of_values, linear

from jaxveh import InputError, Recording, filters, fitting, observers
from jaxveh import statespace as ss
from jaxveh._core.names import record_type
from jaxveh.filters import SingularValues, SquareRoot

LogVolatility = record_type("State", ("h",))
Returns = record_type("Measurements", ("returns",))
POUND_DOLLAR = {"beta": 0.6338, "phi": 0.9731, "sigma": 0.1726}
"""Daily pound-dollar returns, per cent: J. Durbin & S. J. Koopman, Monte Carlo maximum likelihood estimation for non-Gaussian
state space models, Biometrika 84 (1997)."""


def revert(system, t0, t1, x, u):
    return LogVolatility(system["phi"] * x.h)


def nothing(system, t, x, u):
    return Returns(jnp.zeros_like(x.h))


def volatility(system, t, x, u):
    return {"returns": system["beta"] * jnp.exp(0.5 * x.h)}


def stochastic_volatility(beta, phi, sigma):
    """y = beta exp(h / 2) e,  h' = phi h + sigma v, from its stationary law (S. Taylor 1982)."""
    number = lambda value: jnp.asarray(value, float)
    beta, phi, sigma = number(beta), number(phi), number(sigma)
    return ss.StateSpace(
        system={"beta": beta, "phi": phi},
        transition=revert,
        observation=nothing,
        process_noise=ss.Discrete(ss.Gaussian({"h": sigma})),
        measurement_noise=ss.StateDependent(volatility, "returns"),
        prior=ss.Prior(LogVolatility(0.0), {"h": sigma / jnp.sqrt(1.0 - phi**2)}),
    )


def returns(rows):
    return every_return().rows(slice(0, rows))


@functools.cache
def every_return():
    """Drawn from the model, as the 750 returns themselves are not ours; with a holiday."""
    schedule = Recording(np.arange(750.0), {})
    recording = ss.draw(stochastic_volatility(**POUND_DOLLAR), schedule, jax.random.key(3)).recording
    values = np.array(recording["returns"])
    values[10] = np.nan
    return Recording(recording.time, {"returns": values})


@functools.cache
def grid_answer():
    return grid_filter(np.array(returns(750)["returns"]), **POUND_DOLLAR)


def grid_filter(y, beta, phi, sigma, nodes=500):
    """Log-likelihood and filtered means by the trapezoidal rule on six stationary spreads either way."""
    spread = sigma / np.sqrt(1 - phi**2)
    h = np.linspace(-6 * spread, 6 * spread, nodes)
    normal = lambda e, s: np.exp(-0.5 * (e / s) ** 2) / (np.sqrt(2 * np.pi) * s)
    move = normal(h[:, None] - phi * h[None, :], sigma) * (h[1] - h[0])
    p, total, means = normal(h, spread), 0.0, []
    for k, value in enumerate(y):
        p = move @ p if k else p
        p = p * normal(value, beta * np.exp(0.5 * h)) if np.isfinite(value) else p
        mass = p.sum() * (h[1] - h[0])
        total, p = total + np.log(mass), p / mass
        means.append((p * h).sum() * (h[1] - h[0]))
    return total, np.array(means)


@pytest.mark.parametrize(
    "filter_",
    [filters.ParticleFilter(1000), filters.AuxiliaryParticleFilter(1000), filters.Guided(1000)],
    ids=lambda f: type(f).__name__,
)
def test_the_pound_dollar_model_has_the_grid_s_likelihood_and_means(filter_):
    recording, model = returns(750), stochastic_volatility(**POUND_DOLLAR)
    exact, means = grid_answer()
    rows = model.rows(recording)
    found = jax.vmap(lambda key: filters.scan(filter_, model, rows, key))(jax.random.split(jax.random.key(0), 6))
    found = jax.tree.map(
        np.asarray, (found.result, found.log_likelihood, found.mean.h, found.info.innovation_std.returns)
    )
    result, logs, h, stds = found
    assert not result.any()
    scatter = np.std(logs, ddof=1)
    assert 0.01 < scatter < 1.0
    # A likelihood that is unbiased has a logarithm that is low by half its variance.
    assert abs(np.mean(logs) + 0.5 * scatter**2 - exact) < 4 * scatter / 6**0.5
    assert np.sqrt(np.mean((np.mean(h, 0) - means) ** 2)) < 0.02
    # What a row was expected to be: as wide as the volatilities.
    assert np.isnan(stds[:, 10]).all()
    z = np.array(recording["returns"]) / stds[0]
    np.testing.assert_allclose(np.nanmean(z**2), 1.0, atol=0.15)


def test_its_gradient_is_that_of_the_grid():
    recording = returns(60)
    y = np.array(recording["returns"])

    def value(numbers, key):
        model = stochastic_volatility(*numbers)
        return filters.scan(filters.ParticleFilter(2000), model, model.rows(recording), key).log_likelihood

    at = jnp.array(list(POUND_DOLLAR.values()))
    slopes = np.array(jax.jit(jax.vmap(jax.grad(value), (None, 0)))(at, jax.random.split(jax.random.key(1), 16)))
    for i, h in enumerate((1e-4, 1e-4, 1e-4)):
        moved = [np.array(at) + sign * h * np.eye(3)[i] for sign in (1, -1)]
        exact = (grid_filter(y, *moved[0])[0] - grid_filter(y, *moved[1])[0]) / (2 * h)
        error = np.mean(slopes[:, i]) - exact
        assert abs(error) < 4 * np.std(slopes[:, i], ddof=1) / 4, (i, exact, error)


def worse_when_turning(system, t, x, u):
    """Noise of two channels, correlated, that grows with a state and with the input."""
    scale = 1.0 + 0.5 * jnp.square(x.x0) + 0.3 * jnp.square(u.force)
    return ss.MultivariateGaussian(("y0", "y1"), scale * system["R"])


def turning_model():
    model = linear_model(2, 2, seed=5)
    system = {**model.system, "R": jnp.asarray(spd(np.random.default_rng(1), 2, 0.2))}
    noise = ss.StateDependent(worse_when_turning, ("y0", "y1"))
    return with_noise(eqx.tree_at(lambda m: m.system, model, system), noise)


TURNS = linear_recording(linear_model(2, 2, seed=5), rows=12)


def kalman_at_predicted_means(model, recording):
    """The Kalman filter in NumPy, each row's R at the mean of its prediction."""
    A, B, H, D, R0 = (np.asarray(model.system[k]) for k in ("A", "B", "H", "D", "R"))
    Q, t, u = np.asarray(model.process_noise.law.matrix), np.asarray(recording.time), np.asarray(recording["force"])
    y = np.stack([np.asarray(recording[name]) for name in model.channels], axis=1)
    x, P = np.array([float(v) for v in model.prior.mean]), np.asarray(model.prior.covariance())
    total, means = 0.0, []
    for k in range(len(t)):
        if k:
            dt = t[k] - t[k - 1]
            F = np.eye(len(x)) + dt * A
            x, P = F @ x + dt * B * u[k - 1], F @ P @ F.T + Q * dt
        here = np.isfinite(y[k])
        if here.any():
            R = (1.0 + 0.5 * x[0] ** 2 + 0.3 * u[k] ** 2) * R0
            h = H[here]
            S = h @ P @ h.T + R[np.ix_(here, here)]
            e = y[k, here] - h @ x - D[here] * u[k]
            K = P @ h.T @ np.linalg.inv(S)
            total += -0.5 * (e @ np.linalg.solve(S, e) + np.linalg.slogdet(2 * np.pi * S)[1])
            x, P = x + K @ e, P - K @ S @ K.T
        means.append(x)
    return total, np.array(means)


GAUSSIAN = {
    "extended": filters.Extended(),
    "unscented": filters.Unscented(),
    "square root": filters.Cubature(form=SquareRoot()),
    "singular values": filters.Cubature(form=SingularValues()),
    "iterated": filters.Iterated(filters.Extended()),
    "gated": filters.Gated(filters.Cubature(), 50.0),
}


@pytest.mark.parametrize("name", GAUSSIAN)
def test_gaussian_filters_take_the_covariance_at_the_prediction_s_mean(name):
    model, recording = turning_model(), TURNS
    total, means = kalman_at_predicted_means(model, recording)
    found = filters.run(GAUSSIAN[name], model, recording)
    np.testing.assert_allclose(found.log_likelihood, total, rtol=1e-9)
    np.testing.assert_allclose(np.stack(found.mean).T, means, rtol=1e-8, atol=1e-9)


def test_its_numbers_have_gradients_in_gaussian_filters():
    model, recording = turning_model(), TURNS
    rows = model.rows(recording)
    at = lambda R: eqx.tree_at(lambda m: m.system["R"], model, R)
    of = lambda R: filters.scan(filters.Extended(), at(R), rows).log_likelihood
    slope = np.asarray(jax.jit(jax.grad(of))(model.system["R"]))
    step = 1e-6 * np.array([[1.0, 0.5], [0.5, -2.0]])
    values = [kalman_at_predicted_means(at(model.system["R"] + sign * step), recording)[0] for sign in (1, -1)]
    np.testing.assert_allclose(np.sum(slope * step), (values[0] - values[1]) / 2, rtol=1e-6)


def test_the_parallel_smoother_takes_it_where_it_linearises():
    """One pass about the prior's mean: the noise of all rows is that of this mean."""
    model, recording = turning_model(), TURNS
    found = filters.smooth_parallel(filters.Iterated(filters.Extended(), 1), model, recording)
    at = model.prior.mean.x0

    def fixed(system, t, x, u):
        return worse_when_turning(system, t, x._replace(x0=at), u)

    other = with_noise(model, ss.StateDependent(fixed, model.channels))
    expected = filters.smooth(filters.Kalman(), other, recording)
    np.testing.assert_allclose(np.stack(found.mean), np.stack(expected.mean), rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(found.filtered.log_likelihood, expected.filtered.log_likelihood, rtol=1e-9)


def test_each_particle_counts_with_its_own_law_and_missing_channels_with_none():
    model = turning_model()
    row = model.row(TURNS.time[0], {"force": TURNS["force"][0]}, {"y1": 0.7})

    @jax.jit
    def after_a_row(key):
        drawn = model.prior.sample(jax.random.split(key)[0], (50,))
        return *filters.ParticleFilter(50).init(model, row, key), jnp.stack(drawn)

    belief, info, x = after_a_row(jax.random.key(0))
    x = np.asarray(x)
    R = (1.0 + 0.5 * x[0] ** 2 + 0.3 * float(row.u.force) ** 2) * float(model.system["R"][1, 1])
    e = 0.7 - np.asarray(model.system["H"])[1] @ x - float(model.system["D"][1] * row.u.force)
    density = np.exp(-0.5 * e**2 / R) / np.sqrt(2 * np.pi * R)
    np.testing.assert_allclose(info.log_likelihood, np.log(density.mean()), rtol=1e-10)
    np.testing.assert_allclose(belief.weights, density / density.sum(), rtol=1e-9)
    np.testing.assert_allclose(info.innovation_std.y1, np.sqrt(e.var() + R.mean()), rtol=1e-9)
    assert np.isnan(info.innovation_std.y0)


def never_changes(system, t, x, u):
    return {"y1": jnp.asarray(0.3, x.x0.dtype), "y0": jnp.asarray(0.4, x.x0.dtype)}


ONE_LAW = {
    "Huber", "contaminated", "Student-t", "Sage-Husa", "variational Bayes", "wavelet noise", "wavelet noise, contaminated",
    "wavelet noise, particles", "marginalised", "interacting",
}  # fmt: skip
"""Filters that need one law for all rows, and say so."""


def with_noise(model, noise):
    return eqx.tree_at(
        lambda m: m.measurement_noise, model, noise, is_leaf=lambda leaf: leaf is model.measurement_noise
    )


DEFAULT = ("Ensemble", "strong tracking", "federated", "guided, fully adapted")
"""Of which numbers are compared in the default run; the others are only traced there, in test_every_filters_parameters, or have
tests above."""


def batch_for(name):
    """What two states say suffices, but for filters that name the third."""
    if name not in DEFAULT:
        return batch("linear")
    model, drives = of_two_states(), [drawn(seed=seed) for seed in (1, 2)]
    return model, jax.tree.map(lambda *leaves: np.stack(leaves), *map(model.rows, drives))


@pytest.mark.full  # By default test_every_filters_parameters traces every filter with such a law.
@pytest.mark.parametrize("name", [name for name in FILTERS if name not in ONE_LAW])
def test_every_other_filter_takes_it(name):
    model, rows = batch("linear")
    other = with_noise(model, ss.StateDependent(never_changes, ("y0", "y1")))
    FILTERS[name].make().check(other)
    dtypes = lambda m: [
        leaf.dtype
        for leaf in jax.tree.leaves(eqx.filter_eval_shape(batch_of_values, FILTERS[name].make(), m, rows, KEYS))
    ]
    assert dtypes(other) == dtypes(model)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[] if n in DEFAULT else pytest.mark.full) for n in FILTERS if n not in ONE_LAW]
)
def test_every_filter_takes_a_law_that_never_changes_for_the_law_itself(name):
    model, rows = batch_for(name)
    other = with_noise(model, ss.StateDependent(never_changes, ("y0", "y1")))
    (value, estimate), (same, expected) = (batch_of_values(FILTERS[name].make(), m, rows, KEYS) for m in (other, model))
    np.testing.assert_allclose(value, same, rtol=1e-10)
    for found, known in zip(jax.tree.leaves(estimate.info), jax.tree.leaves(expected.info), strict=True):
        np.testing.assert_allclose(found, known, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("name", sorted(ONE_LAW - {"interacting"}))
def test_a_filter_that_needs_one_law_says_so(name):
    model = linear()
    other = with_noise(model, ss.StateDependent(never_changes, ("y0", "y1")))
    with pytest.raises(InputError, match=r"\(StateDependent\): must be one law. (Take|Use)"):
        FILTERS[name].make().check(other)


def test_kalman_takes_a_law_of_the_inputs_and_refuses_one_of_the_state():
    model = turning_model()
    with pytest.raises(InputError, match="Kalman: the measurement noise depends on the state. Use Extended"):
        filters.Kalman().check(model)


def chosen_beta():
    return ss.with_parameters(stochastic_volatility(**POUND_DOLLAR), lambda m: m.system["beta"], 0.1)


@pytest.mark.parametrize(
    ("refused", "message"),
    [
        (
            lambda m: observers.RecursiveLeastSquares().check(m),
            "RecursiveLeastSquares: the measurement noise of y0, y1",
        ),
        (
            lambda m: filters.VaryingNoise(filters.Extended(), {"y0": "force"}).check(m),
            "VaryingNoise.measurement: the measurement noise of y0, y1 depends on the state",
        ),
        (
            lambda m: ss.posterior_cramer_rao(m, TURNS, jax.random.key(0), runs=2),
            "StateDependent: its Fisher information is not known here",
        ),
        (
            lambda m: fitting.multiple_shooting(chosen_beta(), returns(60), window=10.0),
            "residuals are weighted by one law, and StateDependent has another for each state",
        ),
        (
            lambda m: ss.kit.whiten(m.measurement_noise, {}, {}),
            "residuals are weighted by one law, and StateDependent has another for each state",
        ),
    ],
)
def test_what_needs_one_law_refuses_it_by_name(refused, message):
    with pytest.raises(InputError, match=message):
        refused(turning_model())

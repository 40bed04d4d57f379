"""Fits of a filter's likelihood: the Nile's noise levels, standard errors from differences, priors, errors."""

from collections import namedtuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from nile import NILE

from jaxveh import FilterError, InputError, Recording, Result, filters
from jaxveh import statespace as ss
from jaxveh.fitting import maximum_likelihood

Level = namedtuple("Level", "level")
Flow = namedtuple("Flow", "flow")

RECORDING = Recording(np.arange(1871.0, 1971.0), {"flow": NILE})


def stay(system, t0, t1, x, u):
    return x


def see(system, t, x, u):
    return Flow(x.level)


def model(walk=60.0, noise=100.0, dtype=None):
    made = ss.StateSpace(
        transition=stay,
        observation=see,
        process_noise=ss.Discrete(ss.Gaussian({"level": walk})),
        measurement_noise=ss.Gaussian({"flow": noise}),
        prior=ss.Prior(Level(0.0), {"level": 1e7**0.5}),
    )
    return made if dtype is None else ss.cast(made, dtype)


LEVELS = lambda m: (m.process_noise.law.std.level, m.measurement_noise.std.flow)


@pytest.fixture(scope="module")
def fit():
    return maximum_likelihood(filters.Unscented(), model(), RECORDING, LEVELS)


def test_noise_levels_of_the_nile(fit):
    walk, noise = fit.parameters.array()
    np.testing.assert_allclose([walk**2, noise**2], [1469.1, 15099.0], rtol=0.01)
    assert fit.names == ("process_noise.law.std.level", "measurement_noise.std.flow")
    assert Result(int(fit.result)) is Result.successful
    np.testing.assert_allclose(LEVELS(fit.model), fit.parameters.array(), rtol=1e-12)
    # The value printed for these variances is the largest, so that it is met from below within rounding of the print.
    assert abs(float(fit.cost) - 641.5855784594) < 1e-4
    np.testing.assert_allclose(filters.run(filters.Unscented(), fit.model, RECORDING).log_likelihood, -fit.cost)


def test_standard_errors_are_those_of_the_curvature(fit):
    @jax.jit
    def cost(z):
        changed = jnp.exp(z)
        return -filters.run(filters.Unscented(), model_with(changed), RECORDING).log_likelihood

    def model_with(levels):
        return ss.StateSpace(
            transition=stay,
            observation=see,
            process_noise=ss.Discrete(ss.Gaussian({"level": levels[0]})),
            measurement_noise=ss.Gaussian({"flow": levels[1]}),
            prior=model().prior,
        )

    z, h = np.asarray(fit.unconstrained), 1e-3
    unit = np.eye(2) * h
    hessian = np.empty((2, 2))
    for i in range(2):
        for j in range(2):
            corners = [float(cost(z + a * unit[i] + b * unit[j])) for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
            hessian[i, j] = (corners[0] - corners[1] - corners[2] + corners[3]) / (4 * h * h)
    expected = np.linalg.inv(hessian)
    np.testing.assert_allclose(fit.covariance, expected, rtol=1e-3)
    np.testing.assert_allclose(
        fit.parameters_std.array(), np.sqrt(np.diagonal(expected)) * fit.parameters.array(), rtol=1e-3
    )


def test_two_recordings_count_twice(fit):
    both = maximum_likelihood(filters.Unscented(), model(), [RECORDING, RECORDING], LEVELS, standard_errors=False)
    np.testing.assert_allclose(both.parameters.array(), fit.parameters.array(), rtol=2e-3)
    np.testing.assert_allclose(both.cost, 2 * fit.cost, rtol=1e-6)


def test_a_prior_holds_what_it_knows():
    held = maximum_likelihood(
        filters.Unscented(), model(), RECORDING, LEVELS, prior={"level": 0.01, "flow": 0.5}, standard_errors=False
    )
    assert abs(float(held.parameters.array()[0]) - 60.0) < 2.0
    assert np.isnan(held.parameters_std.array()).all()
    around = [
        eqx.tree_at(LEVELS, held.model, (held.parameters.array()[0], held.parameters.array()[1] * (1 + change)))
        for change in (-0.02, 0.0, 0.02)
    ]
    low, best, high = (float(filters.run(filters.Unscented(), m, RECORDING).log_likelihood) for m in around)
    assert best > max(low, high)


def test_a_start_value_is_a_parameter_too():
    picked = lambda m: m.prior.mean.level
    found = maximum_likelihood(
        filters.Unscented(),
        ss.StateSpace(
            transition=stay,
            observation=see,
            process_noise=None,
            measurement_noise={"flow": 100.0},
            prior=ss.Prior(Level(500.0), {"level": 1e-3}),
        ),
        RECORDING,
        picked,
    )
    # A level that stays: the mean, known to a tenth of the noise.
    assert float(found.parameters.prior.mean.level) == pytest.approx(NILE.mean(), abs=0.01)
    assert float(found.parameters_std.prior.mean.level) == pytest.approx(10.0, rel=1e-3)


def test_particle_likelihood_with_a_held_key():
    short = RECORDING.rows(slice(0, 20))
    near = model(noise=150.0)
    near = ss.StateSpace(
        transition=stay, observation=see, process_noise=near.process_noise, measurement_noise=near.measurement_noise,
        prior=ss.Prior(Level(1100.0), {"level": 100.0}))  # fmt: skip
    key = jax.random.key(0)
    noise = lambda m: m.measurement_noise.std.flow
    found = maximum_likelihood(
        filters.ParticleFilter(500), near, short, noise, key=key, tolerance=1e-2, standard_errors=False, throw=False
    )
    exact = maximum_likelihood(filters.Unscented(), near, short, noise, standard_errors=False)
    there = [float(one.parameters.measurement_noise.std.flow) for one in (found, exact)]
    assert there[0] == pytest.approx(there[1], rel=0.1)
    with pytest.raises(InputError, match="ParticleFilter draws random numbers: give it a key"):
        maximum_likelihood(filters.ParticleFilter(500), near, short, noise)


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (lambda: maximum_likelihood(filters.Unscented(), model(), [], LEVELS), "recordings: empty"),
        (lambda: maximum_likelihood(filters.Unscented(), model(), RECORDING, lambda m: m.nothing), "where: .*nothing"),
        (lambda: maximum_likelihood(filters.Unscented(), model(), RECORDING, LEVELS, prior=0.0), "prior spread of"),
        (
            lambda: maximum_likelihood(
                filters.Unscented(),
                ss.StateSpace(transition=stay, observation=see, process_noise=None,
                              measurement_noise=ss.MultivariateGaussian(("flow",), [[1.0]]), prior=model().prior),
                RECORDING, lambda m: m.measurement_noise.matrix),
            r"where picked measurement_noise\.matrix, an array of shape \(1, 1\)",
        ),
    ],
)  # fmt: skip
def test_errors(act, message):
    with pytest.raises(InputError, match=message):
        act()


def test_a_fit_that_does_not_finish_raises_unless_told():
    with pytest.raises(FilterError, match=r"stopped after 2 steps: the solver stopped before its tolerance"):
        maximum_likelihood(filters.Unscented(), model(), RECORDING, LEVELS, max_steps=2, standard_errors=False)


def test_float32_without_x64(float32):
    settings = dict(tolerance=1e-4, standard_errors=False, throw=False)
    found = maximum_likelihood(filters.Unscented(), model(), RECORDING, LEVELS, **settings)
    assert found.parameters.array()[0].dtype == jnp.float32
    np.testing.assert_allclose(
        [found.parameters.array()[0] ** 2, found.parameters.array()[1] ** 2], [1469.1, 15099.0], rtol=0.1
    )

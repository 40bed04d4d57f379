"""Fits of a filter's likelihood: the Nile's noise levels, standard errors from differences, priors, errors."""

from collections import namedtuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import FilterError, InputError, Recording, Result, filters
from jaxveh import statespace as ss
from jaxveh.fitting import maximum_likelihood

Level = namedtuple("Level", "level")
Flow = namedtuple("Flow", "flow")

# Annual flow of the Nile at Aswan 1871-1970, 10^8 m^3 (Cobb 1978; Durbin & Koopman 2012, sec. 2.2.5).
NILE = np.array(
    """1120 1160 963 1210 1160 1160 813 1230 1370 1140 995 935 1110 994 1020 960 1180 799 958 1140 1100 1210 1150 1250
    1260 1220 1030 1100 774 840 874 694 940 833 701 916 692 1020 1050 969 831 726 456 824 702 1120 1100 832 764 821 768
    845 864 862 698 845 744 796 1040 759 781 865 845 944 984 897 822 1010 771 676 649 846 812 742 801 1040 860 874 848
    890 744 749 838 1050 918 986 797 923 975 815 1020 906 901 1170 912 746 919 718 714 740""".split(),
    dtype=float,
)
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


LEVELS = lambda m: (m.process_noise.law.std.level, m.measurement_noise.std.flow)  # noqa: E731


@pytest.fixture(scope="module")
def fit():
    return maximum_likelihood(filters.Unscented(), model(), RECORDING, LEVELS)


def test_noise_levels_of_the_nile(fit):
    walk, noise = fit.mean
    np.testing.assert_allclose([walk**2, noise**2], [1469.1, 15099.0], rtol=0.01)
    assert fit.mean._fields == ("process_noise_law_std_level", "measurement_noise_std_flow")
    assert Result(int(fit.result)) is Result.successful
    np.testing.assert_allclose(LEVELS(fit.model), fit.mean, rtol=1e-12)
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
    np.testing.assert_allclose(fit.std, np.sqrt(np.diagonal(expected)) * np.stack(fit.mean), rtol=1e-3)


def test_two_recordings_and_a_prior_narrow_it(fit):
    both = maximum_likelihood(filters.Unscented(), model(), [RECORDING, RECORDING], LEVELS)
    np.testing.assert_allclose(both.mean, fit.mean, rtol=2e-3)
    np.testing.assert_allclose(both.std, np.stack(fit.std) / 2**0.5, rtol=0.02)
    held = maximum_likelihood(
        filters.Unscented(), model(), RECORDING, LEVELS, prior={"level": 0.01, "flow": 0.5}, standard_errors=False
    )
    assert abs(float(held.mean[0]) - 60.0) < 2.0
    assert abs(float(held.mean[1]) - float(fit.mean[1])) < 5.0
    assert np.isnan(held.std).all()


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
    assert float(found.mean.prior_mean_level) == pytest.approx(NILE.mean(), abs=0.01)
    assert float(found.std.prior_mean_level) == pytest.approx(10.0, rel=1e-3)


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
    assert float(found.mean[0]) == pytest.approx(float(exact.mean[0]), rel=0.1)
    with pytest.raises(InputError, match="ParticleFilter draws particles: give it a key"):
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
    found = maximum_likelihood(filters.Unscented(), model(), RECORDING, LEVELS, tolerance=1e-4, throw=False)
    assert found.mean[0].dtype == jnp.float32
    np.testing.assert_allclose([found.mean[0] ** 2, found.mean[1] ** 2], [1469.1, 15099.0], rtol=0.1)

"""The C++ measuring stick builds and gives the right answers; a wrong stick would measure nothing."""

import numpy as np
import pytest

from benchmarks import limit
from benchmarks.limit import coefficients
from benchmarks.peers import numpy_filters
from benchmarks.problems import single_track, speed_and_mass

# Building it takes the compiler minutes.
pytestmark = [
    pytest.mark.skipif(limit.unavailable() is not None, reason=str(limit.unavailable())),
    pytest.mark.studies,
]

# This machine's vectors, 32-byte ones as on a machine without AVX-512, and no AVX at all (slow to compile).
FLAGS = [
    pytest.param((), id="native"),
    pytest.param(("-mno-avx512f",), id="avx2", marks=pytest.mark.full),
    pytest.param(("-march=x86-64",), id="plain", marks=pytest.mark.full),
]


@pytest.mark.parametrize("fit", coefficients.FITS, ids=lambda fit: fit.name)
def test_polynomials_reach_rounding_on_their_interval(fit):
    x = np.linspace(fit.lower, fit.upper, 20001)[1:]
    for terms, bound in ((fit.single, 5e-8), (fit.double, 2e-16)):
        if terms:
            value = np.polynomial.polynomial.polyval(x.astype(np.longdouble), coefficients.power_series(fit, terms))
            assert np.abs(value / fit.function(x.astype(np.longdouble)) - 1).max() < bound


@pytest.mark.parametrize("flags", FLAGS)
@pytest.mark.parametrize("beta", [0.0, 2.0])
@pytest.mark.parametrize("runs", [1, 13])
def test_unscented_equals_numpy(runs, beta, flags):
    problem = speed_and_mass(rows=400, runs=runs, seed=3, beta=beta)
    expected = numpy_filters.unscented(problem)()
    result = limit.unscented(problem, extra_flags=flags)()
    scale = problem.prior_std[:, None]
    assert np.abs((result.mean - expected.mean) / scale).max() < 1e-9
    np.testing.assert_allclose(result.log_likelihood, expected.log_likelihood, rtol=0, atol=1e-9 * problem.rows)


def test_unscented_in_single_precision_follows_double():
    problem = speed_and_mass(rows=400, runs=20, seed=4)
    double = limit.unscented(problem)()
    single = limit.unscented(problem, dtype=np.float32)()
    assert np.abs((single.mean - double.mean) / problem.prior_std[:, None]).max() < 0.02
    np.testing.assert_allclose(single.log_likelihood, double.log_likelihood, atol=0.05)


@pytest.fixture(scope="module")
def drive():
    return single_track(rows=150, seed=1)


@pytest.fixture(scope="module")
def numpy_runs(drive):
    """Log-likelihoods and means of the last row from NumPy's filter, (seeds,) and (seeds, 11)."""
    run = numpy_filters.particle_filter(drive, 3000, auxiliary=True)
    results = [run(seed) for seed in range(6)]
    return np.array([r.log_likelihood for r in results]), np.array([r.mean[-1] for r in results])


@pytest.mark.parametrize("flags", FLAGS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("auxiliary", [False, True], ids=["pf", "apf"])
# Neither is a multiple of every vector width, so the last pack is cut.
@pytest.mark.parametrize("particles", [1021, 3000])
def test_particle_filters_agree_with_numpy(drive, numpy_runs, particles, auxiliary, dtype, flags):
    run = limit.particle_filter(drive, particles, auxiliary=auxiliary, dtype=dtype, extra_flags=flags)
    results = [run(seed) for seed in range(6)]
    logs = np.array([r.log_likelihood for r in results])
    expected_logs, expected_means = numpy_runs
    spread = np.sqrt(logs.var(ddof=1) / len(logs) + expected_logs.var(ddof=1) / len(expected_logs))
    assert abs(logs.mean() - expected_logs.mean()) < 4.5 * spread + 0.5 * logs.var(ddof=1)
    # The prior's spread is the scale on which parameters are known at all here.
    distance = (results[0].mean[-1] - expected_means.mean(0)) / drive.prior_std
    allowed = 6 * expected_means.std(0, ddof=1) / drive.prior_std * np.sqrt(3000 / particles)
    assert np.all(np.abs(distance) < allowed + 0.05)


def test_few_particles_and_extreme_weights_stay_finite(drive):
    sharp = single_track(rows=60, seed=2)
    object.__setattr__(sharp, "yaw_rate_std", 1e-5)
    for auxiliary in (False, True):
        for dtype in (np.float32, np.float64):
            for particles in (2, 3, 17):
                result = limit.particle_filter(sharp, particles, auxiliary=auxiliary, dtype=dtype)(0)
                assert np.isfinite(result.mean).all()
                assert np.isfinite(result.log_likelihood)


def test_wrong_arguments_are_named(drive):
    with pytest.raises(ValueError, match="particles is 1"):
        limit.particle_filter(drive, 1, auxiliary=False)
    with pytest.raises(ValueError, match="dtype is int32"):
        limit.unscented(speed_and_mass(rows=3), dtype=np.int32)

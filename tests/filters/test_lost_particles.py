"""Particles that the model loses: they get no weight, leave the others' means finite, and all of them lost is a code."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import see_level
from nile import NILE

from jaxveh import Recording, Result, filters
from jaxveh import statespace as ss
from jaxveh._core.names import record

N = 400
KEY = jax.random.key(0)
KINDS = {
    "bootstrap": filters.ParticleFilter(N),
    "seldom resampled": filters.ParticleFilter(N, threshold=0.1),
    "auxiliary": filters.AuxiliaryParticleFilter(N),
    "auxiliary, other lookahead": filters.AuxiliaryParticleFilter(
        N, lookahead=filters.PointLookahead(lambda model, t0, t1, x, u: x)
    ),
    "guided": filters.Guided(N),
    "guided, auxiliary": filters.Guided(N, "unscented", auxiliary=True),
    "marginalised": filters.Marginalised(N, ("drift",)),
    "Liu-West": filters.LiuWest(filters.ParticleFilter(N), names=("drift",)),
}
GAPS = Recording(np.arange(12.0), {"flow": np.where(np.arange(12) % 3 == 1, np.nan, NILE[:12])})


def fragile(system, t0, t1, x, u):
    """Stays, but has no value below a level: like a tyre's law at no load."""
    level = jnp.where(x.level > system["floor"], x.level, jnp.nan)
    return x._replace(level=level + 0.01 * x.drift)


def model_with(floor):
    return ss.StateSpace(
        system={"floor": jnp.asarray(floor)},
        transition=fragile,
        observation=see_level,
        process_noise=ss.Discrete(ss.Gaussian({"level": 40.0, "drift": 1.0})),
        measurement_noise=ss.Gaussian({"flow": 120.0}),
        prior=ss.Prior(record("Level", {"level": 1000.0, "drift": 0.0}), {"level": 300.0, "drift": 1.0}),
    )


@pytest.mark.parametrize("name", KINDS)
def test_some_lost_particles_leave_the_others_whole(name):
    # About one in seven of the first particles is below the floor, of later ones few.
    estimate = filters.run(KINDS[name], model_with(np.array(700.0)), GAPS, key=KEY)
    for values in (*estimate.mean, *estimate.std, estimate.info.ess, estimate.info.log_likelihood):
        assert np.isfinite(values).all()
    measured = np.isfinite(GAPS["flow"])
    assert np.isfinite(np.asarray(estimate.info.innovation.flow)[measured]).all()
    assert np.isfinite(np.asarray(estimate.info.innovation_std.flow)[measured]).all()
    # What they leave is the belief given that no level fell below the floor: without a floor, nearly the same.
    free = filters.run(KINDS[name], model_with(np.array(-1e9)), GAPS, key=KEY)
    np.testing.assert_allclose(estimate.mean.level[-1], free.mean.level[-1], atol=40.0)


def test_a_marginalised_particle_whose_covariance_is_lost_in_part_is_lost():
    """Its mean stays finite, and so does the other linear state's variance."""

    def transition(system, t0, t1, x, u):
        # Of no value where the level is low, of endless slope: the drift itself is 0 there.
        slope = jnp.where(x.level > 900.0, 0.0, 1e200)
        return x._replace(drift=slope * x.drift)

    model = ss.StateSpace(
        transition=transition,
        observation=see_level,
        process_noise=ss.Discrete(ss.Gaussian({"level": 40.0, "drift": 1.0, "bias": 1.0})),
        measurement_noise=ss.Gaussian({"flow": 120.0}),
        prior=ss.Prior(
            record("Level", {"level": 1000.0, "drift": 0.0, "bias": 0.0}), {"level": 300.0, "drift": 1.0, "bias": 1.0}
        ),
    )
    estimate = filters.run(filters.Marginalised(N, ("drift", "bias")), model, GAPS, key=KEY)
    for values in (*estimate.mean, *estimate.std, estimate.info.log_likelihood):
        assert np.isfinite(values).all()
    assert np.max(estimate.std.drift) < 10


@pytest.mark.parametrize("name", KINDS)
def test_all_particles_lost_is_told_in_their_row(name):
    # In the second row, which has no measurement.
    estimate = filters.run(KINDS[name], model_with(np.array(1e9)), GAPS, key=KEY, throw=False)
    assert Result(int(estimate.result)) is Result.non_finite_state
    assert int(estimate.failed_at) == 1
